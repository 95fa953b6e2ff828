"""`friso check`: the verdict."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from friso.cli.common import (
    AsJson,
    OutFolder,
    Overrides,
    StageFile,
    Tolerance,
    finite,
    leave,
    made_folder,
    print_table,
    read_stage,
    read_tolerance,
)
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.hunting import Case, Cycle, Judgement, Margin


def check(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-6",
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Does the stage hunt: as given, and with its joint locked and free.

    Example: friso check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report
    """
    stage, tolerance = read_stage(stage_file, overrides), read_tolerance(rtol)
    folder = None if out is None else made_folder(out)
    from friso.hunting import check as check_stage

    cases = check_stage(stage, rtol=tolerance, traces=folder is not None)
    if folder is not None:
        from friso.views.report import write_report

        write_report(cases, folder / "report.html")
    if as_json:
        print(json.dumps(_check_document(stage, cases), allow_nan=False))
    else:
        _print_cases(stage, cases)
        if folder is not None:
            print(f"report: {folder / 'report.html'}")
    leave(all(case.solver.done for case in cases.values()))


def _check_document(stage: Stage, cases: dict[str, Case]) -> dict[str, Any]:
    """The JSON document of `check` (design.md, section 3)."""
    return {"stage": stage.name, "cases": {name: _case_document(case) for name, case in cases.items()}}


def _case_document(case: Case) -> dict[str, Any]:
    into_1um, into_10um = case.settling_time.values()
    known = case.judgement
    return {
        "verdict": case.verdict,
        "peaks": case.peaks,
        "peak_to_peak_m": finite(case.peak_to_peak),
        "period_s": case.period,
        "settling_time_s": into_1um,
        "settling_time_10um_s": into_10um,
        "largest_force_n": finite(case.largest_force),
        "cycle": _cycle_document(known.cycle) if known.cycle else None,
        "cycles": len(known.hunting.cycles),
        "reason": known.hunting.reason or None,
        "settled_after_s": known.settled_after,
        "margin": _margin_document(known.margin) if known.margin else None,
        "kick": _kick_document(known),
        "moves": {"drawn": known.moves.drawn, "hunting": known.moves.hunting} if known.moves else None,
        "observed": known.observed,
        "solver": {
            "status": case.solver.status,
            "steps": case.solver.steps,
            "rejected": case.solver.rejected,
            "rtol": case.solver.rtol,
        },
    }


def _cycle_document(cycle: Cycle) -> dict[str, Any]:
    return {
        "amplitude_m": cycle.amplitude,
        "period_s": cycle.period,
        "multiplier": cycle.multiplier,
        "symmetric": cycle.symmetric,
        "attracts": cycle.attracts,
        "slope": finite(cycle.slope),
        "growth": finite(cycle.growth),
        "residual": cycle.residual,
        "time_constant_s": finite(cycle.time_constant),
    }


def _kick_document(known: Judgement) -> dict[str, Any] | None:
    if known.displacement is None or known.push is None:
        return None
    return {"displacement_m": known.displacement.windows, "velocity_m_per_s": known.push.windows}


def _margin_document(edge: Margin) -> dict[str, Any]:
    return {"factor": edge.factor, "crossover_hz": edge.crossover, "certain": edge.certain}


def _print_cases(stage: Stage, cases: dict[str, Case]) -> None:
    """The short table of `check`, and a sentence per case."""
    from friso.views.cases import shown_cases
    from friso.views.check_table import rows
    from friso.views.summary import conclusion, verdict_sentence

    shown = shown_cases(cases)
    sentences = [f"{item.label}: {verdict_sentence(item, cases)}" for item in shown]
    found = conclusion(cases)
    print_table(stage.name, [item.label for item in shown], rows(shown), [*sentences, *([found] if found else [])])
