"""Simulate the thesis's identification of its rig (Sec. 4.2, Fig. 17 and 19 to 21).

Records are evaluated as measured. The simulated rig has equal friction all along its rail, and no noise; only for Fig.
17 does it have several places.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any, get_type_hints

import numpy as np

from friso.engine.batch import simulate
from friso.identification.logs.log import Log
from friso.identification.readings.common import record
from friso.identification.readings.friction_position import FrictionPosition, friction_position
from friso.identification.readings.motion_events import passes
from friso.stage import Stage, loads
from friso.stage.controllers import CONTROLLER
from friso_thesis.studies.describing.response import mass_line
from friso_thesis.studies.identification.steps import StepStiffness, stiffness_from_steps
from friso_thesis.studies.identification.stick_slip import StickSlip, static_from_stick_slip
from friso_thesis.studies.rig.experiments.constant_speed import passes_log
from friso_thesis.studies.rig.in_position import InPosition
from friso_thesis.studies.rig.outcome import freed, locked_stage, pace
from friso_thesis.studies.rig.stroke_crossover import StrokeCrossover
from friso_thesis.studies.thesis.as_built import (
    RAIL_COUNT,
    RAIL_SEED,
    CyclesOnRails,
    MovesOnRails,
    RailTraces,
    RigLoops,
    cycles,
    grid,
    moves,
    rig_loops,
    rig_with_drive,
    standstill,
    traces,
)
from friso_thesis.studies.thesis.kept import NOT_KEPT, Kept
from friso_thesis.studies.thesis.linear import PartNeeded
from friso_thesis.studies.thesis.studies import LOCKED

FORCE_AMPLITUDE = 5.0
"""Force amplitude [N] of the identification with the joint locked, which the thesis does not give: some times the
friction that it finds."""

STATIC_RANGE, RAIL_PLACES, COULOMB_SHARE = (1.0, 2.5), 4, 1 / 3
"""Static friction by Fig. 20 [N], over which the places of the rail spread evenly; number of places; and Coulomb
friction as a fraction of static friction (as in Table 2). Number and fraction are our choice."""

RESPONSE_FREQUENCIES = (5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 120.0, 160.0, 200.0)
"""Frequencies [Hz] of the response with friction."""

SAMPLE_TIME = 1e-3
"""Sample time of the records [s]: the thesis gives none."""

STEP_SIZE, STEP_DIRECTIONS, STANDING_TIME = 0.3e-3, (1, 1, -1, -1, 1, -1), 2.0
"""Size of a step [m] (Sec. 4.2.2), directions of the steps, and the time [s] for which each stands. The latter two are
our choice."""

FIXED_CART = "1e9 kg"
"""Mass of a cart that does not move: 1 N displaces it by less than a thousandth of a micrometre in 10 s."""

SLOW_SPEEDS, SLOW_TIME = (0.5e-3, 1e-3, 2.5e-3), 20.0
"""Speeds of slow motion [m/s], and their time [s]. The thesis gives neither; the speeds go up to the slower one of Fig.
21."""

STROKE = "8 mm"
"""Stroke to the limiters during identification (Sec. 4.2.1)."""


@dataclass(frozen=True)
class LockedLine:
    """The locked rig's response as measured at several places of the rail (Fig. 17).

    Magnitude and phase [rad] over those of the mass line have the shape (places, frequencies). The scatter of the phase
    over the places [rad] has the shape (frequencies,). All are at RESPONSE_FREQUENCIES.
    """

    magnitude: np.ndarray
    phase: np.ndarray
    scatter: np.ndarray


@dataclass(frozen=True)
class JointSteps:
    """Steps of the joint (Fig. 19): record, analysis, and true joint stiffness [N/m]."""

    log: Log
    result: StepStiffness
    stiffness: float


@dataclass(frozen=True)
class SlowMotion:
    """Slow motion (Fig. 20): speed [m/s], record, analysis, and true static friction [N]."""

    speed: float
    log: Log
    result: StickSlip
    static: float


@dataclass(frozen=True)
class ConstantSpeed:
    """Passes there and back at constant speeds on the real rail (Fig. 21).

    `velocities` [m/s] are those of the passes, each a segment of the log; `result` is friction along the rail.
    """

    velocities: tuple[float, ...]
    log: Log
    result: FrictionPosition


LINE, STEPPED, SLIPS, SPEEDY = "locked_line", "joint_steps", "slow_motion", "constant_speed"
"""Names of the experiments by which judges request them."""

BUILT = "rig_loops"
"""Name of the loops and plants of the rig with its real drive (Sec. 4.2)."""

MOVES, GRID, ON_RAILS, STANDSTILL = "moves", "grid", "cycles", "standstill"
"""Names of the experiments with the real drive (Sec. 4.3.2): moves, their maps, cycles, and standstill."""

TRACES = "traces"
"""Name of the single moves with the real drive, which are shown but not judged."""

EXPERIMENTS: Mapping[str, PartNeeded] = MappingProxyType(
    {
        LINE: PartNeeded(("motion.", f"{CONTROLLER}.", "friction."), locked=True),
        STEPPED: PartNeeded(("motion.",)),
        SLIPS: PartNeeded(("motion.",)),
        SPEEDY: PartNeeded(("motion.",)),
        BUILT: PartNeeded(()),
        MOVES: PartNeeded(("motion.",)),
        GRID: PartNeeded(("motion.",)),
        ON_RAILS: PartNeeded(("motion.",), locked=True),
        STANDSTILL: PartNeeded(("motion.",)),
    }
)
"""Experiments, with the tables of the stage file that do not matter for each."""


class Experiments:
    """Experiments on one rig, each run on first use, unless it was `kept`.

    Constant speeds are run with the joint free, and locked; the loops with the real drive.
    """

    locked_line: LockedLine
    """Identification of the locked rig (Fig. 17)."""

    joint_steps: JointSteps
    """Position steps of the joint (Fig. 19)."""

    slow_motion: tuple[SlowMotion, ...]
    """Slow motion at several speeds (Fig. 20)."""

    constant_speed: tuple[ConstantSpeed, ConstantSpeed]
    """Motion at constant speed with the joint free and locked (Fig. 21)."""

    rig_loops: RigLoops
    """Loops and plants of the rig with its real drive (Fig. 17, 18, 22, 23)."""

    moves: MovesOnRails
    """Moves on several rails (Fig. 24, 25)."""

    grid: StrokeCrossover
    """Moves over strokes and crossovers (Fig. 26)."""

    cycles: CyclesOnRails
    """Cycles on even and varied rails (Fig. 27)."""

    standstill: InPosition
    """Motion of the rig at a standstill under several disturbances (Fig. 28)."""

    traces: RailTraces
    """Logs of single moves (Fig. 24, 25, 27)."""

    def __init__(self, stage: Stage, kept: Kept = NOT_KEPT) -> None:
        self._stage_file, self._kept = stage.to_toml(), kept

    def __getattr__(self, name: str) -> Any:
        """Run an experiment that is not among the attributes yet."""
        if name not in _RUNS:
            raise AttributeError(name)
        about, kind = ("experiment", name, self._stage_file, RAIL_COUNT), get_type_hints(Experiments)[name]
        setattr(self, name, self._kept.result(about, kind, partial(_experiment, name, *about[2:])))
        return vars(self)[name]


@lru_cache(maxsize=64)
def _experiment(name: str, stage_file: str, rails: int) -> Any:
    """Run an experiment by its name on the stage in the text of a stage file, where it needs some on so many `rails`.

    The result is cached for the judges of several claims.
    """
    return _RUNS[name](loads(stage_file))


def locked_line(stage: Stage) -> LockedLine:
    """Simulate the locked rig's response to sines of force, with friction as at several places."""
    places = [
        {"friction.static": f"{f} N", "friction.coulomb": f"{COULOMB_SHARE * f} N"}
        for f in np.linspace(*STATIC_RANGE, RAIL_PLACES)
    ]
    line = mass_line(stage.replace(dict(LOCKED)), places, [FORCE_AMPLITUDE], RESPONSE_FREQUENCIES)
    return LockedLine(line["magnitude"].values[:, 0], line["phase"].values[:, 0], line["spread_phase"].values[0])


