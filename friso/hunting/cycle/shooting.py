"""Close periodic orbits by Newton's method.

After a run over a whole period, an orbit must be back at its start. After half a period it must be at the mirror image
of its start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from friso.engine.arrays import STATISTICS
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble, done


@dataclass(frozen=True)
class Shot(ArrayRows):
    """Result of integrating orbits from initial states (count, states) over times [s] (count,).

    `ends` are the final states, mirrored after half a period. `flows` (count, states, states) are their derivatives
    with respect to the initial states. `high` and `low` [m] (count,) are the extremes of position. `done` marks
    completed runs.
    """

    ends: np.ndarray
    flows: np.ndarray
    high: np.ndarray
    low: np.ndarray
    done: np.ndarray


@dataclass(frozen=True)
class Orbits(ArrayRows):
    """Orbits, closed or not.

    `states` (count, states) has one state of each orbit. `times` [s] (count,) is the time after which the orbit returns
    to that state, or to its mirror image if `sign` is -1. `gaps` (count,) is the remaining error relative to the
    states' magnitudes. `closed` (count,) is true if Newton's method converged. `swings` counts swings in that time: one
    in half a period of the simplest cycles, two in a whole one.
    """

    states: np.ndarray
    times: np.ndarray
    sign: float
    gaps: np.ndarray
    closed: np.ndarray
    swings: int


def shoot(stages: Ensemble, states: np.ndarray, times: np.ndarray, sign: float, rtol: float) -> Shot:
    """Integrate orbits from states (count, states) for times [s] (count,), with derivatives.

    `sign` is -1 for half a period, after which the ends are mirrored. One deviation runs along each state but the one
    with the largest rate: that derivative follows from the others, because the flow carries the rates at the start to
    those at the end. With modes that remember, a state alone does not give the rates, so all deviations are run.
    """
    count, size = states.shape
    rows, before = np.arange(count)[:, None], stages.rates(states)
    last = np.argmax(np.abs(before) / stages.scales, axis=1)
    order = np.argsort(np.arange(size) == last[:, None], axis=1, kind="stable")
    followed = size if stages.kernel.switches else size - 1
    replaced = order[:, :followed]
    runs = np.repeat(np.arange(count), followed)
    starts = np.hstack([states[runs], np.eye(size)[replaced].reshape(-1, size)])
    results = stages.take(runs).run(starts, times[runs], rtol, variational=True, window=0.0)
    both = results.ends.reshape(count, followed, 2 * size)
    ends, columns = both[:, 0, :size], both[:, :, size:]
    flows = np.empty((count, size, size))
    flows[rows, :, replaced] = columns
    if followed < size:
        with np.errstate(divide="ignore", invalid="ignore"):
            left = stages.rates(ends) - np.einsum("kj,kji->ki", before[rows, replaced], columns)
            flows[rows[:, 0], :, last] = left / before[rows[:, 0], last, None]
    extremes = (STATISTICS.index(name) for name in ("deviation_max", "deviation_min"))
    high, low = (results.statistics[::followed, column] for column in extremes)
    return Shot(sign * ends, sign * flows, high, low, np.all(done(results).reshape(count, followed), axis=1))


def swings_of_simplest(sign: float) -> int:
    """Return the swings of the simplest cycles in half a period (sign -1) or in a whole one."""
    return 1 if sign < 0 else 2


def close(
    stages: Ensemble, states: np.ndarray, times: np.ndarray, sign: float, rtol: float, swings: int | None = None
) -> Orbits:
    """Close orbits from guesses: states (count, states) that stick, and times [s] (count,).

    `sign` is -1 for half a period of a symmetric cycle, 1 for a whole one. `swings` counts swings in that time, by
    default as few as possible. The phase is fixed at the instant at which the integrator balances the constant forces
    on a stage at rest.

    A Jacobian is used again for as long as steps with it shrink the gap fast. Where a limiter chatters, the derivative
    of the motion changes from one nanometre to the next, so the last Jacobian, from farther away, is kept.
    """
    orbits = _iterated(_Shooting(lambda which, places: stages.take(which), states, times, sign, rtol)).orbits
    return replace(orbits, swings=swings or orbits.swings)


@dataclass(frozen=True)
class Border:
    """For each branch, a plane on which its next orbit must lie.

    With it a branch can be followed around folds. The space is place along the branch, log distance [m] and log time
    [s]. An orbit lies on the plane if normal @ (place, log distance, log time) = level; shapes (count, 3) and (count,).
    """

    normal: np.ndarray
    level: np.ndarray


Family = Callable[[np.ndarray, np.ndarray], Ensemble]
"""Function that makes stages from the numbers of lines and one place on each, both (count,)."""

Condition = Callable[[Ensemble, Shot], np.ndarray]
"""Function that returns how far orbits are from meeting a condition, (count,), from their stages and shots."""


class Followed(NamedTuple):
    """Orbits, the places of their stages along a line of keys, and the last Jacobians.

    The Jacobians, shape (count, states + 2, states + 2), closed these orbits and start the search for nearby ones. The
    last row of each has the derivatives of the distance from the border, or of the condition. They are NaN where a
    limiter chatters, because they change too fast there.
    """

    orbits: Orbits
    places: np.ndarray
    jacobians: np.ndarray


def close_along(
    family: Family,
    states: np.ndarray,
    times: np.ndarray,
    places: np.ndarray,
    border: Border,
    sign: float,
    rtol: float,
    swings: int | None = None,
    jacobians: np.ndarray | None = None,
    reach: float = np.inf,
) -> Followed:
    """Close orbits while their stages move along lines of keys, until each is on its border.

    The orbits start from `states` and `times` [s], and their stages from `places` on the lines. The method passes
    folds, where no orbit exists at a place beyond. With `jacobians` of closed orbits at or near the start, the first
    step to the border needs no run. The Jacobians may belong to another line through the keys: further steps learn the
    derivative along this line. `sign` is -1 for half a period of a symmetric cycle, 1 for a whole one, and `swings`
    counts swings in that time. An orbit whose place moves farther than `reach` is given up. Runs have the relative
    tolerance `rtol`.
    """
    following = _Following(family, states, times, sign, rtol, places)
    following.border, following.reach = border, reach
    if jacobians is not None:
        following.begin_with(jacobians)
    orbits = _iterated(following).orbits
    return Followed(replace(orbits, swings=swings or orbits.swings), following.best_places, following.best_jacobians)


_S = TypeVar("_S", bound="_Shooting")


STALLED_STEPS = (3, 8, 1)
"""Steps in which the gap must halve, or the search ends: far from an orbit, near it, and once closed."""

FRESH_JACOBIAN_GAP = 1e-5  # [of the states]
"""Gap beyond which an old Jacobian misleads Newton's method."""

