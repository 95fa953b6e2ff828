"""Say in words what a check found for each state of the joint, and what follows from that."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from friso.equations.bandwidth import bandwidth
from friso.hunting import (
    MORE_WORK,
    SEARCH_LIMITS,
    AttractionEnd,
    BandwidthAdvice,
    BandwidthWindow,
    Case,
    CheckPart,
    Decline,
    Feeding,
    Kick,
    MoveShare,
)
from friso.hunting.criteria import ATTRACTED, Verdict
from friso.quantities import percent, plain_factor
from friso.questions.check.margin_words import friction_sentences, other_static_friction, thin_margins
from friso.shown.motion_words import (
    ShownCase,
    band_text,
    dwell_sentences,
    following_sentence,
    shown_cases,
    stick_slip_sentences,
    swings_by_its_loop,
)
from friso.shown.text import (
    digits_that_differ,
    if_so,
    length_at_rest,
    listed,
    range_with_unit,
    rounded_down,
    rounded_up,
    swing_with_unit,
    unstable_where,
    with_unit,
)
from friso.stage.controllers import FORCE_LIMIT, ControllerSection, dead_band, integral_leak
from friso.stage.rig import motion_of
from friso.stage.section import numeric_fields

_AFTERWARDS = {
    "stable": "dies out slowly, if at all",
    "unstable": "grows",
    "unknown": "may last, grow or die out",
}
"""Later course of a swing beyond a force limit without anti-windup, by the loop's stability at lower gains."""

_UNFINISHED = (
    "could not be judged: its own run was completed, but not the longer one that shows whether it ends in the hunting "
    "that was found."
)
"""Sentence for a stage whose final behaviour is not known."""

IN_SHORT: Mapping[Verdict, str] = {
    "hunts": "hunts",
    "bistable": "settles after this motion, but hunts after others",
    "transient": "does not hunt",
    "settles": "does not hunt",
}
"""Words for the verdict on a stage before its margin is known."""

ROUGH_EDGE = 5e-4
"""Relative uncertainty of an edge above which it is mentioned, because the shown digits are not certain."""

TIMES = " times this bandwidth"
"""Unit of a bandwidth where the controller states none."""

ROUGHER = 10 * ROUGH_EDGE
"""Relative uncertainty of an edge above which one digit less is shown."""


def verdict_sentence(item: ShownCase, cases: Mapping[str, Case]) -> str:
    """Say in at most three sentences what the stage does in one case, what to do, and how far it is from changing.

    `cases` holds all cases of the check, so that advice on one may use the others.
    """
    case, first = item.case, _verdict(item.case)
    if _friction_has_no_say(case):
        return _after_loop(case, first[0])
    after = _remedy(item, cases) if case.verdict in ATTRACTED else _outlook(case)
    return _after_loop(
        case, " ".join([f"{first[0][:-1]}{_doubt_of(case)}.", *after[:1], *friction_sentences(case)[:1]])
    )


def _friction_has_no_say(case: Case) -> bool:
    """Tell whether hunting by friction is no question: the loop, or the run, decides first."""
    return swings_by_its_loop(case) or case.runs_away or case.verdict not in _SAYS


def details_sentences(item: ShownCase, cases: Mapping[str, Case]) -> list[str]:
    """Say more about one case: what feeds hunting, other bandwidths, dwells, and what was not determined."""
    case, first = item.case, _verdict(item.case)
    if _friction_has_no_say(case):
        return []
    attracted = case.verdict in ATTRACTED
    feeds = feeding_sentences(case.feeding) if case.feeding else []
    feeds += [f"{_too_much('What feeds it')}."] if CheckPart.FEEDING in case.judgement.given_up else []
    after = _remedy(item, cases) if attracted else _outlook(case)
    stands = [] if attracted else dwell_sentences(case.dwells)
    return [*first[1:], *stands, *feeds, *after[1:], *_loop_lost(case), *friction_sentences(case)[1:]]


def details_of(cases: Mapping[str, Case]) -> list[str]:
    """Return the details of all cases, each with the name of its case."""
    return [f"{item.label}: {text}" for item in shown_cases(cases) for text in details_sentences(item, cases)]


