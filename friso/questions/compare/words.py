"""Describe the options, write their tables, and say which to choose: isolator or firmware."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from friso.axis import axis_shown
from friso.equations.bandwidth import bandwidth
from friso.evidence import value
from friso.frequency.crossover import COMFORTABLE_MARGIN
from friso.quantities import percent, plain_factor
from friso.shown.drawing.prefixes import (
    NOTHING,
    length_at_rest,
    listed,
    percentage,
    range_with_unit,
    share_with_interval,
    with_unit,
)
from friso.shown.machine_words import spread_sentences
from friso.shown.says import Alternatives, Words, always, say
from friso.stage import ControllerSection
from friso.stage.controllers import AgainstFriction
from friso.stage.section import numeric_fields
from friso.studies.compare.measures import EstimatedValue
from friso.studies.compare.options import MODEL_ERROR, Option, rejection
from friso.studies.compare.study import (
    ENOUGH_SHARE,
    FOLLOWED_MACHINES,
    LONGER_FACTOR,
    Comparison,
    OptionResult,
)

COLUMNS = (
    "Swings at the end",
    "With a distinct peak",
    "In position at the end",
    "In position in the longer run",
    "Settling time",
    "In-position RMS",
    "RMS of the {effort}",
    "Modulus margin",
)

PAIRED = (
    "Swinging, difference",
    "In position sooner",
    "In position later",
    "No difference",
    "RMS of the {effort}, ratio",
)

STANDSTILL = "In-position RMS, ratio"
"""Column that is there if a floor shakes the machines."""

PairedRow = tuple[str, list[str]]


def label(result: OptionResult) -> str:
    """Return the label of an option, with its letter."""
    return result.option.label


def in_prose(option: Option) -> str:
    """Name an option with its letter, to stand within a sentence."""
    kind = option.kind
    return f"{kind.prose or f'the {kind.title}'} ({kind.letter})"


def named(result: OptionResult) -> str:
    """Name the option of a result with its letter, to stand within a sentence."""
    return in_prose(result.option)


def options_rows(comparison: Comparison) -> list[tuple[str, str]]:
    """Return a row for each option: its label, and its joint and controller in words."""
    return [(label(result), _about(result.option, comparison)) for result in comparison.results]


def _about(option: Option, comparison: Comparison) -> str:
    """Return what an option is: joint, and controller or setting with its numbers."""
    joint = "the joint free" if option.kind.joint else "the joint locked" if comparison.stage.joint else "no joint"
    flat = option.stage.flat()
    keys = {name: (ControllerSection.key(name), field.unit) for name, field in numeric_fields(AgainstFriction).items()}
    texts = {name: with_unit(flat[key], unit).strip() for name, (key, unit) in keys.items() if key in flat}
    texts |= {"deadband": with_unit(comparison.options.deadband, "m"), "model_error": percent(MODEL_ERROR)}
    texts |= {"faster": _bandwidth(option, comparison)}
    if numbers := rejection(flat):
        texts |= {"rejection_bandwidth": with_unit(numbers.bandwidth, "Hz")}
        texts |= {"observer_ratio": f"{numbers.observer_ratio:g}"}
    return f"{joint}; {option.kind.says.format_map(texts)}"


def _bandwidth(option: Option, comparison: Comparison) -> str:
    """Say how much faster the controller of an option is, and why no faster."""
    present = bandwidth(comparison.stage.flat())
    faster = f"a controller {plain_factor(option.factor)} times as fast"
    if present is not None:
        raised, before = with_unit(present * option.factor, "Hz"), with_unit(present, "Hz")
        faster = f"a {comparison.stage.controller.bandwidth_name} of {raised} instead of {before}"
    limit = comparison.bandwidth_limit
    below = "" if limit is None else f" and a bandwidth of at most {with_unit(limit, 'Hz')}"
    return (
        f"{faster}, the highest at which the machine of the file has a modulus margin of {COMFORTABLE_MARGIN:g}{below}"
    )


def table_rows(comparison: Comparison) -> list[PairedRow]:
    """Return one row for each option, with its texts under `COLUMNS`.

    Brackets hold 95 % intervals.
    """
    return [
        (
            label(result),
            [
                *(share_with_interval(share) for share in (result.swinging, result.counted, result.settled)),
                share_with_interval(result.stays) if result.later.done.size else NOTHING,
                _time(result.settling),
                _at_rest(result.in_position),
                _force(result.force),
                _margin(result, comparison),
            ],
        )
        for result in comparison.results
    ]


def paired_rows(comparison: Comparison) -> list[PairedRow]:
    """Return one row for each option except a, the first, with its texts under `PAIRED`.

    A shaking floor adds the text under `STANDSTILL`. Each machine is compared with itself under option a.
    """
    rows = []
    for result in comparison.results[1:]:
        pair = comparison.paired(result)
        points = [100 * value for value in (pair.swinging.value, pair.swinging.low, pair.swinging.high)]
        more = f"{points[0]:+.1f} points ({points[1]:+.1f} to {points[2]:+.1f})"
        standstill = [_ratio(pair.in_position)] if comparison.shaken else []
        when = [share_with_interval(share) for share in (pair.sooner, pair.later, pair.alike)]
        rows.append((label(result), [more, *when, _ratio(pair.force), *standstill]))
    return rows


def _time(median: EstimatedValue) -> str:
    """Write a median settling time with its interval; "never" if most machines do not settle."""
    if math.isfinite(median.high):
        return f"{with_unit(median.value, 's')} ({range_with_unit(median.low, median.high, 's')})"
    middle, low = ("never" if value == math.inf else with_unit(value, "s") for value in (median.value, median.low))
    return middle if middle == low else f"{middle} ({low} to never)"


def _at_rest(median: EstimatedValue) -> str:
    """Write a median length [m] at standstill with its interval."""
    if not _is_known(median):
        return NOTHING
    middle, low, high = map(length_at_rest, (median.value, median.low, median.high))
    return middle if low == high else f"{middle} ({low} to {high})"


def _force(median: EstimatedValue) -> str:
    """Write a median force [N] with its interval."""
    if not _is_known(median):
        return NOTHING
    return f"{with_unit(median.value, 'N')} ({range_with_unit(median.low, median.high, 'N')})"


def _is_known(median: EstimatedValue) -> bool:
    """Tell whether a median and its interval are finite."""
    return all(map(math.isfinite, (median.value, median.low, median.high)))


def _ratio(median: EstimatedValue) -> str:
    """Write a median ratio with its interval."""
    if not _is_known(median):
        return NOTHING
    return f"{median.value:.3g} ({median.low:.3g} to {median.high:.3g})"


def _margin(result: OptionResult, comparison: Comparison) -> str:
    """Write an option's modulus margin, and the least of all machines or how many are unstable."""
    least = f"least {result.loops.margin.min():.2f}"
    if result.unstable:
        least = f"{result.unstable} of {comparison.machines.count} not stable"
    return f"{result.margin.value:.2f} ({least})"


