"""Friso's verdicts and edges beside those of brute force (`edges.py`), class by class."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.code import code_digest
from benchmarks.oracles.edges import QUOTAS, Quota, Record, kept, of_quota
from benchmarks.oracles.oracle import Finding, Oracle
from benchmarks.return_map.answers import checked
from benchmarks.truth.claims import ATTRACTED
from benchmarks.truth.draws import draw
from benchmarks.truth.kept import CHECKED
from benchmarks.truth.swings import RESTS, SWINGS
from friso.engine.kernel import kernels
from friso.hunting import needed_kernels

ANSWERS = Path("benchmark_results/oracles.jsonl")
"""Friso's answers, a line each, with a digest of the code that gave them: what is there is not asked again."""

CLASSES = ("one friction", "dead band of the error", "backlash", "friction at the motor and at the load")
"""Names of the classes of `edges.QUOTAS`."""

SLACK = 1e-3
"""Share by which an edge may lie outside the bandwidths between which brute force has it: what runs at 1e-6 leave."""


def answer(record: Record) -> Record:
    """What friso says of a stage."""
    key = {"series": record["series"], "seed": record["seed"], "number": record["number"], "code": code_digest(CHECKED)}
    lines = ANSWERS.read_text().splitlines() if ANSWERS.exists() else []
    for said in map(json.loads, lines):
        if {name: said[name] for name in key} == key:
            return said
    stage = draw(record["seed"], record["number"], record["series"])
    kernels(needed_kernels(stage))
    with np.errstate(all="ignore"):
        said = key | checked(stage)
    ANSWERS.parent.mkdir(parents=True, exist_ok=True)
    with ANSWERS.open("a") as stream:
        stream.write(json.dumps(said) + "\n")
    return said


def edges() -> Iterator[Finding]:
    records, beside = kept(), list[tuple[str, Record, Record]]()
    for name, quota in zip(CLASSES, QUOTAS, strict=True):
        own = compared(quota, records)
        beside += [(name, record, answer(record)) for record in own]
        yield from by_class(name, [pair[1:] for pair in beside if pair[0] == name])
    for name, record, said in beside:
        for what, words in differences(record, said):
            sure = "certain" if said["certain"] else "not certain"
            case = f"{record['series']} {record['seed']}:{record['number']} ({name}), {what}"
            yield Finding(case, f"{words[0]} ({sure})", words[1], None if sure == "not certain" else False)


def compared(quota: Quota, records: Sequence[Record]) -> list[Record]:
    """The stages of a class that have an edge, and as many that have none and are decided at their own bandwidth."""
    own = [record for record in of_quota(quota, records) if record["words"]["1"] in (SWINGS, RESTS)]
    with_edge = [record for record in own if record["edge"]]
    return with_edge + [record for record in own if not record["edge"]][: len(with_edge)]


def by_class(name: str, pairs: Sequence[tuple[Record, Record]]) -> Iterator[Finding]:
    """Counts of what friso is certain about, and of what of that brute force has, too."""
    sure = [(record, said) for record, said in pairs if said["certain"]]
    open_edges = sum(not _sure_edge(said) for record, said in pairs if record["edge"])
    parts = {
        "certain verdicts": [same_verdict(*pair) for pair in sure],
        "certain edges": [same_edge(*pair) for pair in sure if pair[0]["edge"] and _sure_edge(pair[1])],
        "nothing beyond a certain edge": [not beyond(*pair) for pair in sure if _sure_edge(pair[1])],
    }
    for what, agree in parts.items():
        words = f"{len(agree)}", f"{sum(agree)} the same"
        yield Finding(f"{name}: {what}", *words, all(agree) if agree else None)
    words = f"{len(pairs) - len(sure)} verdicts, {open_edges} edges", f"of {len(pairs)} and {_with_edge(pairs)}"
    yield Finding(f"{name}: left open", *words, None)


def differences(record: Record, said: Record) -> Iterator[tuple[str, tuple[str, str]]]:
    """In what both differ, whether friso is certain or not: what was asked, and both answers."""
    if not same_verdict(record, said):
        yield "verdict", (said["verdict"], record["words"]["1"])
    if record["edge"] and not same_edge(record, said):
        low, high = record["edge"]
        edge = said["edge"]
        own = f"{edge['factor']:.5g} to {edge['quiet']:.5g}" if edge else "none"
        yield "edge", (own, f"{low:.5g} to {high:.5g}")
    if places := beyond(record, said):
        yield "beyond the edge", ("nothing attracts", f"swings at {', '.join(f'{place:.5g}' for place in places)}")


def same_verdict(record: Record, said: Record) -> bool:
    """Whether friso says that something attracts if and only if a run swings on."""
    return (said["verdict"] in ATTRACTED) == (record["words"]["1"] == SWINGS)


def same_edge(record: Record, said: Record) -> bool:
    """Whether an end that friso tells overlaps the bandwidths between which brute force has the edge."""
    low, high = record["edge"]
    ends = [said["edge"], *(end for _, end in said["windows"])]
    return any(end["factor"] <= high * (1 + SLACK) and end["quiet"] >= low * (1 - SLACK) for end in ends if end)


def beyond(record: Record, said: Record) -> list[float]:
    """Bandwidths at which runs swing on although friso has nothing attract there, beyond its edge."""
    if not said["edge"]:
        return []
    factors = [float(factor) for factor, word in record["words"].items() if word == SWINGS]
    return [f for f in factors if f > said["edge"]["quiet"] * (1 + SLACK) and not _in_window(f, said["windows"])]


def _in_window(factor: float, windows: Any) -> bool:
    for low, high in windows:
        above = low is None or factor >= min(low["factor"], low["quiet"]) * (1 - SLACK)
        if above and (high is None or factor <= max(high["factor"], high["quiet"]) * (1 + SLACK)):
            return True
    return False


def _sure_edge(said: Record) -> bool:
    return bool(said["certain"] and said["edge"] and said["edge"]["certain"])


def _with_edge(pairs: Sequence[tuple[Record, Record]]) -> int:
    return sum(record["edge"] is not None for record, _ in pairs)


ORACLES = (
    Oracle(
        "edges",
        "Stages drawn at random, dead bands, backlash and two frictions among them, hunt and stop hunting at the "
        "bandwidths at which plain simulation from many starts has them do so.",
        "Own brute force (`edges.py`): equations by hand, an integrator that shares nothing with friso "
        "(doi:10.1145/355993.355994), 24 starts at each of 9 bandwidths and between; kept in edges.jsonl",
        "Where friso is certain the verdict is the same, the edge overlaps the bracket of brute force (1.5 %, or up to "
        "6 % where what lies between was not decided), and no run swings on beyond it outside the windows that friso "
        "tells. Where friso is not certain a difference is listed but counts for neither.",
        edges,
    ),
)