def _verdict(case: Case) -> list[str]:
    """Say what the stage does in one case; sentences after the first are details."""
    if case.runs_away:
        return ["runs away from its reference for good."]
    if case.stick_slip and case.solver.done:
        return stick_slip_sentences(case.stick_slip, abs(case.stage.flat()["motion.velocity"]))
    if case.verdict in _SAYS:
        return _SAYS[case.verdict](case)
    if case.solver.done:
        return [_UNFINISHED]
    return [f"could not be simulated to the end of its motion ({case.solver.status})."]


def _after_loop(case: Case, sentences: str) -> str:
    """Say in which states the loop is unstable, whatever the friction, before what else is said of the stage.

    Returns `sentences` alone for a stable loop.
    """
    if case.unstable:
        return f"the loop is {unstable_where(case.unstable)}. {sentences[:1].upper()}{sentences[1:]}"
    return sentences


def answer(cases: Mapping[str, Case]) -> list[str]:
    """Return a sentence for each case: as given, joint locked, joint free; then the conclusion.

    If something was given up, the last sentence says which commands go on.
    """
    says = [f"{item.label}{if_so(item.case.stage)}: {verdict_sentence(item, cases)}" for item in shown_cases(cases)]
    return [*says, *filter(None, [conclusion(cases)]), *_goes_on(cases, says)]


def _goes_on(cases: Mapping[str, Case], says: Sequence[str]) -> Iterator[str]:
    """Yield which commands have no limit of work, if the sentences `says` on the cases leave something open."""
    asked = [case for case in cases.values() if not _friction_has_no_say(case)]
    if any(MORE_WORK in text for text in says) or any(case.judgement.given_up for case in asked):
        yield (
            "A check ends after a fixed amount of work. Without that limit, friso boundary follows hunting over a "
            "range of your choice (--x speed=0.5..2, or another key), friso map runs stages over one, and friso "
            "simulate runs one motion for longer (--set motion.duration)."
        )


def conclusion(cases: Mapping[str, Case]) -> str | None:
    """Say what the joint does to the hunting.

    Returns None if the stage hunts neither with its joint locked nor with it free, or if one of the two verdicts is not
    certain.
    """
    both = [cases[key] for key in ("locked", "free") if key in cases]
    words = [case.verdict for case in both]
    if len(words) < 2 or "failed" in words or not all(case.judgement.hunting.certain for case in both):
        return None
    locked, free = (word in ATTRACTED for word in words)
    if not free:
        return f"The free joint stops the hunting{_reserve(both[1])}." if locked else None
    if words == ["hunts", "bistable"]:
        return "The free joint stops the hunting after this move, but does not rule it out."
    return "The free joint does not stop the hunting." if locked else "The stage hunts only with its joint free."


def _reserve(case: Case) -> str:
    """Say that a stage which settles is close to hunting, if it is."""
    thin = thin_margins(case)
    sure = (case.static_friction is None or case.static_friction.certain) and (
        case.judgement.margin is None or case.judgement.margin.certain
    )
    back = "brings it back" if sure else "may bring it back"
    return f", but with little reserve: {listed(thin, 'or')} {back}" if thin else ""


def at_the_end(case: Case) -> str:
    """Write the peak-to-peak motion in the last quarter of a run."""
    return length_at_rest(case.peak_to_peak, _tolerance(case))


def _tolerance(case: Case) -> float:
    """Return the tolerance that the stage states [m]; 0 if it states none."""
    return float(case.stage.flat().get("tolerance.within", 0.0))


def encoder_step(case: Case) -> float:
    """Return the step of the stage's encoder [m]; 0 if the stage file states none."""
    return float(case.stage.flat().get("drive.encoder_resolution", 0.0))


def _hunting(case: Case) -> list[str]:
    """Describe a stage that hunts, and say whether the verdict rests on simulations alone."""
    judgement, seen = case.judgement, ["This rests on long simulations: no attracting orbit could be closed."]
    if not judgement.observed:
        return [f"hunts, {_swing(case)}."]
    if judgement.hunting.passing:
        return [f"hunts, {_swing(case)} when its run was stopped.", *seen]
    if judgement.swing:
        return [f"hunts, {_swing(case)}.", *seen]
    size, after = with_unit(judgement.lasting, "m"), with_unit(judgement.followed, "s")
    return [f"hunts, still {size} peak to peak after {after}.", *seen]


