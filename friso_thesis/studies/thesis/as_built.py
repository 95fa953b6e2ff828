"""Run the thesis's rig with its real drive, in sizes for a reproduction.

The module has loops and plants as they would be measured (Sec. 4.2.1, 4.2.4), and the hunting experiments (Sec. 4.3.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from friso.equations.controllers.pid import CROSSOVER
from friso.equations.motions import CRUISE
from friso.progress import silent
from friso.stage import Stage
from friso.stage.controllers import ANTI_WINDUP, FORCE_LIMIT
from friso_thesis.studies.rig.experiments.frf import (
    CROSSOVER_SETTINGS,
    MeasuredLoop,
    Plant,
    apparent_masses,
    free_plant,
    measured_loop,
    open_loops,
    stable_settings,
)
from friso_thesis.studies.rig.in_position import InPosition, in_position
from friso_thesis.studies.rig.measured_cycles import MOTORS, moves_on_varied_rails, on_rail, started
from friso_thesis.studies.rig.moves_on_rails import (
    RailRuns,
    crossover,
    distance,
    move,
    numbers_of,
    on_rails,
    once,
    released,
    run_moves,
    with_joint,
)
from friso_thesis.studies.rig.outcome import excite, freed, locked_stage, pace, rig_log, travel
from friso_thesis.studies.rig.stroke_crossover import StrokeCrossover, limits_of_crossover

AS_BUILT: Mapping[str, Any] = MappingProxyType(
    {
        FORCE_LIMIT: "200 N",
        ANTI_WINDUP: "clamp",
        "drive.sample_time": "50 us",
        "drive.delay": "50 us",
        "drive.current_bandwidth": "2 kHz",
        "drive.encoder_resolution": "1 nm",
        "drive.encoder_noise": "0.5 nm",
        "drive.relative_noise": "30 nm",
        "rail.seed": 1,
        "rail.static_deviation": 0.2,
        "rail.coulomb_deviation": 0.2,
        "rail.correlation_length": "5 mm",
        "rail.rolling_pitch": "4 mm",
        "rail.first_harmonic": 0.05,
        "rail.second_harmonic": 0.02,
        "cable.stiffness": "5 N/m",
        "cable.drag": "0.1 N*s/m",
    }
)
"""The drive by Sec. 3.5.2 (sample time, resolutions, peak force); the rest is our choice. The example
thesis_drive.toml, with which `friso rig` runs the same experiments, has the same drive."""

COULOMB_LEVEL = 2.0
"""Coulomb friction relative to the rig's, with the weaker motor. It is our choice among the levels of `friso rig
measured-cycles`."""

RAIL_SEED = 1
"""Seed of the moves and of the varied rails, of which there are `JudgeSettings.rail_count`."""

RELATIVE_CROSSOVERS = np.array([8.0, 9.5, 14.3]) / 8
"""Crossovers relative to 8 Hz (Sec. 4.3.2)."""

RELEASE_DISTANCES = (-0.05, 0.05)
"""Displacements of the releases over the distance of the move: 5 mm to either side."""

RELATIVE_STROKES, STROKE_CROSSOVERS = np.array([0.02, 0.1, 0.3, 1.0]), np.array([3.0, 4.0, 5.0, 6.0, 8.0, 12.0]) / 8
"""Strokes over the rig's and crossovers over 8 Hz, for Fig. 26. Each cell has all rails."""

NOISE_FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Factors on friso's choice of the drive's force noise in Fig. 28, which the thesis does not state."""


@dataclass(frozen=True)
class MovesOnRails:
    """Runs of the moves of Fig. 24 and 25 on several rails.

    `locked` has the shape (crossovers, rails), and `free`, at the first crossover, (rails,). `released` are releases
    with the joint locked at the second crossover, shape (displacements, rails). Crossovers are in Hz.
    """

    crossovers: np.ndarray
    locked: RailRuns
    free: RailRuns
    released: RailRuns


@dataclass(frozen=True)
class CyclesOnRails:
    """Runs of the cycles of Fig. 27: `even` on an even rail, `rails` on varied ones, (rails,).

    `asymmetry`, (rails,), is the logarithm of the ratio of friction on both sides of the target. `weak` is a run on the
    even rail with `COULOMB_LEVEL` times the Coulomb friction, and a weak motor. With such a motor the rig appears to
    have the mass that was measured (`MOTORS`).
    """

    even: RailRuns
    rails: RailRuns
    asymmetry: np.ndarray
    weak: RailRuns


def _prescribed(stage: Stage) -> Stage:
    """Return the rig with its drive, moved as Sec. 4.3.2 prescribes: by 100 mm at 100 m/s^2.

    The path written here is 90 mm long; `move` takes its acceleration and rounds the length to 100 mm.
    """
    time = 0.03 / np.sqrt(1 + stage.flat().get(CRUISE, 0.0))
    own = {"motion.acceleration": "100 m/s^2", "motion.acceleration_time": f"{float(time)!r} s"}
    return rig_with_drive(stage.replace(own))


def rig_with_drive(stage: Stage) -> Stage:
    """Return the rig with the keys of its real drive, such as sampling and delay."""
    return stage.replace(dict(AS_BUILT))


RAIL_COUNT = 20  # [rails]
"""Number of rails, on which a share is known to 22 % at worst. Draws have as many: with 8 instead, F26, which asks
whether any rail has peaks, held in 4 of 17 draws, not in 9."""


def _rails() -> np.ndarray:
    """Return the seeds of the rails, as the virtual rig numbers them."""
    return 1.0 + np.arange(float(RAIL_COUNT))


def moves(stage: Stage) -> MovesOnRails:
    """Run the moves of Fig. 24 and 25 with the rig's real drive on several rails."""
    machine = _prescribed(stage)
    locked, free = (with_joint(machine, held) for held in (True, False))
    seeds, frequencies = _rails(), crossover(machine) * RELATIVE_CROSSOVERS
    keys, count = CROSSOVER, len(seeds)
    held = run_moves(
        locked,
        move(machine),
        numbers_of(RAIL_SEED, len(RELATIVE_CROSSOVERS), count),
        on_rails(machine, {keys: frequencies}, seeds),
    )
    first, second = (on_rails(machine, {keys: frequencies[[row]]}, seeds) for row in (0, 1))
    loose = run_moves(free, move(machine), numbers_of(RAIL_SEED, 1, count), first)
    tasks = [released(machine, share * distance(machine)) for share in RELEASE_DISTANCES]
    let_go = RailRuns.joined([run_moves(locked, task, numbers_of(RAIL_SEED, 1, count), second) for task in tasks])
    return MovesOnRails(
        frequencies, held.shaped(len(RELATIVE_CROSSOVERS), count), loose, let_go.shaped(len(tasks), count)
    )


def grid(stage: Stage) -> StrokeCrossover:
    """Run moves with the real drive over strokes and crossovers, as far as limits need (Fig. 26)."""
    return limits_of_crossover(
        with_joint(_prescribed(stage), locked=False), RAIL_SEED, RELATIVE_STROKES, STROKE_CROSSOVERS, _rails()
    )


def cycles(stage: Stage) -> CyclesOnRails:
    """Run cycles on an even rail and on varied rails, with the joint locked (Fig. 27)."""
    machine = _prescribed(stage)
    even = on_rail(with_joint(machine, locked=True))
    run = started(even, RAIL_SEED, {}, 1, silent, "")
    swing = float(run.swing[0]) if run.swings[0] else 0.01 * distance(machine)
    flat = machine.flat()
    cases = {f"rail.{name}": np.array([flat[f"rail.{name}"]]) for name in _FIELD}
    rails, asymmetry = moves_on_varied_rails(even, RAIL_SEED, cases, _rails(), swing, silent, "")
    changes = {
        "drive.motor_constant_ratio": np.array([MOTORS[1] * flat.get("drive.motor_constant_ratio", 1.0)]),
        "friction.coulomb": np.array([COULOMB_LEVEL * flat["friction.coulomb"]]),
    }
    return CyclesOnRails(run, rails, asymmetry, started(even, RAIL_SEED, changes, 1, silent, ""))


_FIELD = tuple(key.removeprefix("rail.") for key in AS_BUILT if key.startswith("rail.") and key != "rail.seed")


def standstill(stage: Stage) -> InPosition:
    """Run the rig with its real drive at a standstill under each disturbance (Fig. 28)."""
    return in_position(rig_with_drive(stage), RAIL_SEED, silent, NOISE_FACTORS)[0]


@dataclass(frozen=True)
class RailTraces:
    """Positions over time in single moves, on one rail that varies and on an even one.

    Positions [m] are relative to the end of the move, each of shape (n,), at times [s], shape (n,). `moves` has them by
    the joint's state and crossover [Hz], and `rails` by rail. `distance` [m] is the length of the move.
    """

    time: np.ndarray
    moves: Mapping[tuple[str, float], np.ndarray]
    rails: Mapping[str, np.ndarray]
    distance: float


def traces(stage: Stage, rail: int) -> RailTraces:
    """Run single moves on a numbered rail, from 0, and on an even one (Fig. 24, 25, 27)."""
    machine = _prescribed(stage)
    frequencies, task, length = crossover(machine) * RELATIVE_CROSSOVERS, move(machine), distance(machine)
    held, loose = (with_joint(machine, locked) for locked in (True, False))
    key = CROSSOVER
    place = {"rail.seed": 1.0 + rail}
    locked = once(held, task, [RAIL_SEED + rail] * len(frequencies), {key: frequencies, **place})
    free = once(loose, task, [RAIL_SEED + rail], {key: frequencies[:1], **place})
    even = once(on_rail(held), task, [RAIL_SEED])
    logged = locked.logged["position"] - length
    moves = {("locked", float(f)): row for f, row in zip(frequencies, logged, strict=True)}
    moves |= {("free", float(frequencies[0])): free.logged["position"][0] - length}
    rails = {"even rail": even.logged["position"][0] - length, "rail that varies": logged[0]}
    return RailTraces(locked.time, moves, rails, length)


@dataclass(frozen=True)
class RigLoops:
    """Open loops and masses of the rig, as measured with its real drive.

    `locked` has the loops of the locked joint, tuned to several crossovers. `free` is the loop of the free joint at the
    lowest of them, and `plant` its plant. With the joint free, the crossovers `settings` [Hz], shape (n,), were tried;
    `stable`, shape (n,), is true where the loop was stable.

    `apparent`, shape (2, ratios), are masses [kg] that the rig seems to have, locked and free. Its motor then gives
    `MOTOR_CONSTANT_RATIOS` of the force that is assumed.
    """

    locked: tuple[MeasuredLoop, ...]
    free: MeasuredLoop
    plant: Plant
    settings: np.ndarray
    stable: np.ndarray
    apparent: np.ndarray


def rig_loops(stage: Stage) -> RigLoops:
    """Measure the loops of a rig with its real drive."""
    built = rig_with_drive(stage)
    fixed, free, place = locked_stage(built), freed(built), travel(built)[0]
    log = rig_log(excite(free, place, RAIL_SEED), 0, "free", "frequency", free, RAIL_SEED)
    settings, stable = stable_settings(free, place, RAIL_SEED)
    apparent = np.array([apparent_masses(machine, place, RAIL_SEED) for machine in (fixed, free)])
    _, loops = open_loops(fixed, place, RAIL_SEED, CROSSOVER_SETTINGS)
    return RigLoops(loops, measured_loop(log, pace(built)), free_plant([log]), settings, stable, apparent)
