"""Define the options for bringing a machine to rest: controller settings, a joint, or both.

One of them replaces the machine's controller by active disturbance rejection.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np

from friso.equations.bandwidth import bandwidth, sped_up
from friso.equations.conditions import anywhere, level_under_conditions
from friso.equations.controllers.adrc import BANDWIDTH, OBSERVER_RATIO, crossing_ratio
from friso.equations.controllers.van_dijk import TUNED_MASS
from friso.equations.settings import SETTINGS, Setting
from friso.errors import InputError
from friso.frequency.crossover import COMFORTABLE_MARGIN, bandwidths_at, limits
from friso.frequency.margins import margins
from friso.frequency.members import limit_cases
from friso.stage import ControllerSection, Stage
from friso.stage.controllers import CONTROLLER, KIND, controller_of
from friso.stage.tables import MOTOR_FRICTION, moving_mass
from friso.studies.compare.machines import FRICTIONS, Machines
from friso.studies.settings import settings

ADRC = "adrc"
"""Name of the option, and kind of the controller."""


class Rejection(NamedTuple):
    """Bandwidths of a disturbance-rejecting controller: of its feedback [Hz], of its observer.

    The observer's is a multiple of the feedback's.
    """

    bandwidth: float
    observer_ratio: float


def rejecting(stage: Stage, crossings: Sequence[float]) -> Stage:
    """Return the stage with active disturbance rejection as fast as its present controller.

    The loop of the sliding machine, with the mass for which it is tuned, crosses 0 dB at the lowest of the present
    `crossings` [Hz]. Force limit and filters are kept. Raises InputError if there is no crossing, or the drive is too
    slow.
    """
    if not crossings:
        raise InputError(CONTROLLER, "a loop that crosses 0 dB nowhere", "one that does", 'crossover = "8 Hz"')
    kept = {
        name: value
        for name, value in stage.as_written()[CONTROLLER].items()
        if name in ControllerSection.model_fields and name != "kind"
    }
    slow = stage.replace({CONTROLLER: {**kept, "kind": ADRC, "bandwidth": "1 mHz"}})
    flat = stage.flat()
    return slow.with_numbers(
        {
            BANDWIDTH: min(crossings) / crossing_ratio(slow.flat()[OBSERVER_RATIO]),
            TUNED_MASS: flat.get(TUNED_MASS, moving_mass(flat)),
        }
    )


def rejection(flat: Mapping[str, Any]) -> Rejection | None:
    """Return the bandwidths of a stage's disturbance-rejecting controller, None for another one."""
    return Rejection(flat[BANDWIDTH], flat[OBSERVER_RATIO]) if flat[KIND] == ADRC else None


DEADBAND_SHARE = 0.5
"""Deadband of the integrator over the tolerance for in position (friso's choice). The integrator pauses while the stage
is in position, and the edge of the deadband lies inside the tolerance."""

MODEL_ERROR = 0.2
"""Relative error of the friction in the feedforward, with one sign for Coulomb and viscous friction of a machine."""

PER_PERIOD = 10
"""Fewest samples in a period of the crossover, as the stage file demands."""


class UnavailableError(Exception):
    """Error: the machines cannot have an option; its text says why."""


@dataclass(frozen=True)
class Situation:
    """The machines to be brought to rest, and the tolerance `within` [m] for in position.

    A faster controller must not exceed the `bandwidth_limit` [Hz]; with None only margins limit it.
    """

    machines: Machines
    within: float
    bandwidth_limit: float | None = None

    @property
    def locked(self) -> Stage:
        """Return the stage with its joint locked; without a joint, unchanged."""
        return self.machines.stage.variants().get("locked", self.machines.stage)

    @property
    def free(self) -> Stage:
        """Return the stage on its free joint. Raises UnavailableError if the stage has no joint."""
        free = self.machines.stage.variants().get("free")
        if free is None:
            raise UnavailableError("the stage file has no joint with stiffness, damping and stroke")
        return free

    @property
    def integrating(self) -> Stage:
        """Return the stage with its joint locked, if its controller integrates.

        Raises UnavailableError if the controller does not.
        """
        flat = self.machines.stage.flat()
        if not controller_of(flat).integrates(flat):
            raise UnavailableError("the controller does not integrate")
        return self.locked

    @property
    def deadband(self) -> float:
        """Return the deadband of the integrator [m], a fixed fraction of the tolerance."""
        return DEADBAND_SHARE * self.within


class Variant(NamedTuple):
    """A stage as an option changes it.

    `changes` are keys that differ between machines: SI numbers, or arrays with one value for each machine. The
    controller is faster by `factor`.
    """

    stage: Stage
    changes: Mapping[str, Any] = MappingProxyType({})
    factor: float = 1.0