CONDITION_GAP_SHARE = 1e-3
"""Gap per error of a condition on orbits. With more, the scatter of multipliers keeps Newton's method from ending;
with less, it ends too early."""

OLD_JACOBIAN_SHARE = 0.1
"""Least reduction of the gap per step that keeps an old Jacobian in use."""

NEWTON_STRIDE = 0.3
"""Longest Newton step, relative to the states. Longer ones leave the range of convergence."""

FINEST_GAP_CHATTERING = 1e-8  # [of the states]
"""Gap below which everything is rounding where a limiter chatters."""

FINEST_GAP = 1e-11  # [of the states]
"""Gap below which everything is rounding, so that further steps do not help."""

GAP_RTOL_FACTOR = 0.1  # [of the tolerance of runs]
"""Smallest useful gap, relative to the tolerance of the runs."""

CLOSED_GAP = 1e-8  # [of the states]
"""Gap at which an orbit counts as closed. With a larger one runs that are no orbits pass; with a smaller one real
cycles fail."""

CLOSED_GAP_CHATTERING = 1e-4  # [of the states]
"""Gap at which an orbit with a chattering limiter counts as closed. The chatter moves the end of a run by about
this much."""


class _Shooting:
    """Newton's method on several orbits at once; closed and failed orbits are left alone.

    Where a limiter chatters, every step computes a new Jacobian until the gap is small; then the last one is kept.
    """

    condition: Condition | None = None

    def __init__(
        self,
        family: Family,
        states: np.ndarray,
        times: np.ndarray,
        sign: float,
        rtol: float,
        places: np.ndarray | None = None,
    ) -> None:
        self.family, self.sign, self.rtol = family, sign, rtol
        self.states, self.times = states.copy(), times.copy()
        count = len(times)
        self.places = np.zeros(count) if places is None else places.copy()
        self.best_states, self.best_times, self.best_places = states.copy(), times.copy(), self.places.copy()
        self.gaps, self.idle = np.full(count, np.inf), np.zeros(count, np.int64)
        self.inverses: list[np.ndarray] = [np.empty(0)] * count
        self.active, self.serves = np.ones(count, bool), np.zeros(count, bool)
        self.chatters = family(np.arange(count), self.places).chatters
        self.finest = (
            FINEST_GAP_CHATTERING
            if self.chatters
            else max(
                FINEST_GAP,
                min(GAP_RTOL_FACTOR * rtol, CLOSED_GAP),
            )
        )
        self.limit, self.stalled = (
            CLOSED_GAP_CHATTERING if self.chatters else CLOSED_GAP,
            STALLED_STEPS,
        )

    def advance(self) -> bool:
        """Take one step of all active orbits, and tell whether any is still active."""
        renewed = self.gaps > FRESH_JACOBIAN_GAP if self.chatters else ~self.serves
        for renew in (False, True):
            if (which := np.flatnonzero(self.active & (renewed == renew))).size:
                self._advance(which, renew)
        return bool(self.active.any())

    def _advance(self, which: np.ndarray, renew: bool) -> None:
        """Take one Newton step of the orbits numbered `which`.

        With `renew` a new Jacobian is computed, otherwise the last one is used again.
        """
        stages, states, times = self.family(which, self.places[which]), self.states[which], self.times[which]
        shot = shoot(stages, states, times, self.sign, self.rtol) if renew or self.condition else None
        if shot:
            ends, fine = shot.ends, shot.done
        else:
            results = stages.run(states, times, self.rtol)
            ends, fine = self.sign * results.ends, done(results)
        misses, residual = ends - states, self._residual(which, stages, shot)
        gaps = np.where(fine, np.max(np.abs(misses) / stages.scales, axis=1), np.inf)
        if self.condition:
            gaps = np.maximum(gaps, np.abs(residual[:, -1]) * CONDITION_GAP_SHARE)
            gaps = np.where(np.isnan(gaps), np.inf, gaps)
        serves = gaps < np.maximum(OLD_JACOBIAN_SHARE * self.gaps[which], self.finest)
        if shot and (fresh := np.flatnonzero(renew | ~serves)).size:
            jacobians = self._jacobians(which[fresh], stages.take(fresh), shot.take(fresh))
            for k, jacobian in zip(which[fresh], jacobians, strict=True):
                self.inverses[k] = _inverse(jacobian)
        self.serves[which] = serves | (shot is not None)
        # orbits whose old Jacobian no longer serves are shot again from where they are
        kept = self.serves[which] | self.chatters
        self._keep_best(which[kept], gaps[kept])
        scales = stages.scales
        for k, miss, other, scale in zip(which[kept], misses[kept], residual[kept], scales[kept], strict=True):
            self._step(k, np.concatenate([miss, other]), stages.sticking, scale)

    def _jacobians(self, which: np.ndarray, stages: Ensemble, shot: Shot) -> np.ndarray:
        """Return derivatives of the closing errors and the phase error by states and time.

        They are for the orbits numbered `which`, just integrated as `shot`, in the shape (orbits, states + 1, states +
        1).
        """
        count, size = shot.ends.shape
        jacobians = np.zeros((count, size + 1, size + 1))
        jacobians[:, :size, :size] = shot.flows - np.eye(size)
        jacobians[:, :size, size] = stages.rates(shot.ends)
        jacobians[:, size, stages.integral] = 1.0
        jacobians[:, size, stages.sticking] = -stages.relaxed
        return jacobians

    def _residual(self, which: np.ndarray, stages: Ensemble, shot: Shot | None = None) -> np.ndarray:
        """Return the phase error, (orbits, 1): the imbalance of integrator and constant forces."""
        return stages.unbalanced(self.states[which])[:, None]

    def _keep_best(self, which: np.ndarray, gaps: np.ndarray) -> None:
        """Store orbits that are closer to closing than before; stop those that close, fail or stall.

        `gaps`, shape (orbits,), are the errors of closing of the orbits numbered `which`.
        """
        better = which[gaps < self.gaps[which]]
        self.idle[which] = np.where(gaps < 0.5 * self.gaps[which], 0, self.idle[which] + 1)
        for best, current in ((self.best_states, self.states), (self.best_times, self.times)):
            best[better] = current[better]
        self.best_places[better] = self.places[better]
        self.gaps[which] = np.minimum(self.gaps[which], gaps)
        far, near, closed = self.stalled
        patience = np.where(
            self.gaps[which] > FRESH_JACOBIAN_GAP,
            far,
            np.where(self.gaps[which] > max(CLOSED_GAP, self.rtol), near, closed),
        )
        moving = self.idle[which] < patience
        self.active[which] = (gaps > self.finest) & np.isfinite(gaps) & moving

    def _step(self, k: int, residual: np.ndarray, sticking: int, scales: np.ndarray) -> np.ndarray:
        """Take a Newton step of limited length for the orbit numbered `k`; return the step.

        `residual` has the closing errors and the phase error, `scales` the magnitudes of the states. `sticking` is the
        index of the state that is constant while the stage sticks.
        """
        step, size = self.inverses[k] @ -residual, self.states.shape[1]
        far = abs(step[sticking]) / (NEWTON_STRIDE * abs(self.states[k, sticking]))
        late = abs(step[size]) / (NEWTON_STRIDE * self.times[k])
        step = step / max(far, late, 1.0)
        self.states[k] += step[:size]
        self.times[k] += step[size]
        self.places[k] += step[size + 1 :].sum()
        return step

    @property
    def orbits(self) -> Orbits:
        """Return the best orbits so far, and whether they are closed."""
        closed = self.gaps < self.limit
        return Orbits(self.best_states, self.best_times, self.sign, self.gaps, closed, swings_of_simplest(self.sign))


