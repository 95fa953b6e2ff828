"""Compare the verdict across friction laws.

Sentences, the table and the JSON document share this comparison.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.axis import axis_shown
from friso.hunting import SEARCH_LIMITS
from friso.quantities import percent
from friso.shown.motion_words import case_labels, verdict_in_short
from friso.shown.text import NOTHING, digits_that_differ, listed, range_with_unit, with_unit
from friso.stage.stage import declared_keys

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from friso.studies.laws import LawVerdict, MeasuredKind, Trial, VerdictsByLaw

SHOWN: Mapping[MeasuredKind, str] = {
    "curve": "steady friction over speed",
    "static": "break-away",
    "stiffness": "stiffness before sliding",
    "virgin": "virgin curve",
    "conditions": "the conditions of the stage",
    "damping": "damping at rest",
    "viscous": "viscous damping",
    "loop area": "energy lost in a loop",
    "loop stiffness": "stiffness of a loop",
}
"""Names of the properties of friction that measurements show."""

SAME_EDGE = 1e-3
"""Relative difference of edges below which only one edge is stated."""

COUNTS = {3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}


def laws_sentences(laws: VerdictsByLaw) -> list[str]:
    """Say whether the verdict depends on the friction law, joint as given, locked and free.

    Then say which measurement would decide, and name the laws that were not tried.
    """
    labels = case_labels(laws.stage)
    says = [f"{labels[case]}: {_sentence(laws, case)}{_beyond(laws, case)}" for case in labels]
    if laws.left_out:
        lost = [f"{law} ({listed([SHOWN[kind] for kind in kinds], 'and')})" for law, kinds in laws.left_out.items()]
        says.append(f"Not tried, because they cannot reproduce the measurements: {'; '.join(lost)}.")
    says += [text for verdict in laws.verdicts if (text := _misses(verdict))]
    return says


def _misses(verdict: LawVerdict) -> str:
    """Say by how much a law misses the virgin curve; empty if the law reproduces it.

    The virgin curve is the friction force over the displacement from rest.
    """
    off = next((item.off for item in verdict.conversion.lost if item.kind == "virgin"), 0.0)
    advice = "leave it out if the virgin curve of this machine was measured"
    return f"{verdict.law} misses the virgin curve by {percent(off)} of break-away: {advice}." if off else ""


def _sentence(laws: VerdictsByLaw, case: str) -> str:
    """Say what the stage does under each law, and which measurement would decide.

    `case` is "given", "locked" or "free", by the state of the joint.
    """
    hunts, edges = laws.hunts(case), _edges(laws, case)
    if hunts is not None:
        verdicts = {name for verdict in laws.verdicts for name in verdict.verdicts(case)}
        return f"under {_all(laws)} the stage {_does(verdicts)}, {edges}."
    if all(verdict.verdicts(case) == ("none",) for verdict in laws.verdicts):
        return _while_moving(laws, case)
    if not laws.answers(case):
        return "the verdict is not certain under any law that was tried."
    parts = []
    for answer in (True, False):
        alike = [verdict for verdict in laws.verdicts if verdict.hunts(case) is answer]
        if alike:
            does = _does({name for verdict in alike for name in verdict.verdicts(case)})
            subject = "" if parts else "the stage "
            parts.append(f"{subject}{does} under {listed([verdict.law for verdict in alike], 'and')}")
    left_open = [_open(verdict, case) for verdict in laws.verdicts if verdict.hunts(case) is None]
    depends = ["the verdict depends on the friction law"] if laws.depends_on_law(case) else []
    measure = listed(laws.deciding(case), "and")
    first = ": ".join([*depends, *(["; ".join(parts)] if parts else [])])
    decide = f"To decide, measure {measure}" if measure else ""
    said = [first, *left_open, edges[0].upper() + edges[1:], decide]
    return " ".join(f"{text}." for text in said if text)


def _while_moving(laws: VerdictsByLaw, case: str) -> str:
    """Say what a stage whose reference keeps moving does under each law."""
    does: dict[str, list[str]] = {}
    for verdict in laws.verdicts:
        does.setdefault(_verdict(verdict, case), []).append(verdict.law)
    parts = [f"{words} under {listed(names, 'and')}" for words, names in does.items()]
    return f"{'; '.join(parts)}."


def _all(laws: VerdictsByLaw) -> str:
    """Name all friction laws tried by their number: "both laws that were tried"."""
    count = len(laws.verdicts)
    if count == 1:
        return "the one law that was tried"
    return f"{'both' if count == 2 else f'all {COUNTS.get(count, count)}'} laws that were tried"


def _does(verdicts: set[str]) -> str:
    """Return what a stage with these verdicts does, such as "can hunt".

    All verdicts must agree on whether the stage hunts.
    """
    if verdicts <= {"hunts"}:
        return "hunts"
    if verdicts <= {"hunts", "bistable"}:
        return "can hunt"
    return "settles" if verdicts <= {"settles"} else "does not hunt"


def _open(verdict: LawVerdict, case: str) -> str:
    """Say what the stage does under one law with different values of its free parameters.

    `case` is "given", "locked" or "free", by the state of the joint.
    """
    trials: dict[str, list[Trial]] = {}
    for trial in verdict.trials:
        does = _does({trial.cases[case].verdict}) if trial.certain(case) else "is not certain"
        trials.setdefault(does, []).append(trial)
    if len(trials) == 1:
        return f"Under {verdict.law} that is not certain"
    parts = [f"{does} with {_values(verdict, having)}" for does, having in trials.items()]
    return f"Under {verdict.law} it {listed(parts, 'and')}"


def _values(verdict: LawVerdict, trials: Sequence[Trial]) -> str:
    """Write the values of a law's free parameters, key by key, in some trials."""
    converted, fields = verdict.conversion.stage.flat(), declared_keys(verdict.conversion.stage.flat())
    texts = []
    for key in verdict.conversion.open:
        unit = getattr(fields[key], "unit", "")
        every, values = (
            sorted({trial.drawn.get(key, converted[key]) for trial in some}) for some in (verdict.trials, trials)
        )
        digits = digits_that_differ(every)
        shown = listed([with_unit(value, unit, digits) if unit else f"{value:.{digits}g}" for value in values], "and")
        texts.append(f"{key.removeprefix('friction.').replace('_', ' ')} {shown}")
    return listed(texts, "and")