@dataclass(frozen=True)
class OptionKind:
    """An option that `friso compare` can try to bring a machine to rest.

    Parameters
    ----------
    name : str
        Name in code; for options that run only on request, also the word after `--also`.
    letter, title : str
        Names in tables, figures and JSON.
    says : str
        Description, with braces where words.py fills in numbers.
    variant : callable
        Returns the stage with this option, from a `Situation`. Raises UnavailableError if machines cannot have it.
    line : tuple of str
        Colour and dash of its curves.
    prose : str
        Name within a sentence; default: "the" and its title.
    joint : bool
        Whether a joint has to be bought.
    own_loop : bool
        Whether its linear loop differs from that of the machine as it is. Pauses of the integrator and feedforward do
        not change the linear loop.
    """

    name: str
    letter: str
    title: str
    says: str
    variant: Callable[[Situation], Variant]
    line: tuple[str, Literal["solid", "dashed", "dotted"]]
    prose: str = ""
    joint: bool = False
    own_loop: bool = False


@dataclass(frozen=True)
class Option:
    """An option as machines have it: its kind, its stage, and its changes of keys.

    `changes` are SI numbers, or arrays with one value for each machine. The controller is faster by `factor`.
    """

    kind: OptionKind
    stage: Stage
    changes: Mapping[str, Any] = field(default_factory=dict)
    factor: float = 1.0

    @property
    def letter(self) -> str:
        """Return the letter of the option."""
        return self.kind.letter

    @property
    def label(self) -> str:
        """Return the name of the option in a table, such as "c isolator"."""
        return f"{self.kind.letter} {self.kind.title}"


@dataclass(frozen=True)
class CompareOptions:
    """Options that the machines can have, and the deadband of the integrator [m].

    `left_out` says for each letter of an option left out why the machines cannot have it.
    """

    options: tuple[Option, ...]
    left_out: Mapping[str, str]
    deadband: float


