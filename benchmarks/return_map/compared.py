"""The return map's answers against those of the search: counted by class of machine, as a page of Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.truth.tally import markdown

EDGE, KICK = 2e-3, 0.02
"""Shares by which edges, and limits of kicks, may differ that are the same."""

LESS = 1 / 3
"""Share of the search's work that the map may take."""

RIGHT = 0.95
"""Share of edges that have to be the same."""

MAPPED, SEARCHED = ("survey", "kicks"), ("what attracts the stage", "kicks and moves")
"""Parts of an answer that tell the verdict and what starts hunting."""

Record = dict[str, Any]


def page(records: Sequence[Record]) -> str:
    """The comparison: by class, what differs, and which classes go."""
    usable = [record for record in records if _compared(record)]
    names = sorted({name for record in usable for name in record["classes"]})
    groups = {name: [record for record in usable if name in record["classes"]] for name in names} | {"all": usable}
    head, rows = [], []
    for name, some in groups.items():
        counts = counted(some)
        head, rows = ["class", *counts], [*rows, [name, *counts.values()]]
    series = sorted({(record["series"], record["seed"]) for record in records})
    drawn = ", ".join(
        f"{name} {seed} ({len({r['number'] for r in records if (r['series'], r['seed']) == (name, seed)})})"
        for name, seed in series
    )
    days = sorted({record["day"] for record in records})
    lines = [
        "# The return map against the search",
        "",
        f"Written by `python -m benchmarks.return_map --table docs/evidence/return-map.md`; answers of "
        f"{' to '.join(dict.fromkeys((days[0], days[-1])))}, stages of each series and seed: {drawn}.",
        "",
        "Compared are the cases that may hunt and whose verdict the search calls certain. *Resolved*: the map says "
        "that it knows what attracts (the scatter of landings is below a threshold, all runs were completed, and every "
        "attractor was closed as an orbit or left). Of these the table counts verdicts that are the same, certain "
        f"edges within {100 * EDGE:g} % (or what the search leaves open), windows that the map shows, and stages all "
        f"of whose limits of kicks lie within {100 * KICK:g} %; and it has the median of the scatter, and the map's "
        "work over the search's for verdict, kicks and moves alone. The work in all, and at the median, is that of "
        "every case: where the map is not resolved, that of its survey and of the whole search. A class *goes* where "
        f"no verdict differs, {100 * RIGHT:g} % of edges are the same, and the work in all is a third or less; for its "
        "*verdicts* where no verdict differs, and those and the kicks take a third or less.",
        "",
        *markdown(head, rows),
        "",
        "## What differs",
        "",
        "Behind a difference stands what runs from 72 starts show, at the stage itself or between both edges, where "
        "they were made (`--decide`).",
        "",
        *(f"- {_name(record)}: {text}{_decided(record, text)}" for record in usable for text in differences(record)),
        "",
        "## Why maps are not resolved",
        "",
        *markdown(["reason", "cases"], _reasons(usable)),
    ]
    return "\n".join(lines) + "\n"


def counted(records: Sequence[Record]) -> dict[str, Any]:
    """What the columns of the table hold, of some cases."""
    resolved = [record for record in records if record["mapped"].get("resolved")]
    edges = [r for r in resolved if r["searched"]["edge"] and r["searched"]["edge"]["certain"]]
    windows = [(r, window) for r in resolved for window in r["searched"]["windows"]]
    kicks = [r for r in resolved if r["mapped"].get("kick") and (r["searched"]["kick"] or {}).get("windows")]
    same = [r for r in resolved if same_verdict(r)]
    works = np.array([(_work(r), r["searched"]["work"]) for r in records]).reshape(-1, 2)
    ratio = works[:, 0].sum() / max(works[:, 1].sum(), 1.0)
    own = np.array([(_own(r["mapped"], *MAPPED), _own(r["searched"], *SEARCHED)) for r in resolved]).reshape(-1, 2)
    right = [r for r in edges if same_edge(r)]
    goes = len(same) == len(resolved) and len(right) >= RIGHT * len(edges) and ratio <= LESS and len(resolved) > 0
    verdicts_go = 0 < len(resolved) == len(same) and own[:, 0].sum() <= LESS * own[:, 1].sum()
    scatter = [r["mapped"]["scatter"][0] for r in resolved]
    return {
        "cases": len(records),
        "resolved": len(resolved),
        "same verdict": len(same),
        "edges": f"{len(right)} of {len(edges)}",
        "windows": f"{sum(has_window(r, window) for r, window in windows)} of {len(windows)}",
        "kicks": f"{sum(map(same_kicks, kicks))} of {len(kicks)}",
        "scatter": f"{np.median(scatter):.1e}" if scatter else "",
        "of verdict and kicks": f"{own[:, 0].sum() / max(own[:, 1].sum(), 1.0):.2f}",
        "work in all": f"{ratio:.2f}",
        "median": f"{np.median(works[:, 0] / works[:, 1]):.2f}" if len(works) else "",
        "goes": "yes" if goes else "no",
        "verdicts": "go" if verdicts_go else "no",
    }


