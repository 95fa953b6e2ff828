"""Write the identified stage file: the estimates in the given stage, or in a stage assumed for a log.

Its keys take only estimates that are within their bounds, and consistent with each other.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.axis import LINEAR
from friso.equations.controllers.pid import controller_table
from friso.errors import InputError
from friso.identification.estimate import DIGITS_OF_AN_UNCERTAINTY, Estimate
from friso.identification.inverse_model import InverseModel, moved_in
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import HIGHEST_FRICTION_RATIO
from friso.intervals import uncertain_value
from friso.quantities import Number, Quantity
from friso.stage import Stage
from friso.stage.contacts import usual_ranges, written
from friso.stage.stage import numeric_keys

NOT_IDENTIFIED = "not identified: all that is possible"

CHOSEN = "our choice, not identified"

FOLLOWS = "not identified, moved along with"

OUR_CHOICE = "what was identified says so beside its value; the rest is our choice"

PLACEHOLDER = (
    "The [controller] of the stage file is our choice: put yours there, and delete this note and the controller from "
    "the list of what is unknown, before you ask whether the stage hunts."
)


BEND_OF_MADE_UP_BRISTLES = 5e-6  # [m]
"""Deflection of the bristles of a stage made up for a log (friso's choice)."""

MADE_UP_STRIBECK_VELOCITY = 1e-3  # [m/s]
"""Stribeck velocity of a stage made up for a log (friso's choice)."""


def made_up(log: Log, inverse: InverseModel) -> Stage:
    """Make a stage with assumed values for a log without a stage file.

    The stage has one rigid mass, LuGre friction without Stribeck effect, a controller chosen by friso, and a move as
    fast as the log's fastest motion.
    """
    mass, coulomb = (max(inverse.value(name), 1e-6) for name in ("mass", "coulomb"))
    viscous, stiffness = max(inverse.value("viscous"), 0.0), coulomb / BEND_OF_MADE_UP_BRISTLES
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
            "stribeck_velocity": f"{MADE_UP_STRIBECK_VELOCITY:g} {axis.length}/s",
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
    digits = DIGITS_OF_AN_UNCERTAINTY - 1 - math.floor(math.log10(half))
    up = math.ceil(round(half * 10**digits, 6)) / 10**digits
    return (f"{up:.{digits}f}" if digits > 0 else f"{up:.0f}"), digits


STATIC, COULOMB = "friction.static", "friction.coulomb"

ADDED = ("bias.cart", "bias.stage", "friction.viscous_asymmetry")
"""Keys that identification may add to a stage file."""


@dataclass(frozen=True)
class Fitting:
    """Estimates that the stage file can take together.

    `follows` has keys that change with another key (full correlation), and `notes` a sentence for each estimate that
    was changed or dropped. The keys `left` keep their values in the stage file, although logs should have shown them.
    """

    estimates: tuple[Estimate, ...]
    follows: Mapping[str, str]
    notes: tuple[str, ...]
    left: tuple[str, ...] = ()


def fitting(stage: Stage, estimates: Sequence[Estimate]) -> Fitting:
    """Choose the estimates that the stage file can take, one per key, in its units."""
    flat, notes = stage.flat(), []
    estimates = [replace(estimate, unit=stage.axis_kind.unit(estimate.unit)) for estimate in estimates]
    fields = numeric_keys({**flat, "bias.cart": 0.0})
    accepted: dict[str, Estimate] = {}
    for estimate in estimates:
        field = fields.get(estimate.name) if estimate.name in (*flat, *ADDED) else None
        if field is None:
            notes += [f"{estimate.name}: the stage has no such key, it is left out"] if estimate.determined else []
            continue
        bounded = _bounded(estimate, stage, estimates)
        accepted_estimate, why = _within(bounded, field)
        if not why and bounded.high < estimate.high:
            why = f"the upper end {bounded.high:.4g} {estimate.unit} is from what was known beforehand"
        notes += [f"{estimate.name}: {why}"] if why else []
        if accepted_estimate is not None:
            accepted[estimate.name] = accepted_estimate
    follows = _static_above(stage, fields, accepted, notes)
    together = _together(stage, accepted, notes)
    left = tuple(name for name in flat if name in {estimate.name for estimate in estimates} - accepted.keys())
    return Fitting(together, {k: v for k, v in follows.items() if k in accepted}, tuple(notes), left)


def shared_masses(total: Estimate, stage: Stage) -> tuple[Estimate, ...]:
    """Divide the total mass among the stage's masses in the stage file's proportion."""
    masses = {f"masses.{name}": value for name, value in stage.masses if value is not None}
    method = f"{total.method}, shared as in the stage file"
    shares = {key: value / sum(masses.values()) for key, value in masses.items()}
    return tuple(replace(total.scaled(share), name=key, unit="kg", method=method) for key, share in shares.items())


def _bounded(estimate: Estimate, stage: Stage, estimates: Sequence[Estimate]) -> Estimate:
    """Narrow an estimate without a value to the range that the stage file states.

    If static friction has only a lower bound, above the stage's value and Coulomb friction, the highest plausible ratio
    to Coulomb friction bounds it from above. Coulomb friction is taken from the `estimates`, or else from the stage.
    """
    before = stage.uncertain().get(estimate.name)
    if before is not None and not estimate.determined and before.high >= estimate.low and before.low <= estimate.high:
        estimate = replace(estimate, low=max(estimate.low, before.low), high=min(estimate.high, before.high))
    if estimate.name != STATIC or not np.isfinite(estimate.low) or np.isfinite(estimate.high):
        return estimate
    flat = stage.flat()
    coulomb = next((candidate for candidate in estimates if candidate.name == COULOMB and candidate.determined), None)
    value, high = (coulomb.value, coulomb.high) if coulomb else (flat[COULOMB], flat[COULOMB])
    top = HIGHEST_FRICTION_RATIO * value
    # a bound equal to Coulomb friction adds nothing: static friction then follows Coulomb friction
    return replace(estimate, high=top) if max(flat[STATIC], high) < estimate.low < top else estimate


SHARE_OF_A_LEAST_VALUE = 1e-3
"""Lower end of a range that would otherwise reach 0, relative to its upper end."""


def _within(estimate: Estimate, field: Quantity | Number) -> tuple[Estimate | None, str]:
    """Restrict an estimate to the limits of its key; return it, or None if that is impossible.

    The second result is the reason for a change, or "". The estimate must have finite ends.
    """
    if not np.isfinite([estimate.low, estimate.high]).all():
        ends = [f"{word} {end:.4g} {estimate.unit}".rstrip() for word, end in _ends(estimate)]
        knowledge = f"known only to be {' and '.join(ends)}"
        return None, knowledge if ends else ""
    if not estimate.high > estimate.low:
        return None, "its uncertainty is not known, the stage file keeps its value"
    if not (field.bound.holds(estimate.low) or field.bound.holds(estimate.high)):
        ends = f"{estimate.low:.4g} to {estimate.high:.4g} {estimate.unit}".rstrip()
        return None, f"{ends} is all that is known, the stage file keeps its value: it has to be {field.bound.text}"
    if _allowed(estimate, field):
        return estimate, ""
    low = SHARE_OF_A_LEAST_VALUE * estimate.high
    cut = replace(estimate, value=np.nan, low=low, reason=estimate.reason or f"it has to be {field.bound.text}")
    limits = f"{estimate_text(estimate)} was found, but it has to be {field.bound.text}"
    if estimate.low < low and _allowed(cut, field):
        return cut, f"{limits}: the stage file has {estimate_text(cut)}, from a thousandth of the upper end on"
    return None, f"{limits}: the stage file keeps its value"


def _ends(estimate: Estimate) -> list[tuple[str, float]]:
    """List the finite ends of an estimate's interval, each as ("at least" or "at most", value)."""
    return [(word, end) for word, end in (("at least", estimate.low), ("at most", estimate.high)) if np.isfinite(end)]


def _allowed(estimate: Estimate, field: Quantity | Number) -> bool:
    """Tell whether the key accepts the estimate as written in a stage file."""
    try:
        uncertain_value(estimate_text(estimate), field)
    except InputError:
        return False
    return True


def _static_above(
    stage: Stage, fields: Mapping[str, Quantity | Number], estimates: dict[str, Estimate], notes: list[str]
) -> dict[str, str]:
    """Change `estimates` so that static friction is no smaller than Coulomb friction.

    A range of static friction is cut from below. Otherwise static friction follows an estimate of Coulomb friction, or
    else Coulomb friction follows static friction, in the stage's ratio. Returns which key follows which, {} if neither
    does; `notes` get a sentence on each change.
    """
    flat = stage.flat()
    if STATIC not in flat or not estimates.keys() & {STATIC, COULOMB}:
        return {}
    centre = {
        key: float(uncertain_value(estimate_text(estimates[key]), fields[key]) if key in estimates else flat[key])
        for key in (STATIC, COULOMB)
    }
    if centre[STATIC] >= centre[COULOMB]:
        return {}
    static = estimates.get(STATIC)
    if static is not None and not static.determined and centre[COULOMB] < static.high:
        estimates[STATIC] = replace(static, low=centre[COULOMB])
        now = estimate_text(estimates[STATIC])
        notes.append(f"{STATIC}: no smaller than Coulomb friction, the stage file has {now}")
        return {}
    leads, follows = (COULOMB, STATIC) if COULOMB in estimates else (STATIC, COULOMB)
    ratio, lead = flat[follows] / flat[leads], estimates[leads]
    remark = f" ({estimate_text(estimates[follows])} was found)" if follows in estimates else ""
    estimates[follows] = replace(lead.scaled(ratio), name=follows)
    why = f"Coulomb friction would be above static friction otherwise{remark}"
    notes.append(f"{follows}: moved along with {leads} to {estimate_text(estimates[follows])}, since {why}")
    return {follows: leads}


def _together(stage: Stage, estimates: dict[str, Estimate], notes: list[str]) -> tuple[Estimate, ...]:
    """Return the estimates with which the stage file is valid.

    A key that breaks a rule of the stage file is removed from `estimates`, and `notes` say so.
    """
    units = [[key for key in (COULOMB, STATIC) if key in estimates]]
    units += [[key] for key in estimates if key not in (COULOMB, STATIC)]
    fine: list[Estimate] = []
    for unit in units:
        try:
            identified_stage(stage, [*fine, *(estimates[key] for key in unit)], ())
        except InputError as error:
            for key in unit:
                del estimates[key]
            notes.append(f"{', '.join(unit)}: left out, since the stage file takes {error.expected}")
            continue
        fine += [estimates[key] for key in unit]
    return tuple(fine)
