"""Modes of a response: resonances and antiresonances with their damping, by a rational fit in the frequency domain."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.fitting import ResponseFit, refined
from friso.identification.response.rational import (
    RationalShape,
    Row,
    bounds,
    orders,
    poles_and_zeros,
    rational,
    simplest_model,
)
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings

METHOD = "rational fit of the response"


@dataclass(frozen=True)
class Modes:
    """A fit of modes over `band` [Hz], with its resonances and antiresonances by frequency.

    Estimates are called "resonance 1 frequency" and so on. `order` says how the number of modes was chosen. `low_level`
    and `high_level` are the acceleration per input below and above all modes (mass lines), unknown without a rigid
    body.
    """

    shape: RationalShape
    fit: ResponseFit
    scale: float
    estimates: tuple[Estimate, ...]
    low_level: Estimate
    high_level: Estimate
    order: str
    band: tuple[float, float]
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name."""
        return next(estimate for estimate in self.estimates if estimate.name == name)

    def predict(self, frequency: np.ndarray) -> np.ndarray:
        """Return the complex fitted response at frequencies [Hz], in their shape."""
        return rational(self.fit.parameters, self.shape, 1j * frequency / self.scale)


def fit_modes(response: FrequencyResponse, band: tuple[float, float] | None = None, rigid: bool | None = None) -> Modes:
    """Fit modes to a force-to-position response in a `band` [Hz] (default: all lines).

    `rigid` tells whether the mass moves freely (default: the better fit). Raises InputError for fewer than 12 lines.
    """
    part = response if band is None else response.between(*band)
    part = part.at(part.frequency > 0)
    if len(part.frequency) < 12:
        raise InputError("band", f"{len(part.frequency)} lines", "at least 12 lines for a fit of modes", "3 to 20 Hz")
    scale = float(np.sqrt(part.frequency[0] * part.frequency[-1]))
    s = 1j * part.frequency / scale
    deviation = np.hypot(part.scatter(), settings.error_of_a_response * np.abs(part.response))
    kinds = (True, False) if rigid is None else (rigid,)
    rows = [row for kind in kinds for row in orders(s, part.response, deviation, kind, settings.modes_at_most)]
    shape, start, *_ = simplest_model(rows)
    low, high = bounds(shape, s)
    fit = refined(lambda p: rational(p, shape, s)[None], start, part.response[None], deviation[None], low, high)
    limits = (float(part.frequency[0]), float(part.frequency[-1]))
    low_level, high_level = (_level(fit, shape, scale, which, response) for which in ("low", "high"))
    warnings = [*_cancelling(fit, shape, scale, limits)]
    if fit.reduced > settings.misfit_of_a_right_model:
        warnings.append(f"the fit misses by more than the deviations (reduced chi-square {fit.reduced:.3g})")
    estimates = _pairs(fit, shape, scale, limits)
    return Modes(shape, fit, scale, estimates, low_level, high_level, _described(shape, rows), limits, tuple(warnings))


def _described(shape: RationalShape, rows: list[Row]) -> str:
    """Write how the number of modes was chosen."""
    orders = ", ".join(f"{row.shape.words}: {row.bic:.4g}" for row in rows)
    return f"{shape.words} by the Bayesian information criterion ({orders})"


def _cancelling(fit: ResponseFit, shape: RationalShape, scale: float, band: tuple[float, float]) -> Iterator[str]:
    """Yield a sentence for each resonance within the band that an antiresonance nearly cancels.

    `band` is in Hz. Poles and zeros times `scale` are frequencies in Hz.
    """
    poles, zeros = poles_and_zeros(fit.parameters, shape)
    for pole in sorted(poles, key=abs):
        if not zeros.size or not band[0] <= abs(pole) * scale <= band[1]:
            continue
        zero = zeros[np.argmin(np.abs(zeros - pole))]
        if abs(zero - pole) <= settings.widths_of_cancelling * min(-pole.real, abs(zero.real)):
            yield (
                f"a resonance at {abs(pole) * scale:.4g} Hz and an antiresonance at {abs(zero) * scale:.4g} Hz nearly "
                "cancel: an unevenness of the response looks like this, too, and may be no mode"
            )


def _pairs(fit: ResponseFit, shape: RationalShape, scale: float, band: tuple[float, float]) -> tuple[Estimate, ...]:
    """Return frequencies and damping ratios of resonances and antiresonances in the band.

    Damping ratios of 0.7 or more count as neither.
    """
    estimates: list[Estimate] = []
    for kind, which in (("resonance", 0), ("antiresonance", 1)):
        inside = [
            root
            for root in sorted(poles_and_zeros(fit.parameters, shape)[which], key=abs)
            if band[0] <= abs(root) * scale <= band[1] and -root.real < 0.7 * abs(root)
        ]
        for number, root in enumerate(inside, 1):
            tracked = _tracked(shape, which, root)
            name = f"{kind} {number}"
            estimates += [
                fit.estimate(f"{name} frequency", "Hz", METHOD, lambda p, t=tracked: abs(t(p)) * scale, positive=True),
                fit.estimate(f"{name} damping ratio", "1", METHOD, lambda p, t=tracked: -t(p).real / abs(t(p))),
            ]
    return tuple(estimates)


def _tracked(shape: RationalShape, which: int, root: complex) -> Callable[[np.ndarray], complex]:
    """Return a function that computes the pole or zero nearest to `root` from parameters.

    A pole is followed if `which` is 0, and a zero if it is 1.
    """

    def nearest(parameters: np.ndarray) -> complex:
        candidates = poles_and_zeros(parameters, shape)[which]
        return complex(candidates[np.argmin(np.abs(candidates - root))]) if candidates.size else complex(np.nan, np.nan)

    return nearest


def _level(fit: ResponseFit, shape: RationalShape, scale: float, which: str, response: FrequencyResponse) -> Estimate:
    """Return the acceleration per input on the mass line below or above all modes.

    `which` is "low" or "high". Below all modes the rigid body alone counts; above, the residues of the modes are added.
    The level is not determined without a rigid body, or above if modes beyond the band still act.
    """
    unit = f"{response.channels.output_unit}/s^2/{response.channels.input_unit}"
    name = f"mass line level, {'below' if which == 'low' else 'above'} the modes"
    if not shape.rigid:
        return Estimate.unknown(name, unit, METHOD, "no rigid body fits the response in this band")
    if which == "high" and shape.constant:
        return Estimate.unknown(name, unit, METHOD, "modes beyond the band still act at its upper end")
    stop = shape.nonlinear + (1 if which == "low" else 1 + shape.modes)
    factor = (2 * np.pi * scale) ** 2
    return fit.estimate(name, unit, METHOD, lambda p: factor * float(np.sum(p[shape.nonlinear : stop])))
