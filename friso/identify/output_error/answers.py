"""From fitted numbers to keys of the stage file, with their intervals or what is left possible."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from friso.identify.estimate import Estimate
from friso.identify.output_error.coverage import Coverage
from friso.identify.output_error.fit import OutputErrorFit
from friso.identify.output_error.parameters import MASS, RATIO, SHARE, keys_of
from friso.identify.output_error.profile import Profile
from friso.identify.output_error.shown import reason
from friso.intervals import COVERAGE

METHOD = "output error"


def estimates_of(
    found: OutputErrorFit, profiles: Mapping[str, Profile], shown: set[str], covered: Coverage
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The keys of the stage file with their intervals, and the correlation of those shown."""
    parameters = found.problem.parameters
    spread = np.zeros((len(parameters), len(parameters)))
    spread[np.ix_(found.free, found.free)] = np.where(np.isfinite(found.covariance), _no_narrower(found, profiles), 0.0)
    keys, slopes = _slopes(found)
    covariance = slopes @ spread @ slopes.T
    deviation = np.sqrt(np.diag(covariance))
    values = _keys_at(found, found.inner)
    unknown = _reasons(found, profiles, shown, covered)
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
    known = [i for i, estimate in enumerate(estimates) if estimate.shown and estimate.half_width > 0]
    part = covariance[np.ix_(known, known)] / np.outer(deviation[known], deviation[known])
    return tuple(estimates), (part + part.T) / 2


_OWNERS = {"friction.static": RATIO, "masses.cart": MASS, "masses.stage": MASS}
"""The parameter behind a key that has another name."""


def _reasons(
    found: OutputErrorFit, profiles: Mapping[str, Profile], shown: set[str], covered: Coverage
) -> dict[str, str]:
    """Why parameters, or keys that hang on them, are not shown."""
    parameters = {each.name: each for each in found.problem.parameters}
    unknown = {name: reason(name, covered) for name, each in parameters.items() if name not in shown and not each.core}
    for name, parameter in parameters.items():
        if parameter.core and (profiles[name].open_low or profiles[name].open_high):
            unknown[name] = "the log does not bound it"
    if SHARE in unknown:
        why = f"the log shows the sum of both masses, {found.value(MASS):.4g} kg, not how it is split"
        unknown |= {"masses.cart": why, "masses.stage": why}
    if "friction.coulomb" in parameters and not any(name.startswith("bias.") for name in parameters):
        total = f"{found.value('friction.coulomb'):.4g} N"
        why = f"the log moves in one direction only: its sum with a constant force is {total}"
        unknown |= {"friction.coulomb": why, "friction.static": why}
    return unknown


def _no_narrower(found: OutputErrorFit, profiles: Mapping[str, Profile]) -> np.ndarray:
    """The covariance of the fitted numbers with spreads that reach as far as the profiles do."""
    spread = np.sqrt(np.diag(found.covariance))
    factors = np.ones(len(found.free))
    for i, number in enumerate(found.free):
        parameter = found.problem.parameters[number]
        seen = profiles[parameter.name]
        half = float(parameter.inner(seen.high) - parameter.inner(seen.low)) / 2
        if spread[i] > 0 and not (seen.open_low or seen.open_high):
            factors[i] = max(1.0, half / (COVERAGE * spread[i]))
    return found.covariance * np.outer(factors, factors)


def _keys_at(found: OutputErrorFit, inner: np.ndarray) -> dict[str, float]:
    values = {
        parameter.name: parameter.outer(number)
        for parameter, number in zip(found.problem.parameters, inner, strict=True)
    }
    return {key: float(value) for key, value in keys_of(found.problem.flat, values).items()}


def _slopes(found: OutputErrorFit) -> tuple[list[str], np.ndarray]:
    """The keys of the stage file, and their derivatives to the fitted numbers, shape (keys, parameters)."""
    at = _keys_at(found, found.inner)
    step = 1e-6
    moved = [_keys_at(found, found.inner + step * row) for row in np.eye(len(found.inner))]
    return list(at), np.array([[(each[key] - at[key]) / step for each in moved] for key in at])


def _range(owner: str, profiles: Mapping[str, Profile], values: Mapping[str, float]) -> tuple[float, float]:
    """What is left possible of a key that is not shown."""
    low, high = profiles[owner].low, profiles[owner].high
    scale = values["friction.coulomb"] if owner == RATIO else 1.0
    return low * scale, high * scale
