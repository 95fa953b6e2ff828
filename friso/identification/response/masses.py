"""Fit one mass, or two masses and a joint, to responses at the driven mass and, if measured, at the other mass.

To the masses comes the effect of the drive and of modes above the band: delay, hold, compliance. A force that is held
for T at each sample acts T/2 late on average, and is weaker by sin(x)/x, x = omega T/2. The samples of the position
also contain the images of the force at the frequencies f + k/T with k = +/- 1, +/- 2 and so on: a response G(f) is
sampled as the sum over all k of G(f + k/T) sin(x)/(x + k pi), with a delay of T/2 (of the double integrator with a
zero-order hold that is x^2 cos(x)/sin(x)^2 / (m s^2): Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed. 1997,
section 2.3). The images move every mass that is rigid up there, not the driven one alone. A log does not show whether
its force was held, so T is fitted, between zero and the sample time. Modes above the band add a compliance that does
not depend on frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.modes import (
    MISFIT_OF_A_RIGHT_MODEL,
    ResponseFit,
    ResponseTarget,
    deviations,
    fit_modes,
)
from friso.identification.response.records import FrequencyResponse
from friso.intervals import NORMAL_COVERAGE

METHOD = "two-mass model fitted to the response"

FARTHEST_LOG = np.log(30.0)
"""Logarithm of the factor by which masses and stiffness may differ from the start; damping may by twice as much."""

DRIVEN, OTHER, STIFFNESS, DAMPING, DRAG, OTHER_DRAG, OF_TWO = range(7)
"""Indices of the parameters of two masses: logarithms of the masses, stiffness and damping; viscous friction on each
mass; from `OF_TWO` on, the parameters of drive and modes above."""

MASS, DAMPER, SPRING, OF_ONE = range(4)
"""Indices of the parameters of one mass: its logarithm, viscous friction, spring to ground; from `OF_ONE` on, the
parameters of drive and modes above."""

DELAY, HELD, COMPLIANCES = range(3)
"""Indices of the parameters of drive and modes above: the delay [s]; the square of the time for which the force is held
[ms^2]; from `COMPLIANCES` on, the compliance for each output."""

IMAGES = np.array([k for k in range(-8, 9) if k])[:, None]
"""Numbers k of the images that are summed, shape (images, 1). At four samples per period the others add 0.00002 of a
mass's response."""

ONE_THOUSANDTH = 1e-3


