"""A load that moves on a compliant coupling behind the measured body: how far it moves the fit of a rigid mass."""

from __future__ import annotations

import numpy as np

from friso.identification.inverse_model import motion
from friso.identification.output_error.changes import SMALL, effect_of, explained_by, reaching_over
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.parameters import MASS

CUTOFF = 2.0
"""Cut-off frequency of the motion, in units of its bandwidth: well below that of the coupling, whose own swinging no
derivative of the motion describes. Of 3 kg with a third behind 40 Hz, the mass that is 1.3 % too large becomes right at
2 and 3, and no more than half of it is seen at 5."""

WORTH_TELLING = 0.003
"""Share of the mass by which a load has to move it to be named."""


def with_compliance(
    fit: OutputErrorFit, position: np.ndarray, sample_time: float, bandwidth: float
) -> tuple[OutputErrorFit, float]:
    """The fit to a position [m], shape (n,), of this `bandwidth` [Hz] with deviations that reach as far as a load on a
    coupling would move it, and that as a share of the mass; 0 where none is clearly seen.

    A load m on a coupling of natural frequency w seems to weigh m / (1 - s^2 / w^2) where it swings in vibrations that
    go as exp(s t): well below w, the coupling adds a force of m / w^2 times the second derivative of the acceleration.
    """
    acceleration = motion(position, sample_time, CUTOFF * bandwidth).acceleration
    force = np.gradient(np.gradient(acceleration, sample_time), sample_time)
    size = float(np.std(force))
    names = [fit.problem.parameters[number].name for number in fit.free]
    if MASS not in names or not size > 0:
        return fit, 0.0
    rest, slopes = fit.linearised()
    unit = SMALL * fit.value(MASS) * float(np.std(acceleration)) / size
    explained = explained_by(slopes, rest, [effect_of(unit * force, fit, rest)], fit.problem.counted)
    if explained is None or not explained[1] > 0:
        return fit, 0.0
    moved = np.abs(explained[0])
    return reaching_over(fit, moved), float(moved[names.index(MASS)])
