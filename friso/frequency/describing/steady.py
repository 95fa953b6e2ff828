"""Find the periodic steady state of friction under an imposed sinusoidal motion.

An internal state forgets its start as the motion wears it off. At amplitudes far below the deflection at break-away
that takes thousands of periods. So secants solve for the fixed point of the map of the internal states over a period.
LuGre's and Dahl's states obey linear equations under an imposed motion, so their map is affine and the first secant is
exact. Many motions are computed at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.equations.imposed import FREQUENCY, imposed_form
from friso.equations.roles import Role
from friso.frequency.settings import settings

RTOL = 1e-9
"""Default relative tolerance of the runs."""


@dataclass(frozen=True)
class Imposition:
    """Friction laws with equal equations, each under a sinusoidal motion of its own.

    `flat` has their keys with SI numbers or arrays of shape (count,), the amplitude under "motion.displacement" [m] and
    the frequency under "imposed.frequency" [Hz].
    """

    flat: Mapping[str, Any]
    count: int
    rtol: float = RTOL

    @classmethod
    def of(cls, flat: Mapping[str, Any], amplitudes: np.ndarray, frequencies: np.ndarray, rtol: float) -> Imposition:
        """Make the friction of stages under sinusoidal motions, all of shape (count,).

        The motions have `amplitudes` [m] and `frequencies` [Hz]; `flat` has the stages' keys in SI.
        """
        friction = {key: value for key, value in flat.items() if key.startswith("friction.")}
        motion = {"motion.kind": "release", "motion.displacement": amplitudes, "motion.duration": 1.0}
        return cls({**friction, **motion, FREQUENCY: frequencies}, len(amplitudes), rtol)

    @cached_property
    def kernel(self) -> Kernel:
        """Return the compiled friction law under an imposed motion."""
        first = {key: value[0] if np.ndim(value) else value for key, value in self.flat.items()}
        return kernel(imposed_form(first))

    @cached_property
    def values(self) -> list[np.ndarray]:
        return self.kernel.values({**self.flat, "motion.size": self.flat["motion.displacement"]}, self.count)

    @cached_property
    def inner(self) -> list[int]:
        """Return the indices of the law's own states."""
        return self.kernel.having(Role.BRISTLE)

    @cached_property
    def scales(self) -> np.ndarray:
        """Return the magnitudes of the states, shape (count, states)."""
        return self.kernel.scales(self.values, self.count)

    @cached_property
    def symmetric(self) -> bool:
        """Tell whether mirrored motions have mirrored friction forces, tested at random states."""
        states = np.random.default_rng(0).normal(size=(8, *self.scales.shape)) * self.scales
        one, mirrored = (self._reaction(way * states.transpose(2, 0, 1)) for way in (1, -1))
        return bool(np.all(np.abs(one + mirrored) <= 1e-9 * np.abs(one)))

    def _reaction(self, states: np.ndarray) -> np.ndarray:
        """Return friction force and rates of change of the law's own states.

        They follow from states of shape (states, ..., count), and have the shape (1 + inner, ..., count).
        """
        module, at_rest = self.kernel.module, np.zeros(3)
        modes = self.kernel.modes(states, 0.0, at_rest, self.values)
        rates = module.right_hand_side(states, modes, 0.0, at_rest, self.values)
        return np.array([self.force(states), *(np.broadcast_to(rates[i], states.shape[1:]) for i in self.inner)])

    def force(self, states: np.ndarray) -> np.ndarray:
        """Return the friction force [N] in states of shape (states, ..., count)."""
        module, at_rest = self.kernel.module, np.zeros(3)
        modes = self.kernel.modes(states, 0.0, at_rest, self.values)
        (force,) = module.outputs(states, modes, 0.0, at_rest, self.values)
        return np.broadcast_to(force, states.shape[1:])

    def take(self, numbers: np.ndarray) -> Imposition:
        """Select the numbered motions; a number may occur several times."""
        flat = {key: value[numbers] if np.ndim(value) else value for key, value in self.flat.items()}
        return Imposition(flat, len(numbers), self.rtol)

    def run(self, inner: np.ndarray, share: float, samples: int = 0) -> Iterator[tuple[np.ndarray, Results]]:
        """Follow the motions over the fraction `share` of a period, in chunks.

        Each begins at the law's own states, `inner`, (count, inner). There are `samples` per period. Yields the numbers
        of the motions, and their results.
        """
        starts = np.zeros((self.count, len(self.kernel.states)))
        starts[:, self.kernel.position] = self.flat["motion.displacement"]
        starts[:, self.inner] = inner
        interval = 1 / samples if samples else None
        chunk = max(8, min(2048, settings.most_samples // max(samples, 1)))
        options = RunOptions(rtol=self.rtol, interval=interval, chunk=chunk)
        for part in run_chunks(self.kernel, {**self.flat, "motion.duration": share}, self.count, options, starts):
            yield part.numbers, part.results


def periodic_gap(rtol: float) -> float:
    """Return the largest gap of a state after a period at which it counts as periodic.

    It is relative to the state's scale, and depends on the tolerance of the runs.
    """
    return min(settings.gap_tolerances * rtol, settings.widest_gap)


@dataclass(frozen=True)
class PeriodicStates:
    """Periodic steady states of a friction law under sinusoidal motions.

    `inner` (count, inner) are the law's own states at the farthest point of the motion. `gap` (count,) is their change
    over a period, relative to their scales. `done` (count,) is true for completed runs.
    """

    inner: np.ndarray
    gap: np.ndarray
    done: np.ndarray


def steady(friction: Imposition) -> PeriodicStates:
    """Find the periodic steady states of friction under its motions.

    For a symmetric law half a period suffices.
    """
    count, size = friction.count, len(friction.inner)
    inner, gap, done = np.zeros((count, size)), np.zeros(count), np.ones(count, bool)
    width = friction.scales[:, friction.inner].copy()
    open_ = np.arange(count) if size else np.empty(0, np.int64)
    for _ in range(settings.secant_steps):
        if not open_.size:
            break
        chosen_friction, scales = friction.take(open_), friction.scales[open_][:, friction.inner]
        step, missed, fine = _secant(chosen_friction, inner[open_], width[open_])
        gap[open_], done[open_] = np.max(np.abs(missed) / scales, axis=1), fine
        far = fine & (gap[open_] > periodic_gap(friction.rtol))
        inner[open_[far]] += step[far]
        width[open_[far]] = np.clip(np.abs(step[far]), settings.least_secant * scales[far], scales[far])
        open_ = open_[far]
    return PeriodicStates(inner, gap, done)


def share_of_period(friction: Imposition) -> tuple[float, float]:
    """Return what fraction of a period must be computed, and the sign of the states after it.

    For a symmetric law half a period will do, after which the states have the opposite sign.
    """
    return (0.5, -1.0) if friction.symmetric else (1.0, 1.0)


def _secant(friction: Imposition, inner: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Take a secant step to the fixed point of the map of the law's states over a period.

    The step starts from the states `inner`, with `width` the widths of the secants, both (count, inner). Returns the
    step, the error of the states after a period, and which runs were completed.
    """
    share, sign = share_of_period(friction)
    count, size = inner.shape
    rows = np.repeat(np.arange(count), size + 1)
    aside = np.tile(np.vstack([np.zeros(size), np.eye(size)]), (count, 1)) * width[rows]
    ends, fine = np.empty((len(rows), size)), np.empty(len(rows), bool)
    for numbers, results in friction.take(rows).run(inner[rows] + aside, share):
        ends[numbers] = sign * results.ends[:, friction.inner]
        fine[numbers] = np.equal(results.statuses, Status.DONE)
    ends, fine = ends.reshape(count, size + 1, size), np.all(fine.reshape(count, size + 1), axis=1)
    missed = ends[:, 0] - inner
    slopes = np.swapaxes((ends[:, 1:] - ends[:, :1]) / width[:, :, None], 1, 2) - np.eye(size)
    fine &= np.all(np.isfinite(slopes), axis=(1, 2)) & np.all(np.isfinite(missed), axis=1)
    slopes[~fine] = -np.eye(size)
    slopes[np.linalg.det(slopes) == 0] = -np.eye(size)  # the map only shifts states: follow the shift
    return np.linalg.solve(slopes, -missed[:, :, None])[:, :, 0], missed, fine