def _bistable(case: Case) -> list[str]:
    """Describe a stage that settles after this move but hunts after others.

    The sentence names the smallest kicks, and the fraction of moves, that start hunting.
    """
    kicks = (("displacement", case.judgement.displacement, "m"), ("push", case.judgement.push, "m/s"))
    starts = [_kick(name, kick, unit) for name, kick, unit in kicks if kick and kick.windows]
    if (moves := case.judgement.moves) and moves.hunting:
        starts.append(f"{percent(moves.fraction)} of the {moves.count} moves tried")
    first = f"settles after this move{_later(case)}{_stuck(case)}"
    if not starts and CheckPart.STARTS in case.judgement.given_up:
        return [f"{first}, but another move or a kick may start hunting, {_swing(case)}; {_too_much('which ones do')}."]
    if case.judgement.hunting.passing:
        after = _AFTERWARDS[case.judgement.hunting.lower_gains or "unknown"]
        return [f"{first}, but another move or a kick may start a swing that {after}."]
    if not starts:
        return [f"{first}, and none of the kicks and moves tried starts hunting ({_swing(case)})."]
    seen = ["Hunting was observed in simulations; no orbit that attracts could be closed."]
    drawn = [f"Moves were spread evenly over {moves_tried(case, moves)}."] if moves and moves.hunting else []
    says = f"{first}, but {listed(starts, 'or')} can start hunting, {_swing(case)}."
    return [says, *(seen if case.judgement.observed else []), *drawn]


def moves_tried(case: Case, moves: MoveShare) -> str:
    """Write from which ranges of the motion's keys moves were drawn, such as "acceleration 10.0 to 200 m/s²"."""
    fields = numeric_fields(motion_of(case.stage.flat()))
    named = {key.partition(".")[2]: ends for key, ends in moves.ranges.items()}
    ranges = [
        f"{name.replace('_', ' ')} {range_with_unit(*ends, getattr(fields[name], 'unit', ''))}"
        for name, ends in named.items()
    ]
    return listed(ranges, "and")


def _following(case: Case) -> list[str]:
    """Describe a stage whose reference keeps moving; there is no verdict on its hunting."""
    follows = following_sentence(case.tracking) if case.tracking else "could not be followed on its periodic response."
    return [f"{follows} There is no verdict on hunting, because {case.judgement.hunting.reason}."]


def _too_much(what: str) -> str:
    """Say that something, named by `what`, was not determined because it takes too much work."""
    return f"{what} was not determined, as that takes {MORE_WORK}"


def _kick(name: str, kick: Kick, unit: str) -> str:
    """Write the smallest kick that starts hunting, and whether a smaller one was tried."""
    least = kick.smallest or 0.0
    tried = " (the smallest tried)" if abs(least) == kick.searched[0] else ""
    return f"a {name} of {with_unit(abs(least), unit)}{_direction(kick)}{tried}"


def _direction(kick: Kick) -> str:
    """Say in which direction the smallest kick starts hunting; empty if directions are alike."""
    if kick.symmetric:
        return ""
    return f" in the {'positive' if (kick.smallest or 0.0) > 0 else 'negative'} direction"


def _transient(case: Case) -> list[str]:
    """Describe a stage without attracting cycle that has not settled at the end of its run.

    The sentences say how fast it settles afterwards, or what keeps it from its reference.
    """
    judgement, end = case.judgement, _end(case)
    if not judgement.hunting.possible:
        if case.tracking:
            return [f"{following_sentence(case.tracking)} It cannot hunt, because {judgement.hunting.reason}."]
        cannot = f"cannot hunt, because {judgement.hunting.reason}; but this motion "
        return [f"{cannot if judgement.hunting.certain else ''}has not settled at its end ({end}){_held(case)}."]
    leaks = _held_by_a_leak(case)
    if leaks and case.peak_to_peak < case.bands[1] and judgement.hunting.certain and not judgement.runs_away:
        stays = f"; it is still there after {with_unit(judgement.followed, 's')}" if judgement.followed else ""
        return [f"does not hunt, but {leaks}{stays}."]
    none = "" if swings_by_its_loop(case) else "does not hunt, but "
    first = f"{none}has not settled at the end of its run ({end}){_held(case)}"
    if judgement.runs_away:
        first += "; afterwards it runs away from its reference"
    elif judgement.settled_after is not None:
        first += f"; it settles to within {band_text(case.bands[1])} in {with_unit(judgement.settled_after, 's')}"
    elif judgement.followed is not None:
        first += f"; it does not in {with_unit(judgement.followed, 's')} either"
    seen_to_its_end = judgement.settled_after or judgement.followed or judgement.runs_away
    more = [] if seen_to_its_end else [f"{_too_much('How long it takes to settle')}."]
    if judgement.cycle:
        grows = f"a factor of e in {with_unit(judgement.cycle.time_constant, 's')}"
        more.append(f"Beside its unstable cycle, deviations grow by {grows}: a disturbance there changes this time.")
    return [f"{first}.", *more]