FOLLOWED_STALLED_STEPS = (3, 3, 1)
"""Steps in which the gap must halve along a branch, where the next orbit is near."""

PLACE_NUDGE_CHATTERING = 1e-5
"""Change of place for a numerical derivative where a limiter chatters, which moves the end of a run."""

PLACE_NUDGE = 1e-6
"""Change of place for a numerical derivative. If smaller it is rounding; if larger it includes curvature."""

FOLLOWED_GAP = 1e-6  # [of the states]
"""Gap at which orbits along a branch count as closed. Stiff stages close no better; with a larger one a step leads
to another branch."""


class _Following(_Shooting):
    """Periodic orbits followed by continuation, while the keys of their stages vary along lines.

    Newton steps solve for the state, the period and the place on the line together. The Jacobian is updated by
    Broyden's method.
    """

    border: Border
    reach = np.inf

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.begun = self.places.copy()
        size = self.states.shape[1] + 2
        self.jacobians = np.full((len(self.times), size, size), np.nan)
        self.best_jacobians = self.jacobians.copy()
        self.stalled = FOLLOWED_STALLED_STEPS
        self.nudge = PLACE_NUDGE_CHATTERING if self.chatters else PLACE_NUDGE
        if self.chatters:
            self.finest = FOLLOWED_GAP
        else:
            self.finest, self.limit = max(self.finest, CLOSED_GAP), FOLLOWED_GAP
        # for each orbit, its last step and the residual that the step should have removed
        self.latest: list[tuple[np.ndarray, np.ndarray] | None] = [None] * len(self.times)

    def begin_with(self, jacobians: np.ndarray) -> None:
        """Start from Jacobians of closed orbits, with a first step to the border and without a run."""
        self.jacobians = jacobians.copy()
        which = np.arange(len(self.times))
        stages = self.family(which, self.places)
        self._set_border(which, stages)
        residual, scales, gaps = self._residual(which, stages), stages.scales, np.zeros(self.states.shape[1])
        for k in range(len(which)):
            self.inverses[k] = _inverse(self.jacobians[k])
            self._step(k, np.concatenate([gaps, residual[k]]), stages.sticking, scales[k])
            self.latest[k] = None  # its residual is not computed
        self.serves[:] = True

    def _step(self, k: int, residual: np.ndarray, sticking: int, scales: np.ndarray) -> np.ndarray:
        """Update the orbit's Jacobian by what the last step did, then take the next step.

        The method is Broyden 1965, doi:10.2307/2003941.
        """
        if latest := self.latest[k]:
            step, before = latest
            inverse, weighted = self.inverses[k], step * self._weights(k, scales)
            row, closer = weighted @ inverse, inverse @ (residual - before)
            if change := float(weighted @ closer):
                self.inverses[k] = inverse + np.outer(step - closer, row) / change
                self.jacobians[k] = _inverse(self.inverses[k])
        step = super()._step(k, residual, sticking, scales)
        self.active[k] &= abs(self.places[k] - self.begun[k]) <= self.reach
        self.latest[k] = step, residual
        return step

    def _weights(self, k: int, scales: np.ndarray) -> np.ndarray:
        """Return weights of a step of the orbit numbered `k`, (states + 2,); `scales` are the states' magnitudes."""
        return np.concatenate([scales, [self.times[k], 1.0]]) ** -2.0

    def _keep_best(self, which: np.ndarray, gaps: np.ndarray) -> None:
        """Store the best orbits so far with their Jacobians; `gaps` are the errors of closing."""
        if not self.chatters:
            better = which[gaps < self.gaps[which]]
            self.best_jacobians[better] = self.jacobians[better]
        super()._keep_best(which, gaps)

    def _set_border(self, which: np.ndarray, stages: Ensemble) -> None:
        """Set the last row of Jacobians: the derivatives of an orbit's distance from its border."""
        along, out, late = self.border.normal[which].T
        self.jacobians[which, -1] = 0.0
        self.jacobians[which, -1, stages.sticking] = out / self.states[which, stages.sticking]
        self.jacobians[which, -1, -2] = late / self.times[which]
        self.jacobians[which, -1, -1] = along

    def _jacobians(self, which: np.ndarray, stages: Ensemble, shot: Shot) -> np.ndarray:
        """Return derivatives of all errors of orbits by state, time and place along the keys' line.

        The errors are those of closing, of the phase and of the distance from the border. Where a limiter chatters, the
        column of the place is kept from earlier for as long as the closing error shrinks.
        """
        self.jacobians[which, :-1, :-1] = super()._jacobians(which, stages, shot)
        gaps = np.max(np.abs(shot.ends - self.states[which]) / stages.scales, axis=1)
        serves = self.chatters & np.isfinite(self.gaps[which]) & (gaps < OLD_JACOBIAN_SHARE * self.gaps[which])
        stale = which[~serves]
        if stale.size:
            behind, ahead = self._beside(stale)
            self.jacobians[stale, :-1, -1] = (ahead - behind) / (2 * self.nudge)
        self._set_border(which, stages)
        for k in which:
            self.latest[k] = None
        return self.jacobians[which]

    def _beside(self, which: np.ndarray) -> np.ndarray:
        """Run orbits with their stages moved slightly back and ahead along the lines of keys.

        Returns the final states and the phase error of each run, shape (2, orbits, states + 1).
        """
        both, nudge = np.concatenate([which, which]), np.repeat([-self.nudge, self.nudge], len(which))
        stages = self.family(both, self.places[both] + nudge)
        ends = self.sign * stages.run(self.states[both], self.times[both], self.rtol).ends
        return np.hstack([ends, super()._residual(both, stages)]).reshape(2, len(which), -1)

    def _residual(self, which: np.ndarray, stages: Ensemble, shot: Shot | None = None) -> np.ndarray:
        """Return the phase errors of orbits and their distances from the borders, (orbits, 2)."""
        sizes = (np.abs(self.states[which, stages.sticking]), self.times[which])
        where = np.stack([self.places[which], *np.log(sizes)], axis=1)
        residual = (self.border.normal[which] * where).sum(axis=1) - self.border.level[which]
        return np.hstack([super()._residual(which, stages), residual[:, None]])