def differences(record: Record) -> Iterator[str]:
    """In what a map that is resolved differs from the search."""
    search, by_map = record["searched"], record["mapped"]
    if not by_map.get("resolved"):
        return
    if not same_verdict(record):
        yield f"verdict {search['verdict']}, the map: {'attracts' if by_map['attracts'] else 'nothing attracts'}"
    if search["edge"] and search["edge"]["certain"] and not same_edge(record):
        factor = (by_map.get("edge") or {"factor": float("nan")})["factor"]
        yield f"edge {search['edge']['factor']:.5g}, the map: {factor:.5g}"
    for window in search["windows"]:
        if not has_window(record, window):
            ends = [f"{end['factor']:.5g}" if end else "the end of the range" for end in window]
            yield f"no window from {ends[0]} to {ends[1]}"


def same_verdict(record: Record) -> bool:
    """Whether something attracts by both, or nothing does, and the stage's own motion ends alike, if the map tells."""
    search, by_map = record["searched"], record["mapped"]
    if by_map["attracts"] != (search["verdict"] in ("hunts", "bistable")):
        return False
    return not (by_map["attracts"] and by_map.get("own_known")) or by_map["own_ends"] == (search["verdict"] == "hunts")


def same_edge(record: Record) -> bool:
    """Whether the edge is the same, up to what the search leaves open."""
    edge, by_map = record["searched"]["edge"], record["mapped"]
    ends = [by_map.get("edge"), *(high for _, high in by_map.get("windows", ()))]
    return any(abs(end["factor"] / edge["factor"] - 1) <= max(EDGE, edge["reserve"]) for end in ends if end)


def has_window(record: Record, window: Sequence[Any]) -> bool:
    """Whether the map shows a window at the middle of one of the search."""
    factors = [end["factor"] if end else limit for end, limit in zip(window, (0.1, 10.0), strict=True)]
    middle = float(np.sqrt(factors[0] * factors[1]))
    for low, high in record["mapped"].get("windows", ()):
        above = low is None or low["factor"] <= middle * (1 + EDGE)
        if above and (high is None or high["factor"] >= middle * (1 - EDGE)):
            return True
    return False


def same_kicks(record: Record) -> bool:
    """Whether all limits of the displacements that start hunting are the same."""
    search, by_map = record["searched"]["kick"]["windows"], record["mapped"]["kick"]["windows"]
    if len(search) != len(by_map):
        return False
    return bool(np.all(np.abs(np.log(np.array(search) / np.array(by_map))) <= KICK))


def _compared(record: Record) -> bool:
    """Whether the search is certain about a case that may hunt."""
    search = record["searched"]
    return bool(search["possible"] and search["certain"] and search["verdict"] not in ("failed", "runs away"))


def _work(record: Record) -> float:
    """The work of an answer by the map, and of the search where that does not know."""
    by_map, search = record["mapped"], record["searched"]
    return float(
        by_map["work"] if by_map.get("resolved") else by_map["parts"].get("survey", by_map["work"]) + search["work"]
    )


def _own(answer: Record, *parts: str) -> float:
    return float(sum(answer["parts"].get(part, 0.0) for part in parts))


def _reasons(records: Sequence[Record]) -> list[list[Any]]:
    doubts = [r["mapped"].get("doubt", "it was given up for its work") for r in records]
    doubts = [re.sub(r" \(.*", "", doubt) for doubt in doubts]
    return [[reason, doubts.count(reason)] for reason in sorted({*doubts} - {""})]


def _decided(record: Record, difference: str) -> str:
    """What brute force says of a difference."""
    return f"; {record['decided']}" if "decided" in record and not difference.startswith("no window") else ""


def _name(record: Record) -> str:
    classes = ", ".join(name for name in record["classes"] if not name.startswith(("controller", "friction")))
    return f"{record['series']} {record['seed']}:{record['number']}, {record['case']} ({classes})"
