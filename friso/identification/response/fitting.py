"""Fit a model to responses by weighted least squares, with the uncertainty of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from friso.identification.estimate import Estimate
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings
from friso.identification.spread import covariance_of_sum

ResponseModel = Callable[[np.ndarray], np.ndarray]
"""A function from parameters (p,) to complex responses (outputs, lines)."""


NOTHING: Mapping[int, tuple[float, float]] = MappingProxyType({})


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
        factor = np.exp(min(plain.half_width / value, np.log(2 * settings.factor_of_a_loose_interval)))
        if not factor < settings.factor_of_a_loose_interval:
            reason = f"its interval spans more than a factor of {settings.factor_of_a_loose_interval:g} to either side"
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
        free, tolerance = max(count - len(start), 1), settings.tolerance_of_a_fit
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