BRANCH_NUDGES = (1e-6, 1e-4)
"""Smallest and largest relative change of an orbit along its branch for a numerical derivative of the multiplier. A
smaller one is rounding; a larger one includes curvature."""


class ConditionSearch(_Following):
    """Orbits on lines of keys, each followed to the place at which it meets a condition.

    Newton's method solves for orbit, time and place together. It starts from approximate `orbits` and `places`. Runs
    have the relative tolerance `rtol`. The last row of a Jacobian has the derivatives of the condition along the branch
    of closed orbits. Across it, where orbits are not closed, they are only learnt from the steps.
    """

    def __init__(self, condition: Condition, family: Family, orbits: Orbits, places: np.ndarray, rtol: float) -> None:
        super().__init__(family, orbits.states, orbits.times, orbits.sign, rtol, places)
        self.condition = condition
        self.limit, self.finest = (
            CLOSED_GAP,
            GAP_RTOL_FACTOR * CLOSED_GAP,
        )

    def moved(self) -> np.ndarray:
        """Return how far two Newton steps move the places, (count,), from orbits closed at another tolerance.

        The second step corrects the first. The result is infinite where a run fails, or the orbit is not yet closed.
        """
        before = self.places.copy()
        self.advance()
        self.advance()
        near = (self.gaps < FRESH_JACOBIAN_GAP) & np.isfinite(self.places)
        return np.where(near, self.places - before, np.inf)

    def _set_border(self, which: np.ndarray, stages: Ensemble) -> None:
        """Leave the last row of Jacobians, which belongs to the condition."""

    def _jacobians(self, which: np.ndarray, stages: Ensemble, shot: Shot) -> np.ndarray:
        """Return derivatives of all errors of orbits by state, time and place along the keys' line.

        The condition is differentiated by orbits a little farther along the branch: about as far as the next step goes.
        """
        assert self.condition
        before, size = self.jacobians[which, -1], self.states.shape[1]
        jacobians = super()._jacobians(which, stages, shot)
        along = np.array([_null(rows) for rows in jacobians[:, :-1]])
        sizes = np.stack([self.states[which, stages.sticking], self.times[which], np.ones(len(which))], axis=1)
        along /= np.max(np.abs(along[:, [stages.sticking, -2, -1]] / sizes), axis=1, keepdims=True)
        off, (least, most) = self.condition(stages, shot), BRANCH_NUDGES
        with np.errstate(all="ignore"):
            needed = np.abs(off / np.einsum("ki,ki->k", before, along))
        along *= np.clip(np.nan_to_num(needed, nan=most), least, most)[:, None]
        states, times = self.states[which] + along[:, :size], self.times[which] + along[:, size]
        there = self.family(which, self.places[which] + along[:, -1])
        change = self.condition(there, shoot(there, states, times, self.sign, self.rtol)) - off
        for k, step, by, scales in zip(which, along, change, stages.scales, strict=True):
            weighted = step * self._weights(k, scales)
            self.jacobians[k, -1] = by / (weighted @ step) * weighted
        return self.jacobians[which]

    def _residual(self, which: np.ndarray, stages: Ensemble, shot: Shot | None = None) -> np.ndarray:
        """Return the phase errors of orbits, and how far they are from meeting the condition, (orbits, 2)."""
        assert self.condition
        assert shot
        return np.stack([_Shooting._residual(self, which, stages)[:, 0], self.condition(stages, shot)], axis=1)


NEWTON_STEPS = 40
"""Most Newton steps. Orbits that need more do not close."""


def _iterated(shooting: _S) -> _S:
    """Take Newton steps until all orbits are closed or stall."""
    for _ in range(NEWTON_STEPS):
        if not shooting.advance():
            break
    return shooting


def _null(rows: np.ndarray) -> np.ndarray:
    """Return the direction in which linear equations, shape (n - 1, n), stay fulfilled; NaN if they are not finite."""
    if not np.isfinite(rows).all():
        return np.full(rows.shape[1], np.nan)
    return np.linalg.svd(rows / np.abs(rows).max(axis=1, keepdims=True))[2][-1]


def _inverse(jacobian: np.ndarray) -> np.ndarray:
    """Invert a matrix, shape (n, n); return NaN if it is singular."""
    try:
        return np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        return np.full_like(jacobian, np.nan)
