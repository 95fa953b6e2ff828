"""Convert fitted numbers to keys of the stage file with intervals or ranges, and draw machines from these."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.identifiable import Coverage, IdentifiableFit, Profile, why_not_shown
from friso.identification.output_error.parameters import BRISTLES, MASS, RATIO, SHARE, STRIBECK, FitParameter, keys_at
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.intervals import NORMAL_COVERAGE

METHOD = "output error"


STATIC_ERROR_OF_FOLLOWING = 0.05
"""Relative error by which static friction is too high where a stage follows a log, 3 to 6 %
(docs/evidence/identify.md)."""


def estimates_of(identified: IdentifiableFit, covered: Coverage) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Turn a fit into estimates of stage-file keys, with the correlation of the determined keys.

    Intervals are at least as wide as the profiles' and allow for the linearity error of sensors. Quantities that the
    record does not determine have a range with the reason.
    """
    fit = identified.fit
    parameters = fit.problem.parameters
    spread = np.zeros((len(parameters), len(parameters)))
    finite_variance = np.isfinite(np.diag(fit.covariance))
    places = [number for number, finite in zip(fit.free, finite_variance, strict=True) if finite]
    spread[np.ix_(places, places)] = _no_narrower(fit, identified.profiles)[np.ix_(finite_variance, finite_variance)]
    keys, slopes = _slopes(fit)
    covariance = slopes @ spread @ slopes.T
    values = _keys_at(fit, fit.inner)
    shares = np.full(len(keys), LINEARITY_OF_SENSORS)
    if "friction.static" in keys and not fit.problem.closed:
        shares[keys.index("friction.static")] = STATIC_ERROR_OF_FOLLOWING
    linear = shares * np.abs([values[key] for key in keys]) / NORMAL_COVERAGE
    of_logarithm = {parameter.name for parameter in parameters if parameter.logarithmic}
    logarithmic = np.isin([_OWNERS.get(key, key) for key in keys], [*of_logarithm])
    spread_of_keys = np.sqrt(np.diag(covariance))
    farther = _to_the_farther_end(spread_of_keys, np.array([values[key] for key in keys]))
    deviation = np.hypot(np.where(logarithmic, farther, spread_of_keys), linear)
    unknown = _reasons(identified, covered)
    estimates = []
    for i, key in enumerate(keys):
        owner = _OWNERS.get(key, key)
        like = "friction.coulomb" if key == "friction.static" else owner
        unit = next((parameter.unit for parameter in parameters if parameter.name in (key, like)), "")
        if key in unknown or owner in unknown:
            low, high = (-np.inf, np.inf) if key in unknown and owner != key else _range(fit, owner)
            estimates.append(Estimate.unknown(key, unit, METHOD, unknown.get(key) or unknown[owner], low, high))
        else:
            estimates.append(Estimate.normal(key, unit, values[key], deviation[i], METHOD))
    certain = [i for i, estimate in enumerate(estimates) if estimate.determined]
    part = covariance[np.ix_(certain, certain)] / np.outer(deviation[certain], deviation[certain])
    np.fill_diagonal(part, 1.0)
    return tuple(estimates), (part + part.T) / 2


