"""A coupling between force and position: how far what moves on it moves the fit of a rigid mass."""

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

FURTHER = 2.0
"""How many times as far as a coupling moves the fit intervals reach: that is one linear step, which recovered no more
than 60 % of 1.5 % by which the mass of a machine on a coupling was off."""

WORTH_TELLING = 0.003
"""Share of the mass by which a coupling has to move it to be named."""


def with_compliance(
    fit: OutputErrorFit, position: np.ndarray, sample_time: float, bandwidth: float
) -> tuple[OutputErrorFit, float]:
    """The fit to a position [m], shape (n,), of this `bandwidth` [Hz] with deviations that reach beyond where a
    coupling would move it, and the share of its mass that would be too much, negative where it is too little; 0 where
    no coupling is clearly seen.

    A load m behind the measured position, on a coupling of natural frequency w, seems to weigh m / (1 + s^2 / w^2) in
    motion that goes as exp(s t): well below w, its force lacks m / w^2 times the second derivative of the acceleration.
    Where the position is that of the load, the force that moves a mass M before the coupling is greater by M / w^2
    times that derivative.
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
    if explained is None:
        return fit, 0.0
    moved, (load,) = explained
    share = -float(np.expm1(moved[names.index(MASS)]))
    return reaching_over(fit, FURTHER * np.abs(moved)), share if share * load > 0 else 0.0