def sentences(comparison: Comparison) -> list[str]:
    """Return all sentences for the choice between a joint and settings, the answer first."""
    return [*answer(comparison), *details(comparison)]


def answer(comparison: Comparison) -> list[str]:
    """Say in at most three sentences whether to buy a joint, what the best option brings, and from which bandwidth."""
    return say(comparison, _SAYS, _WORDS)[:3]


def details(comparison: Comparison) -> list[str]:
    """Say which options bring the machines to rest and at what cost, how the others do, and what is not compared."""
    further = [*brought(comparison), *_performance(comparison), *_failing(comparison), *_standstill(comparison)]
    return [*say(comparison, _SAYS, _WORDS)[3:], *further]


def brought(comparison: Comparison) -> list[str]:
    """Say for every option that brings the machines to rest how many it brings there, and at what cost."""
    resting, count = _resting(comparison), comparison.machines.count
    says = [f"{named(result)}: {_number(result, count)} at rest{_cost(result, comparison)}" for result in resting]
    return [f"{text[:1].upper()}{text[1:]}." for text in says] + [text for text in [_too_late(resting)] if text]


def _too_late(resting: Sequence[OptionResult]) -> str:
    """Say with which options too many machines miss the far end of their motion in time, and how many are there.

    The text is empty if there is no such option.
    """
    there = [(result, float(np.isfinite(result.measures.settling).mean())) for result in resting]
    late = [f"{percent(fraction, 3)} with {named(result)}" for result, fraction in there if fraction < ENOUGH_SHARE]
    return f"At the far end, before the reference returns, {listed(late, 'and')} are in position." if late else ""