def _to_the_farther_end(deviation: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Widen standard deviations until intervals reach the upper ends of logarithmic intervals.

    An interval that is symmetric in the logarithm of a value reaches farther above the value than below: if it is 0.5
    each way, 65 % above and 39 % below. The deviation is taken from the upper end. Relative deviations above 1 count as
    1 for this. No deviation becomes smaller, and a deviation of a value 0 stays.
    """
    size = np.abs(values)
    relative = np.divide(deviation, size, out=np.zeros_like(size), where=size > 0)
    farther = size * np.expm1(NORMAL_COVERAGE * np.minimum(relative, 1.0)) / NORMAL_COVERAGE
    return np.where(relative > 0, np.maximum(farther, deviation), deviation)


_OWNERS = {"friction.static": RATIO, "masses.cart": MASS, "masses.stage": MASS}
"""Fitted parameter behind each stage-file key whose name differs from its parameter's."""


def _reasons(identified: IdentifiableFit, covered: Coverage) -> dict[str, str]:
    """Return, by name, why parameters, or keys that follow from them, are not determined."""
    fit = identified.fit
    parameters = {parameter.name: parameter for parameter in fit.problem.parameters}
    unknown = {
        name: why_not_shown(name, covered)
        for name, parameter in parameters.items()
        if name not in identified.shown and not parameter.core
    } | dict(identified.refuted)
    for number in {*fit.free} - fit.bounded:
        unknown.setdefault(fit.problem.parameters[number].name, "the log does not bound it")
    for name, other in (STRIBECK, STRIBECK[::-1]):
        if name in parameters and other in unknown:
            unknown.setdefault(name, unknown[other])
    if SHARE in unknown:
        why = f"the log shows the sum of both masses, {fit.value(MASS):.4g} kg, not how it is split"
        unknown |= {"masses.cart": why, "masses.stage": why}
    if _one_way(parameters):
        total = f"{fit.value('friction.coulomb'):.4g} {parameters['friction.coulomb'].unit}"
        why = f"the log moves in one direction only: its sum with a constant force is {total}"
        unknown |= {"friction.coulomb": why, "friction.static": why}
    return unknown


def _one_way(parameters: Collection[str]) -> bool:
    """Tell whether a fit of some parameters has Coulomb friction, but no constant force from which to tell it."""
    return "friction.coulomb" in parameters and not any(name.startswith("bias.") for name in parameters)


def _no_narrower(fit: OutputErrorFit, profiles: Mapping[str, Profile]) -> np.ndarray:
    """Widen the covariance of fitted numbers so that intervals reach as far as closed profiles."""
    spread = fit.deviation
    factors = np.ones(len(fit.free))
    for i, number in enumerate(fit.free):
        parameter = fit.problem.parameters[number]
        interval = profiles.get(parameter.name)
        if interval is None or not np.isfinite(spread[i]) or interval.open_low or interval.open_high:
            continue
        half = max(abs(float(parameter.inner(end)) - fit.inner[number]) for end in (interval.low, interval.high))
        if spread[i] > 0:
            factors[i] = max(1.0, half / (NORMAL_COVERAGE * spread[i]))
    return fit.covariance * np.outer(factors, factors)


def _keys_at(fit: OutputErrorFit, inner: np.ndarray) -> dict[str, float]:
    """Return the keys of the stage file with the SI values that follow from fitted numbers."""
    values = keys_at(fit.problem.flat, fit.problem.parameters, inner)
    return {key: float(value) for key, value in values.items()}


def _slopes(fit: OutputErrorFit) -> tuple[list[str], np.ndarray]:
    """Return stage-file keys, and their derivatives by the fitted numbers, (keys, parameters)."""
    at = _keys_at(fit, fit.inner)
    step = 1e-6
    moved = [_keys_at(fit, fit.inner + step * row) for row in np.eye(len(fit.inner))]
    return list(at), np.array([[(keys[key] - at[key]) / step for keys in moved] for key in at])


COULOMB_FRICTION_OF_ONE_WAY = (0.18, 2.2)
"""Range left to Coulomb friction, in shares of its sum with a constant force. A cable or a tilt helps a motion by
half of the friction, or opposes it by four times as much."""


def _range(fit: OutputErrorFit, owner: str) -> tuple[float, float]:
    """Return the range [SI] that is left to a parameter that the record does not determine.

    `owner` is the parameter's name. The range is the one that the parameter has in the fit, for any bearing. For the
    ratio of static to Coulomb friction it is a range of static friction. The fitted value is no bound, because it
    compensates for what the model lacks. Of motion in one direction the sum with a constant force bounds Coulomb
    friction. Nothing bounds a parameter that every motion shows, if this record does not;
    nor static friction and bristles without Coulomb friction, from which their ranges follow.
    """
    parameters = {parameter.name: parameter for parameter in fit.problem.parameters}
    parameter, number_of = parameters[owner], {name: number for number, name in enumerate(parameters)}
    if owner == "friction.coulomb" and _one_way(parameters):
        low, high = COULOMB_FRICTION_OF_ONE_WAY
        return low * fit.value(owner), high * fit.value(owner)
    of_coulomb = owner in (RATIO, *BRISTLES) and number_of["friction.coulomb"] not in fit.bounded
    if parameter.core or of_coulomb:
        return -np.inf, np.inf
    if owner == RATIO:
        level = parameters["friction.coulomb"]
        number = number_of[level.name]
        off = NORMAL_COVERAGE * float(np.sqrt(fit.covariance[fit.free.index(number), fit.free.index(number)]))
        ends = level.inner(level.low), level.inner(level.high)
        least, most = (float(level.outer(np.clip(fit.inner[number] + end, *ends))) for end in (-off, off))
        return least * parameter.low, most * parameter.high
    if owner == "friction.bristle_damping":  # the range is one of damping ratios
        stiffness = parameters["friction.bristle_stiffness"]
        softer, stiffer = (np.sqrt(end / fit.problem.flat[stiffness.name]) for end in (stiffness.low, stiffness.high))
        return float(parameter.low * softer), float(parameter.high * stiffer)
    return parameter.low, parameter.high


SEED_OF_DRAWS = 5
"""Random seed of the drawn machines, which makes results repeatable."""

MACHINES_DRAWN = 16
"""Number of machines drawn from the ranges that a record leaves open; they fill the solver's lanes twice."""


def drawn_from(
    estimates: Sequence[Estimate], correlation: np.ndarray, parameters: Sequence[FitParameter], inner: np.ndarray
) -> np.ndarray:
    """Sample machines at random from what a record leaves open, as rows of fitted numbers.

    A fitted number is a parameter's value or its logarithm. The result has the shape (machines, parameters). `inner`,
    shape (parameters,), has the numbers of the fit. Quantities with a value are sampled by their intervals and
    `correlation`. Quantities with a range only are uniform in it, or in its logarithm; a parameter without an estimate
    is sampled from its whole range of the fit.
    """
    rng = np.random.default_rng(SEED_OF_DRAWS)
    determined = [estimate for estimate in estimates if estimate.determined]
    sizes, ways = np.linalg.eigh(correlation)
    steps = rng.standard_normal((MACHINES_DRAWN, len(determined))) @ (ways * np.sqrt(np.clip(sizes, 0.0, None))).T
    values = {
        estimate.name: np.clip(
            estimate.value + step * estimate.half_width / NORMAL_COVERAGE, estimate.low, estimate.high
        )
        for estimate, step in zip(determined, steps.T, strict=True)
    }
    for estimate in estimates:
        if not estimate.determined and np.isfinite([estimate.low, estimate.high]).all():
            range_left = FitParameter(estimate.name, "", np.nan, estimate.low, estimate.high, estimate.low > 0)
            values[estimate.name] = _evenly(range_left, rng)
    rows = np.tile(inner, (MACHINES_DRAWN, 1))
    for number, parameter in enumerate(parameters):
        drawn = _of_parameter(parameter.name, values)
        drawn = _evenly(parameter, rng) if drawn is None else np.clip(drawn, parameter.low, parameter.high)
        rows[:, number] = parameter.inner(drawn)
    return rows


def _evenly(parameter: FitParameter, rng: np.random.Generator) -> np.ndarray:
    """Sample values evenly from the whole range of a parameter in the fit, shape (machines,).

    The values are in SI units, and even in the logarithm for a logarithmic parameter.
    """
    ends = parameter.inner(parameter.low), parameter.inner(parameter.high)
    return parameter.outer(rng.uniform(*ends, MACHINES_DRAWN))


def _of_parameter(name: str, values: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return a fit parameter of sampled machines, (machines,), by their keys; None without them.

    `values` has arrays by key, and `name` is the parameter.
    """
    if name in (MASS, SHARE):
        masses = [values[key] for key in ("masses.cart", "masses.stage") if key in values]
        if not masses or (name == SHARE and len(masses) < 2):
            return None
        return sum(masses[1:], masses[0]) if name == MASS else masses[0] / (masses[0] + masses[1])
    if name == RATIO:
        both = [values.get(f"friction.{key}") for key in ("static", "coulomb")]
        return None if both[0] is None or both[1] is None else both[0] / both[1]
    return values.get(name)