@dataclass(frozen=True)
class TwoMass:
    """A driven mass, a joint and another mass, as fitted to a response.

    The unit of masses is input per acceleration. `fit` has the parameters, in the order of `DRIVEN` and so
    on. `signs` of the two outputs are -1 if they oppose the input. `estimates` has masses, stiffness, damping,
    viscous friction, delay, antiresonance and resonance.
    """

    signs: tuple[float, float]
    fit: ResponseFit
    estimates: tuple[Estimate, ...]
    band: tuple[float, float]
    warnings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name."""
        return next(estimate for estimate in self.estimates if estimate.name == name)

    def predict(self, frequency: np.ndarray, collocated: bool = True) -> np.ndarray:
        """Return the complex response of one mass, shape (n,), at frequencies [Hz], shape (n,).

        If `collocated`, the mass is the driven one, otherwise the other one, which must have been fitted.
        """
        which = 0 if collocated else 1
        return self.signs[which] * two_masses(self.fit.parameters, frequency)[which]


def two_masses(parameters: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return the responses of two masses to a force on the driven one, over frequencies [Hz].

    The result has the shape (outputs, lines): the driven mass and, if `parameters` has a second compliance, the other
    mass.
    """
    driven, other, stiffness, damping = np.exp(parameters[:DRAG])
    outputs = len(parameters) - OF_TWO - COMPLIANCES

    def masses(frequency: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * frequency
        joint = damping * s + stiffness
        first = driven * s**2 + parameters[DRAG] * s + joint
        second = other * s**2 + parameters[OTHER_DRAG] * s + joint
        return (np.stack([second, joint]) / (first * second - joint**2))[:outputs]

    return beyond(masses, frequency, parameters[OF_TWO:])


def one_mass(parameters: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return the response of one mass to a force, at frequencies [Hz]; shape (outputs, lines).

    The mass has viscous friction and a spring to ground. Delay, hold and a compliance for each output are added.
    `parameters` are in the order of `MASS` and so on.
    """
    mass, outputs = np.exp(parameters[MASS]), len(parameters) - OF_ONE - COMPLIANCES

    def masses(frequency: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * frequency
        return np.tile(1 / (mass * s**2 + parameters[DAMPER] * s + parameters[SPRING]), (outputs, 1))

    return beyond(masses, frequency, parameters[OF_ONE:])


def beyond(model: Callable[[np.ndarray], np.ndarray], frequency: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Add delay, hold and a compliance for each output to the responses of masses.

    `model` returns the responses of the masses, shape (outputs, n), at any frequencies [Hz], shape (n,), also negative
    ones. The result has the shape (outputs, lines).
    """
    delay, held, compliances = (
        parameters[DELAY],
        ONE_THOUSANDTH * np.sqrt(parameters[HELD]),
        parameters[COMPLIANCES:, None],
    )
    masses = model(frequency) * np.sinc(frequency * held)
    if held > 0:
        turns = IMAGES + frequency * held
        shares = np.sin(np.pi * frequency * held) / (np.pi * turns)
        images = model((turns / held).ravel()).reshape(len(masses), *turns.shape)
        masses = masses + np.sum(images * shares, axis=1)
    return (masses + compliances) * np.exp(-2j * np.pi * frequency * delay)


PERIODS_OF_A_DELAY = 0.4
"""Largest delay, in periods of the highest frequency. A drive with four samples per period is late by 0.38."""

PERIODS_OF_A_SAMPLE = 0.25
"""Usual largest sample time if it is not known, in periods of the highest frequency."""


def _fitting(
    masses: Callable[..., np.ndarray],
    own: int,
    responses: Sequence[FrequencyResponse],
    signs: Sequence[float],
    band: tuple[float, float] | None,
) -> tuple[ResponseTarget, np.ndarray, Callable[..., ResponseFit]]:
    """Set up the fit of a model of `masses` to responses of one or two outputs, in a `band` [Hz] (None: all).

    The model has `own` parameters before those of drive and modes above. Responses with sign -1 are reversed. Returns
    the target, its frequencies [Hz], and the fit by a start, and by lower and upper limits of the masses' own
    parameters.
    """
    parts = [response if band is None else response.between(*band) for response in responses]
    frequency = parts[0].frequency
    values = np.stack([sign * part.response for part, sign in zip(parts, signs, strict=False)])
    deviation = np.stack([deviations(part) for part in parts])
    target = ResponseTarget(partial(masses, frequency=frequency), values, deviation)
    late, free = PERIODS_OF_A_DELAY / float(frequency[-1]), np.full(len(parts), np.inf)
    longest = (_longest(responses[0], 0.5) / ONE_THOUSANDTH) ** 2
    half = (_longest(responses[0], PERIODS_OF_A_SAMPLE) / ONE_THOUSANDTH) ** 2 / 2  # from 0 to a sample time

    def fitted(start: np.ndarray, lower: Sequence[float], upper: Sequence[float]) -> ResponseFit:
        low, high = np.array([*lower, -late, 0.0, *-free]), np.array([*upper, late, longest, *free])
        return target.refined(start, low, high, {own + HELD: (half, half)})

    return target, frequency, fitted


def _longest(response: FrequencyResponse, share: float) -> float:
    """Return the sample time [s] of a response or, if not known, the longest that is plausible.

    Plausible is at most the fraction `share` of the period of the response's highest frequency.
    """
    return response.sample_time or share / float(response.frequency[-1])


def fit_two_mass(
    collocated: FrequencyResponse,
    noncollocated: FrequencyResponse | None = None,
    band: tuple[float, float] | None = None,
) -> TwoMass:
    """Fit the two-mass model to force-to-position responses in a `band` [Hz] (default: all).

    `collocated` is the response of the driven mass, `noncollocated` that of the other mass, if measured. Both must have
    the same lines. Raises InputError if they do not, or for too few lines.
    """
    responses = [collocated] if noncollocated is None else [collocated, noncollocated]
    parts = responses if band is None else [response.between(*band) for response in responses]
    frequency = parts[0].frequency
    if len(frequency) < 8:
        raise InputError("band", f"{len(frequency)} lines", "at least 8 lines for a two-mass model", "3 to 20 Hz")
    if len(parts) > 1 and not np.array_equal(frequency, parts[1].frequency):
        raise InputError("response", "responses on different lines", "both outputs of the same records", "one period")
    sign = _sign(parts[0].response)
    options = [(sign, sign), (sign, -sign)][: len(responses)]
    seen = cache(lambda: _from_modes(parts[0], len(responses)))
    fits = [(_best(responses, pair, band, seen), pair) for pair in options]
    (fit, values), signs = min(fits, key=lambda candidate: candidate[0][0].squares)
    _follows(values, two_masses(fit.parameters, frequency))
    limits = (float(frequency[0]), float(frequency[-1]))
    return TwoMass(signs, fit, _estimates(fit, collocated), limits, tuple(_warnings(signs, fit)))


STARTS_REFINED = 3
"""Number of starting points of the one-mass fit that are refined."""


def fit_one_mass(
    responses: list[FrequencyResponse], signs: tuple[float, ...], band: tuple[float, float]
) -> ResponseFit:
    """Fit one mass to the responses of one or two outputs on the same lines in a band [Hz].

    Responses with sign -1 are reversed. Fits start from several corner frequencies of friction and spring inside and
    below the band; the best is returned.
    """
    target, frequency, fitted = _fitting(one_mass, OF_ONE, responses, signs, band)
    starts = sorted(_starts_of_one(target.response, frequency), key=target.misfit)[:STARTS_REFINED]
    fits = [fitted(start, [-np.inf, 0.0, 0.0], [np.inf] * 3) for start in starts]
    return min(fits, key=lambda fit: fit.squares)


SQUARES_LEFT_BY_TWO = 0.5
"""Largest ratio of the sums of squares of two masses and one mass for two masses to be needed."""

CHANCE_OF_TWO_MASSES = 1e-3
"""Probability that noise alone makes two masses fit so much better."""


def needs_two(model: TwoMass, driven: FrequencyResponse, other: FrequencyResponse | None = None) -> bool:
    """Tell whether two masses explain the responses much better than one mass does.

    The single mass has viscous friction and a spring to ground. Both models include delay and compliance, and cover the
    band of `model`. An F-test decides whether the difference is chance; its level is divided by the number of lines,
    because the mode could lie at any line.
    """
    responses = [response for response in (driven, other) if response is not None]
    one, two = fit_one_mass(responses, model.signs, model.band), model.fit
    free, more = max(two.count - len(two.parameters), 1), len(two.parameters) - len(one.parameters)
    better = (one.squares - two.squares) / more / (two.squares / free)
    chance = float(stats.f.sf(better, more, free)) * one.count / (2 * len(responses))
    return two.squares < SQUARES_LEFT_BY_TWO * one.squares and chance < CHANCE_OF_TWO_MASSES


def widened(fitted: TwoMass, apart: Sequence[TwoMass]) -> TwoMass:
    """Widen estimates to the scatter of the fits of single realisations, `apart`.

    If single fits scatter more than their intervals allow, friction moves the parameters from realisation to
    realisation, which one response cannot show. Intervals are then scaled up by the Birge ratio (Birge 1932,
    doi:10.1103/PhysRev.40.207). Raises InputError for fewer than two single fits.
    """
    if len(apart) < 2:
        raise InputError("records", f"{len(apart)} single fits", "at least two realisations", "exp1 and exp2")
    rows = [_scaled(estimate, [fit[estimate.name] for fit in apart]) for estimate in fitted.estimates]
    return replace(fitted, estimates=tuple(rows))


def _scaled(estimate: Estimate, others: Sequence[Estimate]) -> Estimate:
    """Widen the interval of an estimate if the others scatter by more than their intervals say.

    The factor is the Birge ratio, external over internal scatter of the others, if above 1.
    """
    if not estimate.determined or not all(another.determined and another.half_width > 0 for another in others):
        return estimate
    values = np.array([another.value for another in others])
    weights = np.array([(NORMAL_COVERAGE / another.half_width) ** 2 for another in others])
    off = values - np.average(values, weights=weights)
    ratio = max(float(np.sqrt(np.sum(weights * off**2) / (len(others) - 1))), 1.0)
    low, high = (estimate.value + ratio * (end - estimate.value) for end in (estimate.low, estimate.high))
    return replace(estimate, low=low, high=high, method=f"{estimate.method}, scatter of {len(others)} realisations")


def _sign(response: np.ndarray) -> float:
    """Return 1 if the mass follows the force (-180 degrees), on average over the lines, else -1."""
    return -1.0 if np.sum(np.cos(np.angle(response))) > 0 else 1.0


MISFIT_OF_NO_MODEL = 0.4
"""RMS logarithm of the ratio of response to model above which the model does not describe the response."""


def _follows(values: np.ndarray, model: np.ndarray) -> None:
    """Check that a model follows a response, shape (outputs, lines), at least roughly.

    Raises InputError if it misses the magnitude by too large a factor on average.
    """
    off = float(np.sqrt(np.mean(np.abs(np.log(np.abs(values) / np.abs(model))) ** 2)))
    if off > MISFIT_OF_NO_MODEL:
        text = f"a response that two masses and a joint miss by a factor of {np.exp(off):.2g} on average"
        expected = "the response of a driven mass, and of the other one: are the two positions exchanged?"
        raise InputError("response", text, expected, "")


def _from_modes(response: FrequencyResponse, outputs: int) -> list[np.ndarray]:
    """Return a start of the fit from the first antiresonance and resonance of a rational fit.

    The total mass is 1. Returns [] without both, or if the antiresonance is not below the resonance.
    """
    try:
        modes = fit_modes(response)
    except InputError:
        return []
    values = {mode.name: mode.value for mode in modes.estimates}
    names = ("antiresonance 1 frequency", "resonance 1 frequency", "resonance 1 damping ratio")
    zero, pole, damping = (values.get(name, np.nan) for name in names)
    if not 0 < zero < pole:
        return []
    other = 1 - (zero / pole) ** 2
    stiffness = other * (2 * np.pi * zero) ** 2
    return [_start(other, stiffness, 4 * np.pi * max(damping, 1e-4) * pole * other * (1 - other), outputs)]


def _start(other: float, stiffness: float, damping: float, outputs: int) -> np.ndarray:
    """Return the parameters of a start with a total mass of 1, in logarithms.

    `other` is the fraction of the mass beyond the joint; `outputs` is the number of outputs. Friction, delay and
    compliances begin at 0.
    """
    return np.array([*np.log([1 - other, other, stiffness, damping]), *np.zeros(OF_TWO - DRAG + COMPLIANCES + outputs)])


def _best(
    responses: Sequence[FrequencyResponse],
    signs: tuple[float, float],
    band: tuple[float, float] | None,
    seen: Callable[[], list[np.ndarray]],
) -> tuple[ResponseFit, np.ndarray]:
    """Fit a two-mass model from several starts; stop at the first good fit, else take the best.

    Starts are the best mass ratio on a grid, the models from the modes `seen`, and the second-best ratio. The responses
    that were fitted are returned, too, with their `signs`.
    """
    reach = np.array([FARTHEST_LOG] * 3 + [2 * FARTHEST_LOG])
    target, frequency, fitted = _fitting(two_masses, OF_TWO, responses, signs, band)
    values = target.response

    def starts() -> Iterator[np.ndarray]:
        first, second, *_ = sorted(_starts_of_two(values, frequency), key=target.misfit)
        yield first
        yield from (_scaled_to(visible, values[0], frequency) for visible in seen())
        yield second

    fits = []
    for start in starts():
        fits.append(fitted(start, [*(start[:DRAG] - reach), 0.0, 0.0], [*(start[:DRAG] + reach), np.inf, np.inf]))
        if fits[-1].reduced < MISFIT_OF_A_RIGHT_MODEL:
            break
    return min(fits, key=lambda fit: fit.squares), values


WIDTH_OF_A_START = 0.1
"""Half-width of the mode of the mass on its spring from which a fit starts, relative to its frequency."""


def _starts_of_one(values: np.ndarray, frequency: np.ndarray) -> list[np.ndarray]:
    """Return starts of a fit, with different corner frequencies of friction and spring.

    The magnitude of each start is, on average, that of the first response in `values`.
    """
    places = 2 * np.pi * np.array([0.0, *np.geomspace(frequency[0] / 3, frequency[-1], 6)])
    starts = []
    for corner, mode in product(places, places):
        drag, spring = corner + WIDTH_OF_A_START * mode, mode**2
        rest = np.zeros(COMPLIANCES + len(values))
        shape = one_mass(np.array([0.0, drag, spring, *rest]), frequency)[0]
        level = float(np.mean(np.log(np.abs(shape) / np.abs(values[0]))))
        starts.append(np.array([level, drag * np.exp(level), spring * np.exp(level), *rest]))
    return starts


RESONANCE_RATIOS = (1.05, 1.2, 1.5, 2.0, 3.0)
"""Ratios of resonance to antiresonance from which the fit starts."""


def _starts_of_two(values: np.ndarray, frequency: np.ndarray) -> Iterator[np.ndarray]:
    """Yield starts with the resonance at the highest acceleration of the driven mass.

    The starts have several mass ratios.
    """
    level = np.abs(values[0]) * (2 * np.pi * frequency) ** 2
    resonance = frequency[1 + int(np.argmax(level[1:-1]))]
    for ratio in RESONANCE_RATIOS:
        other = 1 - 1 / ratio**2
        stiffness = other * (2 * np.pi * resonance / ratio) ** 2
        damping = 0.1 * np.sqrt(stiffness * other)
        yield _scaled_to(_start(other, stiffness, damping, len(values)), values[0], frequency)


def _scaled_to(start: np.ndarray, response: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return a start with masses, stiffness and damping scaled together to fit the response."""
    scale = np.mean(np.log(np.abs(two_masses(start, frequency)[0]) / np.abs(response)))
    return np.concatenate([start[:DRAG] + scale, start[DRAG:]])


def _warnings(signs: tuple[float, float], fit: ResponseFit) -> Iterator[str]:
    """Yield a sentence for each output whose sign was reversed, and one for a poor fit."""
    if signs[0] < 0:
        yield "the driven mass goes against the input: its sign was reversed"
    if signs[0] != signs[1]:
        yield "the second output has the opposite sign of the first: it was reversed"
    if fit.reduced > MISFIT_OF_A_RIGHT_MODEL:
        yield f"the model is not right to the precision of the data (reduced chi-square {fit.reduced:.3g})"


def _estimates(fit: ResponseFit, response: FrequencyResponse) -> tuple[Estimate, ...]:
    """Return estimates of masses, joint, friction and delay, antiresonance and resonance."""
    into, out = response.channels.input_unit, response.channels.output_unit
    rate = f"{into} s/{out}"

    rows = [
        ("driven mass", f"{into} s^2/{out}", lambda p: float(np.exp(p[DRIVEN]))),
        ("other mass", f"{into} s^2/{out}", lambda p: float(np.exp(p[OTHER]))),
        ("total mass", f"{into} s^2/{out}", lambda p: float(np.exp(p[DRIVEN]) + np.exp(p[OTHER]))),
        ("joint stiffness", f"{into}/{out}", lambda p: float(np.exp(p[STIFFNESS]))),
        ("joint damping", rate, lambda p: float(np.exp(p[DAMPING]))),
        ("antiresonance frequency", "Hz", lambda p: abs(_root(p, True)) / (2 * np.pi)),
        ("antiresonance damping ratio", "1", lambda p: -np.cos(np.angle(_root(p, True)))),
        ("resonance frequency", "Hz", lambda p: abs(_root(p, False)) / (2 * np.pi)),
        ("resonance damping ratio", "1", lambda p: -np.cos(np.angle(_root(p, False)))),
    ]
    positive = [fit.estimate(name, _si(unit), METHOD, of, positive=True) for name, unit, of in rows]
    plain = [
        fit.estimate("driven viscous friction", _si(rate), METHOD, lambda p: float(p[DRAG])),
        fit.estimate("other viscous friction", _si(rate), METHOD, lambda p: float(p[OTHER_DRAG])),
        fit.estimate("delay", "s", METHOD, lambda p: float(p[OF_TWO + DELAY])),
    ]
    return (*positive, *plain)


def _root(parameters: np.ndarray, zero: bool) -> complex:
    """Return the pole, or the zero of the driven mass, with the largest imaginary part [rad/s]."""
    driven, other, stiffness, damping = np.exp(parameters[:DRAG])
    first = np.array([driven, parameters[DRAG] + damping, stiffness])
    second = np.array([other, parameters[OTHER_DRAG] + damping, stiffness])
    joint = np.array([damping, stiffness])
    characteristic = second if zero else np.polysub(np.polymul(first, second), np.polymul(joint, joint))
    roots = np.roots(characteristic)
    upper = roots[roots.imag > 0]
    return complex(upper[np.argmax(np.abs(upper))]) if upper.size else complex(np.nan, np.nan)


def _si(unit: str) -> str:
    """Shorten a unit to kg, N s/m and so on where input is in newtons and output in metres."""
    return {"N s^2/m": "kg", "N s/m": "N s/m"}.get(unit, unit)