def _number(result: OptionResult, count: int) -> str:
    """Write how many of the machines (`count`) are in position at the end with an option."""
    return f"all {count}" if result.in_position_count == count else f"{result.in_position_count} of {count}"


def _cost(result: OptionResult, comparison: Comparison) -> str:
    """Write an option's force over that of option a, the first, and its modulus margins.

    The text is empty for option a itself.
    """
    if result is comparison.results[0]:
        return ""
    loops = f"modulus margin {result.margin.value:.2f}, least {result.loops.margin.min():.2f}"
    if result.unstable:
        loops = f"the linear loop is unstable on {result.unstable} of {comparison.machines.count}"
    return f" ({plain_factor(comparison.paired(result).force.value)} times the {axis_shown().effort} RMS of a; {loops})"


def _resting(comparison: Comparison) -> list[OptionResult]:
    """Return the options that bring enough machines to rest."""
    return [result for result in comparison.results if result.rests]


def _joints(comparison: Comparison) -> list[OptionResult]:
    """Return the options with a joint that bring the machines to rest."""
    return [result for result in _resting(comparison) if result.option.kind.joint]


def _settings(comparison: Comparison) -> list[OptionResult]:
    """Return the options without a joint that bring the machines to rest."""
    return [result for result in _resting(comparison) if not result.option.kind.joint]


def _first(comparison: Comparison) -> OptionResult:
    """Return the option that the answer describes: the first that brings the machines to rest, or else the best."""
    best = max(comparison.results, key=lambda result: result.in_position_count)
    preferred = _settings(comparison) or _resting(comparison) or [best]
    return preferred[0]


def _others(comparison: Comparison) -> list[OptionResult]:
    """Return the options that bring the machines to rest at their present bandwidth."""
    return [result for result in _resting(comparison) if result.option.factor == 1.0]


def _at_one_bandwidth(comparison: Comparison) -> bool:
    """Tell whether a faster controller brings the machines to rest at a bandwidth, and fails again at a higher one."""
    needed, least = comparison.needed, comparison.turning
    if needed is None or least is None:
        return False
    at = needed.turning(ENOUGH_SHARE)
    return at is None or bool(needed.bandwidths[at] > least)


_WORDS: Words[Comparison] = {
    "left": lambda of: listed([in_prose(option) for option in of.not_run], "and"),
    "unstable": lambda of: str(of.results[0].unstable),
    "count": lambda of: str(of.machines.count),
    "none": lambda of: "none of these options" if of.not_run else "no option",
    "share": lambda of: percent(ENOUGH_SHARE),
    "within": lambda of: with_unit(of.within, "m"),
    "settings": lambda of: _times(_settings(of)),
    "joints": lambda of: _times(_joints(of)),
    "option": lambda of: named(_first(of)),
    "number": lambda of: _number(_first(of), of.machines.count),
    "force": lambda of: plain_factor(of.paired(_first(of)).force.value),
    "effort": lambda of: axis_shown().effort,
    "margin": lambda of: f"{_first(of).margin.value:.2f}",
    "swinging": lambda of: str(int(np.count_nonzero(of.results[0].measures.swings))),
    "in_the_end": lambda of: "" if np.isfinite(of.results[0].settling.value) else " to come to rest in the end",
    "turning": lambda of: with_unit(of.turning, "Hz"),
    "highest": lambda of: with_unit(float(of.needed.bandwidths[-1]), "Hz") if of.needed else "",
    "others": lambda of: _names(_others(of)) or "something else",
}