def joint_steps(stage: Stage) -> JointSteps:
    """Simulate position steps of 0.3 mm with the cart fixed.

    The limiter is not touched, so the rig is linear. The response to all steps is the sum of the responses to each.
    """
    fixed = stage.replace({"masses.cart": FIXED_CART, "joint.stroke": STROKE, "joint.locked": False})
    duration = STANDING_TIME * (len(STEP_DIRECTIONS) + 1)
    run = simulate(
        _with_motion(fixed, kind="step", size=f"{STEP_SIZE!r} m", duration=f"{duration} s"), sample_time=SAMPLE_TIME
    )
    count, signals = round(STANDING_TIME / SAMPLE_TIME), {}
    for name in ("reference", "position", "force"):
        step, total = run[name].values, np.zeros(count * (len(STEP_DIRECTIONS) + 1))
        for number, direction in enumerate(STEP_DIRECTIONS, start=1):
            total[number * count :] += direction * step[: len(total) - number * count]
        signals[name] = total
    log = record("0.3 mm steps, cart fixed", SAMPLE_TIME, **signals)
    return JointSteps(log, stiffness_from_steps(log), float(stage.flat()["joint.stiffness"]))


def slow_motion(stage: Stage, speed: float) -> SlowMotion:
    """Simulate stick-slip at a `speed` [m/s] with the joint free, and analyse it."""
    free = stage.replace({"joint.stroke": STROKE, "joint.locked": False})
    log = _ramp(free, speed, SLOW_TIME)
    flat = stage.flat()
    return SlowMotion(speed, log, static_from_stick_slip(log, flat["joint.stiffness"]), float(flat["friction.static"]))


