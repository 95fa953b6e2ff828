"""Find the modes of a response: resonances and antiresonances with their damping, by a rational fit over frequency.

Models are fitted by weighted least squares, which gives the uncertainty of their parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from friso.errors import InputError
from friso.identification.combine import covariance_of_sum
from friso.identification.estimate import Estimate
from friso.identification.response.records import FrequencyResponse
from friso.identification.response.settings import settings

ResponseModel = Callable[[np.ndarray], np.ndarray]
"""A function from parameters (p,) to complex responses (outputs, lines)."""


NOTHING: Mapping[int, tuple[float, float]] = MappingProxyType({})


FACTOR_OF_A_LOOSE_INTERVAL = 1e3
"""Factor to either side beyond which a linear interval of a positive quantity means nothing."""


@dataclass(frozen=True)
class ResponseFit:
    """Parameters (p,) fitted to responses, with their covariance (p, p).

    `squares` is the sum of squares in units of the variance, and `count` the number of data.
    """

    parameters: np.ndarray
    covariance: np.ndarray
    squares: float
    count: int

    @property
    def reduced(self) -> float:
        """Return the sum of squares over degrees of freedom; 1 if model and deviations are right."""
        return self.squares / max(self.count - len(self.parameters), 1)

    @property
    def bic(self) -> float:
        """Return the Bayesian information criterion for an unknown scale of the variance.

        Schwarz 1978, doi:10.1214/aos/1176344136.
        """
        return self.count * np.log(self.squares / self.count) + len(self.parameters) * np.log(self.count)

    def _at(self, of: Callable[[np.ndarray], float]) -> tuple[float, float]:
        """Return the value of a function of the parameters, and its deviation to first order.

        Value and deviation may be NaN or infinite for undetermined parameters that overflow.
        """
        steps = 1e-4 * np.sqrt(np.maximum(np.diag(self.covariance), 1e-30))
        beside = [_number(of, self.parameters + h) - _number(of, self.parameters - h) for h in np.diag(steps)]
        with np.errstate(all="ignore"):
            slopes = np.array(beside) / (2 * steps)
            variance = slopes @ self.covariance @ slopes
        return _number(of, self.parameters), float(np.sqrt(np.maximum(variance, 0.0)))

    def estimate(
        self, name: str, unit: str, method: str, of: Callable[[np.ndarray], float], positive: bool = False
    ) -> Estimate:
        """Estimate a function of the parameters, with its interval to first order.

        The interval of a `positive` quantity is computed for its logarithm.
        """
        value, deviation = self._at(of)
        if not np.isfinite(value) or (positive and not value > 0):
            return Estimate.unknown(name, unit, method, "the fitted model does not have it")
        if not np.isfinite(deviation):
            return Estimate.unknown(name, unit, method, "the data leave it open")
        plain = Estimate.normal(name, unit, value, deviation, method)
        if not positive:
            return plain
        factor = np.exp(min(plain.half_width / value, np.log(2 * FACTOR_OF_A_LOOSE_INTERVAL)))
        if not factor < FACTOR_OF_A_LOOSE_INTERVAL:
            reason = f"its interval spans more than a factor of {FACTOR_OF_A_LOOSE_INTERVAL:g} to either side"
            return Estimate.unknown(name, unit, method, reason, 0.0)
        return Estimate(name, unit, value, value / factor, value * factor, method)


def _number(of: Callable[[np.ndarray], float], parameters: np.ndarray) -> float:
    """Return the value of the function `of` at some parameters; NaN if it overflows."""
    try:
        with np.errstate(all="ignore"):
            return float(of(parameters))
    except (np.linalg.LinAlgError, OverflowError):
        return np.nan


def deviations(response: FrequencyResponse) -> np.ndarray:
    """Return the deviation by which each spectral line is weighted, shape (lines,).

    Every deviation is at least a thousandth of the response, because no model is more accurate.
    """
    return np.hypot(response.scatter(), 1e-3 * np.abs(response.response))


TOLERANCE_OF_A_FIT = 1e-6
"""Relative change of squares or parameters that ends a fit, far below their noise."""


@dataclass(frozen=True)
class ResponseTarget:
    """Complex responses, (outputs, lines), to which a model is fitted, weighted by their deviations."""

    model: ResponseModel
    response: np.ndarray
    deviation: np.ndarray

    def misfit(self, parameters: np.ndarray) -> float:
        """Return the sum of squares of the model's errors in units of the variance."""
        return float(np.sum(np.abs((self.model(parameters) - self.response) / self.deviation) ** 2))

    def refined(
        self,
        start: np.ndarray,
        lower: np.ndarray | float = -np.inf,
        upper: np.ndarray | float = np.inf,
        believed: Mapping[int, tuple[float, float]] = NOTHING,
    ) -> ResponseFit:
        """Fit the model's parameters by least squares.

        The errors of one line may be correlated between outputs, and those of neighbouring lines with each other, since
        a model is never quite right: the covariance is the larger of the plain one, scaled by the residual, and a
        robust one (Newey, West 1987, doi:10.2307/1913610). `believed` holds prior values and deviations of parameters
        by index; each counts as one more observation. `lower` and `upper` only keep the fit from diverging.
        """
        weight, places = np.sqrt(2) / self.deviation, list(believed)
        middle, reach = np.array(list(believed.values())).reshape(-1, 2).T
        (outputs, lines), count = self.response.shape, 2 * self.response.size
        free, tolerance = max(count - len(start), 1), TOLERANCE_OF_A_FIT
        options: Any = {"x_scale": "jac", "ftol": tolerance, "xtol": tolerance, "max_nfev": 200}

        def solved(first: np.ndarray, scale: float) -> OptimizeResult:
            def residuals(parameters: np.ndarray) -> np.ndarray:
                error = (self.model(parameters) - self.response) * weight
                off = (parameters[places] - middle) / reach * scale
                return np.concatenate([np.stack([error.real, error.imag], axis=-1).ravel(), off])

            return least_squares(residuals, first, bounds=(lower, upper), **options)

        def reduced(solution: OptimizeResult) -> float:
            return float(np.sum(solution.fun[:count] ** 2)) / free

        solution = solved(start, 1.0)
        if places:
            solution = solved(solution.x, np.sqrt(reduced(solution)))
        size = np.linalg.norm(solution.jac, axis=0)
        size[size == 0] = 1.0
        slopes = solution.jac / size
        inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-14, hermitian=True)
        plain = inverse * reduced(solution)
        scores = slopes * solution.fun[:, None]
        by_line = scores[:count].reshape(outputs, lines, 2, -1).sum(axis=(0, 2))
        alone = slopes[count:].T @ slopes[count:] * reduced(solution)
        together = covariance_of_sum(by_line, int(4 * (lines / 100) ** (2 / 9)) + 1)
        robust = inverse @ (together * (count / free) + alone) @ inverse
        covariance = _larger(plain, robust) / size[:, None] / size
        return ResponseFit(solution.x, covariance, reduced(solution) * free, count)


