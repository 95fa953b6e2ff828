"""Choose a design's controller, and whether more joint damping would help.

The loop has all modes of the leaf springs that actuator and sensor both see; the equations of motion contain only one
of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design_method.population import Population
from friso.design_method.settings import settings
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.controllers.van_dijk import ALPHA, BETA, CROSSOVER, TUNED_MASS
from friso.frequency.bode import COMFORTABLE_MARGIN, Range, ranges_below, searched_crossovers, settled_members, shared
from friso.frequency.margins import (
    Tuning,
    controller_response,
    distance_to_lines,
    frequency_grid,
    plants,
    stability_by_poles,
    tuning,
)
from friso.frequency.settings import settings as frequency_settings
from friso.frequency.system import DriveTiming, Members
from friso.leaf_springs.mechanism import Evaluation
from friso.stage import Stage

AROUND_A_MODE = np.sinh(np.linspace(-7.0, 7.0, 71))
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
        ratio = (1 + loop) / (1 + bare)
        turns = np.angle(ratio[..., 1:] / ratio[..., :-1]).sum(axis=-1) / (2 * np.pi)  # around 0 in the complex plane
        stable = np.abs(turns) < 0.5
        return float(distance_to_lines(loop).min()) if stable.all() else 0.0

    @property
    def comfortable(self) -> tuple[Range, ...]:
        """Return the crossovers [Hz] with a modulus margin of at least 0.5."""
        return ranges_below(
            np.geomspace(*searched_crossovers(self.flat), frequency_settings.crossover_steps),
            lambda at: COMFORTABLE_MARGIN - self.margin(at),
        )


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
        frequency_grid(faster(flat, np.array(end / bandwidth(flat))), frequency_settings.search_density)
        for end in searched_crossovers(flat)
    ]
    zeta = float(leaves.mechanism.damping_ratio)
    about = [2 * np.pi * mode.frequency * (1 + zeta * AROUND_A_MODE) for mode in leaves.modes[1:]]
    frequencies = np.unique(np.concatenate([*ends, *about]))
    return frequencies[(frequencies > 0) & (frequencies < drive.highest)]


DAMPING_RATIOS = np.geomspace(0.02, 0.7, 9)
"""Joint dampings that are tried, as damping ratios of the stage on the joint."""


@dataclass(frozen=True)
class Damping:
    """Joint dampings that were tried [N s/m], and each one's least modulus margin.

    The margin is 0 for an unstable loop. The stage's own damping comes first.
    """

    tried: np.ndarray
    margins: np.ndarray

    @property
    def worth(self) -> int:
        """Return the index of the smallest damping that gives nearly all of the possible margin.

        Index 0 is the stage's own damping.
        """
        return int(np.flatnonzero(self.margins >= settings.enough_margin * self.margins.max())[0])


@dataclass(frozen=True)
class DesignedController:
    """Gains by van Dijk's rules at the chosen `crossover` [Hz].

    `margin` is the least modulus margin as designed, over the limit cases and all states stuck under a bias force.
    `corners` has the least margin at each corner of friction and masses, shape (n,). `damping` shows what more damping
    of the joint would add.
    """

    crossover: float
    gains: Tuning
    margin: float
    corners: np.ndarray
    damping: Damping


def comfortable_below(ranges: Sequence[Range], highest: float) -> float | None:
    """Return the highest crossover [Hz] in the `ranges` up to `highest`; None if all lie above."""
    below = [min(high, highest) for low, high in ranges if low < highest]
    return max(below) if below else None


def comfortable(stage: Stage, leaves: Evaluation, population: Population) -> tuple[Range, ...]:
    """Return the ranges of crossovers [Hz] in which the least modulus margin is at least 0.5.

    The margin counts in the limit cases and all states stuck under a bias force, for the stage's own masses and all
    masses in the population.
    """
    flat = stage.flat()
    ranges = Modal.of(flat, leaves).comfortable
    masses = {
        tuple((key, value) for key, value in population.of(k).items() if key.startswith("masses."))
        for k in range(population.count)
    }
    for group in sorted(masses):
        if group:
            ranges = shared(ranges, Modal.of({**flat, **dict(group)}, leaves).comfortable)
    return ranges


def choose_controller(stage: Stage, leaves: Evaluation, population: Population) -> DesignedController:
    """Return the gains and margins of a stage with leaf springs, at its chosen crossover."""
    flat = stage.flat()
    gains = tuning(*(flat[key] for key in (CROSSOVER, ALPHA, BETA, TUNED_MASS)))
    corners = np.array([_margin({**flat, **population.of(k)}, leaves) for k in range(population.count)])
    tried = dampings(flat)
    damping = Damping(tried, np.array([_margin({**flat, "joint.damping": trial}, leaves) for trial in tried]))
    return DesignedController(flat[CROSSOVER], gains, _margin(flat, leaves), corners, damping)


def _margin(flat: Mapping[str, Any], leaves: Evaluation) -> float:
    return float(Modal.of(flat, leaves).margin(flat[CROSSOVER])[0])


def dampings(flat: Mapping[str, Any]) -> np.ndarray:
    """Return the joint dampings to try [N s/m]: the stage's own, then larger ones, ascending."""
    tried = DAMPING_RATIOS * 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])
    return np.append(flat["joint.damping"], tried[tried > flat["joint.damping"]])
