"""Isolator or firmware, in words: what the options are, the tables, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from friso.equations.bandwidth import bandwidth
from friso.evidence import value
from friso.frequency.crossover import WANTED
from friso.studies.compare.options import JOINT, MODEL_ERROR, Option
from friso.studies.compare.statistics import EstimatedValue
from friso.studies.compare.study import ENOUGH, FOLLOWED, LONGER, Comparison, Paired, Result
from friso.studies.shares import Share
from friso.views.drawing.prefixes import NOTHING, listed, range_with_unit, with_unit

COLUMNS = (
    "Swings at the end",
    "Counts a distinct peak",
    "In position at the end",
    "Stays there later",
    "Settling time",
    "In-position RMS",
    "Force RMS",
    "Modulus margin",
)

PAIRED = ("Swings more often by", "In position sooner, later, alike", "In-position RMS times", "Force RMS times")

UNSHAKEN = "not compared: no [floor]"

Row = tuple[str, list[str]]


def label(result: Result) -> str:
    return f"{result.letter} {result.option.name}"


def options_rows(found: Comparison) -> list[tuple[str, str]]:
    """What each option is."""
    return [(label(result), _about(result.option, found)) for result in found.results]


def _about(option: Option, found: Comparison) -> str:
    joint = "the joint free" if option.letter in JOINT else "the joint locked" if found.stage.joint else "no joint"
    deadband = with_unit(found.options.deadband, "m")
    what = {
        "a": "the controller as in the file",
        "b": _bandwidth(option, found),
        "c": "the controller as in the file",
        "d": f"the integrator pauses while the error is below {deadband}",
        "e": "the integrator is reset where the error changes sign",
        "f": f"feedforward of Coulomb and viscous friction, both {100 * MODEL_ERROR:g} % too large or both too small, "
        "drawn for each machine",
        "g": _bandwidth(option, found),
    }
    return f"{joint}; {what[option.letter]}"


def _bandwidth(option: Option, found: Comparison) -> str:
    own = bandwidth(found.stage.flat())
    faster = f"a controller {option.factor:.3g} times as fast"
    if own is not None:
        raised, before = with_unit(own * option.factor, "Hz"), with_unit(own, "Hz")
        faster = f"a {found.stage.controller.bandwidth_name} of {raised} instead of {before}"
    return f"{faster}, the highest at which the machine of the file keeps a modulus margin of {WANTED:g}"


def table_rows(found: Comparison) -> list[Row]:
    """A row for each option, its texts under `COLUMNS`; 95 % intervals in brackets."""
    return [
        (
            label(each),
            [
                *(percent(share) for share in (each.swinging, each.counted, each.settled, each.stays)),
                _time(each.settling),
                *(_length(value, unit) for value, unit in ((each.in_position, "m"), (each.force, "N"))),
                _margin(each, found),
            ],
        )
        for each in found.results
    ]


def paired_rows(found: Comparison) -> list[Row]:
    """A row for each option but a, its texts under `PAIRED`."""
    rows = []
    for each in found.results[1:]:
        pair = found.paired(each)
        points = [100 * value for value in (pair.swinging.value, pair.swinging.low, pair.swinging.high)]
        more = f"{points[0]:+.1f} points ({points[1]:+.1f} to {points[2]:+.1f})"
        still = _ratio(pair.in_position) if found.shaken else UNSHAKEN
        rows.append((label(each), [more, _when(pair), still, _ratio(pair.force)]))
    return rows


def _when(pair: Paired) -> str:
    shares = {"sooner": pair.sooner, "later": pair.later, "alike": pair.alike}
    return "; ".join(f"{word} {percent(share)}" for word, share in shares.items())


def percent(share: Share) -> str:
    middle = f"{_percent(share.probability)} %" if share.probability == share.probability else "unknown"
    return f"{middle} ({_percent(share.low)} to {_percent(share.high)} %)"


def _percent(part: float) -> str:
    """A percentage; one that is not 0 or 100 does not look like that."""
    digits = 1 if part in (0, 1) or 0.001 <= part <= 0.999 else 2
    return f"{100 * part:.{digits}f}"


def _time(found: EstimatedValue) -> str:
    """A median of settling times, of which more than half may never come."""
    if math.isfinite(found.high):
        return f"{with_unit(found.value, 's')} ({range_with_unit(found.low, found.high, 's')})"
    middle, low = ("never" if value == math.inf else with_unit(value, "s") for value in (found.value, found.low))
    return middle if middle == low else f"{middle} ({low} to never)"


def _length(found: EstimatedValue, unit: str) -> str:
    if not all(map(math.isfinite, (found.value, found.low, found.high))):
        return NOTHING
    return f"{with_unit(found.value, unit)} ({range_with_unit(found.low, found.high, unit)})"


def _ratio(found: EstimatedValue) -> str:
    if not all(map(math.isfinite, (found.value, found.low, found.high))):
        return NOTHING
    return f"{found.value:.3g} ({found.low:.3g} to {found.high:.3g})"


def _margin(result: Result, found: Comparison) -> str:
    least = f"least {result.loops.margin.min():.2f}"
    if result.unstable:
        least = f"{result.unstable} of {found.machines.count} not stable"
    return f"{result.margin.value:.2f} ({least})"


def sentences(found: Comparison) -> list[str]:
    """What follows for the one who has to choose between a joint and settings."""
    return [_who_rests(found), *_costs(found), *_others(found), _choice(found), *_standstill(found)]


def _who_rests(found: Comparison) -> str:
    count, settling = found.machines.count, _resting(found)
    within = f"within {with_unit(found.within, 'm')}"
    some = min(FOLLOWED, count)
    if not settling:
        best = max(found.results, key=lambda each: each.in_position_count)
        return (
            f"No option brings {100 * ENOUGH:g} % of the {count} machines into position {within} and keeps them "
            f"there: {label(best)} has the most in position at the end, {percent(best.settled)}."
        )
    parts = [f"{label(each)} {_how_many(each, count)}" for each in settling]
    return (
        f"Of {count} machines are in position {within} at the end: {listed(parts, 'and')}; of {some} that were "
        f"followed {LONGER} times as long at least {100 * ENOUGH:g} % stay there."
    )


def _how_many(result: Result, count: int) -> str:
    number = "all" if result.in_position_count == count else str(result.in_position_count)
    return f"{number} (95 %: at least {_percent(result.settled.low)} %)"


def _costs(found: Comparison) -> list[str]:
    """The price of each option that brings the machines to rest."""
    own = found.results[0].margin.value
    return [
        f"{label(each)}: in position in {with_unit(each.settling.value, 's')} (median), {_still(each, found)}takes "
        f"{found.paired(each).force.value:.3g} times the force RMS of a, and has a modulus margin of "
        f"{each.margin.value:.2f} instead of {own:.2f}{_robust(each, found)}."
        for each in _resting(found)
        if each.letter != "a"
    ]


def _still(result: Result, found: Comparison) -> str:
    return f"stands still to {with_unit(result.in_position.value, 'm')} RMS, " if found.shaken else ""


def _standstill(found: Comparison) -> list[str]:
    """Why standstill is no part of the conclusions."""
    if found.shaken:
        return []
    joint = (
        " On the thesis's rig, with a quiet floor and amplifier noise, the stage on its free joint moves "
        f"{value('rig.in-position', 'rms_ratio'):.2g} times as much (RMS) as with the joint locked "
        "(friso rig in-position)."
    )
    return [
        "Standstill is not compared: the stage file has no [floor]. In-position RMS is then that of a "
        "machine that nothing shakes from outside; it shows whether the machine is at rest, not how still it would "
        "stand in a real room." + (joint if any(each.letter in JOINT for each in found.results) else "")
    ]


def _robust(result: Result, found: Comparison) -> str:
    if result.unstable:
        return f"; the linear loop of {result.unstable} of {found.machines.count} machines is not stable"
    return f", {result.loops.margin.min():.2f} in the worst machine"


def _others(found: Comparison) -> list[str]:
    """What the machines do at the end with the other options."""
    return [
        f"{label(each)} does not bring them to rest: {percent(each.swinging)} swing at the end, "
        f"{percent(each.settled)} are in position then, and {percent(each.stays)} stay there later."
        for each in found.results
        if not each.rests
    ]


def _choice(found: Comparison) -> str:
    settling = _resting(found)
    joint, settings = ([each for each in settling if (each.letter in JOINT) is bought] for bought in (True, False))
    if joint and settings:
        return (
            f"On these machines controller settings achieve what a joint achieves: {_names(settings)} brings them to "
            f"rest without one, {_names(joint)} with one. The joint is for machines on which those settings are not "
            "possible."
        )
    if joint:
        return f"On these machines only the joint brings them to rest: {_names(joint)}; no setting alone does."
    if settings:
        said = "and no option with a joint does" if any(each.letter in JOINT for each in found.results) else ""
        return f"On these machines controller settings suffice: {_names(settings)}{', ' + said if said else ''}."
    return (
        "On these machines neither a joint nor controller settings bring enough of them to rest: see the table for "
        "what each achieves."
    )


def _names(some: Sequence[Result]) -> str:
    return listed([label(each) for each in some], "or")


def _resting(found: Comparison) -> list[Result]:
    return [each for each in found.results if each.rests]


def population(found: Comparison) -> list[str]:
    """How the machines were drawn."""
    machines = found.machines
    says = [
        f"{machines.count} machines drawn with seed {found.seed}, each the same in all options: parameters, rail, "
        "noise."
    ]
    if machines.from_file:
        says.append(f"Uncertain as the file says: {', '.join(machines.from_file)}.")
    if machines.spreads:
        spreads = ", ".join(f"{key} ±{spread:g} %" for key, spread in machines.spreads.items())
        says.append(f"With default spreads (95 % of the machines) because the file gives none: {spreads}.")
    if "rail.seed" in machines.keys:
        says.append("Each has its own rail.")
    return says
