"""Fit laws of the edge of hunting, which combine frequencies that are products of powers.

A law is fitted to the logarithm of the edge with a loss that outliers do not dominate (soft L1). Cross-validation
chooses the exponents. Beginning with none, the exponent that lowers the cross-validated loss most is added, until the
next one gains too little.

Rigid (or locked): two times add up. At the Stribeck velocity the bristles need F_s/(sigma_0 v_s) to slip. Where
friction falls with speed, it drives a mass away with the time constant m v_s/(F_s - F_c). A loop that is faster than
both together catches the mass before it has broken away for good.

Free joint: the stage on its joint may move without the cart, so that the loop corrects it while the bearing sticks. The
slower the joint, sqrt(k_j/m), the lower the edge. But once the deflection has used up the stroke, the joint is as good
as locked. The edge is then no lower than that of a joint whose stroke just suffices, sqrt(F_s/(m S_j)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import least_squares

REFERENCE: Mapping[str, float] = {
    "gap": 1.0,
    "stribeck": 1.0,
    "bristle_damping": 0.4,
    "viscous": 1e-3,
    "alpha": 0.1,
    "beta": 2.0,
    "tuned_mass": 1.0,
    "stage_share": 0.5,
    "joint_damping": 0.01,
    "limiter_damping": 0.05,
}
"""Values of the groups that serve as references in the laws: round numbers near the thesis rig."""

LINEAR_LOSS_FROM = 0.1
"""Error of the logarithm above which the loss grows linearly instead of quadratically."""

VALIDATION_PARTS, LEAST_GAIN, MOST_EXPONENTS = 8, 0.02, 8
"""Settings of the cross-validation: the number of parts, the relative loss that a further exponent must save, and the
largest number of exponents."""

SampleValues = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Rate:
    """A frequency that enters a law of the edge, in units of sqrt(sigma_0/m).

    The frequency is a factor times dimensionless groups to the fixed powers of `base`, times further groups, relative
    to reference values, to fitted powers. Powers are fitted only for those `candidates` that turn out to matter.
    """

    name: str
    base: Mapping[str, float]
    candidates: tuple[str, ...]

    def fixed(self, values: SampleValues) -> np.ndarray:
        """Return the logarithm of the product of dimensionless groups to fixed powers, (count,)."""
        return sum((power * np.log(values[group]) for group, power in self.base.items()), start=np.zeros(()))


Combine = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Function that combines rates into an edge. It takes the logarithms of the rates, shape (rates, count), and of the
locked edge, (count,). It returns the logarithm of the edge and its derivatives by the logarithms of the rates."""

Exponent = tuple[int, str]
"""An exponent to be fitted: the index of a frequency (rate) of the law, and the group."""


@dataclass(frozen=True)
class EdgeLaw:
    """A law of the edge before the fit: the frequencies that enter it, and how they combine.

    Its factors and exponents are still open.
    """

    rates: tuple[Rate, ...]
    combine: Combine

    @property
    def candidates(self) -> list[Exponent]:
        return [(number, group) for number, rate in enumerate(self.rates) for group in rate.candidates]


@dataclass(frozen=True)
class FittedLaw:
    """A law of the edge with its numbers.

    `factors` belong to the frequencies (rates) that enter it. `exponents` are those fitted, in the order in which they
    were chosen. `path` has the cross-validated loss, a mean error of the logarithm, with no exponent, one, two, and so
    on.
    """

    law: EdgeLaw
    factors: tuple[float, ...]
    exponents: Mapping[Exponent, float]
    path: tuple[float, ...] = ()

    def of(self, rate: int) -> dict[str, float]:
        """Return the fitted exponents of one of the law's frequencies, by dimensionless group.

        `rate` is the index of the frequency.
        """
        return {group: value for (number, group), value in self.exponents.items() if number == rate}

    def log_rates(self, values: SampleValues) -> np.ndarray:
        """Return logarithms of the frequencies that enter the law, shape (rates, count).

        The frequencies are in units of sqrt(sigma_0/m).
        """
        parameters = np.array([*np.log(self.factors), *self.exponents.values()])
        return _log_rates(self.law, tuple(self.exponents), values, parameters)

    def edge(self, values: SampleValues, locked: np.ndarray | None = None) -> np.ndarray:
        """Return the edge of stages by their dimensionless groups, in units of sqrt(sigma_0/m).

        `locked` is the edge with the joint locked, which only the law of the free joint needs.
        """
        rates = self.log_rates(values)
        return np.exp(self.law.combine(rates, np.log(locked) if locked is not None else np.zeros(rates.shape[1:]))[0])