def _edges(laws: VerdictsByLaw, case: str) -> str:
    """Say between which bandwidths the edge of hunting lies, over all friction laws.

    If there is no edge, or it was not searched under some laws, the text says so.
    """
    edges = [edge for verdict in laws.verdicts if (edge := verdict.edges(case))]
    unsought = [verdict.law for verdict in laws.verdicts if not verdict.edges_sought(case)]
    part = "in part " if any(verdict.edges(case) for verdict in laws.verdicts if verdict.law in unsought) else ""
    missing = f"{part}not determined under {listed(unsought, 'and')}" if unsought else ""
    if not edges:
        low, high = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
        none = f"no edge of hunting between {low:g} and {high:g} times its bandwidth"
        return f"its edge of hunting {missing}" if missing else none
    low, high = min(edge[0] for edge in edges), max(edge[1] for edge in edges)
    doubt = "" if all(verdict.edges_certain(case) for verdict in laws.verdicts) else " (not certain)"
    begins = [begin for verdict in laws.verdicts if (begin := verdict.again(case))]
    again = f", and hunting again from {_span(laws, (min(begins), min(begins))).removeprefix('at ')}" if begins else ""
    return f"edge {_span(laws, (low, high))}{doubt}{again}{', ' + missing if missing else ''}"


def _beyond(laws: VerdictsByLaw, case: str) -> str:
    """Warn that advice keeps clear of the edge under the stage's own law alone.

    The warning is empty unless another law has a higher edge, and the stage surely hunts under its own.
    """
    own, *others = laws.verdicts
    edges = own.edges(case)
    highest = max((other[1] for verdict in others if (other := verdict.edges(case))), default=0.0)
    if own.hunts(case) is not True or edges is None or highest <= edges[1] * (1 + SAME_EDGE):
        return ""
    return f" The advice keeps clear of the edge under {own.law} alone; keep clear of the highest of these."


def _span(laws: VerdictsByLaw, ends: tuple[float, float]) -> str:
    """Write a range of edges in hertz, or as multiples of the bandwidth."""
    low, high = ends
    if laws.in_hertz:
        return range_with_unit(low, high, "Hz")
    first, last = f"{low:.3g}", f"{high:.3g}"
    return f"at {first}{'' if first == last else f' to {last}'} times the bandwidth"


def laws_columns(laws: VerdictsByLaw) -> list[str]:
    """Return the names of the laws, the stage's own law first."""
    return [verdict.law + (" (as given)" if k == 0 else "") for k, verdict in enumerate(laws.verdicts)]


def laws_rows(laws: VerdictsByLaw) -> list[tuple[str, list[str]]]:
    """Return the rows of the table with one column per friction law.

    Verdict, amplitude and edge come first, with the joint as given, locked and free. Then follow the law's parameters
    that were varied, measured effects that it does not reproduce, and its condition of passivity.
    """
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
    """Write the verdict by one friction law, or several joined by "or".

    `case` is "given", "locked" or "free". "(not certain)" is added where it applies.
    """
    return " or ".join(dict.fromkeys(verdict_in_short(trial.cases[case]) for trial in verdict.trials))


def _amplitude(verdict: LawVerdict, case: str) -> str:
    """Write the range of hunting amplitudes under a law."""
    sizes = verdict.amplitudes(case)
    return range_with_unit(*sizes, "m") if sizes else NOTHING


def _edge(laws: VerdictsByLaw, verdict: LawVerdict, case: str) -> str:
    """Write the edge of hunting under a law, and whether it is certain."""
    edges = verdict.edges(case)
    if edges is None:
        return NOTHING if verdict.edges_sought(case) else "not determined"
    doubt = "" if verdict.edges_certain(case) else " (not certain)"
    return f"{_span(laws, edges)}{doubt}{'' if verdict.edges_sought(case) else ', in part not determined'}"


def _drawn(verdict: LawVerdict) -> str:
    """Name the free parameters of a law that were varied."""
    keys = dict.fromkeys(key for trial in verdict.trials for key in trial.drawn)
    return ", ".join(key.removeprefix("friction.") for key in keys) or NOTHING


def _not_kept(verdict: LawVerdict) -> str:
    """Name the measured effects that a law does not reproduce."""
    return ", ".join(SHOWN[item.kind] for item in verdict.conversion.lost) or NOTHING


def laws_document(laws: VerdictsByLaw) -> dict[str, Any]:
    """Return the verdicts law by law and case by case, with every trial.

    For each case the document says whether the verdict depends on the law, and what would decide.
    """
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
    """Return the verdicts and trials of one law with the joint as given, locked or free."""
    return {
        "verdicts": list(verdict.verdicts(case)),
        "trials": [_trial(trial, case) for trial in verdict.trials],
        "not_kept": [SHOWN[item.kind] for item in verdict.conversion.lost],
        "passive_where": verdict.conversion.active or None,
    }


def _trial(trial: Trial, name: str) -> dict[str, Any]:
    """Return the result of one trial of a law: verdict, cycle and edge of hunting."""
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