def _larger(plain: np.ndarray, robust: np.ndarray) -> np.ndarray:
    """Raise the deviations of the plain covariance to the robust ones where these are larger."""
    ratio = np.diag(robust) / np.maximum(np.diag(plain), np.finfo(float).tiny)
    raised = np.sqrt(np.maximum(ratio, 1.0))
    return plain * raised[:, None] * raised


METHOD = "rational fit of the response"


@dataclass(frozen=True)
class Modes:
    """A fit of modes over `band` [Hz], with its resonances and antiresonances by frequency.

    Estimates are called "resonance 1 frequency" and so on. `order` says how the number of modes was chosen.
    """

    shape: RationalShape
    fit: ResponseFit
    scale: float
    estimates: tuple[Estimate, ...]
    order: str
    band: tuple[float, float]
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """Return an estimate by name."""
        return next(estimate for estimate in self.estimates if estimate.name == name)

    def predict(self, frequency: np.ndarray) -> np.ndarray:
        """Return the complex fitted response at frequencies [Hz], in their shape."""
        return rational(self.fit.parameters, self.shape, 1j * frequency / self.scale)


ERROR_OF_A_RESPONSE = 0.01
"""Smallest relative error of a spectral line, which keeps a few strong lines from dominating the fit."""

MISFIT_OF_A_RIGHT_MODEL = 3.0
"""Largest sum of squares over degrees of freedom of a model that counts as right."""


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
    deviation = np.hypot(part.scatter(), ERROR_OF_A_RESPONSE * np.abs(part.response))
    kinds = (True, False) if rigid is None else (rigid,)
    rows = [row for kind in kinds for row in orders(s, part.response, deviation, kind, settings.modes_at_most)]
    shape, start, *_ = simplest_model(rows)
    low, high = bounds(shape, s)
    target = ResponseTarget(lambda p: rational(p, shape, s)[None], part.response[None], deviation[None])
    fit = target.refined(start, low, high)
    limits = (float(part.frequency[0]), float(part.frequency[-1]))
    warnings = [*_cancelling(fit, shape, scale, limits)]
    if fit.reduced > MISFIT_OF_A_RIGHT_MODEL:
        warnings.append(f"the fit misses by more than the deviations (reduced chi-square {fit.reduced:.3g})")
    estimates = _pairs(fit, shape, scale, limits)
    return Modes(shape, fit, scale, estimates, _described(shape, rows), limits, tuple(warnings))


