"""Estimate the joint's stiffness in slow motion: while the cart sticks, the creeping stage loads the joint."""

from __future__ import annotations

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.readings.common import Mean, by_t, solve_normal_equations
from friso.identification.readings.settings import settings

KEY, UNIT = "joint.stiffness", "N/m"
METHOD = "force over deflection while the cart sticks"
SOFT = "more deflection does not need more force"


def stiffness_of_loading(
    deflection: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, force: np.ndarray, loads: list[slice]
) -> Estimate:
    """Estimate the stiffness [N/m] of a joint that is loaded between slips of the cart.

    The deflection [m] and its rate [m/s], the acceleration of the stage [m/s^2] and the actuator's force [N] are
    low-passed, shape (n,). `loads` are the samples between slips, in which the cart sticks and the joint is loaded.

    Least squares fits a spring, a damper and a mass, with an offset for each load: after a slip the stage swings on its
    joint. The error is by the jackknife over loads. Creep of the cart does not matter. With fewer than three loads the
    stiffness is unknown.
    """
    count = len(loads)
    if count < settings.fewest_loads:
        return Estimate.unknown(KEY, UNIT, METHOD, f"{count} loads between slips: {settings.fewest_loads} are needed")
    signals = [np.stack([x[s] - x[s].mean() for x in (deflection, rate, acceleration, force)]) for s in loads]
    products = np.array([x @ x.T for x in signals])
    if not products[:, 0, 0].sum() > 0:
        return Estimate.unknown(KEY, UNIT, METHOD, "the deflection stays the same")
    without = np.array([_spring(products.sum(axis=0) - product) for product in products])
    error = float(np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)))
    value = _spring(products.sum(axis=0))
    linear = settings.linearity_of_sensors * abs(value)
    return by_t(KEY, UNIT, Mean(value, error, count - 1), METHOD, linear, linear).if_positive(SOFT)


def _spring(products: np.ndarray) -> float:
    """Fit the last of several signals by all others, and return the coefficient of the first.

    `products`, shape (signals, signals), are the scalar products of the signals.
    """
    return float(solve_normal_equations(products[:-1, :-1], products[:-1, -1])[0])
