"""Write the numbers of each case of a check: as texts for the table, and in SI for the JSON document.

The cases are the stage as given, with its joint locked, and with its joint free.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from friso import hunting
from friso.axis import axis_shown
from friso.hunting import MORE_WORK, Case, CheckPart, Cycle, Kick, Tracking
from friso.hunting.criteria import COUNTED_AFTER
from friso.quantities import percent, plain_factor
from friso.questions.check.margin_words import margin_ways
from friso.questions.check.words import at_the_end, edge_text, moves_tried
from friso.shown.blocks import filled
from friso.shown.documents import dwells_document, entries, plain_json, tracking_document, unit_suffix
from friso.shown.motion_words import ShownCase, band_text, verdict_in_short
from friso.shown.text import (
    NOTHING,
    listed,
    percent_range,
    range_with_unit,
    swing_with_unit,
    window_with_unit,
    with_unit,
)

if TYPE_CHECKING:
    from friso.stage import Stage

MOST_WINDOWS = 4  # largest number of listed windows of kicks
UNKNOWN = f"not determined: that takes {MORE_WORK}"


def rows(cases: tuple[ShownCase, ...]) -> list[tuple[str, list[str]]]:
    """Return the rows of the table, one text for each case; rows without any entry are left out."""
    return _rows(_NUMBERS, cases)


def rows_behind(cases: tuple[ShownCase, ...]) -> list[tuple[str, list[str]]]:
    """Return further rows, for readers who know the method: on what the verdict rests.

    A row has its name and one text for each case; rows without any entry are left out.
    """
    return _rows(_BEHIND, cases)


def _rows(columns: dict[str, Callable[[Case], str]], cases: tuple[ShownCase, ...]) -> list[tuple[str, list[str]]]:
    """Return rows with one text for each case.

    `columns` has, by the name of a row, the function that writes a text about a case.
    """
    effort = axis_shown().effort
    fine, coarse = map(band_text, cases[0].case.bands)
    texts = {
        name.format(effort=effort, fine=fine, coarse=coarse): [text(item.case) for item in cases]
        for name, text in columns.items()
    }
    return filled(texts.items())


def _of_the_cycle(text: Callable[[Cycle], str]) -> Callable[[Case], str]:
    """Return a function that writes `text` about the hunting cycle of a stage, if it has one."""

    def of_the_case(case: Case) -> str:
        """Write the text about the cycle of a stage, or that there is none."""
        cycle = case.judgement.cycle
        return text(cycle) if cycle else NOTHING

    return of_the_case


def _amplitude(cycle: Cycle) -> str:
    """Write the amplitude of a cycle, and whether it repels."""
    return f"{swing_with_unit(cycle.amplitude, cycle.middle, 'm', 4)}{'' if cycle.attracts else ' (repels)'}"


def _time_constant(cycle: Cycle) -> str:
    """Write the time in which deviations from a cycle shrink by the factor e; a dash for one that repels."""
    return with_unit(cycle.time_constant, "s") if cycle.attracts else NOTHING


def _multiplier(cycle: Cycle) -> str:
    """Write the Floquet multiplier of a cycle, and the growth that a simulation shows."""
    simulated = f" (simulated: {cycle.growth:.4f})" if cycle.growth == cycle.growth else ""
    return f"{cycle.multiplier:.4f}{simulated}"


def _decided(cycle: Cycle) -> str:
    """Say over which part of a period the multiplier was computed, and by which method."""
    method = "slope of the returns" if cycle.multiplier == cycle.slope else "Floquet"
    return f"{'half a' if cycle.symmetric else 'a whole'} period ({method})"


def _further_cycles(case: Case) -> str:
    """List the cycles of a stage, except the one that decides the verdict."""
    judgement = case.judgement
    return (
        "; ".join(_further_cycle(cycle) for cycle in judgement.hunting.cycles if cycle is not judgement.cycle)
        or NOTHING
    )


def _further_cycle(cycle: Cycle) -> str:
    """Describe a cycle by symmetry, amplitude and stability."""
    kind, does = "symmetric" if cycle.symmetric else "asymmetric", "attracts" if cycle.attracts else "repels"
    return f"{kind}, {swing_with_unit(cycle.amplitude, cycle.middle, 'm', 4)}, {does}"


def _observed(case: Case) -> str:
    """List the swings that were observed in simulations."""
    swings = case.judgement.hunting.observed
    return (
        "; ".join(
            f"{swing_with_unit(s.amplitude, s.middle, 'm', 4)} every {with_unit(s.period, 's', 4)}" for s in swings
        )
        or NOTHING
    )


def _edge(case: Case) -> str:
    """Write the bandwidth at which hunting ends, and whether it is certain."""
    edge = case.judgement.margin
    if edge is None:
        return UNKNOWN if CheckPart.BANDWIDTHS in case.judgement.given_up else NOTHING
    return f"{edge_text(case, edge.end)}{'' if edge.certain else ' (not certain)'}"


def _static_friction(case: Case) -> str:
    """Write the static friction at which hunting begins or ends."""
    margin = case.static_friction
    if margin is None:
        return NOTHING
    low, high = (plain_factor(factor) for factor in margin.range)
    does = "ends" if margin.attracts else "begins"
    ways = listed(margin_ways(margin), "or")
    says = f"{does} {ways}" if ways else f"no other from {low} to {high} times yours"
    return UNKNOWN if margin.open_sides and not ways else f"{says}{'' if margin.certain else ' (not certain)'}"


def _kicks(case: Case, kick: Kick | None, unit: str) -> str:
    """Write the kicks that start hunting, and the range that was searched."""
    if kick is None:
        return UNKNOWN if CheckPart.STARTS in case.judgement.given_up else NOTHING
    searched = range_with_unit(*kick.searched, unit)
    if not kick.windows:
        return UNKNOWN if kick.unknown else f"none from {searched}"
    lost = f" ({kick.unknown} run{'s were' if kick.unknown > 1 else ' was'} given up)" if kick.unknown else ""
    if kick.symmetric:
        return f"{_windows(kick, 1.0, unit, searched)}{lost}"
    positive, negative = (_windows(kick, side, unit, searched) for side in (1.0, -1.0))
    return f"{positive}; in the negative direction {negative}{lost}"


def _windows(kick: Kick, side: float, unit: str, searched: str) -> str:
    """Write the ranges of kicks in one direction that start hunting; `searched` is the range tried."""
    windows = kick.towards(side)
    if not windows:
        return f"none from {searched}"
    if windows == (kick.searched,):
        return f"all that were tried, {searched}"
    texts = [window_with_unit(*window, kick.searched, unit) for window in windows[:MOST_WINDOWS]]
    more = len(windows) - len(texts)
    text = ", ".join([*texts, *([f"and {more} more range{'s' * (more > 1)}"] if more else [])])
    open_ended = windows[0][0] == kick.searched[0] or windows[-1][1] == kick.searched[1]
    return f"{text} (tried: {searched})" if open_ended else text


def _moves(case: Case) -> str:
    """Write the fraction of the moves tried that end in hunting, with its interval."""
    moves = case.judgement.moves
    if moves is None:
        return UNKNOWN if CheckPart.STARTS in case.judgement.given_up else NOTHING
    low, high = moves.interval
    return f"{percent(moves.fraction)} ({percent_range(low, high)}) of {moves.count} moves"


def _moves_tried(case: Case) -> str:
    """Write from which ranges of the motion's keys moves were drawn."""
    moves = case.judgement.moves
    return f"{moves_tried(case, moves)}, evenly" if moves else NOTHING