def _described(shape: RationalShape, rows: list[Row]) -> str:
    """Write how the number of modes was chosen."""
    orders = ", ".join(f"{row.shape.words}: {row.bic:.4g}" for row in rows)
    return f"{shape.words} by the Bayesian information criterion ({orders})"


WIDTHS_OF_CANCELLING = 1.0
"""Distance of resonance and antiresonance, in half-widths, up to which they nearly cancel."""


def _cancelling(fit: ResponseFit, shape: RationalShape, scale: float, band: tuple[float, float]) -> Iterator[str]:
    """Yield a sentence for each resonance within the band that an antiresonance nearly cancels.

    `band` is in Hz. Poles and zeros times `scale` are frequencies in Hz.
    """
    poles, zeros = poles_and_zeros(fit.parameters, shape)
    for pole in sorted(poles, key=abs):
        if not zeros.size or not band[0] <= abs(pole) * scale <= band[1]:
            continue
        zero = zeros[np.argmin(np.abs(zeros - pole))]
        if abs(zero - pole) <= WIDTHS_OF_CANCELLING * min(-pole.real, abs(zero.real)):
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


@dataclass(frozen=True)
class RationalShape:
    """Structure of a rational model: a rigid body or not, modes, and a constant beyond them."""

    rigid: bool
    modes: int
    constant: bool

    @property
    def nonlinear(self) -> int:
        """Return the number of nonlinear parameters, which come first.

        Nonlinear parameters are viscous pole and delay, logarithms of frequencies, then logarithms of damping ratios.
        """
        return 2 + 2 * self.modes

    @property
    def words(self) -> str:
        """Describe the model's structure in words."""
        parts = [f"{self.modes} mode{'s' if self.modes != 1 else ''}"]
        parts += ["rigid body"] * self.rigid + ["constant"] * self.constant
        return " + ".join(parts)


class Row(NamedTuple):
    """A rational model that was tried, with its parameters (p,).

    `bic` is the Bayesian information criterion, and `squares` the sum of squares over variances.
    """

    shape: RationalShape
    parameters: np.ndarray
    bic: float
    squares: float


