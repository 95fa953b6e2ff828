"""`friso check`: the verdict."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
from friso.cli.progress import progress_bar
from friso.errors import InputError
from friso.stage import Stage, load, numeric_keys

if TYPE_CHECKING:
    from friso.hunting import Case, Cycle, Judgement, Margin
    from friso.stage.correlations import Drawn
    from friso.views.check.draws import Drawing

Draws = Annotated[
    int | None,
    typer.Option(
        "--draws",
        metavar="N",
        help='Draw N stages from the uncertain keys ("20 N +/- 1 N", "1 N .. 3 N"), and report how many hunt.',
    ),
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="K", help="Seed of the draws: the same seed gives the same stages.")
]


def check(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-6",
    draws: Draws = None,
    seed: Seed = 0,
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Does the stage hunt: as given, and with its joint locked and free.

    Example: friso check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report
    """
    stage, tolerance = read_stage(stage_file, overrides, drawn=draws is not None), read_tolerance(rtol)
    drawn = None if draws is None else _drawn(stage, stage_file, draws, seed)
    folder = None if out is None else made_folder(out)
    from friso.hunting import check as check_stage

    cases = check_stage(stage, rtol=tolerance, traces=folder is not None)
    drawing = None if drawn is None else _drawing(cases, drawn, seed, tolerance)
    if folder is not None:
        from friso.views.check.page import write_report

        write_report(cases, folder / "report.html", drawing)
    if as_json:
        print(json.dumps(_check_document(stage, cases, drawing), allow_nan=False))
    else:
        _print_cases(stage, cases)
        if drawing is not None:
            _print_draws(drawing)
        if folder is not None:
            print(f"report: {folder / 'report.html'}")
    leave(all(case.solver.done for case in cases.values()))


def _drawn(stage: Stage, path: Path, count: int, seed: int) -> Drawn:
    """Stages drawn, correlated as a file beside the stage file says. Raises InputError."""
    from friso.stage.correlations import Correlations, beside, draw, read_correlations
    from friso.studies.draws import MOST

    for option, value, least, most in (("--draws", count, 1, MOST), ("--seed", seed, 0, 2**32 - 1)):
        if not least <= value <= most:
            raise InputError(option, str(value), f"a whole number from {least} to {most}", f"{option} 1000")
    try:
        known = read_correlations(beside(path), load(path)) if beside(path).exists() else Correlations()
        return draw(stage, known.among(stage.uncertain()), count, seed)
    except InputError as error:
        raise error if error.origin else error.found_in("--draws") from None


def _drawing(cases: dict[str, Case], drawn: Drawn, seed: int, tolerance: float) -> Drawing:
    """What becomes of the stages drawn."""
    from friso.studies.draws import different, fates
    from friso.views.check.cases import shown_cases
    from friso.views.check.draws import Drawing

    stage = cases["given"].stage
    with progress_bar("draws", drawn.count * len(different(stage))) as advance:
        found = fates(stage, drawn, tolerance, advance)
    fields = numeric_keys(stage.flat())
    labels = {item.key: item.label for item in shown_cases(cases)}
    return Drawing(drawn, seed, found, labels, {key: fields[key].unit for key in drawn.keys})


def _check_document(stage: Stage, cases: dict[str, Case], drawing: Drawing | None) -> dict[str, Any]:
    """The JSON document of `check` (design.md, section 3)."""
    document = {"stage": stage.name, "cases": {name: _case_document(case) for name, case in cases.items()}}
    if drawing is not None:
        from friso.views.check.draws import draws_document

        for name, case in document["cases"].items():
            case["draws"] = draws_document(drawing, name)
    return document


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


def _print_draws(drawing: Drawing) -> None:
    """The table of the draws, and a sentence per case."""
    from friso.views.check.draws import draws_rows, draws_sentences

    title = f"{drawing.drawn.count} stages drawn from the uncertain keys, seed {drawing.seed}"
    print_table(title, [*drawing.labels.values()], draws_rows(drawing), draws_sentences(drawing))


def _print_cases(stage: Stage, cases: dict[str, Case]) -> None:
    """The short table of `check`, and a sentence per case."""
    from friso.views.check.cases import shown_cases
    from friso.views.check.table import rows
    from friso.views.check.words import conclusion, verdict_sentence

    shown = shown_cases(cases)
    sentences = [f"{item.label}: {verdict_sentence(item, cases)}" for item in shown]
    found = conclusion(cases)
    print_table(stage.name, [item.label for item in shown], rows(shown), [*sentences, *([found] if found else [])])
