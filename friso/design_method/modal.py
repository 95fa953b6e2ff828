"""Analyse the loop with all modes of the leaf springs that actuator and sensor both see.

The equations of motion contain only one of these modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, faster
from friso.frequency.crossover import WANTED, searched_crossovers, settled_members
from friso.frequency.drive import DriveTiming
from friso.frequency.family import controller_response, distance_to_lines, frequency_grid, plants, stability_by_poles
from friso.frequency.members import Members
from friso.frequency.ranges import Range, ranges_below
from friso.frequency.settings import settings
from friso.leaf_springs.evaluation import Evaluation

AROUND = np.sinh(np.linspace(-7.0, 7.0, 71))
"""Frequencies around a mode at which the loop is evaluated, in units of its half width."""


@dataclass(frozen=True)
class Modal:
    """A stage in its settled states, with its plants over `omega` [rad/s].

    Settled states are the limit cases, and all states stuck under a bias force. `bare` are the plants without parasitic
    mode, and `with_modes` the plants with the modes of the leaf springs. Both have shape (states, frequencies) [m/N]
    and include the drive. Modes are added to the motion of the stage as a rigid mass, because they lie far above the
    frequencies at which the cart matters.
    """

    flat: Mapping[str, Any]
    members: Members
    omega: np.ndarray
    bare: np.ndarray
    with_modes: np.ndarray

    @classmethod
    def of(cls, flat: Mapping[str, Any], leaves: Evaluation) -> Modal:
        """Build the settled states of a stage, from its keys in SI, with its leaf springs' modes."""
        rigid = {key: value for key, value in flat.items() if not key.startswith("parasitic.")}
        members, drive = settled_members(rigid), DriveTiming.of(rigid)
        omega = _frequencies(rigid, leaves, drive)
        bare = plants(rigid, members, omega) * drive.transfer(omega)
        return cls(rigid, members, omega, bare, bare + compliance(leaves, omega) * drive.transfer(omega))

    def margin(self, crossover: np.ndarray) -> np.ndarray:
        """Return the least modulus margin of all states at each crossover [Hz], shape (n,).

        The margin is 0 at a crossover at which a state is unstable.
        """
        factors = np.atleast_1d(crossover) / bandwidth(self.flat)
        keys = faster(self.flat, np.repeat(factors, len(self.members)))
        settled = stability_by_poles(keys, self.members.repeated(len(factors))).abscissa.reshape(len(factors), -1) < 0
        stable = np.asarray(settled.all(axis=1))
        return np.array([self._margin(factors[k]) if stable[k] else 0.0 for k in range(len(factors))])

    def _margin(self, factor: np.ndarray) -> float:
        """Return the least modulus margin of all states, with the bandwidth scaled by `factor`.

        The states must be stable without the modes; it is 0 if the modes make one of them unstable.
        """
        shape = controller_response(faster(self.flat, factor), self.omega)
        bare, loop = self.bare * shape, self.with_modes * shape
        stable = np.abs(_turns((1 + loop) / (1 + bare))) < 0.5
        return float(distance_to_lines(loop).min()) if stable.all() else 0.0

    @property
    def comfortable(self) -> tuple[Range, ...]:
        """Return the crossovers [Hz] with a modulus margin of at least 0.5."""
        return ranges_below(
            np.geomspace(*searched_crossovers(self.flat), settings.crossover_steps), lambda at: WANTED - self.margin(at)
        )


def _turns(ratio: np.ndarray) -> np.ndarray:
    """Return how often curves `ratio` in the complex plane, (..., frequencies), run around 0."""
    return np.angle(ratio[..., 1:] / ratio[..., :-1]).sum(axis=-1) / (2 * np.pi)


def compliance(leaves: Evaluation, omega: np.ndarray) -> np.ndarray:
    """Return what the leaf springs' modes add to the plant [m/N], shape (frequencies,).

    The first mode, the motion in the drive direction, is left out. `omega` are frequencies [rad/s].
    """
    zeta = float(leaves.mechanism.damping_ratio)
    parts = [
        mode.actuator
        * mode.sensor
        / ((2 * np.pi * mode.frequency) ** 2 - omega**2 + 2j * zeta * 2 * np.pi * mode.frequency * omega)
        for mode in leaves.modes[1:]
    ]
    return np.sum(parts, axis=0)


def _frequencies(flat: Mapping[str, Any], leaves: Evaluation, drive: DriveTiming) -> np.ndarray:
    """Return angular frequencies that show the loop at all crossovers, and every mode."""
    ends = [
        frequency_grid(faster(flat, np.array(end / bandwidth(flat))), settings.search_density)
        for end in searched_crossovers(flat)
    ]
    zeta = float(leaves.mechanism.damping_ratio)
    about = [2 * np.pi * mode.frequency * (1 + zeta * AROUND) for mode in leaves.modes[1:]]
    frequencies = np.unique(np.concatenate([*ends, *about]))
    return frequencies[(frequencies > 0) & (frequencies < drive.highest)]
