"""Periodic orbits by Newton's method on the flow over a period, or on half of it followed by the mirror."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble, done

STEPS = 40
"""Steps at most."""

RENEWED = 1e-5
"""Gap, as a share of the states' magnitudes, above which every step has a Jacobian of its own."""

STALLED = (3, 8)
"""Steps after which an orbit whose gap has not halved gets no closer: while steps have Jacobians of their own, and
after that."""

STRIDE = 0.3
"""Largest change in one step of the distance at which the stage sticks, and of the time, as a share of it."""

CLOSED, CLOSED_CHATTERING = 1e-8, 1e-4
"""Gap up to which an orbit counts as closed, and that for a limiter that may chatter."""

FINEST = 1e-11
"""Gap that is as good as none."""


@dataclass(frozen=True)
class Shot:
    """Where orbits from states (count, states) are after times [s] (count,): `ends`, mirrored after half a period,
    and their derivative by the starts, `flows` (count, states, states)."""

    ends: np.ndarray
    flows: np.ndarray
    done: np.ndarray


@dataclass(frozen=True)
class Orbits:
    """Closed orbits: a state of each (count, states), the time after which it comes back, or comes to its mirror
    image where sign is -1 [s] (count,), the gap that is left, as a share of the states' magnitudes (count,), and
    whether Newton's method has come that far that they may be called closed (count,)."""

    states: np.ndarray
    times: np.ndarray
    sign: float
    gaps: np.ndarray
    closed: np.ndarray


def shoot(stages: Ensemble, states: np.ndarray, times: np.ndarray, sign: float, rtol: float) -> Shot:
    """Follow orbits together with a small deviation along every state."""
    count, size = states.shape
    every = np.repeat(np.arange(count), size)
    starts = np.hstack([states[every], np.tile(np.eye(size), (count, 1))])
    results = stages.take(every).run(starts, times[every], rtol, variational=True)
    ends = results.ends.reshape(count, size, 2 * size)
    flows = sign * np.swapaxes(ends[:, :, size:], 1, 2)
    return Shot(sign * ends[:, 0, :size], flows, done(results).reshape(count, size).all(axis=1))


def close(stages: Ensemble, states: np.ndarray, times: np.ndarray, sign: float, rtol: float) -> Orbits:
    """Close orbits from guesses: states (count, states) at which the stage sticks, and times [s] (count,).

    `sign` is -1 for half a period of a symmetric cycle, 1 for a whole one. The integrator's state tells the phase and
    is kept. Where a limiter chatters, the flow's derivative changes from one nanometre to the next and points nowhere;
    the last Jacobian from farther away then serves for as many steps as it takes.
    """
    shooting = _Shooting(stages, states, times, sign, rtol)
    for _ in range(STEPS):
        if not shooting.advance():
            break
    return shooting.outcome()


class _Shooting:
    """Orbits on their way to being closed, all at once; those that are closed, or have failed, rest."""

    def __init__(self, stages: Ensemble, states: np.ndarray, times: np.ndarray, sign: float, rtol: float) -> None:
        self.stages, self.sign, self.rtol = stages, sign, rtol
        self.states, self.times = states.copy(), times.copy()
        self.best_states, self.best_times = states.copy(), times.copy()
        self.gaps = np.full(stages.count, np.inf)
        size = states.shape[1]
        self.inverses = np.zeros((stages.count, size + 1, size + 1))
        self.active = np.ones(stages.count, bool)
        self.idle = np.zeros(stages.count, np.int64)

    def advance(self) -> bool:
        """One step of the orbits still on their way; whether any is on its way still."""
        far = self.gaps > RENEWED
        for which in (np.flatnonzero(self.active & far), np.flatnonzero(self.active & ~far)):
            if which.size:
                self._advance(which, renew=bool(far[which[0]]))
        return bool(self.active.any())

    def _advance(self, which: np.ndarray, renew: bool) -> None:
        """One step of some orbits, with a Jacobian of their own or with the last one."""
        stages, states, times = self.stages.take(which), self.states[which], self.times[which]
        if renew:
            shot = shoot(stages, states, times, self.sign, self.rtol)
            ends, fine = shot.ends, shot.done
            self.inverses[which] = _inverted(stages, shot)
        else:
            results = stages.run(states, times, self.rtol)
            ends, fine = self.sign * results.ends, done(results)
        misses = ends - states
        self._keep_best(which, np.where(fine, _gap(stages, misses), np.inf))
        self._step(which, misses)

    def _keep_best(self, which: np.ndarray, gaps: np.ndarray) -> None:
        """Keep what is closer than before; what is closed, fails or gets no closer rests."""
        better = gaps < self.gaps[which]
        self.idle[which] = np.where(gaps < 0.5 * self.gaps[which], 0, self.idle[which] + 1)
        self.best_states[which[better]], self.best_times[which[better]] = (
            self.states[which[better]],
            self.times[which[better]],
        )
        self.gaps[which] = np.minimum(self.gaps[which], gaps)
        self.active[which] = (gaps > FINEST) & np.isfinite(gaps) & (self.idle[which] < np.where(self.gaps[which] > RENEWED, *STALLED))

    def _step(self, which: np.ndarray, misses: np.ndarray) -> None:
        position = self.stages.index("position")
        wanted = np.einsum("nij,nj->ni", self.inverses[which], np.pad(-misses, ((0, 0), (0, 1))))
        far = np.abs(wanted[:, position]) / (STRIDE * np.abs(self.states[which, position]))
        wanted /= np.maximum(far, np.maximum(np.abs(wanted[:, -1]) / (STRIDE * self.times[which]), 1.0))[:, None]
        self.states[which] += wanted[:, :-1]
        self.times[which] += wanted[:, -1]

    def outcome(self) -> Orbits:
        limit = CLOSED_CHATTERING if self.stages.chatters else CLOSED
        return Orbits(self.best_states, self.best_times, self.sign, self.gaps, self.gaps < limit)


def _inverted(stages: Ensemble, shot: Shot) -> np.ndarray:
    """Inverses of the bordered Jacobians, shape (count, states + 1, states + 1); NaN where there is none."""
    count, size = shot.ends.shape
    jacobians = np.zeros((count, size + 1, size + 1))
    jacobians[:, :size, :size] = shot.flows - np.eye(size)
    jacobians[:, :size, size] = stages.rates(shot.ends)
    jacobians[:, size, stages.index("integral")] = 1.0
    inverses = np.full_like(jacobians, np.nan)
    for k in range(count):
        with suppress(np.linalg.LinAlgError):
            inverses[k] = np.linalg.inv(jacobians[k])
    return inverses


def _gap(stages: Ensemble, misses: np.ndarray) -> np.ndarray:
    """Largest miss in units of the states' magnitudes, shape (count,)."""
    return np.max(np.abs(misses) / stages.scales, axis=1)
