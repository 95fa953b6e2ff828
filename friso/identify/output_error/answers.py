"""From fitted numbers to keys of the stage file, with their intervals or what is left possible."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from friso.identify.estimate import Estimate
from friso.identify.output_error.coverage import Coverage
from friso.identify.output_error.fit import OutputErrorFit
from friso.identify.output_error.identifiable import reason
from friso.identify.output_error.parameters import MASS, RATIO, SHARE, keys_of
from friso.identify.output_error.profile import Profile
from friso.intervals import COVERAGE

METHOD = "output error"


def estimates_of(
    fit: OutputErrorFit, profiles: Mapping[str, Profile], identifiable: set[str], covered: Coverage
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The keys of the stage file with their intervals, and the correlation of those shown."""
    parameters = fit.problem.parameters
    spread = np.zeros((len(parameters), len(parameters)))
    spread[np.ix_(fit.free, fit.free)] = np.where(np.isfinite(fit.covariance), _no_narrower(fit, profiles), 0.0)
    keys, slopes = _slopes(fit)
    covariance = slopes @ spread @ slopes.T
    deviation = np.sqrt(np.diag(covariance))
    values = _keys_at(fit, fit.inner)
    unknown = _reasons(fit, profiles, identifiable, covered)
    estimates = []
    for i, key in enumerate(keys):
        owner = _OWNERS.get(key, key)
        unit = next((parameter.unit for parameter in parameters if parameter.name in (key, owner)), "")
        unit = "N" if key == "friction.static" else unit
        if key in unknown or owner in unknown:
            low, high = (-np.inf, np.inf) if key in unknown and owner != key else _range(owner, profiles, values)
            estimates.append(Estimate.unknown(key, unit, METHOD, unknown.get(key) or unknown[owner], low, high))
        else:
            estimates.append(Estimate.normal(key, unit, values[key], deviation[i], METHOD))
    certain = [i for i, estimate in enumerate(estimates) if estimate.determined and estimate.half_width > 0]
    part = covariance[np.ix_(certain, certain)] / np.outer(deviation[certain], deviation[certain])
    return tuple(estimates), (part + part.T) / 2


_OWNERS = {"friction.static": RATIO, "masses.cart": MASS, "masses.stage": MASS}
"""The parameter behind a key that has another name."""


def _reasons(
    fit: OutputErrorFit, profiles: Mapping[str, Profile], identifiable: set[str], covered: Coverage
) -> dict[str, str]:
    """Why parameters, or keys that hang on them, are not shown."""
    parameters = {parameter.name: parameter for parameter in fit.problem.parameters}
    unknown = {
        name: reason(name, covered)
        for name, parameter in parameters.items()
        if name not in identifiable and not parameter.core
    }
    for name, parameter in parameters.items():
        if parameter.core and (profiles[name].open_low or profiles[name].open_high):
            unknown[name] = "the log does not bound it"
    if SHARE in unknown:
        why = f"the log shows the sum of both masses, {fit.value(MASS):.4g} kg, not how it is split"
        unknown |= {"masses.cart": why, "masses.stage": why}
    if "friction.coulomb" in parameters and not any(name.startswith("bias.") for name in parameters):
        total = f"{fit.value('friction.coulomb'):.4g} N"
        why = f"the log moves in one direction only: its sum with a constant force is {total}"
        unknown |= {"friction.coulomb": why, "friction.static": why}
    return unknown


def _no_narrower(fit: OutputErrorFit, profiles: Mapping[str, Profile]) -> np.ndarray:
    """The covariance of the fitted numbers with spreads that reach as far as the profiles do."""
    spread = np.sqrt(np.diag(fit.covariance))
    factors = np.ones(len(fit.free))
    for i, number in enumerate(fit.free):
        parameter = fit.problem.parameters[number]
        interval = profiles[parameter.name]
        half = float(parameter.inner(interval.high) - parameter.inner(interval.low)) / 2
        if spread[i] > 0 and not (interval.open_low or interval.open_high):
            factors[i] = max(1.0, half / (COVERAGE * spread[i]))
    return fit.covariance * np.outer(factors, factors)


def _keys_at(fit: OutputErrorFit, inner: np.ndarray) -> dict[str, float]:
    values = {
        parameter.name: parameter.outer(number) for parameter, number in zip(fit.problem.parameters, inner, strict=True)
    }
    return {key: float(value) for key, value in keys_of(fit.problem.flat, values).items()}


def _slopes(fit: OutputErrorFit) -> tuple[list[str], np.ndarray]:
    """The keys of the stage file, and their derivatives to the fitted numbers, shape (keys, parameters)."""
    at = _keys_at(fit, fit.inner)
    step = 1e-6
    moved = [_keys_at(fit, fit.inner + step * row) for row in np.eye(len(fit.inner))]
    return list(at), np.array([[(keys[key] - at[key]) / step for keys in moved] for key in at])


def _range(owner: str, profiles: Mapping[str, Profile], values: Mapping[str, float]) -> tuple[float, float]:
    """What is left possible of a key that is not shown."""
    low, high = profiles[owner].low, profiles[owner].high
    scale = values["friction.coulomb"] if owner == RATIO else 1.0
    return low * scale, high * scale