@dataclass(frozen=True)
class Errors:
    """Errors of a law, taken as logarithms of the edge over the law, on `count` samples.

    `rms` is the root mean square; `median`, `usual` (95 % quantile) and `worst` are sizes. The ratio of the edge to the
    law lies between `least` and `most`; `safe` is its 95 % quantile.
    """

    count: int
    rms: float
    median: float
    usual: float
    worst: float
    least: float
    most: float
    safe: float

    @classmethod
    def between(cls, law: np.ndarray, edges: np.ndarray) -> Errors:
        """Return the errors of a law against the edges found, both of shape (count,).

        `safe` is the factor on the law below which 95 % of the edges lie.
        """
        off = np.log(edges / law)
        size = np.abs(off)
        return cls(
            len(off),
            float(np.sqrt(np.mean(off**2))),
            float(np.median(size)),
            float(np.quantile(size, 0.95)),
            float(size.max()),
            float(np.exp(off.min())),
            float(np.exp(off.max())),
            float(np.exp(np.quantile(off, 0.95))),
        )


def rates_in_series(power: float, rates: np.ndarray, locked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Combine frequencies whose periods add: edge^-power is the sum of rate^-power.

    `rates`, shape (rates, count), are logarithms; `locked` is not used. Returned are the logarithm of the edge, and its
    derivatives by each of the `rates`.
    """
    total = np.logaddexp.reduce(-power * rates, axis=0)
    return -total / power, np.exp(-power * rates - total)


def beside_locked(rates: np.ndarray, locked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Combine the largest rate with the edge of the locked joint: edge^-2 = rate^-2 + locked^-2.

    `rates`, shape (rates, count), and `locked`, shape (count,), are logarithms of frequencies. Returned are the
    logarithm of the edge, and its derivatives by each of the `rates`.
    """
    largest = rates.argmax(axis=0)
    log, weights = rates_in_series(2.0, np.stack([rates.max(axis=0), locked]), locked)
    return log, np.where(np.arange(len(rates))[:, None] == largest, weights[0], 0.0)


def fit_law(law: EdgeLaw, values: SampleValues, edges: np.ndarray, locked: np.ndarray | None = None) -> FittedLaw:
    """Fit a law to edges, shape (count,); cross-validation chooses its exponents.

    `values` are the samples' dimensionless groups by name. `locked`, shape (count,), is the edge with the joint locked,
    for a law that needs it.
    """
    target = np.log(edges)
    offset = np.zeros(len(edges)) if locked is None else np.log(locked)
    folds = np.random.default_rng(0).permutation(len(edges)) % VALIDATION_PARTS
    chosen: tuple[Exponent, ...] = ()
    path = [_validated(law, chosen, values, target, offset, folds)]
    while len(chosen) < MOST_EXPONENTS:
        remaining = [exponent for exponent in law.candidates if exponent not in chosen]
        scores = [_validated(law, (*chosen, exponent), values, target, offset, folds) for exponent in remaining]
        if not scores or min(scores) > (1 - LEAST_GAIN) * path[-1]:
            break
        path.append(min(scores))
        chosen = (*chosen, remaining[int(np.argmin(scores))])
    solution = _log_coefficients(law, chosen, values, target, offset)
    rates = len(law.rates)
    factors = tuple(float(factor) for factor in np.exp(solution[:rates]))
    return FittedLaw(law, factors, dict(zip(chosen, map(float, solution[rates:]), strict=True)), tuple(path))


def loss(off: np.ndarray) -> float:
    """Return the size of errors `off` of the logarithm: nearly the rms if they are small.

    Errors beyond `LINEAR_LOSS_FROM` count linearly.
    """
    return float(np.sqrt(np.mean(2 * LINEAR_LOSS_FROM**2 * (np.sqrt(1 + (off / LINEAR_LOSS_FROM) ** 2) - 1))))


def _validated(
    law: EdgeLaw,
    chosen: tuple[Exponent, ...],
    values: SampleValues,
    target: np.ndarray,
    offset: np.ndarray,
    folds: np.ndarray,
) -> float:
    """Return the cross-validated loss of a law with some exponents `chosen`.

    Each part of the samples, numbered in `folds`, is predicted by the law fitted to the other parts. `target` are
    logarithms of edges, and `offset` are logarithms of edges with the joint locked.
    """
    off = np.empty(len(target))
    for fold in range(VALIDATION_PARTS):
        out, rest = folds == fold, folds != fold
        solution = _log_coefficients(law, chosen, _some(values, rest), target[rest], offset[rest])
        rates = _log_rates(law, chosen, _some(values, out), solution)
        off[out] = law.combine(rates, offset[out])[0] - target[out]
    return loss(off)


def _log_coefficients(
    law: EdgeLaw, chosen: tuple[Exponent, ...], values: SampleValues, target: np.ndarray, offset: np.ndarray
) -> np.ndarray:
    """Fit a law: return the logarithms of its factors, followed by the exponents `chosen`.

    `target` are logarithms of edges, and `offset` are logarithms of edges with the joint locked.
    """
    features = _features(law, chosen, values)
    fixed = np.stack([np.broadcast_to(rate.fixed(values), target.shape) for rate in law.rates])

    def off(parameters: np.ndarray) -> np.ndarray:
        return law.combine(fixed + np.einsum("rpc,p->rc", features, parameters), offset)[0] - target

    def slopes(parameters: np.ndarray) -> np.ndarray:
        weights = law.combine(fixed + np.einsum("rpc,p->rc", features, parameters), offset)[1]
        return np.einsum("rc,rpc->cp", weights, features)

    start = np.zeros(len(law.rates) + len(chosen))
    return least_squares(off, start, slopes, loss="soft_l1", f_scale=LINEAR_LOSS_FROM).x  # type: ignore[arg-type]


def _features(law: EdgeLaw, chosen: tuple[Exponent, ...], values: SampleValues) -> np.ndarray:
    """Return derivatives of the logarithms of a law's frequencies by the fitted parameters.

    The shape is (rates, parameters, count).
    """
    count, rates = len(next(iter(values.values()))), len(law.rates)
    features = np.zeros((rates, rates + len(chosen), count))
    features[np.arange(rates), np.arange(rates)] = 1.0
    for column, (rate, group) in enumerate(chosen):
        features[rate, rates + column] = np.log(values[group] / REFERENCE[group])
    return features


def _log_rates(law: EdgeLaw, chosen: tuple[Exponent, ...], values: SampleValues, parameters: np.ndarray) -> np.ndarray:
    fixed = np.stack([np.broadcast_to(rate.fixed(values), values["gap"].shape) for rate in law.rates])
    return fixed + np.einsum("rpc,p->rc", _features(law, chosen, values), parameters)


def _some(values: SampleValues, which: np.ndarray) -> dict[str, np.ndarray]:
    return {name: value[which] for name, value in values.items()}


_TUNING = ("alpha", "beta", "tuned_mass")
_FRICTION = ("gap", "bristle_damping", "viscous")
_JOINT = ("stage_share", "joint_damping", "limiter_damping", "stribeck")

SLIP = Rate("slip", {"stribeck": 1.0, "gap": 1.0}, (*_TUNING, *_FRICTION))
"""Frequency at which the bristles slip, sigma_0 v_s/F_s."""

DROP = Rate("drop", {"stribeck": -1.0}, (*_TUNING, *_FRICTION))
"""Frequency at which falling friction drives the mass away, (F_s - F_c)/(m v_s)."""

JOINT = Rate("joint", {"joint": 0.5}, (*_TUNING, *_FRICTION, *_JOINT))
"""Natural frequency of the joint, sqrt(k_j/m)."""

STROKE = Rate("stroke", {"joint": 0.5, "stroke": -0.5}, (*_TUNING, *_FRICTION, *_JOINT))
"""Natural frequency of a joint whose stroke just suffices, sqrt(F_s/(m S_j))."""

LOCKED_LAW = EdgeLaw((SLIP, DROP), partial(rates_in_series, 1.0))
FREE_LAW = EdgeLaw((JOINT, STROKE), beside_locked)