def orders(s: np.ndarray, values: np.ndarray, deviation: np.ndarray, rigid: bool, most: int) -> list[Row]:
    """Fit rational models with 0, 1, ... modes, at most `most`, as long as one more mode helps.

    The models have a `rigid` body or not. They are fitted to `values` with their `deviation` at complex frequencies `s`
    over a scale, (lines,) each. The last result is the best of these models with a constant added.
    """
    rows: list[Row] = []
    nonlinear = np.zeros(2)
    for modes in range(most + 1):
        shape = RationalShape(rigid, modes, False)
        if modes:
            nonlinear = _another(nonlinear, shape, s, values, deviation)
        if rigid or modes:
            nonlinear = _eliminated(nonlinear, shape, s, values, deviation)
            rows.append(_completed(nonlinear, shape, s, values, deviation))
        if len(rows) > 1 and not _better(rows[-1], rows[-2]):
            break
    best = simplest_model(rows)
    shape = RationalShape(rigid, best.shape.modes, True)
    nonlinear = _eliminated(best.parameters[: shape.nonlinear], shape, s, values, deviation)
    return [*rows, _completed(nonlinear, shape, s, values, deviation)]


def simplest_model(rows: list[Row]) -> Row:
    """Return the model that wins if models are compared in order of their size.

    A larger model must beat the winner so far clearly.
    """
    ordered = sorted(rows, key=lambda row: (len(row.parameters), not row.shape.rigid))
    best = ordered[0]
    for row in ordered[1:]:
        if _better(row, best):
            best = row
    return best


CRITERION_OF_A_MODE = 10.0
"""Decrease of the information criterion for another mode (Kass, Raftery 1995: very strong evidence)."""

SQUARES_LEFT_BY_A_MODE = 0.8
"""Largest ratio of the sums of squares with and without another mode. The criterion alone would fit friction's
ripple."""


def _better(larger: Row, smaller: Row) -> bool:
    """Tell whether a larger model beats a smaller one clearly.

    Its Bayesian criterion and its sum of squares must both be lower by more than the settings ask.
    """
    lower = larger.bic < smaller.bic - CRITERION_OF_A_MODE
    return lower and larger.squares < SQUARES_LEFT_BY_A_MODE * smaller.squares


def _columns(nonlinear: np.ndarray, shape: RationalShape, s: np.ndarray) -> np.ndarray:
    """Return the complex responses, (linear, lines), whose weighted sum is the model's response.

    There is one for the rigid body, if the model has one, one for each mode, and 1 for the constant, if it has one. The
    linear parameters are the weights.
    """
    viscous, delay = nonlinear[:2]
    omega, damping = np.exp(nonlinear[2 : 2 + shape.modes]), np.exp(nonlinear[2 + shape.modes : shape.nonlinear])
    parts = [1 / (s * (s + viscous))[None]] if shape.rigid else []
    parts.append(1 / (s**2 + 2 * (damping * omega)[:, None] * s + (omega**2)[:, None]))
    if shape.constant:
        parts.append(np.ones((1, len(s)), complex))
    return np.concatenate(parts) * np.exp(-s * delay)


def rational(parameters: np.ndarray, shape: RationalShape, s: np.ndarray) -> np.ndarray:
    """Return the response of a rational model, shape (lines,).

    `s`, shape (lines,), is i times the frequency over a reference frequency, without unit.
    """
    return parameters[shape.nonlinear :] @ _columns(parameters[: shape.nonlinear], shape, s)


