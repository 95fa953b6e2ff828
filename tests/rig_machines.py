"""Draw machines with their real drives at random, and pass their rig's logs through files.

They are the known truth for tests and benchmarks of the way from `friso rig` to `friso identify`. Mass, stiffness and
friction are those of machines.py. Further sizes of the thesis's rig are scaled with them, in the structure of
examples/thesis_drive.toml, so that all share one set of kernels.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from machines import Machine, drawn

import friso
from friso.equations.rail import friction_factors
from friso.identification.kind import Source
from friso.identification.logs.roles import Mapping, mapping_text, sidecar
from friso.identification.readings.friction_velocity import friction_velocity
from friso.identification.sources import LogFile, read_all
from friso_thesis.questions.rig.blocks import write_csv
from friso_thesis.studies.rig.outcome import RigLog

EXAMPLE = Path(__file__).parent.parent / "examples" / "thesis_drive.toml"

STROKE = (0.5, 1.5)
"""Stroke over the deflection at which the joint breaks the cart away (0.8 on the thesis's rig)."""

PARASITIC, RETURN, DURATION = 37.5, 40.0, 160.0
"""Parasitic mode over the crossover, and periods of that until the move's return and its end: the thesis's 300 Hz, 5 s
and 20 s at 8 Hz."""

STRONG = 60.0
"""Peak force over static friction (67 on the thesis's rig), besides twice what the acceleration takes."""

RAIL = {"static_deviation": 0.05, "coulomb_deviation": 0.05, "correlation_length": "5 mm"}
"""A mild rail, on which the friction differs by 5 % from place to place."""


def built(seed: int) -> Machine:
    """A jointed machine drawn at random, with the drive of the thesis's rig, on a mild rail; no constant force acts."""
    machine, example = drawn(seed, True), friso.load(EXAMPLE)
    rng = np.random.default_rng((seed, len("rail")))
    flat = machine.flat
    mass, static = flat["masses.cart"] + flat["masses.stage"], flat["friction.static"]
    tables = machine.truth.as_written()
    tables["drive"] = example.as_written()["drive"]
    tables["parasitic"] = {**example.as_written()["parasitic"], "mass": f"{flat['masses.stage'] / 2} kg"}
    tables |= {"rail": {**RAIL, "seed": seed}, "controller": {**tables["controller"], "anti_windup": "clamp"}}
    numbers = {
        "joint.stroke": rng.uniform(*STROKE) * static / flat["joint.stiffness"],
        "parasitic.frequency": PARASITIC * flat["controller.crossover"],
        "controller.tuned_mass": mass,
        "controller.force_limit": 2 * mass * flat["motion.acceleration"] + STRONG * static,
        "motion.return_at": RETURN / flat["controller.crossover"],
        "motion.duration": DURATION / flat["controller.crossover"],
    }
    tables["bias"] = {"cart": "0 N"}
    limited = {**tables["controller"], "force_limit": "1 N"}
    return replace(machine, truth=friso.Stage(**{**tables, "controller": limited}).with_numbers(numbers))


def through_files(logs: Iterable[RigLog], folder: Path) -> list[LogFile]:
    """Logs of the rig written as `friso rig` does, and read back as `friso identify` does."""
    paths = []
    for log in logs:
        paths.append(folder / f"{log.name}.csv")
        write_csv(paths[-1], log.interval, log.logged, f"friso rig, seed {log.seed}")
        if log.kind is not None:
            sidecar(paths[-1]).write_text(mapping_text(Mapping(experiment=log.kind)))
    return read_all(paths, Mapping(), folder)


def sources(logs: Iterable[LogFile]) -> list[tuple[Source, str]]:
    """Return the logs as sources for `identify`."""
    return [(item.source, item.kind) for item in logs]


def mean_level(logs: Iterable[RigLog], key: str) -> float:
    """Static or Coulomb friction [N] on average over the stretches of rail on which it was read: a log sees no
    others."""
    row = ("friction.static", "friction.coulomb").index(key)
    means = []
    for log in logs:
        flat = log.stage.flat()
        places = log.true.get("cart_position", log.true["position"])
        way = friction_velocity(log.log).places if log.kind == "constant-speed" else (places.min(), places.max())
        if np.isnan(way[0]):
            continue  # nothing was steady
        means.append(flat[key] * float(friction_factors(flat, np.linspace(*way, 1000))[row].mean()))
    return float(np.mean(means))
