"""Describe the remedies in words.

The sentences say what to change, what the change brings and costs, and which remedies fail and why.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from friso.axis import axis_shown
from friso.design_method.spec import Geometry
from friso.equations.bandwidth import breakaway, least_breakaway
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import Mechanism
from friso.platform.installed import install
from friso.quantities import Quantity, percent, positive
from friso.questions.design.words import leaf_words
from friso.questions.tune.present_words import DOUBTS, as_it_is, moves_words
from friso.remedies.catalogue import (
    BANDWIDTH,
    FASTER_THAN_LEAST,
    FASTEST_UNASKED,
    MODE_SHARE,
    SAMPLING_SHARE,
    TYPED_DIGITS,
)
from friso.remedies.machines import Goal
from friso.remedies.method import Advice
from friso.remedies.search import TriedPoints
from friso.remedies.verified import Performance, RemedyOutcome
from friso.shown.text import (
    NOTHING,
    Alternatives,
    Words,
    always,
    digits_that_differ,
    listed,
    pretty,
    range_with_unit,
    say,
    say_all,
    share_with_interval,
    spread_sentences,
    unstable_where,
    with_unit,
)
from friso.stage import Stage, numeric_keys
from friso.stage.controllers import CONTROLLER, FORCE_LIMIT
from friso.stage.tables import leading_friction
from friso.virtual_rig.cures import Cure

COLUMNS = ("Set to", "Works", "95 % settle within", "Largest {effort}", "Modulus margin")

ABSENT = "never"

NONE_FOUND = "none was found that surely works"
"""Sentence on a remedy whose settings meet the goal for the machines of the search, but not surely for others."""

LOCKED = "joint.locked"


def time(seconds: float) -> str:
    """Write a settling time [s]; "never" if it is not finite."""
    return with_unit(seconds, "s") if math.isfinite(seconds) else ABSENT


def slowest_time(measured: Performance, goal: Goal) -> str:
    """Write the time in which enough machines are in position (`goal.share`), with its interval."""
    low, high = measured.slowest_interval(goal)
    alone = time(measured.slowest(goal))
    if not math.isfinite(low):
        return alone
    between = range_with_unit(low, high, "s") if math.isfinite(high) else f"{with_unit(low, 's')} or longer"
    if alone == ABSENT:
        return f"{between}, possibly {ABSENT}"
    return alone if between == alone else f"{alone} ({between})"


def changes(before: Stage, after: Stage) -> list[str]:
    """List the keys that differ, with their values before and after.

    Texts and removed keys are listed for the controller only.
    """
    old, new = before.flat(), after.flat()
    keys = numeric_keys(new)
    numbers = [
        _change(key, old.get(key), new[key], before, keys[key].unit) for key in new if _changes(key, old, new, keys)
    ]
    own = [key for key in {**new, **old} if key.startswith(f"{CONTROLLER}.")]
    words = [f'{key} = "{new[key]}"' for key in own if isinstance(new.get(key), str) and new[key] != old.get(key)]
    if old.get(LOCKED) and not new.get(LOCKED):
        words.append(f"{LOCKED} = false (was true)")
    return [*words, *numbers, *(f"{key} left out" for key in own if key not in new)]


def _changes(key: str, old: Mapping[str, Any], new: Mapping[str, Any], keys: Mapping[str, Any]) -> bool:
    """Tell whether a numeric key is new or has another value."""
    if key not in keys:
        return False
    return key not in old or not math.isclose(old[key], new[key], rel_tol=1e-9)


def _change(key: str, old: Any, new: float, before: Stage, unit: str) -> str:
    """Write a key with its new value and, if it had one, its old value; `unit` is that of SI."""
    text = f"{key} = {number(key, new, before, unit)}"
    return text if old is None else f"{text} (was {number(key, old, before, unit)})"


def number(key: str, value: float, before: Stage, unit: str) -> str:
    """Write the value of a key [unit] in the unit of the file `before`; a key that it lacks with a prefix that suits.

    The value has as many digits as tuned numbers have.
    """
    if not unit:
        return f"{value:.{TYPED_DIGITS}g}"
    if not before.unit_in_file(key):
        return with_unit(value, unit, TYPED_DIGITS)
    text, _, written = str(before.in_file_unit(key, value, TYPED_DIGITS)).partition(" ")
    return f"{float(text):.10g} {pretty(written)}"


def answer(tuning: Advice) -> list[str]:
    """Say in at most three sentences what to change, what the change brings and costs, and what remains open."""
    return say(tuning, _SAYS, _WORDS)[:3]


def explained(tuning: Advice) -> list[str]:
    """Say in full what the recommended changes are, bring and cost, what the goal is, and what is not known."""
    works = [text for outcome in tuning.recommended for text in _works(outcome, tuning, outcome.remedy.name)]
    return [*works, *say_all(tuning, _EXPLAINED, _WORDS)]


def _rest(tuning: Advice) -> str:
    """Say which remedies might work, and why that is not sure."""
    return " ".join(f"{outcome.remedy.name} might work, but {unsure_why(outcome)}." for outcome in _unsure(tuning))


def _unsure(tuning: Advice) -> list[RemedyOutcome]:
    """Return the remedies with settings that are not sure to work."""
    return [outcome for outcome in tuning.outcomes if outcome.certainty == "unsure" and outcome.stage is not None]


def _some_moves_alone(tuning: Advice) -> bool:
    """Tell whether the least change works for all moves, but not every remedy does."""
    least = tuning.least
    return least is not None and tuning.for_all_moves(least) and not all(map(tuning.for_all_moves, tuning.working))


def _modes_unknown(tuning: Advice) -> bool:
    """Tell whether neither the stage file nor the goal says what the modes of the machine allow."""
    return tuning.stage.parasitic is None and not tuning.stage.flexure and tuning.goal.bandwidth_limit is None


def cure_words(tuning: Advice, cure: Cure) -> str:
    """Say what to set in the drive, and where and when the machine as built then rests."""
    set_to, built = listed(changes(tuning.complete(tuning.stage), cure.stage), "and"), cure.built
    rests = "toggles by a count" if built.verdict == "toggles" else "rests"
    off = f" within {with_unit(built.rest_error, 'm')}" if built.rest_error else ""
    late = built.settled_after
    when = f", {with_unit(late, 's')} after the motion at the latest" if late and math.isfinite(late) else ""
    return f"{cure.kind} stops the hunting as built: set {set_to}; it then {rests}{off}{when}"


def _cures(tuning: Advice) -> str:
    """Say what each cure of the drive sets and brings."""
    texts = [cure_words(tuning, cure) for cure in tuning.cures]
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)


def _first_modes(tuning: Advice) -> str:
    """Ask to look at the modes of the machine before its bandwidth is raised, where none is known."""
    if not _modes_unknown(tuning) or _first(tuning).remedy.buys_joint:
        return ""
    return "; the file states no mode: first find out whether those of the machine allow this"


def unseen(flat: Mapping[str, Any]) -> str:
    """Say how far the load may stay from its place where the position is measured at the motor."""
    if flat.get("encoder.position") != "motor":
        return ""
    load = {key: value for key, value in flat.items() if not key.startswith("motor_friction.")}
    wound = breakaway(load) / flat["transmission.stiffness"] + flat.get("transmission.backlash", 0.0) / 2
    return f"; that is the motor's place, and the load stays up to {with_unit(wound, 'm')} off by its friction"


def _second(tuning: Advice) -> str:
    """Say what the second remedy is, brings and costs, in the words of the first."""
    second = tuning.working[1]
    assert second.measured is not None
    set_to = listed(changes(tuning.stage, _stage_of(second)), "and")
    force = _against(second.measured.force(tuning.goal), tuning.present.force(tuning.goal), FORCE)
    margin = f"a modulus margin of {second.measured.least_margin(tuning.goal):.2f}"
    settled = _settled(second.measured, tuning.goal)
    return f"Or ({second.remedy.name}) set {set_to}: then {settled}, with {force} and {margin}."


_CAPPED = {
    "stated": "",
    "least": "more than {least} times the speed that is needed",
    "unknown": "more than {factor} times the present speed",
    "mode": "a bandwidth of more than {mode} of the lowest mode",
    "sampling": "a bandwidth of more than {sampling} of the sampling rate",
}
"""What is not tried unasked, by the reason of the cap."""


def cap_words(tuning: Advice) -> str:
    """Say which controllers are too fast to be advised unasked; empty if the user stated a limit."""
    return _CAPPED[tuning.cap.reason].format(
        least=factor_text(FASTER_THAN_LEAST),
        factor=factor_text(FASTEST_UNASKED),
        mode=percent(MODE_SHARE),
        sampling=percent(SAMPLING_SHARE),
    )


def _drive_timed(tuning: Advice) -> bool:
    """Tell whether the table [drive] of the file has a timing."""
    return bool({"sample_time", "delay", "current_bandwidth"} & {*tuning.as_built.get("drive", ())})


def _first(tuning: Advice) -> RemedyOutcome:
    """Return the remedy that the answer names: the least change, or the one that might work."""
    return (*tuning.working[:1], *_unsure(tuning))[0]


def _measured(tuning: Advice) -> Performance:
    """Return the performance with the least change."""
    assert tuning.least is not None
    assert tuning.least.measured is not None
    return tuning.least.measured


_WORDS: Words[Advice] = {
    "unstable": lambda of: unstable_where(of.case.unstable),
    "changes": lambda of: listed(changes(of.stage, _stage_of(_first(of))), "and"),
    "name": lambda of: _first(of).remedy.name,
    "why": lambda of: unsure_why(_first(of)),
    "for_all": lambda of: " for all moves" if _some_moves_alone(of) else "",
    "so_far": lambda of: " so far" if of.interrupted else "",
    "goal": lambda of: goal_words(of.goal),
    "brings": lambda of: _brings(of.present if not of.needed else _measured(of), of),
    "settled": lambda of: _settled(_measured(of), of.goal),
    "force": lambda of: _against(_measured(of).force(of.goal), of.present.force(of.goal), FORCE),
    "margin": lambda of: f"{_measured(of).least_margin(of.goal):.2f}",
    "factor": lambda of: factor_text(_first(of).factor),
    "unseen": lambda of: unseen(of.stage.flat()),
    "first_modes": lambda of: _first_modes(of),
    "second": lambda of: _second(of),
    "cap": cap_words,
    "state": lambda of: (
        f"state {'the lowest mode ([parasitic]) or ' if _modes_unknown(of) else ''}"
        'the highest bandwidth that the machine allows (--bandwidth-limit "25 Hz")'
    ),
    "as_it_is": lambda of: as_it_is(of),
    "limit": lambda of: Quantity("N", positive, "200 N").on(of.stage.axis_kind).example,
    "rest": _rest,
    "parts": lambda of: listed(["the controller"] * of.goal.controller + ["the joint"] * of.goal.joint, "or"),
    "cures": _cures,
    "cure": lambda of: cure_words(of, of.cures[0]),
    "part": lambda of: "joint" if of.goal.controller else "controller",
}

_SAYS: Sequence[Alternatives[Advice]] = (
    (
        (lambda of: of.interrupted, "Interrupted: this is the best so far; other options were not tried."),
        (lambda of: of.case.unstable, "The loop of the stage as its file gives it is {unstable}."),
    ),
    (
        (lambda of: not of.needed, "The stage meets the goal as it is: {brings}."),
        (
            lambda of: of.working and _first(of).remedy.name == BANDWIDTH,
            "Make the controller {factor} times as fast, the cheapest change that works{for_all}{so_far} ({name}): set "
            "{changes}.",
        ),
        (lambda of: of.working, "Set {changes}: the cheapest change that works{for_all}{so_far} ({name})."),
        (lambda of: of.cures, "No change of {parts} was found that surely works; of the drive, {cure}."),
        (_unsure, "No change was found that surely works; {name} might ({changes}), but {why}."),
        (always, "No change was found that surely meets the goal."),
    ),
    (
        (lambda of: not of.needed, ""),
        (lambda of: of.working, "Then {settled}, with {force} and a modulus margin of {margin}{unseen}{first_modes}."),
        (always, "{as_it_is}"),
    ),
    (
        (lambda of: not of.needed, ""),
        (lambda of: not of.working and of.goal.controller and cap_words(of), "Not tried: {cap}; for that, {state}."),
        (lambda of: not of.working, ""),
        (lambda of: of.cures, "Or of the drive: {cure}."),
        (lambda of: of.working[1:], "{second}"),
        (always, "{as_it_is}"),
    ),
)
"""Sentences on what to change, what that brings and costs, and what remains open; the first three are said."""

_EXPLAINED: Alternatives[Advice] = (
    (lambda of: not of.working, "{rest}"),
    (lambda of: of.needed, "{as_it_is}"),
    (lambda of: of.cures, "{cures}"),
    (always, "The goal: {goal}."),
    (_drive_timed, "The [drive] of the file counts for the margin and the verdict as built, not for moves."),
    (
        _modes_unknown,
        "Not known: modes of the machine. None is assumed; they make fast controllers unstable.",
    ),
    (
        lambda of: cap_words(of) and of.goal.controller and of.needed,
        "Not tried: {cap}; for that, {state}.",
    ),
    (
        lambda of: of.goal.force_limit is None and FORCE_LIMIT not in of.stage.flat(),
        'Not known: the force of the actuator. No limit is assumed; state one (--force-limit "{limit}").',
    ),
    (
        lambda of: of.needed and not (of.working or (of.goal.controller and of.goal.joint)),
        "Changes of the {part} were not tried, as told.",
    ),
)
"""Details: other remedies, what the stage misses as it is, the goal, and what is not known of the machine."""


def goal_words(goal: Goal) -> str:
    """Describe the goal: accuracy, time, moves, force, margins and bandwidth that are required."""
    late = "" if goal.settle is None else f", in {with_unit(goal.settle, 's')}"
    force = "" if goal.force_limit is None else f" with at most {with_unit(goal.force_limit, 'N')}"
    most, moves = goal.bandwidth_limit, goal.moves
    moving = "" if moves is None else f" after {moves_words(moves)}"
    limit = "" if most is None else f" and a bandwidth of at most {with_unit(most, 'Hz')}"
    return (
        f"{percent(goal.share)} of the machines in position within {with_unit(goal.within, 'm')}{late}{moving}{force}, "
        f"with a modulus margin of {goal.margin:g}{limit}, and no hunting at their bandwidth and the lower ones tried, "
        f"down to {percent(1 / goal.distance)} of it"
    )


def _works(outcome: RemedyOutcome, tuning: Advice, what: str) -> list[str]:
    """Say what to set for a remedy, and what that brings and costs; `what` begins the first sentence."""
    assert outcome.measured is not None
    return [
        f"{what}: set {listed(changes(tuning.stage, _stage_of(outcome)), 'and')}.",
        f"{_brings(outcome.measured, tuning)}. {price(outcome.measured, tuning, outcome.remedy.buys_joint)}",
        *_made_of_leaves(outcome, tuning),
    ]


def _stage_of(outcome: RemedyOutcome) -> Stage:
    """Return the stage with the settings of a remedy that has some."""
    assert outcome.stage is not None
    return outcome.stage


UNMADE = {
    "rotary": "leaf springs guide along a line, and this axis turns",
    "mode": "the stage file states a parasitic mode, and a stage has no second one for the leaves (friso design)",
    "extra": f"that takes {install('design')}",
    "none": "no size of friso init --spec has this stiffness and bears this stroke (friso design takes others)",
}
"""Why no leaf springs make the joint of a remedy."""


def _made_of_leaves(outcome: RemedyOutcome, tuning: Advice) -> Iterator[str]:
    """Yield which leaf springs make the joint of a remedy, and whether they work.

    If there are none, the reason is given.
    """
    made = tuning.made_of_leaves(outcome)
    if made is not None:
        flat = made.remedy.stage.flat()
        disturbs = float(first_interfering(Mechanism.of(flat)))
        mode = (
            f"first interfering frequency {with_unit(disturbs, 'Hz')}"
            if math.isfinite(disturbs)
            else "no interfering mode"
        )
        yield (
            f"Leaf springs for its joint: {leaf_words(Geometry.of_stage(flat))}; "
            f"{with_unit(flat['joint.stiffness'], 'N/m')}, {mode}{_replaced(tuning.stage)}. {_verified(made, tuning)}"
        )
    elif outcome.remedy.name in tuning.unmade:
        yield f"No leaf springs were sized for its joint: {UNMADE[tuning.unmade[outcome.remedy.name]]}."


def _replaced(stage: Stage) -> str:
    """Say that the leaf springs' mode replaces the parasitic mode of the stage file.

    Nothing is said for a stage file without such a mode.
    """
    if stage.parasitic is None or stage.flexure is not None:
        return ""
    return f", in place of the parasitic mode of the file ({with_unit(stage.flat()['parasitic.frequency'], 'Hz')})"


def _verified(made: RemedyOutcome, tuning: Advice) -> str:
    """Say whether the stage still meets the goal with leaf springs and their parasitic mode."""
    if made.certainty == "works" and made.measured is not None:
        return f"With them, {share_with_interval(made.measured.share(tuning.goal))} of the machines meet the goal."
    if made.certainty == "unsure":
        return f"With them, it is not sure to work: {unsure_why(made)}."
    return f"With them, it does not surely work. {why_unmet(made, tuning)}"


def _brings(measured: Performance, tuning: Advice) -> str:
    """Say how many machines meet the goal, for which moves, and how fast."""
    goal = tuning.goal
    moves = held_range(measured, goal)
    alone = "" if measured.holds_for_all_moves(goal) else " alone"
    held = "for no range of moves" if moves == NOTHING else f"for moves of {moves}{alone}"
    share = share_with_interval(measured.share(goal))
    return f"Of {measured.count} fresh machines, {share} meet the goal, {held}; {_settled(measured, goal)}"


def _settled(measured: Performance, goal: Goal) -> str:
    """Say after which time 95 % of the machines are in position."""
    if not measured.slowest(goal):
        return "95 % of the machines are in position once the reference stands"
    settled = slowest_time(measured, goal)
    if settled == ABSENT:
        return "fewer than 95 % of the machines are in position in time"
    return f"95 % of the machines are in position within {settled}"


def held_range(measured: Performance, goal: Goal) -> str:
    """Write the smallest and largest move for which the goal holds; a dash if it holds for none."""
    held = measured.held_moves(goal)
    return NOTHING if held is None else range_with_unit(*held, "m")


FORCE, LOAD = ("{effort}", "N"), ("stiffness against a load before the integral acts", "N/m")
"""What a remedy changes beside the margin, and its unit."""


def price(measured: Performance, tuning: Advice, buys_joint: bool) -> str:
    """Say what a remedy costs compared with the stage as it is: force, margin and stiffness.

    If it `buys_joint`, the text adds that standstill was not computed.
    """
    goal, before = tuning.goal, tuning.present
    margin, margin_before = (f"{performance.least_margin(goal):.2f}" for performance in (measured, before))
    says = (
        f"Its price: {_against(measured.force(goal), before.force(goal), FORCE)}, a modulus margin of {margin} "
        f"{'as before' if margin == margin_before else f'instead of {margin_before}'}, "
        f"{_against(measured.stiffness, before.stiffness, LOAD)}."
    )
    floor = (
        "Standstill was not computed: on a floor that shakes, a stage on a joint moves more (friso rig in-position)."
    )
    return f"{says} {floor}" if buys_joint else says


def _against(now: float, before: float, quantity: tuple[str, str]) -> str:
    """Compare a quantity, by its name and unit, now with its value before, as a factor and with its unit.

    A rotary axis has a torque in place of a force.
    """
    name, unit = quantity[0].format(effort=axis_shown().effort), quantity[1]
    if not before > 0 or not math.isfinite(now / before):
        return f"a {name} of {with_unit(now, unit)}"
    factor = factor_text(now / before)
    return f"{'the same' if factor == '1' else f'{factor} times the'} {name} ({with_unit(now, unit)})"


def factor_text(factor: float) -> str:
    """Write a factor to three digits, without an exponent."""
    return f"{float(f'{factor:.3g}'):.15g}"


def unsure_why(outcome: RemedyOutcome) -> str:
    """Say why a remedy is not sure to work."""
    if outcome.interrupted and not outcome.doubts:
        return "it was not verified: the search was interrupted"
    if not outcome.remedy.verifiable:
        return "its dither keeps the stage moving, so that no cycle can verify it"
    return listed([DOUBTS[doubt] for doubt in outcome.doubts], "and")


def failing(tuning: Advice) -> list[str]:
    """List the remedies that cannot work or are not sure to, with reasons."""
    lines = []
    for outcome in tuning.outcomes:
        if outcome.stage is None and not outcome.interrupted:
            lines.append(f"{outcome.remedy.name}: {_verdict(outcome, tuning)}. {why_unmet(outcome, tuning)}")
        elif outcome.certainty == "unsure" and tuning.working:
            lines.append(f"{outcome.remedy.name}: not sure to work: {unsure_why(outcome)}.")
    return lines


def _verdict(outcome: RemedyOutcome, tuning: Advice) -> str:
    """Say in a few words whether a remedy works."""
    some = outcome.points is not None and bool(outcome.points.meets(tuning.goal).any())
    return NONE_FOUND if some and outcome.certainty == "does not work" else outcome.certainty


def why_unmet(outcome: RemedyOutcome, tuning: Advice) -> str:
    """Say why no setting of a remedy meets the goal."""
    if outcome.untried:
        return "It was not tried: the others took all the computing that is allowed."
    if outcome.points is None:
        return "Its motions take too much computing."
    points, goal = outcome.points, tuning.goal
    sentence = _reason(points, outcome, goal)
    cut = " The search was given up there, as it takes too much computing: others may work." if outcome.cut else ""
    return f"{sentence}{cut}"


def _reason(points: TriedPoints, outcome: RemedyOutcome, goal: Goal) -> str:
    """Say why no setting of a remedy meets the goal, by the part of the goal at which no setting is left.

    The parts are checked in order. If some settings meet all parts, the sentence says that none surely does on fresh
    machines, or that it is not known whether they hunt.
    """
    broken, left = points.broken(goal), np.ones(len(points.margin), bool)
    best = float(points.margin.max(initial=0.0))
    numbers = {
        "tried": str(len(left)),
        "kept": f" with a modulus margin of {goal.margin:g}" if broken["margin"].any() else "",
        "margin": f"{goal.margin:g}",
        "best": f"{best:.{digits_that_differ((best, goal.margin))}g}",
        "share": percent(goal.share),
        "distance": f"{1 / goal.distance:.2f}",
        "surveyed": str(outcome.attracted),
    }
    for name, text in _UNMET.items():
        left = left & ~broken[name]
        if not left.any():
            return text.format_map(numbers)
    text = "Of {tried} settings tried {left} meet the rest of the goal on the machines of the search; "
    surveyed = _SURVEYED[bool(outcome.attracted) or not outcome.cut]
    return f"{text}{surveyed}".format_map(numbers | {"left": str(left.sum())})


_UNMET = {
    "margin": "No setting keeps a modulus margin of {margin} on {share} of the machines: the best has {best}.",
    "settling": "No setting{kept} (of {tried} tried) brings {share} of the machines to rest in position in time.",
    "distance": "No setting{kept} (of {tried} tried) still settles in time at {distance} of its bandwidth.",
    "force": "All settings{kept} that settle take more force than there is.",
    "settle": "All settings{kept} that settle do so too late.",
    "bandwidth": "Only settings above your bandwidth limit meet the rest of the goal.",
}
"""Sentence for each part of the goal, in the order in which they are checked, if no setting is left that meets it."""

_SURVEYED = {
    True: "{surveyed} of these were surveyed, and none surely meets it on fresh machines.",
    False: "none of these was surveyed, so that they may still hunt.",
}
"""What is known of settings that meet every part of the goal on the machines of the search: was any surveyed?"""


def rows(tuning: Advice) -> list[tuple[str, list[str]]]:
    """Return the remedies with settings side by side, the stage as it is first."""
    table = [("as it is", _row(tuning.present, tuning, NOTHING, "no" if tuning.needed else "yes"))]
    if "bandwidth" in tuning.unmet:
        table[0][1][1] = "no"  # no machine meets a limit that its controller breaks
    for outcome in tuning.outcomes:
        if outcome.measured is not None and outcome.stage is not None:
            works = _WORKS.get(verdict := _verdict(outcome, tuning), verdict)
            row = _row(outcome.measured, tuning, _set_to(tuning.stage, outcome.stage), works)
            row[1] = row[1] if outcome.remedy.verifiable else works
            table.append((outcome.remedy.name, row))
    before = tuning.complete(tuning.stage)
    for cure in tuning.cures:
        time_to_rest = NOTHING if cure.built.settled_after is None else time(cure.built.settled_after)
        table.append((cure.kind, [_set_to(before, cure.stage), "as built", time_to_rest, NOTHING, NOTHING]))
    return table


_WORKS = {
    "works": "yes",
    "unsure": "not sure",
    NONE_FOUND: "none found",
    "does not work": "no",
}
"""Words of the table on whether a remedy works."""


def _row(measured: Performance, tuning: Advice, set_to: str, works: str) -> list[str]:
    """Return the texts of one row of the table: what is set, and how machines perform, under `COLUMNS`.

    `works` says whether it works; beside it stands for which share of the machines, and for which moves if not for all.
    """
    goal = tuning.goal
    moves = "" if works == "yes" or measured.held_moves(goal) is None else f", for {held_range(measured, goal)}"
    return [
        set_to,
        f"{works}: {share_with_interval(measured.share(goal))}{moves}",
        slowest_time(measured, goal),
        with_unit(measured.force(goal), "N"),
        f"{measured.least_margin(goal):.2f}",
    ]


LISTED_CHANGES = 6
"""Largest number of changed keys that a row of the table lists; the stage file of the remedy has the others."""


def _set_to(before: Stage, after: Stage) -> str:
    """List the first changed keys with their new values, and how many more the stage file of the remedy has."""
    keys = [one.partition(" (was ")[0] for one in changes(before, after)]
    more = len(keys) - LISTED_CHANGES
    return ", ".join([*keys[:LISTED_CHANGES], *([f"and {more} more"] if more > 0 else [])])


def assumptions(tuning: Advice) -> list[str]:
    """Say what is assumed of the machine, and how the machines were drawn."""
    machines = tuning.machines
    return [*say_all(tuning, _ASSUMED, _ABOUT), *spread_sentences(machines.from_file, machines.spreads)]


def _has_friction(tuning: Advice) -> bool:
    """Tell whether a friction law acts on the stage."""
    return leading_friction(tuning.stage.flat())["friction.model"] != "none"


def _drive_keys(tuning: Advice) -> list[str]:
    """List the uncertain keys of the drive, which all machines have in the middle of their range."""
    return [key for key in tuning.complete(tuning.stage).uncertain() if key.startswith("drive.")]


_ABOUT: Words[Advice] = {
    "count": lambda of: str(of.machines.count),
    "seed": lambda of: str(of.seed),
    "moves": lambda of: moves_words(of.machines.moves),
    "keys": lambda of: listed(_drive_keys(of), "and"),
    "left_out": lambda of: str(of.machines.left_out),
}

_ASSUMED: Alternatives[Advice] = (
    (
        lambda of: _has_friction(of) and breakaway(of.stage.flat()) <= 0,
        "No settings against friction were tried: the friction law declares no break-away force to size them by.",
    ),
    (
        lambda of: _has_friction(of) and of.goal.joint and least_breakaway(of.stage.flat()) <= 0,
        "No isolator was tried: the friction of the guide does not hold the cart against the force of a joint and the "
        "bias force.",
    ),
    (
        always,
        "Margins include sampling, delay and current loop of the file; hunting and moves are those of a controller in "
        "continuous time. {count} machines that the optimiser did not see were drawn (seed {seed}), each with a move "
        "of its own, spread evenly over the logarithm: {moves}.",
    ),
    (_drive_keys, "In the middle of its range on all machines: {keys}."),
    (lambda of: of.machines.left_out, "{left_out} draws that no stage may have were replaced by others."),
)
"""Sentences on what was not tried, what the model holds, and which machines were drawn."""