def _held_by_a_leak(case: Case) -> str:
    """Say how far off its reference the leak of the integral holds a stage; empty without a leak, or at a limit."""
    if not integral_leak(case.stage.flat()) or case.force_limit is not None:
        return ""
    off = length_at_rest(abs(case.offset), _tolerance(case))
    return f"rests {off} off its reference: the leak of its integral holds it there"


def _held(case: Case) -> str:
    """Say how large the force limit is, and if break-away takes more; empty without a limit."""
    if case.force_limit is None:
        return ""
    limit, least = _forces(case.force_limit, case.breakaway)
    more = f", and break-away takes {least}" if case.force_limit < case.breakaway else ""
    return f", with its force at {FORCE_LIMIT}, {limit}{more}"


def _forces(*forces: float) -> list[str]:
    """Write forces [N] with as many digits as tell them apart."""
    digits = digits_that_differ(forces)
    return [with_unit(force, "N", digits) for force in forces]


def _settling(case: Case) -> list[str]:
    """Describe a stage that settles, and say why it cannot hunt, if that is certain."""
    hunting, says = case.judgement.hunting, _settling_sentence(case)
    if not hunting.possible and hunting.certain:
        return [f"{says[:-1]}; it cannot hunt, because {hunting.reason}."]
    return [f"{says[:-1]}, barely." if thin_margins(case) else says]


def _later(case: Case) -> str:
    """Say that a motion which still swings at the end of its run comes to rest later.

    The text is empty if the motion settles within its run, or swings by less than the wider band. It is also empty if
    the stage ends farther off its reference.
    """
    band = case.bands[1]
    if case.in_the_end[band] is not None or case.peak_to_peak < band or case.offset > band:
        return ""
    return f" (later than in its run of {with_unit(case.stage.flat()['motion.duration'], 's')})"


def _stuck(case: Case) -> str:
    """Add that the motion does not break the stage away, with both forces; empty if it does."""
    if not case.unmoved:
        return ""
    force, least = _forces(case.largest_force, case.breakaway)
    return f" without breaking away (it exerts at most {force}; break-away takes {least})"


def _settling_sentence(case: Case) -> str:
    """Say how fast a stage settles, and into which band."""
    (fine, coarse), (into_fine, into_coarse) = case.bands, map(case.settling_time.get, case.bands)
    stuck, small, wide = _stuck(case), _band(case, fine), _band(case, coarse)
    if into_fine == 0 and stuck:
        return f"settles: it ends within {small} of its reference{stuck}."
    if into_fine == 0:
        return f"stays within {small} of its reference from the end of the motion on."
    if into_fine is not None:
        return f"settles to within {small} in {with_unit(into_fine, 's')}{stuck}."
    if into_coarse is not None:
        within = f"settles to within {wide} in {with_unit(into_coarse, 's')}{stuck}"
        swing = _small_swing(case)
        off = abs(case.offset) > fine and case.in_the_end[fine] is None
        finer = f"not to within {small}{_at_the_far_end(case, fine)}"
        finer = (off and _held_by_a_leak(case)) or finer
        return f"{within}, but {f'does not stay within {small}{swing}' if swing else finer}."
    if far := _at_the_far_end(case, coarse):
        within = f"settles to within {wide} in {with_unit(case.in_the_end[coarse] or 0.0, 's')}"
        return f"{within}{stuck}, but not{far}."
    return f"settles{stuck}, but not to within {wide} ({_end(case)}){_held(case)}."


