"""Describe the remedies in words.

The sentences say what to change, what the change brings and costs, and which remedies fail and why.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from friso.design_method.geometry import Geometry
from friso.equations.bandwidth import bandwidth
from friso.equations.breakaway import breakaway, least_breakaway
from friso.frequency.crossover import COMFORTABLE_MARGIN, bandwidths_at
from friso.leaf_springs.joint import first_interfering
from friso.leaf_springs.mechanism import Mechanism
from friso.platform.extras import install
from friso.quantities import Quantity, percent, positive
from friso.questions.design.words import leaf_words
from friso.questions.tune.present_words import DOUBTS, as_it_is, moves_words
from friso.remedies.catalogue import BANDWIDTH
from friso.remedies.least import ChangeSize
from friso.remedies.machines import Goal
from friso.remedies.method import Advice
from friso.remedies.search import TriedPoints
from friso.remedies.verified import Performance, RemedyOutcome
from friso.shown.drawing.prefixes import (
    NOTHING,
    digits_that_differ,
    listed,
    range_with_unit,
    share_with_interval,
    with_unit,
)
from friso.shown.loop_words import unstable_loop
from friso.shown.machine_words import spread_sentences
from friso.stage import Stage, numeric_keys
from friso.stage.controllers import CONTROLLER, FORCE_LIMIT
from friso.stage.tables import leading_friction

COLUMNS = (
    "Works",
    "Machines that meet the goal",
    "For moves of",
    "95 % settle within",
    "Median",
    "Largest force",
    "Modulus margin",
    "Stiffness under load",
)

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
    numbers = [_change(key, old.get(key), new[key], keys[key].unit) for key in new if _changes(key, old, new, keys)]
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


def _change(key: str, old: Any, new: float, unit: str) -> str:
    """Write a key with its new value and, if it had one, its old value."""
    text = f"{key} = {number(new, unit)}"
    return text if old is None else f"{text} (was {number(old, unit)})"


def number(value: float, unit: str) -> str:
    """Write the value of a key with its unit, if it has one."""
    return with_unit(value, unit, 4) if unit else f"{value:.4g}"


def answer(tuning: Advice) -> list[str]:
    """Write the answer: the least change that works, its benefits and costs, and the next best."""
    lines = [*unstable_loop(tuning.case.unstable), *_interrupted(tuning)]
    if not tuning.needed:
        return [
            *lines,
            f"The stage meets the goal as it is: {goal_words(tuning.goal)}. {_brings(tuning.present, tuning)}.",
        ]
    if not tuning.working:
        return [*lines, *_nothing(tuning), as_it_is(tuning)]
    least, *others = tuning.recommended
    lines += _in_short(tuning)
    so_far = " so far" if tuning.interrupted else ""
    lines += _works(least, tuning, f"The least of the changes that work{_for_all(tuning)}{so_far}")
    for other in others:
        lines += _works(other, tuning, "What settles soonest" if other is tuning.fastest else "The next best")
    goal = f"The goal: {goal_words(tuning.goal)}.{_of_the_drive(tuning)}"
    return [*lines, as_it_is(tuning), goal, *unknown(tuning)]


def _in_short(tuning: Advice) -> Iterator[str]:
    """Yield one line on the least change and the fastest remedy, with their settling times.

    Nothing is yielded if both are the same remedy, or if one of them is missing or was not measured.
    """
    least, fastest = tuning.least, tuning.fastest
    if least is None or fastest is None or least is fastest:
        return
    times = [slowest_time(outcome.measured, tuning.goal) for outcome in (least, fastest) if outcome.measured]
    if len(times) == 2:
        yield (
            f"Least change{_for_all(tuning)}: {least.remedy.name}, in position after {times[0]}. "
            f"Soonest: {fastest.remedy.name}, after {times[1]}."
        )


def _for_all(tuning: Advice) -> str:
    """Write " for all moves" if that is true of the least change, but not of every remedy."""
    least = tuning.least
    every = least is not None and tuning.for_all_moves(least)
    return " for all moves" * (every and not all(map(tuning.for_all_moves, tuning.working)))


def _of_the_drive(tuning: Advice) -> str:
    """Say that timing in the table [drive] counts for the margin alone; empty without timing."""
    has = {"sample_time", "delay", "current_bandwidth"} & {*tuning.as_built.get("drive", ())}
    return " The [drive] of the file counts for the margin alone, not for moves and hunting." if has else ""


def unknown(tuning: Advice) -> list[str]:
    """Say which limits of the machine are unknown, and what is assumed instead."""
    stage, goal, flat = tuning.stage, tuning.goal, tuning.stage.flat()
    lines = []
    if stage.parasitic is None and not stage.flexure and goal.bandwidth_limit is None:
        lines.append(
            "Not known: modes of the machine. None is assumed; they make fast controllers unstable, so state "
            '[parasitic], or the highest bandwidth that the machine allows (--bandwidth-limit "25 Hz").'
        )
    if goal.force_limit is None and FORCE_LIMIT not in flat:
        example = Quantity("N", positive, "200 N").on(stage.axis_kind).example
        lines.append(
            f'Not known: the force of the actuator. No limit is assumed; state one (--force-limit "{example}").'
        )
    return lines


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


def _interrupted(tuning: Advice) -> Iterator[str]:
    """Yield that the search was interrupted and the answer is the best so far; or nothing."""
    if tuning.interrupted:
        yield (
            "Interrupted: this is the best so far. Options that are not named were not tried, and one may be "
            "unfinished."
        )


def _works(outcome: RemedyOutcome, tuning: Advice, what: str) -> list[str]:
    """Say what to set for a remedy, and what that brings and costs.

    `what` begins the first sentence, such as "The least change".
    """
    assert outcome.stage is not None
    assert outcome.measured is not None
    return [
        f"{what}: set {listed(changes(tuning.stage, outcome.stage), 'and')} ({outcome.remedy.name}; "
        f"{size_words(tuning.size(outcome))}).",
        f"{_brings(outcome.measured, tuning)}. {price(outcome.measured, tuning, outcome.remedy.buys_joint)}",
        *_made_of_leaves(outcome, tuning),
    ]


UNMADE = {
    "rotary": "leaf springs of friso guide along a line, and this axis turns",
    "mode": (
        "the stage file states a parasitic mode of the machine, and a stage has no second one for the leaves; friso "
        "design designs without it"
    ),
    "extra": f"that takes {install('design')}",
    "none": (
        "none of the sizes that friso init --spec begins with has this stiffness and bears this stroke; friso design "
        "takes other sizes"
    ),
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
    if made.certainty == "works":
        assert made.measured is not None
        return f"With them, {share_with_interval(made.measured.share(tuning.goal))} of the machines meet the goal."
    if made.certainty == "unsure":
        return f"With them, it is not sure to work: {unsure_why(made)}."
    result = "the search was given up" if made.certainty == "given up" else "it does not work"
    return f"With them, {result}. {why_unmet(made, tuning)}"


def size_words(size: ChangeSize) -> str:
    """Write how large a change is: a joint, the number of keys changed, and their mean factor."""
    keys = [f"{size.keys} key{'s' * (size.keys != 1)} of the controller"] if size.keys else []
    some = "" if size.scaled == size.keys else f"{'one' if size.scaled == 1 else size.scaled} of them "
    average = f"{' each' * (not some)} on average" if size.scaled > 1 else ""
    factor = f", {some}by a factor of {factor_text(size.mean)}{average}" if size.factor > 1 else ""
    return f"{' and '.join([*(['a joint'] if size.bought else []), *keys])}{factor}"


def _brings(measured: Performance, tuning: Advice) -> str:
    """Say how many machines meet the goal and how fast, compared with the stage as it is."""
    before = slowest_time(tuning.present, tuning.goal)
    as_is = "" if measured is tuning.present or before == ABSENT else f"; as it is: {before}"
    meet = share_with_interval(measured.share(tuning.goal))
    settled = slowest_time(measured, tuning.goal)
    share = "fewer than 95 % are in position in time" if settled == ABSENT else f"95 % are in position within {settled}"
    if not measured.slowest(tuning.goal):
        share = "95 % are in position once the reference stands"
    return (
        f"Of {measured.count} fresh machines and moves, {meet} meet the goal, {_holds(measured, tuning.goal)}; "
        f"{share}{as_is}"
    )


def held_range(measured: Performance, goal: Goal) -> str:
    """Write the smallest and largest move for which the goal holds; a dash if it holds for none."""
    held = measured.held_moves(goal)
    return NOTHING if held is None else range_with_unit(*held, "m")


def _holds(measured: Performance, goal: Goal) -> str:
    """Say for which moves the goal holds."""
    moves = held_range(measured, goal)
    if moves == NOTHING:
        return "for no range of moves"
    return f"which holds for moves of {moves}{'' if measured.holds_for_all_moves(goal) else ' alone'}"


def price(measured: Performance, tuning: Advice, buys_joint: bool) -> str:
    """Say what a remedy costs compared with the stage as it is: force, margin and stiffness.

    If it `buys_joint`, the text adds that standstill was not computed.
    """
    goal, before = tuning.goal, tuning.present
    force = _against(measured.force(goal), before.force(goal), "force", "N")
    resists = "stiffness against a load before the integral acts"
    stiffness = _against(measured.stiffness, before.stiffness, resists, "N/m")
    margin, margin_before = (f"{performance.least_margin(goal):.2f}" for performance in (measured, before))
    before_it = " as before" if margin == margin_before else f" instead of {margin_before}"
    still = (
        " Standstill was not computed: on a floor that shakes, a stage on a joint moves more (friso rig in-position)."
        if buys_joint
        else ""
    )
    return f"Its price: {force}, a modulus margin of {margin}{before_it}, {stiffness}.{still}"


def _against(now: float, before: float, what: str, unit: str) -> str:
    """Compare a quantity now with its value before, as a factor and with its unit."""
    if not before > 0 or not math.isfinite(now / before):
        return f"a {what} of {with_unit(now, unit)}"
    factor = factor_text(now / before)
    return (
        f"{'' if factor == '1' else f'{factor} times '}the {'same ' * (factor == '1')}{what} ({with_unit(now, unit)})"
    )


def factor_text(factor: float) -> str:
    """Write a factor to three digits, without an exponent."""
    return f"{float(f'{factor:.3g}'):.15g}"


def _nothing(tuning: Advice) -> list[str]:
    """Say that no remedy surely works, and which ones might."""
    unsure = [outcome for outcome in tuning.outcomes if outcome.certainty == "unsure"]
    lines = [f"No option was found that certainly meets the goal: {goal_words(tuning.goal)}."]
    for outcome in tuning.for_large_moves:
        lines += _works(outcome, tuning, f"For moves of {length_from(outcome)} and more alone")
    lines += [
        f"{outcome.remedy.name} might work ({listed(changes(tuning.stage, outcome.stage), 'and')}), but "
        f"{unsure_why(outcome)}."
        for outcome in unsure
        if outcome.stage is not None
    ]
    if not (tuning.goal.controller and tuning.goal.joint):
        lines.append(f"Changes of the {'joint' if tuning.goal.controller else 'controller'} were not tried, as told.")
    return lines


def length_from(outcome: RemedyOutcome) -> str:
    """Write the smallest move [m] that a remedy serves, if it serves large moves only."""
    return with_unit(outcome.moves_from or 0.0, "m")


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
    sentence = next(_reasons(points, outcome, goal))
    largest = goal.moves.largest if goal.moves else np.inf
    for number in points.for_large_moves(goal, largest)[:1]:
        smallest = with_unit(float(points.moves_from[number]), "m")
        sentence += f" For moves of {smallest} and more alone, one does on the machines of the search."
    edges = _edges(tuning) if [v.name for v in outcome.remedy.variables] == [BANDWIDTH] else ""
    cut = " The search was given up there, as it takes too much computing: others may work." if outcome.cut else ""
    return f"{sentence}{edges}{cut}"


def _reasons(points: TriedPoints, outcome: RemedyOutcome, goal: Goal) -> Iterator[str]:
    """Yield sentences on why no setting of a remedy meets the goal; only the first one counts.

    The parts of the goal are checked in order. The first sentence names the part at which no setting is left. If some
    settings meet all parts, it says that none surely does on fresh machines, or that it is not known whether they hunt.
    """
    broken, left = points.broken(goal), np.ones(len(points.margin), bool)
    margin, best = f"a modulus margin of {goal.margin:g}", float(points.margin.max(initial=0.0))
    some = bool(broken["margin"].any())  # these settings lack the margin and are not mentioned
    tried = f"No setting{f' that keeps {margin}' * some} (of {len(left)} tried)"
    brings, still_settles = f"{tried} brings", f"{tried} still settles"
    if len(left) == 1:  # no setting is varied
        brings, still_settles = "It does not bring", "It does not settle any more"
    settle = f"All settings that {'keep the margin and ' * some}settle"
    sentences = {
        "margin": f"No setting keeps {margin} on {percent(goal.share)} of the machines: the best has "
        f"{best:.{digits_that_differ((best, goal.margin))}g}.",
        "settling": f"{brings} {percent(goal.share)} of the machines to rest in position in time.",
        "distance": f"{still_settles} in time at {1 / goal.distance:.2f} of its bandwidth.",
        "force": f"{settle} take more force than there is.",
        "settle": f"{settle} do so too late.",
        "bandwidth": f"Only settings above your bandwidth limit meet the rest of the goal{_lowest(points, goal)}.",
    }
    for name, sentence in sentences.items():
        left = left & ~broken[name]
        if not left.any():
            yield sentence
    meet = f"Of {len(left)} settings tried {left.sum()} meet the rest of the goal on the machines of the search"
    if outcome.cut and not outcome.attracted:
        yield f"{meet}; of none it is known whether something attracts these."
    else:
        yield (
            f"{meet}; of those looked at further ({outcome.attracted} surveyed) none surely meets it on fresh machines"
            f"{'' if outcome.cut else ', others may'}."
        )


def _lowest(points: TriedPoints, goal: Goal) -> str:
    """Write the lowest bandwidth of the settings that miss the goal by their bandwidth alone.

    The text is empty if there is no such setting.
    """
    others = np.all([~broken for name, broken in points.broken(goal).items() if name != "bandwidth"], axis=0)
    lowest = np.nanmin(points.bandwidth[others], initial=np.inf)
    return (
        f", the slowest of which last crosses 0 dB at {with_unit(float(lowest), 'Hz')}" if np.isfinite(lowest) else ""
    )


def _edges(tuning: Advice) -> str:
    """Say at which bandwidth hunting ends, and up to which bandwidth the margin is enough.

    The user's limit of the bandwidth is added. What is not known is left out; if nothing is known, the text is empty.
    """
    edge, comfortable, stage = tuning.case.judgement.margin, tuning.limits.highest_comfortable, tuning.stage
    parts = []
    if edge is not None:
        factors = (edge.quiet, tuning.goal.distance * edge.quiet)
        ends, needed = (with_unit(float(hertz), "Hz") for hertz in bandwidths_at(stage, factors))
        parts.append(f"hunting of the machine in the file ends at {ends} (it needs {needed}, others more)")
    if comfortable is not None and np.isfinite(comfortable) and comfortable < tuning.limits.searched[1]:
        again = [low for low, _ in tuning.limits.comfortable if low > comfortable][:1]
        own = bandwidth(stage.flat()) or 1.0
        hertz = [with_unit(float(at), "Hz") for at in bandwidths_at(stage, np.array([comfortable, *again]) / own)]
        parts.append(
            f"a modulus margin of {COMFORTABLE_MARGIN:g} is kept up to "
            f"{' and again from '.join(hertz)}{' on' * len(again)}"
        )
    if tuning.goal.bandwidth_limit is not None:
        parts.append(f"your limit is {with_unit(tuning.goal.bandwidth_limit, 'Hz')}")
    return f" In bandwidth (where the loop last crosses 0 dB) {listed(parts, 'and')}." if parts else ""


def rows(tuning: Advice) -> list[tuple[str, list[str]]]:
    """Return the remedies side by side, the stage as it is first."""
    shown = [("as it is", tuning.present, "no" if tuning.needed else "yes")]
    words = {
        "works": "yes",
        "large moves": "large moves",
        "unsure": "not sure",
        NONE_FOUND: "none found",
        "does not work": "no",
    }
    table = [(name, _row(measured, tuning, works)) for name, measured, works in shown]
    if "bandwidth" in tuning.unmet:
        table[0][1][1] = NOTHING  # no machine meets a limit that its controller breaks
    for outcome in tuning.outcomes:
        works = words.get(verdict := _verdict(outcome, tuning), verdict)
        cells = [works, *[NOTHING] * (len(COLUMNS) - 1)]
        if outcome.measured is not None:
            cells = _row(outcome.measured, tuning, works)
            cells[1] = cells[1] if outcome.remedy.verifiable else NOTHING
        table.append((outcome.remedy.name, cells))
    return table


def _row(measured: Performance, tuning: Advice, works: str) -> list[str]:
    """Return the texts of one row of the table: how machines perform, under `COLUMNS`.

    The first text is `works`, which says whether the remedy works.
    """
    goal = tuning.goal
    return [
        works,
        share_with_interval(measured.share(goal)),
        held_range(measured, goal),
        slowest_time(measured, goal),
        time(measured.median),
        with_unit(measured.force(goal), "N"),
        f"{measured.least_margin(goal):.2f}",
        with_unit(measured.stiffness, "N/m"),
    ]


def _without_friction(flat: Mapping[str, Any], goal: Goal) -> Iterator[str]:
    """Yield what was not tried because friction is too small; nothing without friction.

    Settings against friction need a break-away force, and an isolator needs friction that holds the cart.
    """
    if leading_friction(flat)["friction.model"] == "none":
        return
    if breakaway(flat) <= 0:
        yield "No settings against friction were tried: the friction law declares no break-away force to size them by."
    if goal.joint and least_breakaway(flat) <= 0:
        yield (
            "No isolator was tried: the friction of the guide does not hold the cart against the force of a joint and "
            "the bias force."
        )


def assumptions(tuning: Advice) -> list[str]:
    """Say what is assumed of the machine, and how the machines were drawn."""
    lines, stage, machines = [], tuning.stage, tuning.machines
    lines += _without_friction(stage.flat(), tuning.goal)
    if any(outcome.remedy.of_setting for outcome in tuning.outcomes) and any(
        not outcome.remedy.buys_joint for outcome in tuning.working
    ):
        lines.append(
            "Settings against friction were not tried together with the bandwidth, nor those of more keys than what "
            "works, as less works."
        )
    alone = {outcome.remedy.name for outcome in tuning.working}
    if {"gains", "isolator"} <= alone:
        lines.append("Gains and isolator were not tried together, as each works alone.")
    if any(outcome.remedy.buys_joint and outcome not in tuning.recommended for outcome in tuning.working):
        lines.append("Leaf springs were sized only for joints of what is told first; friso design sizes others.")
    spread = ", spread evenly over the logarithm" * (machines.moves.smallest < machines.moves.largest)
    lines.append(
        "Margins include sampling, delay and current loop of the file; hunting and moves are those of a controller in "
        f"continuous time. {machines.count} machines that the optimiser did not see were drawn (seed {tuning.seed}), "
        f"each with a move of its own: {moves_words(machines.moves)}{spread}."
    )
    lines += spread_sentences(machines.from_file, machines.spreads)
    held = [key for key in tuning.complete(stage).uncertain() if key.startswith("drive.")]
    if held:
        lines.append(f"In the middle of its range on all machines: {listed(held, 'and')}.")
    if machines.left_out:
        lines.append(f"{machines.left_out} draws that no stage may have were replaced by others.")
    return lines
