"""Build the JSON document of `friso check` (design.md, section 3)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from friso import hunting
from friso.questions.check.laws import laws_document
from friso.questions.check.words import answer
from friso.shown.documents import dwells_document, entries, plain_json, tracking_document, unit_suffix
from friso.stage.tables import passive_where

if TYPE_CHECKING:
    from friso.remedies.catalogue import Suggestion
    from friso.stage import Stage
    from friso.studies.draws import DrawnBandwidths, Draws
    from friso.studies.laws.verdicts import VerdictsByLaw


def check_document(
    cases: Mapping[str, hunting.Case],
    draws: Draws | None = None,
    isolator: Suggestion | None = None,
    laws: VerdictsByLaw | None = None,
) -> dict[str, Any]:
    """Return the verdicts as a JSON document: as given, with the joint locked and free.

    Results on drawn stages, on an isolator and across friction laws are added if they were computed.
    """
    document = {name: _case(case) for name, case in cases.items()}
    if draws is not None:
        for name, case in document.items():
            case["draws"] = draws_document(draws, name)
    return plain_json(
        {
            "conclusion": " ".join(answer(cases)),
            "stage": cases["given"].stage.name,
            "friction_passive_where": passive_where(cases["given"].stage.flat()) or None,
            "cases": document,
            **({"isolator": _isolator(isolator)} if isolator else {}),
            **({"laws": laws_document(laws)} if laws else {}),
        }
    )


def _isolator(isolator: Suggestion) -> dict[str, Any]:
    """Return the suggested isolator, and whether the stage settles on it."""
    flat = isolator.stage.flat()
    return {
        "settles": isolator.settles,
        "stiffness_n_per_m": flat["joint.stiffness"],
        "stroke_m": flat["joint.stroke"],
        "damping_ns_per_m": flat["joint.damping"],
        "modulus_margin": isolator.margin,
    }


def _feeding(feeding: hunting.Feeding) -> dict[str, Any]:
    """Return the fractions of friction and backlash down to which hunting persists."""
    parts = {"friction": feeding.friction, "backlash": feeding.backlash}
    return {name: asdict(part) | {"needed": part.needed} for name, part in parts.items() if part}


def _case(case: hunting.Case) -> dict[str, Any]:
    """Return all results for one state of the joint: verdict, run, cycle, margins and basins."""
    into_1um, into_10um = case.settling_time.values()
    last_1um, last_10um = case.in_the_end.values()
    judgement = case.judgement
    return {
        **entries(case, "verdict", "peaks", "peak_to_peak_m", "period_s"),
        "settling_time_s": into_1um,
        "settling_time_10um_s": into_10um,
        "settling_time_in_the_end_s": last_1um,
        "settling_time_10um_in_the_end_s": last_10um,
        **entries(case, "largest_force_n", "unmoved"),
        "breakaway_force_n": case.breakaway,
        "cycle": _cycle(judgement.cycle) if judgement.cycle else None,
        "cycles": len(judgement.hunting.cycles),
        "reason": judgement.hunting.reason or None,
        "doubt": reason.name.lower() if isinstance(reason := judgement.hunting.reason, hunting.HuntingDoubt) else None,
        "settled_after_s": judgement.settled_after,
        "margin": _margin(judgement.margin) if judgement.margin else None,
        "windows": _windows(judgement.windows),
        "settles_below": _end(judgement.lower),
        "static_friction": _parameter_margin(case.static_friction) if case.static_friction else None,
        "advice": {"faster": _advice(case.faster), "slower": _advice(case.slower)},
        "kick": _kick(judgement),
        "displacements_that_run_away_m": judgement.running_away.windows if judgement.running_away else None,
        "moves": {"drawn": judgement.moves.count, "hunting": judgement.moves.hunting} if judgement.moves else None,
        **entries(judgement, "observed", "given_up"),
        "loop_unstable_while_it": case.unstable,
        "loop_unstable_bandwidths": _windows(case.unstable_bandwidths),
        **({"loop_unstable_as_built_while_it": case.unstable_as_built} if case.unstable_as_built else {}),
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
    return {**entries(cycle, *names, "time_constant_s"), "swings_per_period": cycle.swings}


def _swing(swing: hunting.Swing) -> dict[str, Any]:
    """Return amplitude and period of a swing that was observed in a run."""
    return {**entries(swing, "amplitude_m", "period_s", "regular"), "swings_per_period": swing.swings}


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


def _windows(windows: Iterable[hunting.BandwidthWindow]) -> list[dict[str, Any]]:
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


def _parameter_margin(margin: hunting.ParameterMargin) -> dict[str, Any]:
    """Return the multiples of a parameter at which hunting begins or ends.

    Each end has the last multiple with an unchanged verdict and the next multiple with another verdict.
    """

    def end(one: hunting.AttractionEnd | None) -> dict[str, Any] | None:
        """Return one end of a margin; None if hunting does not change on that side."""
        if one is None:
            return None
        factors = {"same_at_factor": margin.same(one), "other_at_factor": margin.other(one)}
        return {**factors, **entries(one, "certain", "kind")}

    return {
        "hunts": margin.attracts,
        "below": end(margin.below),
        "above": end(margin.above),
        "searched": margin.range,
        "not_determined": [{-1: "below", 1: "above"}[side] for side in margin.open_sides],
    }


def joint_margins_document(stage: Stage, margins: Mapping[str, hunting.ParameterMargin]) -> dict[str, Any]:
    """Return the margins of a stage in the keys of its joint, as multiples and as values."""
    document, flat, fields = {}, stage.flat(), stage.numeric_keys()
    for key, margin in margins.items():
        entry, unit = _parameter_margin(margin), unit_suffix(fields[key].unit)
        for end in filter(None, (entry["below"], entry["above"])):
            end |= {f"{name}{unit}": end[f"{name}_at_factor"] * flat[key] for name in ("same", "other")}
        document[key.removeprefix("joint.")] = {f"yours{unit}": flat[key], **entry}
    return plain_json({"joint_margins": document})


def draws_document(draws: Draws, case: str) -> dict[str, Any]:
    """Return the verdicts on the stages drawn, with the joint as given, locked or free."""
    from friso.hunting.criteria import ATTRACTED, VERDICT_CRITERION

    fates = draws.fates[case]
    return {
        "count": draws.sample.count,
        "seed": draws.seed,
        "left_out": draws.sample.left_out,
        "hunts": asdict(fates.share(("hunts",))),
        "attracting_cycle": asdict(fates.share(ATTRACTED)),
        "criterion": VERDICT_CRITERION,
        "verdicts": fates.counts,
        "loop_unstable": int(fates.unstable.sum()),
        "separation": fates.separations(draws.sample.keys),
        "amplitude_m": _ends(fates.amplitudes),
        "period_s": _ends(fates.periods),
        "split": draws.split(case),
        **_bandwidths(draws.bandwidths.get(case)),
    }


def _bandwidths(tried: DrawnBandwidths | None) -> dict[str, Any]:
    """Return where hunting of the machines drawn ends, and at which faster bandwidths none of them hunts."""
    edges = _ends(np.r_[tried.edges]) if tried else None
    cure = list(tried.cure) if tried and tried.cure else None
    own = tried.own if tried else None
    return {
        "tried_at_bandwidths": len(tried.hunts) if tried else 0,
        "edge_factor": edges,
        "edge_hz": [own * end for end in edges] if own and edges else None,
        "cure_factor": cure,
        "cure_hz": [own * end for end in cure] if own and cure else None,
    }


def _ends(values: np.ndarray) -> list[float] | None:
    """Return the least and the largest finite value; None if no value is finite."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