def _band(case: Case, band: float) -> str:
    """Write a band [m], and what of the machine makes it so wide."""
    causes = {
        float(dead_band(case.stage.flat())): "within which its controller exerts no force",
        encoder_step(case): "a step of its encoder",
    }
    return f"{band_text(band)}{f' ({causes[band]})' if band in causes else ''}"


def _at_the_far_end(case: Case, band: float) -> str:
    """Say that only the far end of the motion misses a band [m] in time; empty otherwise."""
    return " at the far end before it returns" if case.in_the_end.get(band) is not None else ""


def _small_swing(case: Case) -> str:
    """Describe the swing of a motion that stays within the wider band; empty if it does not swing."""
    if not case.period or case.peak_to_peak < case.bands[0]:
        return ""
    return f": at its end it swings by {at_the_end(case)} peak to peak every {with_unit(case.period, 's')}"


def _doubt_of(case: Case) -> str:
    """Say why the verdict is not certain, as the end of its sentence; empty if it is certain."""
    hunting = case.judgement.hunting
    return "" if hunting.certain else f" (not certain: {hunting.reason})"


def _running_away(case: Case) -> str:
    """Say that large motions grow without bound, or may do so, and what prevents it; empty if they do not."""
    cause = 'set controller.anti_windup, which is "none", to "clamp"'
    if (away := case.judgement.running_away) and away.windows:
        return f"it runs away after {_kick('displacement', away, 'm')}{_or_more(away)}: {cause}"
    may = {"unstable": "large motions may run away", "unknown": "it is not known whether large motions run away"}
    says = may.get(case.judgement.hunting.lower_gains or "")
    return f"{says}: {cause}" if says else ""


def _or_more(kick: Kick) -> str:
    """Add " or more" if all larger kicks searched in that direction do the same; else nothing."""
    least = kick.smallest or 0.0
    return " or more" if kick.towards(least) == ((abs(least), kick.searched[1]),) else ""


def _outlook(case: Case) -> list[str]:
    """Say at which other bandwidths the stage hunts, or that none was found, and what makes a thin margin wider."""
    judgement, away = case.judgement, _running_away(case)
    says: list[str] = []
    above, below = (_places(case, side, 1.0) for side in (1, -1))
    if judgement.margin and not _holds(case.unstable_bandwidths, judgement.margin.factor):
        up_to = "below" if judgement.margin.certain else "up to"
        again = f", and again {listed(above, 'and')}" if above else ""
        says.append(f"Hunting is possible {up_to} {edge_text(case, judgement.margin.end)}{again}.")
    elif not judgement.margin and judgement.hunting.possible and CheckPart.BANDWIDTHS not in judgement.given_up:
        but = f", but it is possible {listed(above, 'and')}" if above else ""
        says.append(f"No hunting was found down to {percent(SEARCH_LIMITS.lowest_bandwidth)} of this bandwidth{but}.")
    else:
        below = [*below, *above]
    if case.verdict == "settles" and case.faster and case.faster.keeps_friction:
        says.insert(0, f"{_capital(_to(case, case.faster))} gives it reserve.")
    if away:
        says.insert(0, f"{_capital(away)}.")
    return [*says, *_possible_again(case, below), *_unsearched(case)]


def _unsearched(case: Case) -> list[str]:
    """Say that the search for hunting at other bandwidths was stopped, if it was."""
    if CheckPart.BANDWIDTHS not in case.judgement.given_up:
        return []
    if case.judgement.margin and case.judgement.margin.certain:
        return [f"{_too_much('Whether hunting is possible again at other bandwidths')}."]
    if case.judgement.margin:
        return [f"The search for the edge of hunting was given up there: it takes {MORE_WORK}."]
    return [f"{_too_much('At which bandwidths hunting is possible')}."]


def edge_text(case: Case, end: AttractionEnd) -> str:
    """Write a bandwidth at which hunting ends.

    For an uncertain edge, the text states where hunting was found and where not.
    """
    if not end.certain:
        ends = sorted((end.inside, end.outside))
        low, high = _bandwidth(case, ends[0], up=False, digits=4), _bandwidth(case, ends[1], digits=4)
        return f"somewhere between {low} and {high}"
    text, error = _edge_and_error(case, end)
    return f"{text} (at the centre of its ranges)" if case.stage.uncertain() else f"{text}{_within(error)}"


