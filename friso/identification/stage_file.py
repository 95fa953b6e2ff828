"""Write the identified stage file: the estimates in the given stage, or in a stage assumed for a log."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from friso.axis import LINEAR
from friso.equations.controllers.van_dijk import controller_table
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import InverseModel, moved_in
from friso.identification.logs.log import Log
from friso.identification.settings import identification_settings
from friso.stage import Stage
from friso.stage.contacts import usual_ranges, written

NOT_IDENTIFIED = "not identified: all that is possible"

CHOSEN = "our choice, not identified"

FOLLOWS = "not identified, moved along with"

OUR_CHOICE = "what was identified says so beside its value; the rest is our choice"

PLACEHOLDER = (
    "The [controller] of the stage file is our choice: put yours there, and delete this note and the controller from "
    "the list of what is unknown, before you ask whether the stage hunts."
)


def made_up(log: Log, inverse: InverseModel) -> Stage:
    """Make a stage with assumed values for a log without a stage file.

    The stage has one rigid mass, LuGre friction without Stribeck effect, a controller chosen by friso, and a move as
    fast as the log's fastest motion.
    """
    mass, coulomb = (max(inverse.value(name), 1e-6) for name in ("mass", "coulomb"))
    viscous, stiffness = max(inverse.value("viscous"), 0.0), coulomb / identification_settings.bend_of_made_up_bristles
    parts = [moved_in(log, log["position"][part], inverse.bandwidth) for part in log.segments]
    axis = log.axis
    top = max(float(np.abs(part.velocity).max()) for part in parts)
    brisk = max(float(np.abs(part.acceleration).max()) for part in parts)
    time = max(top / brisk, log.sample_time)
    back = max(2.0, 3 * time)
    tables: dict[str, Any] = {
        "masses": {"cart": f"{mass:.6g} {axis.mass}"},
        "friction": {
            "model": "lugre",
            "static": f"{coulomb:.6g} {axis.force}",
            "coulomb": f"{coulomb:.6g} {axis.force}",
            "stribeck_velocity": f"{identification_settings.made_up_stribeck_velocity:g} {axis.length}/s",
            "stribeck_exponent": 2,
            "bristle_stiffness": f"{stiffness:.6g} {axis.unit('N/m')}",
            "bristle_damping": f"{math.sqrt(stiffness * mass):.6g} {axis.unit('N*s/m')}",
            "viscous": f"{viscous:.6g} {axis.unit('N*s/m')}",
        },
        "controller": controller_table("10 Hz"),
        "motion": {
            "kind": "there_and_back",
            "acceleration": f"{brisk:.4g} {axis.length}/s^2",
            "acceleration_time": f"{time:.4g} s",
            "return_at": f"{back:.4g} s",
            "duration": f"{2.5 * back:.4g} s",
        },
    }
    if axis != LINEAR:
        tables["axis"] = {"kind": axis.name}
    return Stage(name=log.name, source=OUR_CHOICE, note=PLACEHOLDER, **tables)


def identified_stage(stage: Stage, estimates: Iterable[Estimate], logs: Iterable[str]) -> Stage:
    """Return the stage with its identified keys as values with intervals, or as ranges.

    Units follow the stage's kind of axis. A stiffness that follows from a [flexure] is not replaced. Raises InputError
    if the values contradict each other; values from `fitting` never do.
    """
    changes: dict[str, object] = {}
    for estimate in estimates:
        if "." not in estimate.name or (stage.flexure and estimate.name == "joint.stiffness"):
            continue
        if np.isfinite([estimate.low, estimate.high]).all() and estimate.high > estimate.low:
            changes[estimate.name] = estimate_text(estimate)
    source = f"identified by friso from {', '.join(logs)}"
    return stage.replace({**changes, "source": f"{source}; {stage.source}" if stage.source else source})


TOLD_BY_LOGS = ("masses", "friction", "motion")
"""Tables of a stage file that a log of moves can replace."""


def completed(tables: Mapping[str, Any], around: Stage) -> dict[str, Any]:
    """Return the tables of a stage file, completed by those of a made-up stage that it lacks."""
    made = around.as_written()
    return {**{name: made[name] for name in TOLD_BY_LOGS}, **tables}


def origins(
    stage: Stage, estimates: Iterable[Estimate], follows: Mapping[str, str], chosen: Collection[str] | None
) -> dict[str, str]:
    """Return the origin of each key of an identified stage, in words.

    A key was identified, follows another one (`follows`), was given in the stage file, or was chosen by friso. The last
    applies to the `chosen` keys (None: all that were not identified).
    """
    sources = {"axis.kind": "that of the log"} if chosen is None else {}
    for estimate in estimates:
        sources[estimate.name] = f"identified: {estimate.method}" if estimate.determined else NOT_IDENTIFIED
    sources |= {key: f"{FOLLOWS} {lead}" for key, lead in follows.items()}
    tables = {name: table for name, table in stage.as_written().items() if isinstance(table, dict)}
    keys = [f"{name}.{key}" for name, table in tables.items() for key in table]
    ours = keys if chosen is None else chosen
    return {key: sources.get(key, CHOSEN if key in ours else "as given") for key in keys}


def with_unknown(
    stage: Stage, origins: Mapping[str, str], left: Collection[str], estimates: Iterable[Estimate] = ()
) -> Stage:
    """Return the stage with a list of the values that are unknown, and with the range of each that friction has.

    Ranges are those of similar machines (`friso.stage.contacts`), cut by the finite ends of `estimates`. They hold the
    value that the stage has.

    They are those that friso chose, apart from the motion, keys and tables `left` open by the logs, and keys that only
    moved along with another one. By `origins`, keys have their origins in words. A value with an interval of its own is
    known, and a controller that friso chose as a whole is listed as such.
    """
    numbers, uncertain = (
        {".".join(key.split(".")[:2]) for key in keys}  # an array has one origin
        for keys in (stage.numeric_keys(), stage.uncertain())
    )
    unknown = [
        key
        for key, origin in origins.items()
        if key in numbers
        and not key.startswith("motion.")
        and (origin.startswith(FOLLOWS) or (key not in uncertain and (origin == CHOSEN or key in left)))
    ]
    of_controller = {origin for key, origin in origins.items() if key.startswith("controller.")}
    if of_controller == {CHOSEN}:
        unknown = [*(key for key in unknown if not key.startswith("controller.")), "controller"]
    tables = [name for name in left if "." not in name]
    unknown = [*(key for key in unknown if key.partition(".")[0] not in tables), *tables]
    listed = dict.fromkeys([*stage.unknown_keys, *unknown])
    follows = {key for key, origin in origins.items() if origin.startswith(FOLLOWS)}
    bounds = {one.name: (one.low, one.high) for one in estimates if not one.determined}
    bounded = {key for key in stage.uncertain() if origins.get(key) == NOT_IDENTIFIED} - {"friction.coulomb"}
    open_keys = [*bounded, *(key for key in listed if key not in uncertain or key in follows)]
    keys, flat, changes = stage.numeric_keys(), stage.flat(), {}
    for key, ends in usual_ranges(stage, open_keys, bounds).items():
        own = ends[0] if origins.get(key) == CHOSEN or key in bounded | follows else flat[key]
        changes[key] = written((min(ends[0], own), max(ends[1], own)), keys[key].unit)
    return stage.replace({**changes, **({"unknown": ", ".join(listed)} if listed else {})})


def with_origins(text: str, origins: Mapping[str, str]) -> str:
    """Return the text of a stage file with a comment on the origin of each key."""
    lines, table = [], ""
    for line in text.splitlines():
        key = f"{table}.{line.partition(' = ')[0]}"
        if line.startswith("["):
            table = line.strip("[]")
        lines.append(f"{line}  # {origins[key]}" if key in origins and " = " in line else line)
    return "\n".join(lines) + "\n"


def estimate_text(estimate: Estimate) -> str:
    """Write an estimate for a stage file: "20.4 N +/- 0.1 N", or a range "1 N .. 2.5 N"."""
    unit = f" {estimate.unit}" if estimate.unit else ""
    if not estimate.determined:
        return written((estimate.low, estimate.high), estimate.unit)
    half, digits = round_uncertainty(estimate.half_width)
    value = f"{round(estimate.value, digits) + 0.0:.{max(digits, 0)}f}"  # + 0.0: no minus before a zero
    return f"{value}{unit} +/- {half}{unit}"


def round_uncertainty(half: float) -> tuple[str, int]:
    """Round an uncertainty up, to two digits; return its text and its number of decimal places.

    The number is negative if tens, hundreds and so on are the last digit.
    """
    digits = identification_settings.digits_of_an_uncertainty - 1 - math.floor(math.log10(half))
    up = math.ceil(round(half * 10**digits, 6)) / 10**digits
    return (f"{up:.{digits}f}" if digits > 0 else f"{up:.0f}"), digits