_SAYS: Sequence[Alternatives[Comparison]] = (
    (
        (
            lambda of: of.not_run,
            "Interrupted: this is the answer of the options that were run, without {left}.",
        ),
        (
            lambda of: of.results[0].unstable,
            "As it is, the loop is unstable on {unstable} of {count} machines, whatever the friction: retune the "
            "controller (friso bode).",
        ),
    ),
    (
        (
            lambda of: not _resting(of),
            "{none} brings {share} of the {count} machines to rest within {within}; the best is {option}, with "
            "{number} in position at the end, and as is (a) {swinging} swing.",
        ),
        (lambda of: of.not_run, ""),
        (lambda of: of.results[0].rests, "These machines need neither a joint nor other settings{in_the_end}."),
        (
            lambda of: _joints(of) and _settings(of),
            "Controller settings do here what a joint does, and no joint is needed: half of the machines are in "
            "position {settings}, and {joints}.",
        ),
        (_joints, "Only a joint brings these machines to rest, half of them {joints}. No setting does so alone."),
        (
            lambda of: any(result.option.kind.joint for result in of.results),
            "Controller settings suffice, a joint does not: half of the machines are in position {settings}.",
        ),
        (always, "Controller settings suffice: half of the machines are in position {settings}."),
    ),
    (
        (lambda of: of.results[0].rests, ""),
        (
            _resting,
            "As is (a), {swinging} of {count} machines swing at the end; {option} brings {number} to rest within "
            "{within}, at {force} times the {effort} RMS and with a modulus margin of {margin}.",
        ),
    ),
    (
        (lambda of: of.needed is None or of.results[0].rests, ""),
        (
            _at_one_bandwidth,
            "A faster controller alone brings them to rest at a bandwidth of {turning}, where the loop last crosses 0 "
            "dB, but not at all higher ones; a drive limited to less needs {others}.",
        ),
        (
            lambda of: of.turning is not None,
            "A faster controller alone brings them to rest from a bandwidth of {turning} on, where the loop last "
            "crosses 0 dB; a drive limited to less needs {others}.",
        ),
        (
            always,
            "The controller alone does not bring {share} of the machines to rest at any bandwidth up to {highest}.",
        ),
    ),
)
"""Sentences on what to choose, what it brings and costs, and from which bandwidth on a faster controller is enough."""


def _performance(comparison: Comparison) -> list[str]:
    """Say how fast each successful option is, how still machines stand, and how sure that is.

    The list is empty if no option brings the machines to rest.
    """
    resting, followed = _resting(comparison), min(FOLLOWED_MACHINES, comparison.machines.count)
    lines = [
        f"{label(result)}: in position in {with_unit(result.settling.value, 's')} "
        f"(median){_still(result, comparison)}; at least {percentage(result.settled.low)} % of such machines come to "
        "rest (95 % confidence)."
        for result in resting
    ]
    longer = (
        f"Of {followed} machines followed {LONGER_FACTOR} times as long, {percent(ENOUGH_SHARE)} or more stay at "
        "rest with "
    )
    return [*lines, f"{longer}{listed([result.letter for result in resting], 'and')}."] if lines else []


def _still(result: OptionResult, comparison: Comparison) -> str:
    """Write how still machines stand, as an RMS [m], if the floor shakes; empty otherwise."""
    return f", stands still to {length_at_rest(result.in_position.value)} RMS" if comparison.shaken else ""


def _failing(comparison: Comparison) -> list[str]:
    """Say what the machines finally do with the options that fail."""
    return [
        f"{label(result)}: not enough. {share_with_interval(result.swinging)} of the machines swing at the end and "
        f"{share_with_interval(result.settled)} are in position."
        for result in comparison.results
        if not result.rests
    ]


def _standstill(comparison: Comparison) -> list[str]:
    """Say why standstill plays no part in the conclusions, if the floor is still."""
    if comparison.shaken:
        return []
    joint = (
        " On the thesis's rig, with a quiet floor and amplifier noise, the stage on its free joint moves "
        f"{value('rig.in-position', 'rms_ratio'):.2g} times as much (RMS) as with the joint locked "
        "(friso rig in-position)."
    )
    bought = any(result.option.kind.joint for result in comparison.results)
    return [f"Standstill is not compared: the stage file has no [floor].{joint if bought else ''}"]


def _names(results: Sequence[OptionResult]) -> str:
    """Join the names of options by "or"."""
    return listed([named(result) for result in results], "or")


def _times(results: Sequence[OptionResult]) -> str:
    """Join the median settling times of options, each with the name of its option."""
    return listed([f"{_soon(result.settling.value)} with {named(result)}" for result in results], "or")


def _soon(median: float) -> str:
    """Write a median settling time [s]; it is infinite where most machines are late at the far end of their move."""
    return f"in {with_unit(median, 's')}" if math.isfinite(median) else "only in the end"


def population(comparison: Comparison) -> list[str]:
    """Say how the machines were drawn: how many, and how far each key spreads."""
    machines = comparison.machines
    lines = [
        f"{machines.count} machines were drawn with seed {comparison.seed}; each has the same parameters, rail and "
        "noise in all options."
    ]
    lines += spread_sentences(machines.from_file, machines.spreads)
    if "rail.seed" in machines.keys:
        lines.append("Every machine has a different rail.")
    return lines
