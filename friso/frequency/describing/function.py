"""Compute a friction law's describing function: its response to a sinusoidal motion.

The method is that of Gelb, Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, McGraw-Hill
1968. The law is the stage's own (LuGre: Canudas de Wit et al. 1995, doi:10.1109/9.376053). LuGre has a memory, so its
describing function depends on amplitude and frequency.

Convention: position x(t) = Re(A exp(i omega t)) with real A > 0. Friction force F(t) = Re(sum of F_k exp(i k omega t)),
positive against positive velocity. The dynamic stiffness N = F_1/A then has a spring as positive real part and a damper
as positive imaginary part. It takes pi A^2 Im(N) out of the motion in every period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.tolerance import checked_rtol
from friso.equations.imposed import HARMONIC
from friso.errors import InputError
from friso.frequency.describing.steady import RTOL, Imposition, periodic_gap, share_of_period, steady
from friso.stage import Stage
from friso.stage.arguments import check_arguments

if TYPE_CHECKING:
    import xarray as xr

SAMPLES = 4096
"""Default number of samples per period for the higher harmonics."""

NOT_CLOSED = "no periodic steady state found: the law's own states do not repeat; tighten rtol"
NOT_RUN = "a run was not completed: loosen rtol"


def dynamic_stiffness(
    flat: Mapping[str, Any], amplitudes: np.ndarray, frequencies: np.ndarray, rtol: float = RTOL
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
    samples: int = SAMPLES,
    rtol: float = RTOL,
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
    >>> import friso
    >>> friso.describing(friso.load("rig.toml"), [1e-5, 1e-4], [10.0])["stiffness"]  # doctest: +SKIP
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
