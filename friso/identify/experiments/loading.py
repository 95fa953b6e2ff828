"""Stiffness of the joint in slow motion: while the cart sticks, a stage that creeps on loads the joint."""

from __future__ import annotations

import numpy as np

from friso.identify.estimate import Estimate
from friso.identify.experiments.common import LINEARITY, Mean, by_t

KEY, UNIT = "joint.stiffness", "N/m"
METHOD = "force over deflection while the cart sticks"
LEAST = 3
SOFT = "more deflection does not need more force"


def stiffness_of_loading(deflection: np.ndarray, force: np.ndarray, rate: np.ndarray, loads: list[slice]) -> Estimate:
    """The stiffness [N/m] from low-passed deflection [m], force on the joint [N] and rate of the deflection [m/s],
    shape (n,), over the `loads`, each between two slips.

    Least squares of a spring and a damper, with an offset for each load; the error is that of the jackknife over loads.
    What is common to all loads drops out, as does the cart's creep. Of fewer than three loads it is unknown.
    """
    count = len(loads)
    if count < LEAST:
        return Estimate.unknown(KEY, UNIT, METHOD, f"{count} loads between slips: {LEAST} are needed")
    signals = [np.stack([x[s] - x[s].mean() for x in (deflection, rate, force)]) for s in loads]
    products = np.array([x @ x.T for x in signals])
    if not products[:, 0, 0].sum() > 0:
        return Estimate.unknown(KEY, UNIT, METHOD, "the deflection stays the same")
    without = np.array([_spring(products.sum(axis=0) - each) for each in products])
    error = float(np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)))
    value = _spring(products.sum(axis=0))
    found = by_t(KEY, UNIT, Mean(value, error, count - 1), METHOD, LINEARITY * abs(value), LINEARITY * abs(value))
    return found if found.low > 0 else Estimate.unknown(KEY, UNIT, METHOD, SOFT, 0.0, max(found.high, 0.0) or np.inf)


def _spring(products: np.ndarray) -> float:
    """Coefficient of the first of three signals in a fit of the third by the first two, from their scalar products."""
    return float(np.linalg.lstsq(products[:2, :2], products[:2, 2], rcond=None)[0][0])
