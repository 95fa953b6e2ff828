"""Sample machines at random from what a record leaves open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.output_error.parameters import MASS, RATIO, SHARE, FitParameter
from friso.identification.output_error.settings import settings
from friso.intervals import COVERAGE


def drawn_from(
    estimates: Sequence[Estimate], correlation: np.ndarray, parameters: Sequence[FitParameter], inner: np.ndarray
) -> np.ndarray:
    """Sample machines at random from what a record leaves open, as rows of fitted numbers.

    A fitted number is a parameter's value or its logarithm. The result has the shape (machines, parameters). `inner`,
    shape (parameters,), has the numbers of the fit. Quantities with a value are sampled by their intervals and
    `correlation`. Quantities with a range only are uniform in it, or in its logarithm; a parameter without an estimate
    is sampled from its whole range of the fit.
    """
    rng = np.random.default_rng(settings.seed_of_draws)
    determined = [estimate for estimate in estimates if estimate.determined]
    sizes, ways = np.linalg.eigh(correlation)
    steps = (
        rng.standard_normal((settings.machines_drawn, len(determined))) @ (ways * np.sqrt(np.clip(sizes, 0.0, None))).T
    )
    values = {
        estimate.name: np.clip(estimate.value + step * estimate.half_width / COVERAGE, estimate.low, estimate.high)
        for estimate, step in zip(determined, steps.T, strict=True)
    }
    for estimate in estimates:
        if not estimate.determined and np.isfinite([estimate.low, estimate.high]).all():
            range_left = FitParameter(estimate.name, "", np.nan, estimate.low, estimate.high, estimate.low > 0)
            values[estimate.name] = _evenly(range_left, rng)
    rows = np.tile(inner, (settings.machines_drawn, 1))
    for number, parameter in enumerate(parameters):
        drawn = _of_parameter(parameter.name, values)
        drawn = _evenly(parameter, rng) if drawn is None else np.clip(drawn, parameter.low, parameter.high)
        rows[:, number] = parameter.inner(drawn)
    return rows


def _evenly(parameter: FitParameter, rng: np.random.Generator) -> np.ndarray:
    """Sample values evenly from the whole range of a parameter in the fit, shape (machines,).

    The values are in SI units, and even in the logarithm for a logarithmic parameter.
    """
    return parameter.outer(
        rng.uniform(parameter.inner(parameter.low), parameter.inner(parameter.high), settings.machines_drawn)
    )


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