def peaks_shown(case: Case) -> str:
    """Write the peak count, and why it may contradict the verdict.

    A run that ends too early has none, nor has a rotary axis, as the thesis counts peaks by their height in mm.
    """
    duration = case.stage.flat()["motion.duration"]
    if duration <= COUNTED_AFTER or not axis_shown().plain:
        return NOTHING
    remarks = {
        ("bistable", True): " (a long transient)",
        ("transient", True): " (a long transient)",
        ("settles", True): " (a long transient)",
    }
    return f"{case.peaks}{remarks.get((case.verdict, case.peaks > 0), '')}"


def _settled_within(number: int) -> Callable[[Case], str]:
    """Return a function that writes a stage's settling time into its band with this number, 0 or 1."""

    def text(case: Case) -> str:
        """Write the settling time of a stage, or why there is none."""
        band = case.bands[number]
        time = case.settling_time[band]
        if case.tracking:
            return NOTHING
        if time is not None:
            return with_unit(time, "s")
        if case.in_the_end.get(band) is not None:
            return f"not before it returns; {with_unit(case.in_the_end[band] or 0.0, 's')} afterwards"
        return "never" if case.verdict == "hunts" else "not in this run"

    return text


def _tracked(size: Callable[[Tracking], float]) -> Callable[[Case], str]:
    """Return a function that writes how well a stage follows a reference that keeps moving.

    `size` reads the error [m] to write. For a reference that stops, a dash is written.
    """
    return lambda case: with_unit(size(case.tracking), "m") if case.tracking else NOTHING


