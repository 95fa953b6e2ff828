"""A delay between the force of a log and the motion that it causes: how far it moves the fit of a stage held to the
log."""

from __future__ import annotations

import numpy as np

from friso.identification.output_error.changes import effect_of, explained_by, reaching_over
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.readings.common import low_pass

CUTOFF = 10.0
"""Cut-off frequency of the force, in units of the bandwidth of the motion, above which its derivative is noise."""

SMALL = 0.05
"""Samples by which the force is moved for its effect on a record: larger ones are followed in jumps."""

FURTHER = 2.0
"""How many times as far as a delay moves the fit intervals reach: that is one linear step, which recovered 40 to 50 %
(in the logarithm) of the damping of bristles that three samples more than doubled."""

LATE = 0.25
"""Samples of delay from which on it is named."""


def with_delay(
    fit: OutputErrorFit, force: np.ndarray, sample_time: float, bandwidth: float
) -> tuple[OutputErrorFit, float]:
    """The fit to a log of this `force` [N], shape (n,), sampled every `sample_time` [s], whose motion is of this
    `bandwidth` [Hz], with deviations that reach beyond where a delay would move it, and the time [s] by which the
    motion comes after the force, negative where before; 0 where no delay is clearly seen.

    A force that acts later by a short time differs from the log's by that time times its derivative. Bristles pass it
    on as damping, by their stiffness times the delay, and inertia as viscous friction.
    """
    rate = np.gradient(low_pass(force, sample_time, CUTOFF * bandwidth), sample_time)
    if fit.problem.closed or not rate.any():
        return fit, 0.0
    rest, slopes = fit.linearised()
    unit = SMALL * sample_time
    explained = explained_by(slopes, rest, [effect_of(unit * rate, fit, rest)], fit.problem.counted)
    if explained is None:
        return fit, 0.0
    moved, (delay,) = explained
    return reaching_over(fit, FURTHER * np.abs(moved)), -float(delay) * unit