def _edge_and_error(case: Case, end: AttractionEnd) -> tuple[str, float]:
    """Write the bandwidth at a certain end of hunting, and return its relative error (0: less than its last digit)."""
    if end.reserve < ROUGH_EDGE:
        return _bandwidth(case, end.inside, up=None, digits=4), 0.0
    value, digits = end.inside * (_present_bandwidth(case) or 1.0), 4 if end.reserve < ROUGHER else 3
    stated = float(f"{value:.{digits}g}")
    bound = (end.reserve * value + abs(stated - value)) / stated
    return _bandwidth(case, end.inside, up=None, digits=digits), bound


def _within(error: float) -> str:
    """Write the relative error of a bandwidth, such as " (± 2 %)"; empty for none."""
    return f" (± {percent(rounded_up(error, 1), 1)})" if error else ""


def _present_bandwidth(case: Case) -> float | None:
    """Return the bandwidth of the stage [Hz]; None if its controller sets none."""
    edge = case.judgement.margin
    return edge.crossover / edge.factor if edge and edge.crossover else bandwidth(case.stage.flat())


def _bandwidth(case: Case, factor: float, up: bool | None = True, digits: int = 3) -> str:
    """Write a bandwidth that is `factor` times that of the stage, rounded to some digits.

    It is rounded up if `up` is true, down if `up` is false, and to the nearest number if `up` is None.
    """
    crossover = _present_bandwidth(case)
    value = factor * (crossover or 1.0)
    if up is not None:
        value = (rounded_up if up else rounded_down)(value, digits)
    if crossover is None:
        return f"{value:.{digits}g}{TIMES}"
    key = _elsewhere(case)
    return f"{key} = {with_unit(value, 'Hz', digits)}" if key else with_unit(value, "Hz", digits)


def _elsewhere(case: Case) -> str | None:
    """Return the key that sets the bandwidth, unless this key is a crossover.

    Returns None for a crossover, and if no key sets the bandwidth.
    """
    controller = case.stage.controller
    return None if controller.bandwidth_name == "crossover" else controller.bandwidth_key


def _hunting_windows(case: Case) -> list[BandwidthWindow]:
    """Return the ranges of the bandwidth, beside that of the edge, in which the stage hunts and its loop is stable."""
    windows = list(case.judgement.windows)
    for lost in case.unstable_bandwidths:
        windows = [part for window in windows for part in window.without(lost)]
    return windows


def _places(case: Case, side: int, factor: float) -> list[str]:
    """Write in which ranges of the bandwidth the stage hunts again, above (`side` 1) or below (-1) a factor of it."""
    return [_window(case, window) for window in _hunting_windows(case) if window.lies(side, factor)]


def _possible_again(case: Case, places: Sequence[str]) -> list[str]:
    """Say in which ranges of the bandwidth hunting is possible, beside that of the edge if there is one."""
    again = " again" if case.judgement.margin else ""
    return [f"Hunting is possible{again} {listed(places, 'and')}."] if places else []


def _loop_lost(case: Case) -> list[str]:
    """Say at which bandwidths friction does not matter, because the loop is unstable; empty without any."""
    places = [_window(case, window) for window in case.unstable_bandwidths]
    return [f"The loop itself is unstable, whatever the friction, {listed(places, 'and')}."] if places else []


def _window(case: Case, window: BandwidthWindow) -> str:
    """Write a range of bandwidths, such as one beyond the edge of hunting in which the stage hunts again."""
    low, high = window.low, window.high
    if low and high and high.inside < low.inside * SEARCH_LIMITS.narrow_window:
        width = percent(high.outside / low.outside - 1)
        middle = (low.inside + high.inside) / 2
        return f"within a range of at most {width} about {_bandwidth(case, middle, up=None, digits=5)}"
    lowest, highest = (
        f"{_bandwidth(case, factor, up=None)} (the {name} searched)"
        for factor, name in ((SEARCH_LIMITS.lowest_bandwidth, "lowest"), (SEARCH_LIMITS.highest_bandwidth, "highest"))
    )
    if low and high and low.certain and high.certain:
        (first, error), (last, other) = _edge_and_error(case, low), _edge_and_error(case, high)
        return f"from {first.removesuffix(TIMES)} to {last}{_within(max(error, other))}"
    return f"from {edge_text(case, low) if low else lowest} to {edge_text(case, high) if high else highest}"


