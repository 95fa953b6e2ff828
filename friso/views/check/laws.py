"""The verdict across friction laws: sentences, the table, and the part of the JSON document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.axis import axis_shown
from friso.hunting.margin import FARTHEST
from friso.views.check.cases import case_labels
from friso.views.convert.words import SHOWN
from friso.views.drawing.prefixes import NOTHING, listed, range_with_unit, with_unit

if TYPE_CHECKING:
    from friso.studies.laws.verdicts import LawVerdict, Trial, VerdictsByLaw

COUNTS = {3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def laws_sentences(laws: VerdictsByLaw) -> list[str]:
    """Case by case whether the verdict depends on the law, and what would decide; then which laws were not tried."""
    labels = case_labels(laws.stage)
    says = [f"{labels[case]}: {_sentence(laws, case)}" for case in labels]
    if laws.left_out:
        lost = [f"{law} ({listed([SHOWN[kind] for kind in kinds], 'and')})" for law, kinds in laws.left_out.items()]
        says.append(f"Not tried, because they cannot reproduce the measurements: {'; '.join(lost)}.")
    return says


def _sentence(laws: VerdictsByLaw, case: str) -> str:
    hunts, edges = laws.hunts(case), _edges(laws, case)
    if hunts is not None:
        return f"under {_all(laws)} the stage {_does(hunts)}{edges}."
    silent = [verdict.law for verdict in laws.verdicts if not verdict.answers(case)]
    unsure = [f"under {listed(silent, 'and')} that is not certain"] if silent else []
    if not laws.answers(case):
        return "the verdict is not certain under any law that reproduces the measurements."
    parts = [
        f"{_does(answer)} under {listed(under, 'and')}"
        for answer in (True, False)
        if (under := [verdict.law for verdict in laws.verdicts if verdict.hunts(case) is answer])
    ]
    parts += [text for verdict in laws.verdicts if (text := _open(verdict, case))]
    if not laws.depends_on_law(case):
        return f"the stage {'; '.join([*parts, *unsure])}{edges}."
    measure = listed(laws.deciding(case), "and")
    decide = f" To decide, measure {measure}." if measure else ""
    return f"the verdict depends on the friction law: the stage {'; '.join([*parts, *unsure])}{edges}.{decide}"


def _all(laws: VerdictsByLaw) -> str:
    """The laws that were tried."""
    count = len(laws.verdicts)
    if count == 1:
        return "the one law that reproduces the measurements"
    return f"{'both' if count == 2 else f'all {COUNTS.get(count, count)}'} laws that reproduce the measurements"


def _does(hunts: bool) -> str:
    return "hunts" if hunts else "settles"


def _open(verdict: LawVerdict, case: str) -> str:
    """What the stage does under a law with some of what is open in it; "" if it does so with all of it, or if nothing
    is certain."""
    answers = verdict.answers(case)
    if verdict.hunts(case) is not None or not answers:
        return ""
    words = [_does(answer) for answer in (True, False) if answer in answers]
    if len(answers) > 1:
        return f"under {verdict.law} it {listed(words, 'or')}, depending on the parameters that are left open"
    return (
        f"under {verdict.law} it {words[0]} with some of the values that are left open, and is not certain with others"
    )


def _edges(laws: VerdictsByLaw, case: str) -> str:
    edges = [edge for verdict in laws.verdicts if (edge := verdict.edges(case))]
    unsought = [verdict.law for verdict in laws.verdicts if not verdict.edges_sought(case)]
    missing = f"not determined under {listed(unsought, 'and')}" if unsought else ""
    if not edges:
        none = f"with no edge of hunting within a factor of {FARTHEST:g} of its bandwidth"
        return f", its edge of hunting {missing}" if missing else f", {none}"
    low, high = min(edge[0] for edge in edges), max(edge[1] for edge in edges)
    doubt = "" if all(verdict.edges_certain(case) for verdict in laws.verdicts) else " (not certain)"
    return f", edge {_span(laws, (low, high))}{doubt}{', ' + missing if missing else ''}"


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
            (f"{label}: verdict", [_verdict(verdict, case) for verdict in laws.verdicts]),
            (f"{label}: amplitude", [_amplitude(verdict, case) for verdict in laws.verdicts]),
            (f"{label}: edge", [_edge(laws, verdict, case) for verdict in laws.verdicts]),
        ]
    rows.append(("Varied (left open)", [_drawn(verdict) for verdict in laws.verdicts]))
    rows.append(("Not reproduced", [_not_kept(verdict) for verdict in laws.verdicts]))
    rows.append(("Passive only if", [verdict.conversion.active or "it is" for verdict in laws.verdicts]))
    return [(axis_shown().text(name), texts) for name, texts in rows]


def _verdict(verdict: LawVerdict, case: str) -> str:
    return f"{' or '.join(verdict.verdicts(case))}{'' if verdict.certain(case) else ' (not certain)'}"


def _amplitude(verdict: LawVerdict, case: str) -> str:
    sizes = verdict.amplitudes(case)
    return range_with_unit(*sizes, "m") if sizes else NOTHING


def _edge(laws: VerdictsByLaw, verdict: LawVerdict, case: str) -> str:
    edges = verdict.edges(case)
    if edges is None:
        return NOTHING if verdict.edges_sought(case) else "not determined"
    doubt = "" if verdict.edges_certain(case) else " (not certain)"
    return f"{_span(laws, edges)}{doubt}{'' if verdict.edges_sought(case) else ', in part not determined'}"


def _drawn(verdict: LawVerdict) -> str:
    keys = dict.fromkeys(key for trial in verdict.trials for key in trial.drawn)
    return ", ".join(key.removeprefix("friction.") for key in keys) or NOTHING


def _not_kept(verdict: LawVerdict) -> str:
    return ", ".join(SHOWN[item.kind] for item in verdict.conversion.lost) or NOTHING


def laws_document(laws: VerdictsByLaw) -> dict[str, Any]:
    """Law by law and case by case, with every trial; whether the verdict depends on the law or is not certain, and what
    would decide."""
    cases = {}
    for case in case_labels(laws.stage):
        cases[case] = {
            "hunts": laws.hunts(case),
            "depends_on_law": laws.depends_on_law(case),
            "not_certain": laws.uncertain(case),
            "measure": laws.deciding(case),
            "laws": {verdict.law: _law(verdict, case) for verdict in laws.verdicts},
        }
    return {
        "conclusion": " ".join(laws_sentences(laws)),
        "cases": cases,
        "left_out": {law: [SHOWN[kind] for kind in kinds] for law, kinds in laws.left_out.items()},
    }


def _law(verdict: LawVerdict, case: str) -> dict[str, Any]:
    return {
        "verdicts": list(verdict.verdicts(case)),
        "trials": [_trial(trial, case) for trial in verdict.trials],
        "not_kept": [SHOWN[item.kind] for item in verdict.conversion.lost],
        "passive_where": verdict.conversion.active or None,
    }


def _trial(trial: Trial, name: str) -> dict[str, Any]:
    case = trial.cases[name]
    cycle, edge = case.judgement.cycle, case.judgement.margin
    return {
        "drawn": dict(trial.drawn),
        "verdict": case.verdict,
        "amplitude_m": cycle.amplitude if cycle else None,
        "multiplier": cycle.multiplier if cycle else None,
        "edge_hz": edge.crossover if edge else None,
        "edge_factor": edge.factor if edge else None,
        "edge_certain": edge.certain if edge else trial.edge_sought(name),
        "certain": case.judgement.hunting.certain,
    }
