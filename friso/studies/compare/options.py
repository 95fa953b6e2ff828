"""The ways to settle a machine: settings of its controller, a joint, or both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, sped_up
from friso.equations.conditions import anywhere, level_under_conditions
from friso.equations.settings import SETTINGS, Setting
from friso.errors import InputError
from friso.frequency.crossover import WANTED, limits
from friso.frequency.margins import margins
from friso.frequency.members import limit_cases
from friso.stage import Stage
from friso.stage.controllers import controller_of
from friso.studies.compare.disturbance_rejection import rejecting
from friso.studies.compare.machines import Machines

DEADBAND = 0.5
"""Deadband of the integrator, in tolerances for being in position: our choice. It rests while the stage is in position,
and the edge of the band is not that of the tolerance."""

MODEL_ERROR = 0.2
"""Share by which the friction in the feedforward is off, Coulomb and viscous of a machine in the same direction."""

PER_PERIOD = 10
"""Samples that a period of the crossover has at least, as the stage file demands."""

NAMES = {
    "a": "as is",
    "b": "faster",
    "c": "isolator",
    "d": "deadband",
    "e": "reset",
    "f": "feedforward",
    "g": "isolator, faster",
    **{setting.letter: setting.name for setting in SETTINGS.values()},
    "n": "disturbance rejection",
}

JOINT: tuple[str, ...] = ("c", "g")
"""The options for which a joint has to be bought."""


@dataclass(frozen=True)
class Option:
    """One way: its `letter`, the stage that has it, what it changes of the keys (numbers, or arrays of one for each
    machine), by which `factor` its controller is faster, and which `setting` against friction it is, if any."""

    letter: str
    stage: Stage
    changes: Mapping[str, Any] = field(default_factory=dict)
    factor: float = 1.0
    setting: Setting | None = None

    @property
    def name(self) -> str:
        return NAMES[self.letter]

    @property
    def loop(self) -> str:
        """The option whose linear loop it has: rests of the integrator and feedforward are no part of that."""
        return self.letter if self.letter in "abcgn" else "a"


@dataclass(frozen=True)
class CompareOptions:
    """Those that the stage can have; why others, by letter, are left out; and the deadband of the integrator [m]."""

    options: tuple[Option, ...]
    left_out: Mapping[str, str]
    deadband: float


def linear_flat(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Keys for the linear loop: the current loop is that of the stage for all machines, and the motor's constant over
    the one believed is part of the controller's gains. The cable is left out."""
    current_loop = {key: value for key, value in stage.flat().items() if key == "drive.current_bandwidth"}
    ratio, controller = flat.get("drive.motor_constant_ratio", 1.0), controller_of(flat)
    return {
        **flat,
        **{key: ratio * flat[key] for key in map(controller.key, controller.loop_gain)},
        **current_loop,
    }


def options(
    machines: Machines, within: float, also: tuple[Setting, ...] = (), with_adrc: bool = False
) -> CompareOptions:
    """The options of machines that are to be in position `within` a tolerance [m], some settings `also`, and active
    disturbance rejection if that is asked for."""
    stage = machines.stage
    variants = stage.variants()
    locked, free = variants.get("locked", stage), variants.get("free")
    left_out: dict[str, str] = (
        {} if free else dict.fromkeys(JOINT, "the stage file has no joint with stiffness, damping and stroke")
    )
    deadband = DEADBAND * within
    listed = [Option("a", locked), *_faster("b", locked, left_out)]
    if free:
        listed.append(Option("c", free))
    if _integrates(stage):
        waiting = locked.with_numbers({"drive.integrator_deadband": deadband})
        listed += [Option("d", waiting), Option("e", locked.replace({"drive.integrator_reset": True}))]
    else:
        left_out |= dict.fromkeys("de", "the controller does not integrate")
    ahead = _feedforward(machines)
    if any(np.any(force) for force in ahead.values()):
        listed.append(Option("f", locked, ahead))
    else:
        left_out["f"] = "the stage file has neither Coulomb nor viscous friction"
    if free:
        listed += _faster("g", free, left_out)
    for setting in also:
        if setting.integral and not _integrates(stage):
            left_out[setting.letter] = "the controller does not integrate"
        else:
            numbers = setting.numbers(locked.flat(), within)
            listed.append(Option(setting.letter, locked.with_numbers(numbers), setting=setting))
    if with_adrc:
        flat = locked.flat()
        crossings = margins(linear_flat(locked, flat), limit_cases(flat)["sliding"]).crossovers
        try:
            listed.append(Option("n", rejecting(locked, crossings)))
        except InputError as error:
            left_out["n"] = str(error)
    return CompareOptions(tuple(listed), dict(sorted(left_out.items())), deadband)


def _faster(letter: str, stage: Stage, left_out: dict[str, str]) -> list[Option]:
    """The stage with the highest bandwidth at which the machine of the file keeps its margin: an engineer tunes one
    machine, and all others get its settings. Nothing, and why not, where it is that fast already."""
    flat = stage.flat()
    highest = limits(linear_flat(stage, flat)).highest_comfortable
    tuned = bandwidth(flat)
    present = 1.0 if tuned is None else tuned
    if tuned is not None and highest is not None:
        highest = min(highest, 1 / (PER_PERIOD * flat["drive.sample_time"]))
    if highest is None or highest <= present:
        left_out[letter] = f"no higher bandwidth keeps a modulus margin of {WANTED:g}"
        return []
    factor = float(highest / present)
    changes = {key: value for key, value in sped_up(flat, factor).items() if value != flat[key]}
    return [Option(letter, stage.with_numbers(changes), factor=factor)]


def _integrates(stage: Stage) -> bool:
    """Whether there is an integrator that could rest."""
    flat = stage.flat()
    return controller_of(flat).integrates(flat)


def _feedforward(machines: Machines) -> dict[str, np.ndarray]:
    """Feedforward of Coulomb and viscous friction of each machine, both wrong by the model error."""
    flat = anywhere(machines.flat(machines.stage, {}))
    coulomb = level_under_conditions(flat, "coulomb") if "friction.coulomb" in flat else 0.0
    off = 1 + MODEL_ERROR * machines.signs
    return {
        "drive.feedforward_coulomb": off * coulomb,
        "drive.feedforward_viscous": off * flat.get("friction.viscous", 0.0),
    }
