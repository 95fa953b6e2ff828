"""The verdict across friction laws: sentences, the table, and the part of the JSON document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.axis import axis_shown
from friso.views.check.cases import case_labels
from friso.views.drawing.prefixes import NOTHING, listed, range_with_unit, with_unit

if TYPE_CHECKING:
    from friso.hunting import Case
    from friso.studies.laws.verdicts import LawVerdict, Trial, VerdictsByLaw

COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def laws_sentences(laws: VerdictsByLaw) -> list[str]:
    """Case by case whether the verdict hangs on the law, and what would decide; then which laws were not asked."""
    labels = case_labels(laws.stage)
    says = [f"{labels[case]}: {_sentence(laws, case)}" for case in labels]
    if laws.left_out:
        lost = [f"{law} ({listed(list(what), 'and')})" for law, what in laws.left_out.items()]
        says.append(f"Not asked, since they do not keep what is measured: {'; '.join(lost)}.")
    return says


def _sentence(laws: VerdictsByLaw, case: str) -> str:
    hunts, names = laws.hunts(case), [verdict.law for verdict in laws.verdicts]
    count = COUNTS.get(len(names), str(len(names)))
    edges = [edge for verdict in laws.verdicts if (edge := verdict.edges(case))]
    if hunts is not None:
        says = "hunts" if hunts else "settles"
        return f"under all {count} laws that keep what is measured the stage {says}{_edges(laws, case, edges)}."
    parts = [
        f"{says} under {listed(under, 'and')}"
        for says, answer in (("hunts", True), ("settles", False))
        if (under := [verdict.law for verdict in laws.verdicts if verdict.hunts(case) is answer])
    ]
    parts += [
        f"under {verdict.law} {listed(list(verdict.verdicts(case)), 'or')}, by what is open in it"
        for verdict in laws.verdicts
        if verdict.hunts(case) is None
    ]
    measure = listed(laws.deciding(case), "and")
    decide = f" To decide, measure {measure}." if measure else ""
    return f"the verdict hangs on the law: the stage {'; '.join(parts)}{_edges(laws, case, edges)}.{decide}"


def _edges(laws: VerdictsByLaw, case: str, edges: list[tuple[float, float]]) -> str:
    if not edges:
        return ", with no edge of hunting within a factor of ten of its bandwidth"
    low, high = min(edge[0] for edge in edges), max(edge[1] for edge in edges)
    return f", edge {_span(laws, (low, high))}"


def _span(laws: VerdictsByLaw, ends: tuple[float, float]) -> str:
    """Edges in hertz, or in factors of the bandwidth."""
    low, high = ends
    if laws.in_hertz:
        return with_unit(low, "Hz") if high - low < 1e-3 * high else range_with_unit(low, high, "Hz")
    return f"at {low:.3g}" + ("" if high - low < 1e-3 * high else f" to {high:.3g}") + " times the bandwidth"


def laws_columns(laws: VerdictsByLaw) -> list[str]:
    """The laws, the stage's own first."""
    return [verdict.law + (" (as given)" if k == 0 else "") for k, verdict in enumerate(laws.verdicts)]


def laws_rows(laws: VerdictsByLaw) -> list[tuple[str, list[str]]]:
    """The rows of the table, a column per law: verdict, amplitude and edge case by case, and what was drawn."""
    rows = []
    for case, label in case_labels(laws.stage).items():
        rows += [
            (f"{label}: verdict", [" or ".join(verdict.verdicts(case)) for verdict in laws.verdicts]),
            (f"{label}: amplitude", [_amplitude(verdict, case) for verdict in laws.verdicts]),
            (f"{label}: edge", [_edge(laws, verdict, case) for verdict in laws.verdicts]),
        ]
    rows.append(("Drawn, since left open", [_drawn(verdict) for verdict in laws.verdicts]))
    rows.append(("Not kept", [_lost(verdict) for verdict in laws.verdicts]))
    return [(axis_shown().text(name), texts) for name, texts in rows]


def _amplitude(verdict: LawVerdict, case: str) -> str:
    sizes = verdict.amplitudes(case)
    return range_with_unit(*sizes, "m") if sizes else NOTHING


def _edge(laws: VerdictsByLaw, verdict: LawVerdict, case: str) -> str:
    edges = verdict.edges(case)
    return _span(laws, edges) if edges else NOTHING


def _drawn(verdict: LawVerdict) -> str:
    keys = dict.fromkeys(key for trial in verdict.trials for key in trial.drawn)
    return ", ".join(key.removeprefix("friction.") for key in keys) or NOTHING


def _lost(verdict: LawVerdict) -> str:
    return ", ".join(item.what for item in verdict.conversion.lost) or NOTHING


def laws_document(laws: VerdictsByLaw) -> dict[str, Any]:
    """Law by law and case by case, with every trial; whether the verdict hangs on the law, and what would decide."""
    cases = {}
    for case in case_labels(laws.stage):
        hunts = laws.hunts(case)
        cases[case] = {
            "hunts": hunts,
            "hangs_on_the_law": hunts is None,
            "measure": laws.deciding(case) if hunts is None else [],
            "laws": {verdict.law: _law(verdict, case) for verdict in laws.verdicts},
        }
    return {
        "conclusion": " ".join(laws_sentences(laws)),
        "cases": cases,
        "left_out": {law: list(what) for law, what in laws.left_out.items()},
    }


def _law(verdict: LawVerdict, case: str) -> dict[str, Any]:
    return {
        "verdicts": list(verdict.verdicts(case)),
        "trials": [_trial(trial, trial.cases[case]) for trial in verdict.trials],
        "not_kept": [item.what for item in verdict.conversion.lost],
        "passive_where": verdict.conversion.active or None,
    }


def _trial(trial: Trial, case: Case) -> dict[str, Any]:
    cycle, edge = case.judgement.cycle, case.judgement.margin
    return {
        "drawn": dict(trial.drawn),
        "verdict": case.verdict,
        "amplitude_m": cycle.amplitude if cycle else None,
        "multiplier": cycle.multiplier if cycle else None,
        "edge_hz": edge.crossover if edge else None,
        "edge_factor": edge.factor if edge else None,
        "certain": case.judgement.hunting.certain,
    }