def _linear_parameters(columns: np.ndarray, values: np.ndarray, deviation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the best linear parameters, real, and the weighted residuals.

    Residuals hold all real parts, then all imaginary parts.
    """
    weight = np.sqrt(2) / deviation
    matrix, right = (columns * weight).T, values * weight
    matrix, right = np.concatenate([matrix.real, matrix.imag]), np.concatenate([right.real, right.imag])
    sizes = np.linalg.norm(matrix, axis=0)
    linear = np.linalg.lstsq(matrix / sizes, right, rcond=1e-12)[0] / sizes
    return linear, matrix @ linear - right


def bounds(shape: RationalShape, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest value that the fit allows for each parameter.

    Modes lie within an octave of the band, damping ratios between 1e-4 and 2, and delays turn the phase by at most one
    radian at the highest frequency.
    """
    low, high, linear = np.abs(s[0]), np.abs(s[-1]), int(shape.rigid) + shape.modes + int(shape.constant)
    rest = np.full(linear, np.inf)
    omega, damping = np.full(shape.modes, np.log(low / 2)), np.full(shape.modes, np.log(1e-4))
    lower = np.concatenate([[0.0, -1 / high], omega, damping, -rest])
    upper = np.concatenate([[high, 1 / high], omega + np.log(4 * high / low), damping + np.log(2e4), rest])
    return lower, upper


FREQUENCIES_TRIED = 60
"""Number of frequencies at which a further mode is tried."""

DAMPINGS_TRIED = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Damping ratios at which a further mode is tried."""


def _another(
    nonlinear: np.ndarray, shape: RationalShape, s: np.ndarray, values: np.ndarray, deviation: np.ndarray
) -> np.ndarray:
    """Add one more mode to the nonlinear parameters, where it improves the fit most."""
    before = shape.modes - 1
    best, best_parameters = np.inf, nonlinear
    for place in np.geomspace(np.abs(s[0]), np.abs(s[-1]), FREQUENCIES_TRIED):
        for damping in DAMPINGS_TRIED:
            start = np.insert(np.append(nonlinear, np.log(damping)), 2 + before, np.log(place))
            left = _linear_parameters(_columns(start, shape, s), values, deviation)[1]
            if left @ left < best:
                best, best_parameters = left @ left, start
    return best_parameters


def _eliminated(
    start: np.ndarray, shape: RationalShape, s: np.ndarray, values: np.ndarray, deviation: np.ndarray
) -> np.ndarray:
    """Refine the nonlinear parameters of a model from a start, and return them.

    At each step the linear parameters follow by least squares (Golub, Pereyra 1973).
    """

    def left(nonlinear: np.ndarray) -> np.ndarray:
        return _linear_parameters(_columns(nonlinear, shape, s), values, deviation)[1]

    lower, upper = (limit[: shape.nonlinear] for limit in bounds(shape, s))
    options: Any = {"bounds": (lower, upper), "ftol": TOLERANCE_OF_A_FIT, "max_nfev": 60}
    return least_squares(left, np.clip(start, lower, upper), **options).x


def _completed(
    nonlinear: np.ndarray, shape: RationalShape, s: np.ndarray, values: np.ndarray, deviation: np.ndarray
) -> Row:
    """Make the tried model from its nonlinear parameters: all parameters, `bic` and `squares`."""
    linear, left = _linear_parameters(_columns(nonlinear, shape, s), values, deviation)
    parameters = np.concatenate([nonlinear, linear])
    squares = float(left @ left)
    return Row(shape, parameters, ResponseFit(parameters, np.zeros((0, 0)), squares, left.size).bic, squares)


def poles_and_zeros(parameters: np.ndarray, shape: RationalShape) -> tuple[np.ndarray, np.ndarray]:
    """Return the poles of the modes and the zeros of the response with positive imaginary part.

    Poles and zeros are relative to the scale of s, a reference frequency.
    """
    omega, damping = np.exp(parameters[2 : 2 + shape.modes]), np.exp(parameters[2 + shape.modes : shape.nonlinear])
    linear = parameters[shape.nonlinear :]
    factors = [np.array([1.0, parameters[0], 0.0])] if shape.rigid else []
    factors += [np.array([1.0, 2 * z * w, w**2]) for w, z in zip(omega, damping, strict=True)]
    numerator = np.zeros(1)
    for number, residue in enumerate(linear):
        others = [factor for other, factor in enumerate(factors) if other != number]
        numerator = np.polyadd(numerator, reduce(np.polymul, others, np.array([residue])))
    zeros = np.roots(numerator)
    poles = omega * (-damping + 1j * np.sqrt(np.maximum(1 - damping**2, 0.0)))
    return poles[np.argsort(np.abs(poles))], zeros[zeros.imag > 1e-6 * np.abs(zeros)]