_NUMBERS: dict[str, Callable[[Case], str]] = {
    "Verdict": verdict_in_short,
    "Hunting cycle, amplitude": _of_the_cycle(_amplitude),
    "Hunting cycle, period": _of_the_cycle(lambda cycle: with_unit(cycle.period, "s", 4)),
    "Other hunting cycles": _further_cycles,
    "Observed in simulations": _observed,
    "Hunting cycle, time constant": _of_the_cycle(_time_constant),
    "Edge of hunting": _edge,
    "Hunting, by static friction": _static_friction,
    "Displacements that hunt": lambda case: _kicks(case, case.judgement.displacement, "m"),
    "Pushes that hunt": lambda case: _kicks(case, case.judgement.push, "m/s"),
    "Moves that end in hunting": _moves,
    "Moves tried": _moves_tried,
    "Peak to peak, last quarter": at_the_end,
    "Period, last quarter": lambda case: with_unit(case.period, "s"),
    "Largest error on the way": _tracked(lambda tracking: tracking.largest),
    "Error on the way, RMS": _tracked(lambda tracking: tracking.rms),
    "Settling time into {fine}": _settled_within(0),
    "Settling time into {coarse}": _settled_within(1),
    "Largest actuator {effort}": lambda case: with_unit(case.largest_force, "N"),
}

_BEHIND: dict[str, Callable[[Case], str]] = {
    "Hunting multiplier": _of_the_cycle(_multiplier),
    "Multiplier taken over": _of_the_cycle(_decided),
    "Counted peaks": peaks_shown,
    "Solver status": lambda case: case.solver.status,
    "Steps (rejected)": lambda case: f"{case.solver.steps} ({case.solver.rejected})",
}


def _feeding(feeding: hunting.Feeding) -> dict[str, Any]:
    """Return the fractions of friction and backlash down to which hunting persists."""
    parts = {"friction": feeding.friction, "backlash": feeding.backlash}
    return {name: asdict(part) | {"needed": part.needed} for name, part in parts.items() if part}


def case_document(case: hunting.Case) -> dict[str, Any]:
    """Return all results for one state of the joint: verdict, run, cycle, margins and basins."""
    into_fine, into_coarse = (case.settling_time[band] for band in case.bands)
    last_fine, last_coarse = (case.in_the_end[band] for band in case.bands)
    judgement = case.judgement
    return {
        "verdict": case.verdict,
        "verdict_in_short": verdict_in_short(case),
        **entries(case, "peaks", "peak_to_peak_m", "period_s"),
        "bands_m": case.bands,
        "settling_time_s": into_fine,
        "settling_time_10um_s": into_coarse,
        "settling_time_in_the_end_s": last_fine,
        "settling_time_10um_in_the_end_s": last_coarse,
        **entries(case, "largest_force_n", "unmoved"),
        "breakaway_force_n": case.breakaway,
        "cycle": _cycle(judgement.cycle) if judgement.cycle else None,
        "cycles": len(judgement.hunting.cycles),
        "reason": judgement.hunting.reason or None,
        "doubt": reason.name.lower() if isinstance(reason := judgement.hunting.reason, hunting.HuntingDoubt) else None,
        "settled_after_s": judgement.settled_after,
        "margin": _margin(judgement.margin) if judgement.margin else None,
        "windows": _bandwidths(judgement.windows),
        "settles_below": _end(judgement.lower),
        "static_friction": margin_document(case.static_friction) if case.static_friction else None,
        "advice": {"faster": _advice(case.faster), "slower": _advice(case.slower)},
        "kick": _kick(judgement),
        "displacements_that_run_away_m": judgement.running_away.windows if judgement.running_away else None,
        "moves": {"drawn": judgement.moves.count, "hunting": judgement.moves.hunting} if judgement.moves else None,
        **entries(judgement, "observed", "given_up"),
        "loop_unstable_while_it": case.unstable,
        "loop_unstable_bandwidths": _bandwidths(case.unstable_bandwidths),
        **({"feeding": _feeding(case.feeding)} if case.feeding else {}),
        **({"dwells": dwells_document(case.dwells)} if case.dwells else {}),
        **({"tracking": tracking_document(case.tracking)} if case.tracking else {}),
        **({"stick_slip": _stick_slip(case.stick_slip)} if case.stick_slip else {}),
        "observed_swings": [_swing(swing) for swing in judgement.hunting.observed],
        "certain": judgement.hunting.certain,
        "solver": entries(case.solver, "status", "steps", "rejected", "rtol"),
    }


