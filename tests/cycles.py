"""Turning points of a run, its derivative by where it begins, and the return map of a hunting cycle."""

import numpy as np
from variants import gains, limit, lugre, release, stage

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting import Ensemble
from friso.stage import Stage


def turning_points(stage: Stage, rtol: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values [m] of all extrema of position minus reference."""
    flat = stage.flat()
    (runs,) = run_chunks(kernel(structure(flat)), flat, 1, RunOptions(rtol=rtol))
    assert runs.results.statuses[0] == Status.DONE
    count = int(runs.results.turn_counts[0])
    return runs.results.turn_times[0, :count], runs.results.turn_values[0, :count]


def swings(stage: Stage, rtol: float) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and height [m] of the farthest point of every swing to one side.

    Stopping, a mass rings on its bristles: most turning points are of that ringing, and not of the cycle.
    """
    times, values = turning_points(stage, rtol)
    starts = np.flatnonzero(np.diff(np.sign(values), prepend=0))
    parts = zip(np.split(times, starts[1:]), np.split(np.abs(values), starts[1:]), strict=True)
    farthest = [(t[np.argmax(v)], np.max(v)) for t, v in parts]
    return np.array([t for t, _ in farthest]), np.array([v for _, v in farthest])


def flow(stages: Ensemble, start: np.ndarray, time: float, rtol: float = 1e-11) -> np.ndarray:
    """Derivative of the state after a time [s] by the state at the start, all in units of the states' magnitudes."""
    size, scales = start.size, stages.scales[0]
    starts, several = np.hstack([np.tile(start, (size, 1)), np.eye(size)]), stages.take(np.zeros(size, np.int64))
    results = several.run(starts, np.full(size, time), rtol, variational=True)
    assert (results.statuses == Status.DONE).all()
    return results.ends[:, size:].T * scales / scales[:, None]


def flow_by_differences(stages: Ensemble, start: np.ndarray, time: float, step: float) -> np.ndarray:
    """The same by finite differences of simulated runs."""
    weights = {2: -1 / 12, 1: 8 / 12, -1: -8 / 12, -2: 1 / 12}
    size, scales = start.size, stages.scales[0]
    starts = np.concatenate([start + k * step * np.diag(scales) for k in weights])
    several = stages.take(np.zeros(len(starts), np.int64))
    results = several.run(starts, np.full(len(starts), time), 1e-12)
    assert (results.statuses == Status.DONE).all()
    ends = results.ends.reshape(len(weights), size, size)
    return np.tensordot(list(weights.values()), ends, 1).T / step / scales[:, None]


def return_map(heights: np.ndarray, near: float = 0.03) -> tuple[float, float]:
    """Fixed point [m] and slope of the map from one swing to the next, from a straight line through those near it."""
    guess = np.median(heights[-10:])
    at = np.abs(heights / guess - 1)
    use = (at[:-1] < near) & (at[:-1] > 1e-4) & (at[1:] < near)
    assert np.count_nonzero(use) >= 5
    slope, offset = np.polyfit(heights[:-1][use], heights[1:][use], 1)
    return float(offset / (1 - slope)), float(slope)


def by_gains(crossover: float, force_limit: str) -> Stage:
    """The rigid mass of 1.7 kg, its tuned controller (alpha 0.1, beta 2) written as gains, with a force limit.

    k_p ((1 + tau_z/tau_i) + 1/(tau_i s) + tau_z s)/(tau_p s + 1) = kp + ki/s + kd s/(tau s + 1).
    """
    omega, root, beta = 2 * np.pi * crossover, np.sqrt(1 / 0.1), 2
    tau_z, tau_p, k_p = root / omega, 1 / (omega * root), 1.7 * omega**2 / root
    tau_i = beta * tau_z
    kp = k_p * (1 + tau_z / tau_i - tau_p / tau_i)
    numbers = map(float, (kp, k_p / tau_i, k_p * tau_z - kp * tau_p, tau_p))
    return stage(release(), friction=lugre(2), controller=gains(*numbers, extra=limit(force_limit)))
