"""Judge the linear loops of many machines: which are stable, and with which margin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.frequency.loops import Poles
from friso.frequency.margins import about_resonances, for_poles
from friso.frequency.system import limit_cases
from friso.stage import Stage
from friso.stage.controllers import controller_of

FREQUENCIES_PER_DECADE, SLOWEST_FACTOR, FASTEST_FACTOR = 25, 0.1, 10.0
"""Frequencies at which loops are evaluated: per decade, apart from those near resonances; the lowest, over the slowest
pole; the highest, over the fastest pole, or half the sampling frequency."""

REFINEMENT_ROUNDS, REFINED_FREQUENCIES = 2, 9
"""Refinements of the frequency at which a loop comes closest to -1, and number of frequencies in each."""


def linear_flat(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys from which the linear loops of machines are computed, with SI values.

    `flat` has the machines' keys. The drive's loop for the motor current has the bandwidth of the `stage` on all
    machines. The ratio of true to assumed motor constant becomes a factor of the controller's gains. The cable is left
    out.
    """
    current_loop = {key: value for key, value in stage.flat().items() if key == "drive.current_bandwidth"}
    ratio, controller = flat.get("drive.motor_constant_ratio", 1.0), controller_of(flat)
    return {**flat, **{key: ratio * flat[key] for key in map(controller.key, controller.loop_gain)}, **current_loop}


@dataclass(frozen=True)
class LoopRobustness:
    """Stability and margin of the linear loop of each machine, arrays of shape (count,).

    `stable` is true if the loop is stable in all limit cases of the joint and the friction. `margin` is the least
    modulus margin among the cases, 0 if it is not stable.
    """

    stable: np.ndarray
    margin: np.ndarray


def linear_loops(stage: Stage, flat: Mapping[str, Any], count: int) -> LoopRobustness:
    """Return stability and margin of machines' linear loops, in the limit cases of a stage.

    `flat` has the machines' keys, such as "masses.cart", with SI numbers or arrays (count,).
    """
    stable, margin = np.ones(count, bool), np.full(count, np.inf)
    for limit_case in limit_cases(stage.flat()).values():
        for which, (settles, distance) in for_poles(flat, limit_case.repeated(count), _robustness):
            stable[which] &= settles
            margin[which] = np.minimum(margin[which], distance)
    return LoopRobustness(stable, np.where(stable, margin, 0.0))


def _robustness(loops: Poles) -> tuple[np.ndarray, np.ndarray]:
    """Return which loops are stable, and the least distance of each from -1, both (loops,)."""
    size, rows = np.abs(loops.continuous), np.arange(len(loops.closed))
    low = SLOWEST_FACTOR * float(np.median(size.min(axis=1)))
    high = min(loops.drive.highest, FASTEST_FACTOR * float(size.max()))
    even = np.geomspace(low, high, int(FREQUENCIES_PER_DECADE * np.log10(high / low)) + 2)
    resonant = np.nan_to_num(about_resonances(loops), nan=high)
    omega = np.sort(np.concatenate([np.broadcast_to(even, (len(rows), len(even))), resonant], axis=1), axis=1)
    distance = loops.distance(omega)
    for _ in range(REFINEMENT_ROUNDS):
        closest = distance.argmin(axis=1)
        before, after = (omega[rows, np.clip(closest + step, 0, omega.shape[1] - 1)] for step in (-1, 1))
        omega = np.linspace(before, after, REFINED_FREQUENCIES, axis=1)
        distance = loops.distance(omega)
    return loops.abscissa < 0, distance.min(axis=1)