def _cycle(cycle: hunting.Cycle) -> dict[str, Any]:
    """Return the properties of a hunting cycle."""
    names = ("amplitude_m", "period_s", "multiplier", "symmetric", "attracts", "slope", "growth", "residual")
    return {**entries(cycle, *names, "time_constant_s", "extremes_m"), **_of_swing(cycle)}


def _swing(swing: hunting.Swing) -> dict[str, Any]:
    """Return amplitude and period of a swing that was observed in a run."""
    return {**entries(swing, "amplitude_m", "period_s", "regular", "extremes_m"), **_of_swing(swing)}


def _of_swing(swing: hunting.Cycle | hunting.Swing) -> dict[str, Any]:
    """Return the middle of a swing, and its number of swings."""
    return {"offset_m": swing.middle, "swings_per_period": swing.swings}


def _kick(judgement: hunting.Judgement) -> dict[str, Any] | None:
    """Return the displacements and pushes that start hunting; None if they were not searched."""
    if judgement.displacement is None or judgement.push is None:
        return None
    return {
        "displacement_m": judgement.displacement.windows,
        "velocity_m_per_s": judgement.push.windows,
        "displacements_given_up": judgement.displacement.unknown,
        "velocities_given_up": judgement.push.unknown,
    }


def _bandwidths(windows: Iterable[hunting.BandwidthWindow]) -> list[dict[str, Any]]:
    """Return windows of bandwidths by their ends."""
    return [{"low": _end(window.low), "high": _end(window.high)} for window in windows]


def _margin(edge: hunting.Margin) -> dict[str, Any]:
    """Return how far the bandwidth is from the edge of hunting, for the document."""
    return {**entries(edge, "factor", "crossover_hz", "certain", "reserve", "kind"), "settles_at_factor": edge.quiet}


def _end(end: hunting.AttractionEnd | None) -> dict[str, Any] | None:
    """Return one end of the bandwidths at which hunting attracts; None if there is no end."""
    if end is None:
        return None
    return {"factor": end.inside, "settles_at_factor": end.outside, **entries(end, "certain", "reserve", "kind")}


def _stick_slip(speeds: hunting.StickSlipSpeeds) -> dict[str, Any]:
    """Return at which constant speeds the stage sticks and slips."""
    return {
        **entries(speeds, "lasts", "sticks", "period_s", "open_speeds"),
        "swing_m": speeds.swing,
        "ranges": [
            entries(one, "slowest_m_per_s", "fastest_m_per_s", "quiet_below_m_per_s", "quiet_above_m_per_s")
            for one in speeds.ranges
        ],
        "tried_m_per_s": speeds.tried,
    }


def _advice(advice: hunting.BandwidthAdvice | None) -> dict[str, Any] | None:
    """Return a bandwidth advised, as a factor of the stage's own; None without one."""
    return advice and entries(advice, "factor", "just_beyond", "keeps_friction")


def margin_document(margin: hunting.ParameterMargin) -> dict[str, Any]:
    """Return the multiples of a parameter at which hunting begins or ends.

    Each end has the last multiple with an unchanged verdict and the next multiple with another verdict.
    """

    def end(one: hunting.AttractionEnd | None) -> dict[str, Any] | None:
        """Return one end of a margin; None if hunting does not change on that side."""
        if one is None:
            return None
        factors = {"same_at_factor": margin.same(one), "other_at_factor": margin.other(one)}
        return {**factors, **entries(one, "certain", "kind")}

    sides = {-1: "below", 1: "above"}
    again = {sides[side]: _end(begins) for side, begins in margin.again.items()}
    return {
        "hunts": margin.attracts,
        "below": end(margin.below),
        "above": end(margin.above),
        "searched": margin.range,
        "not_determined": [sides[side] for side in margin.open_sides],
        **({"again": again} if again else {}),
    }


def joint_margins_document(stage: Stage, margins: Mapping[str, hunting.ParameterMargin]) -> dict[str, Any]:
    """Return the margins of a stage in the keys of its joint, as multiples and as values."""
    document, flat, fields = {}, stage.flat(), stage.numeric_keys()
    for key, margin in margins.items():
        entry, unit = margin_document(margin), unit_suffix(fields[key].unit)
        for end in filter(None, (entry["below"], entry["above"])):
            end |= {f"{name}{unit}": end[f"{name}_at_factor"] * flat[key] for name in ("same", "other")}
        document[key.removeprefix("joint.")] = {f"yours{unit}": flat[key], **entry}
    return plain_json({"joint_margins": document})