def constant_speed(machine: Stage) -> ConstantSpeed:
    """Simulate passes over 150 mm with the real drive, there and back at both speeds."""
    whole, flat = passes_log("constant speed", machine, RAIL_SEED).log, machine.flat()
    stretches = passes(whole)
    log = replace(whole, segments=tuple(stretch.span for stretch in stretches))
    friction = friction_position(whole, flat["masses.cart"] + flat["masses.stage"], pace(machine))
    return ConstantSpeed(tuple(stretch.velocity for stretch in stretches), log, friction)


def _ramp(stage: Stage, speed: float, duration: float) -> Log:
    run = simulate(
        _with_motion(stage, kind="ramp", velocity=f"{speed!r} m/s", duration=f"{duration!r} s"), sample_time=SAMPLE_TIME
    )
    roles = {role: run[role].values for role in ("reference", "position", "cart_position", "force")}
    return record(f"{speed * 1e3:g} mm/s", SAMPLE_TIME, **roles)


def _with_motion(stage: Stage, **motion: Any) -> Stage:
    """Return the stage with another kind of motion, without keys that this kind does not have."""
    rows = "\n".join(f'{key} = "{value}"' for key, value in motion.items())
    text = stage.to_toml()
    begin = text.index("[motion]")
    end = text.find("\n[", begin)
    return loads(f"{text[:begin]}[motion]\n{rows}\n{text[end + 1 :] if end >= 0 else ''}")


def _lively_rail(moves: MovesOnRails) -> int:
    """Return the number of the first rail with peaks at the lowest crossover, joint locked.

    If no rail has any, the result is the first rail.
    """
    return int(np.argmax(moves.locked.counted[0]))


_RUNS: Mapping[str, Callable[[Stage], Any]] = MappingProxyType(
    {
        LINE: locked_line,
        STEPPED: joint_steps,
        SLIPS: lambda stage: tuple(slow_motion(stage, speed) for speed in SLOW_SPEEDS),
        SPEEDY: lambda stage: tuple(constant_speed(joint(rig_with_drive(stage))) for joint in (freed, locked_stage)),
        BUILT: rig_loops,
        MOVES: moves,
        GRID: grid,
        ON_RAILS: cycles,
        STANDSTILL: standstill,
        TRACES: lambda stage: traces(stage, _lively_rail(_experiment(MOVES, stage.to_toml(), RAIL_COUNT))),
    }
)