def linear_flat(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys from which the linear loops of machines are computed, with SI values.

    `flat` has the machines' keys. The drive's loop for the motor current has the bandwidth of the `stage` on all
    machines. The ratio of true to assumed motor constant becomes a factor of the controller's gains. The cable is left
    out.
    """
    current_loop = {key: value for key, value in stage.flat().items() if key == "drive.current_bandwidth"}
    ratio, controller = flat.get("drive.motor_constant_ratio", 1.0), controller_of(flat)
    return {**flat, **{key: ratio * flat[key] for key in map(controller.key, controller.loop_gain)}, **current_loop}


def options(
    machines: Machines, within: float, also: Collection[str] = (), bandwidth_limit: float | None = None
) -> CompareOptions:
    """Return the options of machines that are to be in position `within` a tolerance [m].

    Options in `also`, or "all", join the usual ones. No faster controller exceeds the `bandwidth_limit` [Hz].
    """
    situation = Situation(machines, within, bandwidth_limit)
    tried: list[Option] = []
    left_out: dict[str, str] = {}
    for kind in OPTIONS.values():
        if kind.name in ALSO and not {kind.name, "all"} & {*also}:
            continue
        try:
            tried.append(Option(kind, *kind.variant(situation)))
        except UnavailableError as error:
            left_out[kind.letter] = str(error)
    return CompareOptions(tuple(tried), left_out, situation.deadband)


def _faster(stage: Stage, situation: Situation) -> Variant:
    """Return a stage with the highest bandwidth at which the file's machine keeps its margin.

    The bandwidth stays below the limit of the `situation`, and a stated crossover far enough below the sampling
    frequency. An engineer tunes one machine, and all others get its settings. Raises UnavailableError if the present
    bandwidth is already that high, or above the limit.
    """
    flat = stage.flat()
    highest = limits(linear_flat(stage, flat)).highest_comfortable
    tuned = bandwidth(flat)
    present = 1.0 if tuned is None else tuned
    if tuned is not None and highest is not None:
        highest = min(highest, 1 / (PER_PERIOD * flat["drive.sample_time"]))
    if highest is not None and highest > present and situation.bandwidth_limit is not None:
        factors = np.geomspace(1.0, highest / present, settings.limit_factors)
        below = np.flatnonzero(bandwidths_at(stage, factors) <= situation.bandwidth_limit)
        if not below.size:
            raise UnavailableError(f"the limit of {situation.bandwidth_limit:g} Hz is below the present bandwidth")
        highest = present * factors[below[-1]]
    if highest is None or highest <= present:
        raise UnavailableError(f"no higher bandwidth keeps a modulus margin of {COMFORTABLE_MARGIN:g}")
    factor = float(highest / present)
    changes = {key: value for key, value in sped_up(flat, factor).items() if value != flat[key]}
    return Variant(stage.with_numbers(changes), factor=factor)


def _feedforward(situation: Situation) -> Variant:
    """Return the locked stage with feedforward of each machine's Coulomb and viscous friction.

    The fed-forward friction is wrong by the model error. Raises UnavailableError if there is no such friction.
    """
    machines = situation.machines
    flat = anywhere(machines.flat(machines.stage, {}))
    coulomb = level_under_conditions(flat, "coulomb") if "friction.coulomb" in flat else 0.0
    off = 1 + MODEL_ERROR * machines.signs
    ahead = {
        "drive.feedforward_coulomb": off * (coulomb + flat.get(f"{MOTOR_FRICTION}.coulomb", 0.0)),
        "drive.feedforward_viscous": off * sum(flat.get(f"{table}.viscous", 0.0) for table in FRICTIONS),
    }
    if not any(np.any(force) for force in ahead.values()):
        raise UnavailableError("the stage file has neither Coulomb nor viscous friction")
    return Variant(situation.locked, ahead)


def _with_setting(setting: Setting, situation: Situation) -> Variant:
    """Return the locked stage with a setting against friction, sized for the tolerance.

    Raises UnavailableError if the setting needs a controller that integrates.
    """
    stage = situation.integrating if setting.integral else situation.locked
    return Variant(stage.with_numbers(setting.numbers(stage.flat(), situation.within)))


def _rejecting(situation: Situation) -> Variant:
    """Return the locked stage with disturbance rejection, as fast as the present controller.

    Raises UnavailableError if the present loop crosses 0 dB nowhere, or if the result is no valid stage.
    """
    flat = situation.locked.flat()
    crossings = margins(linear_flat(situation.locked, flat), limit_cases(flat)["sliding"]).crossovers
    try:
        return Variant(rejecting(situation.locked, crossings))
    except InputError as error:
        raise UnavailableError(str(error)) from None


_OPTIONS = (
    OptionKind(
        "as-is",
        "a",
        "as is",
        "the controller of the file",
        lambda situation: Variant(situation.locked),
        ("ink", "solid"),
        prose="the machine as is",
        own_loop=True,
    ),
    OptionKind(
        "faster",
        "b",
        "faster",
        "{faster}",
        lambda situation: _faster(situation.locked, situation),
        ("blue", "solid"),
        prose="the faster controller",
        own_loop=True,
    ),
    OptionKind(
        "isolator",
        "c",
        "isolator",
        "the controller of the file",
        lambda situation: Variant(situation.free),
        ("vermillion", "solid"),
        joint=True,
        own_loop=True,
    ),
    OptionKind(
        "deadband",
        "d",
        "deadband",
        "the integrator pauses while the error is below {deadband}",
        lambda situation: Variant(
            situation.integrating.with_numbers({"drive.integrator_deadband": situation.deadband})
        ),
        ("orange", "dashed"),
    ),
    OptionKind(
        "reset",
        "e",
        "reset",
        "the integrator is reset where the error changes sign",
        lambda situation: Variant(situation.integrating.replace({"drive.integrator_reset": True})),
        ("pink", "dashed"),
    ),
    OptionKind(
        "feedforward",
        "f",
        "feedforward",
        "feedforward of Coulomb and viscous friction, both {model_error} too large or both too small, drawn for each "
        "machine",
        _feedforward,
        ("sky", "dashed"),
        prose="feedforward",
    ),
    OptionKind(
        "isolator-faster",
        "g",
        "isolator, faster",
        "{faster}",
        lambda situation: _faster(situation.free, situation),
        ("green", "solid"),
        prose="isolator and faster controller",
        joint=True,
        own_loop=True,
    ),
    *(
        OptionKind(name, letter, setting.name, setting.says, partial(_with_setting, setting), (colour, "dotted"))
        for (name, setting), letter, colour in zip(
            SETTINGS.items(), "hijklm", ("blue", "vermillion", "orange", "pink", "sky", "green"), strict=True
        )
    ),
    OptionKind(
        ADRC,
        "n",
        "disturbance rejection",
        "linear active disturbance rejection with a bandwidth of {rejection_bandwidth}, at which the loop crosses 0 dB "
        "where it does in a, and an observer {observer_ratio} times as fast",
        _rejecting,
        ("ink", "dashed"),
        prose="disturbance rejection",
        own_loop=True,
    ),
)
OPTIONS: Mapping[str, OptionKind] = {kind.name: kind for kind in _OPTIONS}
"""All options, by name, in the order of their letters."""

ALSO = (*SETTINGS, ADRC)
"""Options that run only on request."""
