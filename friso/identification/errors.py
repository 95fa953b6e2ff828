"""Compute the error of a simulated record, and describe the residual force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.inverse_model import FilteredMotion, motion
from friso.identification.logs.log import Log
from friso.identification.output_error.problem import Simulated
from friso.identification.settings import identification_settings
from friso.identification.spread import correlation_length


@dataclass(frozen=True)
class SimulationErrors:
    """Relative errors of a simulated record: norm of the difference over norm of the measured.

    Errors are given for position, velocity, acceleration and force; one filter gives velocity and acceleration of both
    records. For a stage that follows the log's position, only the force has an error, its unexplained part; the others
    are NaN.
    """

    position: float
    velocity: float
    acceleration: float
    force: float


@dataclass(frozen=True)
class Residual:
    """Residual force of a fit [N] and its properties.

    `rms` and `mean` are in newtons, `correlation_time` [s] is the time over which it stays correlated. `by_position`
    and `by_velocity` are the fractions of the residual's power explained by its means over places along the rail, and
    over speeds.
    """

    rms: float
    mean: float
    correlation_time: float
    by_position: float
    by_velocity: float

    @property
    def white(self) -> bool:
        """Tell whether neighbouring samples are uncorrelated."""
        return self.correlation_time == 0.0


def errors_of(log: Log, part: slice, simulated: Simulated, bandwidth: float) -> SimulationErrors:
    """Compare a simulated record with the samples `part` of a log.

    `bandwidth` [Hz] is the motion's.
    """
    measured = motion(log["position"][part], log.sample_time, identification_settings.smoothing_bandwidths * bandwidth)
    modelled = motion(simulated.position, log.sample_time, identification_settings.smoothing_bandwidths * bandwidth)
    disturbance = log["disturbance"][part] if "disturbance" in log else 0.0
    return SimulationErrors(
        _relative(log["position"][part], simulated.position),
        _relative(measured.velocity, modelled.velocity),
        _relative(measured.acceleration, modelled.acceleration),
        _relative(log["force"][part], simulated.force + disturbance),
    )


def unexplained(log: Log, part: slice, held: Simulated) -> SimulationErrors:
    """Return the force that guides a stage along a log, relative to the logged force.

    `held` is the simulated record with this force, which the model leaves unexplained; `part` are the samples. The
    result stands as the error of the force; errors of the motion are NaN.
    """
    share = float(np.linalg.norm(held.force) / np.linalg.norm(log["force"][part]))
    return SimulationErrors(np.nan, np.nan, np.nan, share)


def residual_of(residual: np.ndarray, moved: FilteredMotion, sample_time: float) -> Residual:
    """Describe the residual force [N], (n,), of a fit sampled every `sample_time` [s].

    `moved` is the filtered motion of these samples.
    """
    alike = correlation_length(residual)
    return Residual(
        float(np.sqrt(np.mean(residual**2))),
        float(residual.mean()),
        0.0 if alike <= 1 else alike * sample_time,
        _explained(residual, moved.position),
        _explained(residual, moved.velocity),
    )


def _relative(measured: np.ndarray, simulated: np.ndarray) -> float:
    """Return the norm of measured minus simulated values over the norm of the measured ones."""
    return float(np.linalg.norm(measured - simulated) / np.linalg.norm(measured))


def _explained(residual: np.ndarray, along: np.ndarray) -> float:
    """Return the fraction of a residual's power that its means over bins of `along` explain.

    `along`, shape (n,), is a position or a speed. The fraction that chance explains is subtracted.
    """
    edges = np.linspace(along.min(), along.max(), identification_settings.bins_of_a_residual + 1)
    bins = np.clip(np.digitize(along, edges) - 1, 0, identification_settings.bins_of_a_residual - 1)
    count = np.bincount(bins, minlength=identification_settings.bins_of_a_residual)
    means = np.bincount(bins, residual, minlength=identification_settings.bins_of_a_residual) / np.maximum(count, 1)
    power = float(np.mean(residual**2))
    independent = len(residual) / correlation_length(residual)
    share = float(np.sum(count * means**2)) / len(residual) / power if power else 0.0
    return max(0.0, share - min(1.0, np.count_nonzero(count) / independent))
