"""Compute a friction law's describing function: its response to a sinusoidal motion.

The method is that of Gelb, Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, McGraw-Hill
1968. The law is the stage's own (LuGre: Canudas de Wit et al. 1995, doi:10.1109/9.376053). LuGre has a memory, so its
describing function depends on amplitude and frequency.

Convention: position x(t) = Re(A exp(i omega t)) with real A > 0. Friction force F(t) = Re(sum of F_k exp(i k omega t)),
positive against positive velocity. The dynamic stiffness N = F_1/A then has a spring as positive real part and a damper
as positive imaginary part. It takes pi A^2 Im(N) out of the motion in every period.

The periodic steady state under an imposed motion is found first. An internal state forgets its start as the motion
wears it off. At amplitudes far below the deflection at break-away that takes thousands of periods. So secants solve for
the fixed point of the map of the internal states over a period. LuGre's and Dahl's states obey linear equations under
an imposed motion, so their map is affine and the first secant is exact. Many motions are computed at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.allowance import checked_rtol
from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.equations.imposed import FREQUENCY, HARMONIC, imposed_form
from friso.equations.roles import Role
from friso.errors import InputError
from friso.stage import Stage
from friso.stage.arguments import check_arguments
from friso_thesis.studies.describing.settings import settings

if TYPE_CHECKING:
    import xarray as xr

IMPOSED_RTOL = 1e-9
"""Default relative tolerance of the runs."""


MOST_SAMPLES = 1 << 20
"""Most samples in memory, tens of megabytes."""


@dataclass(frozen=True)
class Imposition:
    """Friction laws with equal equations, each under a sinusoidal motion of its own.

    `flat` has their keys with SI numbers or arrays of shape (count,), the amplitude under "motion.displacement" [m] and
    the frequency under "imposed.frequency" [Hz].
    """

    flat: Mapping[str, Any]
    count: int
    rtol: float = IMPOSED_RTOL

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
        chunk = max(8, min(2048, MOST_SAMPLES // max(samples, 1)))
        options = RunOptions(rtol=self.rtol, interval=interval, chunk=chunk)
        for part in run_chunks(self.kernel, {**self.flat, "motion.duration": share}, self.count, options, starts):
            yield part.numbers, part.results


GAP_TOLERANCES = 1e3
"""Largest gap of a periodic state, in relative tolerances of the run."""

WIDEST_GAP = 1e-4
"""Largest relative mismatch of a state after one period, at any tolerance. It changes the third digit of
stiffness."""


def periodic_gap(rtol: float) -> float:
    """Return the largest gap of a state after a period at which it counts as periodic.

    It is relative to the state's scale, and depends on the tolerance of the runs.
    """
    return min(GAP_TOLERANCES * rtol, WIDEST_GAP)


@dataclass(frozen=True)
class PeriodicStates:
    """Periodic steady states of a friction law under sinusoidal motions.

    `inner` (count, inner) are the law's own states at the farthest point of the motion. `gap` (count,) is their change
    over a period, relative to their scales. `done` (count,) is true for completed runs.
    """

    inner: np.ndarray
    gap: np.ndarray
    done: np.ndarray


LEAST_SECANT = 1e-4
"""Least distance of the points of a secant. Closer ones differ by errors of the runs."""


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
        width[open_[far]] = np.clip(np.abs(step[far]), LEAST_SECANT * scales[far], scales[far])
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


HARMONIC_SAMPLES = 4096
"""Default number of samples per period for the higher harmonics."""

NOT_CLOSED = "no periodic steady state found: the law's own states do not repeat; tighten rtol"
NOT_RUN = "a run was not completed: loosen rtol"


def dynamic_stiffness(
    flat: Mapping[str, Any], amplitudes: np.ndarray, frequencies: np.ndarray, rtol: float = IMPOSED_RTOL
) -> np.ndarray:
    """Return the dynamic stiffness N = F_1/A [N/m], complex, of friction, shape (count,).

    Amplitudes [m] and frequencies [Hz] have the same shape; friction keys of `flat`, which are in SI, may have it, too.
    The result is NaN if no steady state was found.
    """
    if not len(amplitudes):
        return np.empty(0, complex)
    friction = Imposition.of(flat, amplitudes, frequencies, rtol)
    motion = steady(friction)
    first, _ = _harmonics(friction, motion.inner, 1, 0)
    good = motion.done & (motion.gap <= periodic_gap(rtol))
    return np.where(good, first[:, 1] / amplitudes, np.nan)


@check_arguments
def describing(
    stage: Stage,
    amplitudes: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray,
    harmonics: int = 1,
    samples: int = HARMONIC_SAMPLES,
    rtol: float = IMPOSED_RTOL,
) -> xr.Dataset:
    """Describing function of the stage's friction, over amplitude [m] and frequency [Hz].

    Variables over ("amplitude", "frequency"):

    - `stiffness`: N = F_1/A [N/m], complex.
    - `work` [J]: what friction takes out of the motion in a period.
    - `gap`: how far the friction law's own states are from where they began, after a period, relative to their scales.
    - `aliasing`: error of the harmonics from samples. It is the relative difference of the first harmonic from samples
      to the integrated one, NaN if nothing was sampled.
    - `status`: "done", or the reason why a pair of amplitude and frequency failed; its numbers are NaN then.

    The variable `force` [N], complex, over ("amplitude", "frequency", "harmonic"), has the harmonics from the mean F_0
    to F_`harmonics`. The solver integrates the first one itself; the others come from `samples` samples of the period.
    With `harmonics` = 1 nothing is sampled, and F_0 is NaN unless the law is symmetric.

    Raises InputError for a stage without friction, and for amplitudes, frequencies, harmonics, samples or an `rtol`
    that are not usable.

    Examples
    --------
    >>> import friso, friso_thesis
    >>> friso_thesis.describing(friso.load("rig.toml"), [1e-5, 1e-4], [10.0])["stiffness"]  # doctest: +SKIP
    """
    import xarray as xr

    sizes = checked_positive("amplitudes", amplitudes, "1e-5 m")
    rates = checked_positive("frequencies", frequencies, "10 Hz")
    if not 1 <= harmonics < samples / 4:
        expected = f"from 1 to less than a quarter of the samples, {samples}"
        raise InputError("harmonics", str(harmonics), expected, "harmonics = 9")
    pairs = (np.repeat(sizes, len(rates)), np.tile(rates, len(sizes)))
    friction = Imposition.of(stage.flat(), *pairs, checked_rtol(rtol))
    motion = steady(friction)
    force, aliasing = _harmonics(friction, motion.inner, harmonics, samples if harmonics > 1 else 0)
    status = np.where(motion.gap <= periodic_gap(rtol), Status.DONE.text, NOT_CLOSED)
    status = np.where(motion.done & np.isfinite(force[:, 1]), status, NOT_RUN)
    force[status != Status.DONE.text] = np.nan
    coords = _coords(sizes, rates, harmonics)
    variables = _variables(pairs[0], force, {"gap": motion.gap, "aliasing": aliasing, "status": status})
    shape = (len(sizes), len(rates))
    shaped = {name: (dims, v.reshape(*shape, *v.shape[1:]), words) for name, (dims, v, words) in variables.items()}
    attributes = {"stage": stage.to_toml(), "rtol": rtol, "samples": samples}
    return stage.axis_kind.with_units(xr.Dataset(shaped, coords, attributes))


def _coords(amplitudes: np.ndarray, frequencies: np.ndarray, harmonics: int) -> dict[str, Any]:
    return {
        "amplitude": ("amplitude", amplitudes, {"units": "m", "long_name": "amplitude of the motion"}),
        "frequency": ("frequency", frequencies, {"units": "Hz", "long_name": "frequency of the motion"}),
        "harmonic": np.arange(harmonics + 1),
    }


def _variables(
    amplitudes: np.ndarray, force: np.ndarray, rest: Mapping[str, np.ndarray]
) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
    """Return a describing function's variables: dimensions, values (pairs, ...), attributes.

    `amplitudes` [m] and the harmonics `force` [N] have one row for each pair of amplitude and frequency. `rest` has the
    other variables by name.
    """
    plane = ("amplitude", "frequency")
    stiffness = force[:, 1] / amplitudes
    named = {
        "stiffness": (stiffness, "N/m", "dynamic stiffness of friction"),
        "work": (np.pi * amplitudes**2 * np.imag(stiffness), "J", "work of friction per period"),
        "gap": (rest["gap"], "1", "gap of the periodic state"),
        "aliasing": (rest["aliasing"], "1", "error of the sampled first harmonic"),
        "force": (force, "N", "harmonics of the friction force"),
    }
    variables = {
        name: ((*plane, "harmonic")[: 1 + values.ndim], values, {"units": unit, "long_name": text})
        for name, (values, unit, text) in named.items()
    }
    return {**variables, "status": (plane, rest["status"], {})}


def checked_positive(name: str, values: Sequence[float] | np.ndarray, example: str) -> np.ndarray:
    """Return positive numbers of an option `name` as an array, shape (n,).

    Raises InputError with an `example` for anything else, and for no numbers.
    """
    array = np.atleast_1d(np.asarray(values, dtype=float))
    if array.ndim != 1 or not array.size or not np.all(np.isfinite(array) & (array > 0)):
        raise InputError(name, str(values), "positive numbers in one row", example)
    return array


def _harmonics(friction: Imposition, inner: np.ndarray, count: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return harmonics 0 to `count` of the friction force [N], shape (runs, count + 1).

    `inner` holds the friction states at the start of a period, from which they repeat. The first harmonic is
    integrated; the others come from `samples` points per period. The second result, shape (runs,), is the relative
    error of the first harmonic by these points. It is NaN for `samples` = 0, in which case only the first harmonic is
    known, and the mean of a symmetric law.
    """
    share, _ = share_of_period(friction)
    force = np.full((friction.count, count + 1), 0.0 if share < 1 else np.nan, complex)
    aliasing = np.full(friction.count, np.nan)
    real, imaginary = (friction.kernel.states.index(name) for name in HARMONIC)
    for numbers, results in friction.run(inner, share, samples):
        first = (results.ends[:, real] + 1j * results.ends[:, imaginary]) / share
        if samples:
            sampled = _spectrum(friction.take(numbers), results.samples, share, samples)
            aliasing[numbers] = np.abs(sampled[:, 1] - first) / np.abs(first)
            force[numbers] = sampled[:, : count + 1]
        force[numbers, 1] = np.where(np.equal(results.statuses, Status.DONE), first, np.nan)
    return force, aliasing


def _spectrum(friction: Imposition, states: np.ndarray, share: float, samples: int) -> np.ndarray:
    """Return harmonics of the friction force [N] from states (runs, samples, states).

    The states are sampled over the fraction `share` of the period, with `samples` in a whole one.
    """
    within = round(samples * share)
    force = friction.force(np.moveaxis(states[:, :within], 0, 2).swapaxes(0, 1)).T
    period = force if share == 1.0 else np.hstack([force, -force])
    spectrum = np.fft.rfft(period, axis=1) / samples
    spectrum[:, 1:] *= 2
    return spectrum
