"""Apply van Dijk's tuning rules (thesis, Eq. 7 and 8) to the mass they are meant for."""

from __future__ import annotations

from dataclasses import dataclass

from friso.equations.controllers.van_dijk import as_gains, numbers, tuned
from friso.errors import InputError
from friso.frequency.margins import Margins, margins
from friso.frequency.members import member
from friso.stage.arguments import check_arguments
from friso.stage.stage import numeric_keys


@dataclass(frozen=True)
class Tuning:
    """Gain k_p [N/m] and time constants tau_z, tau_i, tau_p [s] of Eq. 8, with margins.

    The margins are those of the loop on the bare mass.

    Examples
    --------
    >>> import friso
    >>> found = friso.tuning(8.0, 0.1, 2.0, 1.7)
    >>> round(found.k_p), round(found.tau_z, 4)
    (1358, 0.0629)
    """

    k_p: float
    tau_z: float
    tau_i: float
    tau_p: float
    margins: Margins

    @property
    def parallel(self) -> dict[str, float]:
        """Return the gains of Eq. 6 by name: kp [N/m], ki [N/(m s)], kd [N s/m], tau [s].

        They act on the error behind the low-pass.
        """
        return as_gains(self.k_p, self.tau_z, self.tau_i, self.tau_p)

    @property
    def true_crossover(self) -> float:
        """Return the 0 dB crossing [Hz] of the loop, slightly above the tuned crossover."""
        return self.margins.crossovers[-1]


EXAMPLE, MOST = "friso.tuning(8.0, 0.1, 2.0, 1.7)", 1e30
"""Example call, and the largest number of any of its arguments."""


@check_arguments
def tuning(crossover: float, alpha: float, beta: float, mass: float) -> Tuning:
    """Return the controller for a mass [kg] at a crossover [Hz] by van Dijk's rules.

    `alpha` and `beta` are the rules' other numbers. The result includes the margins on that mass. Raises InputError
    for numbers that no stage file may have.

    Examples
    --------
    >>> import friso
    >>> round(friso.tuning(8.0, 0.1, 2.0, 1.7).true_crossover, 2)
    8.08
    """
    arguments = {"crossover": crossover, "alpha": alpha, "beta": beta, "mass": mass}
    for name, value in arguments.items():
        if not 1 / MOST <= value <= MOST:
            raise InputError(name, f"{value:g}", f"a number from {1 / MOST:g} to {MOST:g}", EXAMPLE)
    flat = {"friction.model": "none", "masses.stage": mass, **tuned(crossover, alpha, beta, mass)}
    for key, item in numeric_keys({**flat, "motion.kind": "hold"}).items():
        if key in flat and not item.bound.holds(flat[key]):
            raise InputError(key.split(".")[1], str(flat[key]), item.bound.text, EXAMPLE)
    return Tuning(**numbers(flat), margins=margins(flat, member()))
