"""Compare the check with the search alone by class of machine, as a Markdown page."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.truth.tally import markdown
from friso.hunting import SEARCH_LIMITS

KICK = 0.02
"""Relative difference up to which limits of kicks count as equal."""

Record = dict[str, Any]


def page(records: Sequence[Record]) -> str:
    """Return the comparison: counts by class, and the differences."""
    usable = [record for record in records if record["searched"]["possible"]]
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
        "# The check against the search alone",
        "",
        f"Written by `python -m benchmarks.return_map --table docs/evidence/return-map.md`; answers of "
        f"{' to '.join(dict.fromkeys((days[0], days[-1])))}, stages of each series and seed: {drawn}.",
        "",
        "Each case that may hunt was answered by the check, which uses return maps, and by the search, which simulates "
        "every bandwidth and kick (partly with earlier code). Of cases certain in both: equal verdicts; edges of the "
        "search within the interval of the check; windows of the search that the check has, too; stages whose limits "
        f"of kicks agree within {100 * KICK:g} %. Work: over that of the search, and in 1e6 units (median, 95th "
        "percentile, largest). In brackets: the search.",
        "",
        *markdown(head, rows),
        "",
        "## What differs",
        "",
        "With `--decide`, runs from 72 starts between both answers stand behind a difference.",
        "",
        *(f"- {_name(record)}: {text}{_decided(record, text)}" for record in usable for text in differences(record)),
    ]
    return "\n".join(lines) + "\n"


def counted(records: Sequence[Record]) -> dict[str, Any]:
    """Return the entries of the table's columns for some cases."""
    both = [record for record in records if _both_certain(record)]
    edges = [record for record in both if _has_edge(record)]
    windows = [(record, window) for record in both for window in _windows(record)]
    kicks = [record for record in both if (record["searched"]["kick"] or {}).get("windows")]
    works = np.array([(record["mapped"]["work"], record["searched"]["work"]) for record in records]).reshape(-1, 2)
    own = np.percentile(works[:, 0], [50, 95, 100]) / 1e6 if len(works) else np.zeros(3)
    return {
        "cases": len(records),
        "certain": f"{sum(r['mapped']['certain'] for r in records)} ({sum(r['searched']['certain'] for r in records)})",
        "same verdict": f"{sum(map(same_verdict, both))} of {len(both)}",
        "edges": f"{sum(map(same_edge, edges))} of {len(edges)}",
        "windows": f"{sum(has_window(record, window) for record, window in windows)} of {len(windows)}",
        "kicks": f"{sum(map(same_kicks, kicks))} of {len(kicks)}",
        "given up": f"{sum(_gave_up(r['mapped']) for r in records)} ({sum(_gave_up(r['searched']) for r in records)})",
        "work": f"{works[:, 0].sum() / max(works[:, 1].sum(), 1.0):.2f}",
        "by itself": " / ".join(f"{value:.0f}" for value in own),
    }


def differences(record: Record) -> Iterator[str]:
    """Yield how the check differs from the search, where both are certain."""
    search, by_map = record["searched"], record["mapped"]
    if not _both_certain(record):
        return
    if not same_verdict(record):
        yield f"verdict {search['verdict']}, the check: {by_map['verdict']}"
    if _has_edge(record) and not same_edge(record):
        factor = (by_map["edge"] or {"factor": float("nan")})["factor"]
        yield f"edge {search['edge']['factor']:.5g}, the check: {factor:.5g}"
    if by_map["edge"] and by_map["edge"]["certain"] and not search["edge"]:
        yield f"no edge, the check: {by_map['edge']['factor']:.5g}"
    for window in _windows(record):
        if not has_window(record, window):
            ends = [f"{end['factor']:.5g}" if end else "the end of the range" for end in window]
            yield f"no window from {ends[0]} to {ends[1]}"


def same_verdict(record: Record) -> bool:
    """Tell whether the verdicts are equal."""
    return bool(record["mapped"]["verdict"] == record["searched"]["verdict"])


def same_edge(record: Record) -> bool:
    """Tell whether the search's edge, within its error, lies in an interval of the check."""
    edge, by_map = record["searched"]["edge"], record["mapped"]
    ends = [by_map["edge"], *(high for _, high in by_map["windows"])]
    reserve = edge["reserve"] + 1e-3
    return any(
        end["factor"] <= edge["factor"] * (1 + reserve) and edge["factor"] * (1 - reserve) <= end["quiet"]
        for end in ends
        if end
    )


def has_window(record: Record, window: Sequence[Any]) -> bool:
    """Tell whether the check shows a window at the middle of a window of the search."""
    middle = _middle(window)
    for low, high in record["mapped"]["windows"]:
        above = low is None or low["factor"] <= middle * (1 + KICK)
        if above and (high is None or high["factor"] >= middle * (1 - KICK)):
            return True
    return False


def same_kicks(record: Record) -> bool:
    """Tell whether all limits of the displacements that start hunting are equal."""
    search, by_map = record["searched"]["kick"]["windows"], (record["mapped"]["kick"] or {"windows": ()})["windows"]
    if len(search) != len(by_map):
        return False
    return bool(np.all(np.abs(np.log(np.array(search) / np.array(by_map))) <= KICK))


def _has_edge(record: Record) -> bool:
    """Tell whether the search has a certain edge in the range of the check.

    The search may have reached farther.
    """
    edge = record["searched"]["edge"]
    return bool(edge and edge["certain"] and edge["factor"] > SEARCH_LIMITS.lowest_bandwidth)


def _windows(record: Record) -> list[Sequence[Any]]:
    """Return the windows of the search in the range of the check."""
    lowest, windows = SEARCH_LIMITS.lowest_bandwidth, record["searched"]["windows"]
    within = [window for window in windows if not window[1] or window[1]["factor"] > lowest]
    return [window for window in within if _middle(window) > lowest]


def _middle(window: Sequence[Any]) -> float:
    limits = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
    factors = [end["factor"] if end else limit for end, limit in zip(window, limits, strict=True)]
    return float(np.sqrt(factors[0] * factors[1]))


def _both_certain(record: Record) -> bool:
    return bool(record["searched"]["certain"] and record["mapped"]["certain"])


def _gave_up(answer: Record) -> bool:
    return bool(answer["given_up"])


def _decided(record: Record, difference: str) -> str:
    """Return what brute force says about a difference."""
    return f"; {record['decided']}" if "decided" in record and not difference.startswith("no window") else ""


def _name(record: Record) -> str:
    classes = ", ".join(name for name in record["classes"] if not name.startswith(("controller", "friction")))
    return f"{record['series']} {record['seed']}:{record['number']}, {record['case']} ({classes})"