def activity_sentences(condition: str) -> list[str]:
    """Say that a law may give energy back, with the `condition` under which it is passive.

    An empty condition means that the law is passive, and nothing is said.
    """
    return [f"The law may give energy back, which no friction does. It is passive where {condition}."] * bool(condition)


def between_surveyed(cases: Mapping[str, Case]) -> list[str]:
    """Say what the survey of bandwidths may have missed between its steps.

    The list is empty if no case has a margin in bandwidth.
    """
    if all(case.judgement.margin is None for case in cases.values()):
        return []
    low, high = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
    steps = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    fine, coarse = (percent(10 ** (1 / count) - 1) for count in steps)
    return [
        f"Bandwidths from {low:g} to {high:g} times this one were surveyed, {fine} or {coarse} apart. Other ranges in "
        "which the stage hunts, narrower than these steps, may lie between (friso boundary follows cycles from more "
        "bandwidths).",
    ]


def _remedy(item: ShownCase, cases: Mapping[str, Case]) -> list[str]:
    """Say what keeps a stage from hunting: a faster or slower controller, or a free joint."""
    case, judgement = item.case, item.case.judgement
    grows = judgement.hunting.passing and judgement.hunting.lower_gains == "unstable"  # the faster the loop, the sooner
    ways = [_to(case, case.faster)] if case.faster and not grows else []
    ways += [_to(case, case.slower)] if case.slower else []
    ways += ["free the joint"] if freeing_helps(item, cases) else []
    away = _running_away(case)
    cure = [f"Cure: {listed(ways, 'or')}{away and f'; {away}'}."] if ways else [f"{_capital(away)}."] if away else []
    if judgement.margin or CheckPart.BANDWIDTHS in judgement.given_up:
        told = [place for advice in (case.faster, case.slower) if advice for place in _beyond(case, advice)]
        others = [place for window in _hunting_windows(case) if (place := _window(case, window)) not in told]
        return [*cure, *_possible_again(case, others), *_unsearched(case)]
    if judgement.hunting.target is None:
        return cure
    still = "is still possible" if judgement.hunting.certain else "was still found"
    highest = f"{still} at {SEARCH_LIMITS.highest_bandwidth:g} times this bandwidth"
    to_the_top = (
        f"{still} up to where the loop itself is unstable" if _holds(case.unstable_bandwidths, math.inf) else highest
    )
    tune = "" if ways else "; friso tune looks for other settings"
    given_up = CheckPart.LOWER_BANDWIDTHS in judgement.given_up
    open_below = [f"{_too_much('Whether it hunts at lower bandwidths')}."] if given_up else []
    return [*cure, f"Hunting {to_the_top}{tune}.", *open_below]


def _holds(windows: Iterable[BandwidthWindow], factor: float) -> bool:
    """Tell whether one of some windows of bandwidths holds a factor on the stage's bandwidth."""
    return any(window.holds(factor) for window in windows)


def _to(case: Case, advice: BandwidthAdvice) -> str:
    """Name the bandwidth advised, with the edge of hunting, and what it does not allow for."""
    up, crossover = advice.factor >= 1, _present_bandwidth(case)
    edge = advice.edge
    at_edge = _bandwidth(case, edge.inside, up=None) if edge.inside != edge.outside else ""
    remarks = [f"edge {at_edge}"] if at_edge and edge.certain else []
    if not edge.certain:
        seen = _bandwidth(case, edge.inside, up=not up, digits=4)
        remarks.append(f"not certain: hunting was found {'up' if up else 'down'} to {seen}")
    if advice.just_beyond:
        remarks.append("just beyond it, as more would not be safe")
    if again := _beyond(case, advice):
        remarks.append(f"hunting is possible again {listed(again, 'and')}")
    if advice.keeps_friction is not None:
        friction = other_static_friction(case.stage.flat())
        remarks.append(f"also {friction}" if advice.keeps_friction else f"but hunting returns there {friction}")
    elif case.static_friction and not advice.just_beyond:
        remarks.append("not examined with other static friction")
    remark = f" ({'; '.join(remarks)})" if remarks else ""
    return f"{speed_text(case.stage.controller, crossover, advice.factor, up)}{remark}"


def _beyond(case: Case, advice: BandwidthAdvice) -> list[str]:
    """Write in which ranges of the bandwidth the stage hunts again on the side to which an advice leads."""
    return _places(case, 1 if advice.factor >= 1 else -1, advice.edge.outside)


