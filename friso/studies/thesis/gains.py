"""The last step of the thesis's design method: the gains of its rules for a mass."""

from __future__ import annotations

import numpy as np

from friso.equations.controllers.van_dijk import ALPHA, BETA, CROSSOVER
from friso.studies.thesis.studies import thesis_rig


def rig_crossover() -> float:
    """Crossover of the rig [Hz]."""
    return float(thesis_rig().flat()[CROSSOVER])


def rig_gains(mass: float) -> tuple[float, float, float]:
    """k_p [N/m], k_i [N/(m s)] and k_d [N s/m] of Eq. 6 by Eq. 7 and 8 for a mass [kg], at the crossover, alpha and
    beta of the rig, without the filter."""
    flat = thesis_rig().flat()
    omega, lead = 2 * np.pi * flat[CROSSOVER], np.sqrt(1 / flat[ALPHA])
    proportional, tau_z = mass * omega**2 / lead, lead / omega
    tau_i = flat[BETA] * tau_z
    return float(proportional * (1 + tau_z / tau_i)), float(proportional / tau_i), float(proportional * tau_z)