def speed_text(controller: ControllerSection, own: float | None, factor: float, up: bool = True) -> str:
    """Name a controller that is faster or slower by a factor: by its bandwidth, or by its gains if it states none.

    `own` is its present bandwidth [Hz]. The value is rounded up if `up` is true, otherwise down.
    """
    away = rounded_up if up else rounded_down
    if own is not None:
        crossover = controller.bandwidth_name == "crossover" or not controller.bandwidth_key
        name = controller.bandwidth_name.replace("_", " ") if crossover else controller.bandwidth_key
        return f"{name} {with_unit(away(factor * own), 'Hz')}"
    factor, powers = away(factor), controller.speeds_up.items()
    gains = [f"{name} × {factor**power:.3g}" for name, power in powers if getattr(controller, name)]
    return f"a controller {plain_factor(factor)} times as fast ({', '.join(gains)})"


def _capital(text: str) -> str:
    """Return a text with a capital letter."""
    return f"{text[:1].upper()}{text[1:]}"


def freeing_helps(item: ShownCase, cases: Mapping[str, Case]) -> bool:
    """Tell whether a locked joint, if freed, surely ends the hunting."""
    joint, free = item.case.stage.joint, cases.get("free")
    if free is None or joint is None or not joint.locked:
        return False
    return free.verdict in ("settles", "transient") and free.judgement.hunting.certain


def _swing(case: Case) -> str:
    """Write the size and period of the hunting cycle, such as "±0.52 mm every 1.63 s"."""
    swing = case.judgement.swing
    assert swing  # the verdict implies an attracting cycle
    turns, size = swing.swings / 2, swing_with_unit(swing.amplitude, swing.middle, "m")
    often = f"{size} every {with_unit(swing.period / turns, 's')}"
    if turns == 1:
        return often
    return f"up to {often}, each swing unlike the next (it repeats itself after {with_unit(swing.period, 's')})"


def _end(case: Case) -> str:
    """Write the residual motion in the last quarter of the run."""
    if case.peak_to_peak < case.bands[1]:
        return f"at rest, but {length_at_rest(abs(case.offset), _tolerance(case))} off its reference"
    if not case.period:
        return f"in its last quarter it still moves by {at_the_end(case)}"
    return f"still {at_the_end(case)} peak to peak every {with_unit(case.period, 's')}"


def feeding_sentences(feeding: Feeding) -> list[str]:
    """Say whether hunting ends without friction or without backlash, and at which fraction."""
    friction, backlash = feeding.friction, feeding.backlash
    if friction is None:
        feeds = "The backlash feeds it" if backlash.needed else "The backlash does not feed it"
        return [f"{feeds}: there is no dry friction; {_course('backlash', backlash)}.", *_doubt(backlash)]
    feeds = {
        (True, True): "Friction and backlash feed it together, and it ends without either of them",
        (True, False): "Friction feeds it, not the backlash",
        (False, True): "The backlash feeds it, not the friction",
        (False, False): "Either friction or backlash alone would feed it",
    }[friction.needed, backlash.needed]
    return [
        f"{feeds}: {_course('dry friction', friction)}; {_course('backlash', backlash)}.",
        *_doubt(friction, backlash),
    ]


def _course(name: str, decline: Decline) -> str:
    """Say how hunting changes as friction or backlash is scaled down."""
    if decline.gone == 0:
        return f"it shrinks in proportion to the {name}, and is gone without it"
    if decline.gone is None:
        return f"it lasts down to {percent(decline.lasts, 3)} of the {name}"
    return f"it persists at {decline.lasts:.3g} times the {name} and disappears at {decline.gone:.3g} times"


def _doubt(*declines: Decline) -> list[str]:
    """Return a sentence if the result is not certain; an empty list otherwise."""
    certain = all(decline.certain for decline in declines)
    doubt = "That is not certain: some simulations were given up, or swings too small for them to see may last."
    return [] if certain else [doubt]


_SAYS: Mapping[str, Callable[[Case], list[str]]] = {
    "hunts": _hunting,
    "bistable": _bistable,
    "transient": _transient,
    "settles": _settling,
    "none": _following,
}
"""Sentences for each verdict."""
