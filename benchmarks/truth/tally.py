"""Count what attacks show, in total and by class of machine, as data, text and Markdown."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from benchmarks.report import Goal, print_goals, print_table
from benchmarks.truth.attack import GIVEN_UP, STOOD, WRONG
from benchmarks.truth.kept import Record, is_current

SLOWEST = 8
"""Number of checks listed for the work they take."""

Claims = Iterable[tuple[Record, dict[str, Any]]]
"""What is said about cases, each with its attack."""

COLUMNS = {
    "stages": "stages",
    "verdicts": "verdicts",
    "verdicts_certain": "certain",
    "verdicts_right": "right",
    "verdicts_wrong": "wrong",
    "edges": "edges",
    "edges_certain": "certain",
    "edges_right": "right",
    "edges_wrong": "wrong",
    "margins": "margins in static friction",
    "margins_certain": "certain",
    "margins_right": "right",
    "margins_wrong": "wrong",
}
"""What is counted, and its title. "Right" was not refuted. What is certain and neither right nor wrong was not attacked
to the end: the attack took too much work, or there was nothing to try (no friction, or a reference that never stands
still)."""


def document(records: Sequence[Record]) -> dict[str, Any]:
    """Return all results of attacks as data."""
    claims = _claims(records)
    names = sorted({name for _, claim in claims for name in claim["classes"]})
    by_class = {name: [(r, claim) for r, claim in claims if name in claim["classes"]] for name in names}
    return {
        "all": counts(claims),
        "classes": {name: counts(some) for name, some in by_class.items()},
        "wrong": _witnesses(records, sure=True),
        "wrong_not_certain": _witnesses(records, sure=False),
        "given_up": [f"{_name(r)}, {claim['case']}" for r, claim in claims if GIVEN_UP in claim["outcomes"].values()],
        "errors": [{"stage": _name(record), "error": record["error"]} for record in records if record["error"]],
        "of_other_code": [_name(record) for record in records if not is_current(record)],
        "check_cpu_s": _spread([r["cpu"] for r in records if not r["error"]]),
        "attack_cpu_s": _spread([r["attack_cpu"] for r in records if not r["error"]]),
    }


def counts(claims: Claims) -> dict[str, int]:
    """Return the counts named in `COLUMNS`, for some claims."""
    claims = list(claims)
    parts = {
        "verdicts": [claim["outcomes"].get("verdict") for _, claim in claims if claim["sure"]],
        "edges": [claim["outcomes"].get("edge") for _, claim in claims if claim["edge_sure"]],
        "margins": [claim["outcomes"].get("static friction") for _, claim in claims if claim.get("friction_sure")],
    }
    counted = {
        "stages": len({_name(record) for record, _ in claims}),
        "verdicts": len(claims),
        "edges": sum(claim["edge"] is not None for _, claim in claims),
        "margins": sum(claim.get("friction_sure") is not None for _, claim in claims),
    }
    for part, certain in parts.items():
        outcomes = {"certain": len(certain), "right": certain.count(STOOD), "wrong": certain.count(WRONG)}
        counted |= {f"{part}_{name}": count for name, count in outcomes.items()}
    return counted


def print_tally(records: Sequence[Record], tally: dict[str, Any]) -> None:
    """Print what attacks show, why some claims are not certain, and the goals."""
    print_table(["", *COLUMNS.values()], _rows(tally))
    for title, names in (
        ("given up for its work", tally["given_up"]),
        ("wrong, but not certain", [witness["stage"] for witness in tally["wrong_not_certain"]]),
        ("ended in an error", [failed["stage"] for failed in tally["errors"]]),
        ("by other code than now (attacked again with --redo)", tally["of_other_code"]),
    ):
        if names:
            print(f"  {title}: {'; '.join(names)}")
    for witness in tally["wrong"]:
        print(f"  WRONG: {witness['stage']}, {witness['case']}, {witness['of']}: {witness['why']}")
    _print_doubts(records)
    _print_cycles(records)
    every, check, attack = tally["all"], tally["check_cpu_s"], tally["attack_cpu_s"]
    wrong = sum(every[f"{part}_wrong"] for part in ("verdicts", "edges", "margins"))
    share = every["verdicts_certain"] / max(every["verdicts"], 1)
    print_goals(
        [
            Goal("certain verdicts", "97 %", f"{100 * share:.1f} %", share >= 0.97),
            Goal("wrong among the certain", "none", str(wrong), not wrong),
            Goal("CPU of a check, median", "0.5 s", f"{check['median']:.2f} s", check["median"] <= 0.5),
            Goal("CPU of a check, worst", "10 s", f"{check['worst']:.1f} s", check["worst"] <= 10),
            Goal("CPU of an attack on a stage, median", "2 s", f"{attack['median']:.2f} s", attack["median"] <= 2),
            Goal("CPU of an attack on a stage, mean", "2 s", f"{attack['mean']:.2f} s", attack["mean"] <= 2),
        ],
        "Goals of issues 21 and 50",
    )


def page(records: Sequence[Record], tally: dict[str, Any]) -> str:
    """Return Markdown tables: series and seeds by code version, then all by class."""
    groups: dict[tuple[str, int, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record["series"], record["seed"], record["code"]), []).append(record)
    rows = []
    for (series, seed, code), some in sorted(groups.items()):
        days = sorted({record["day"] for record in some})
        counted = [counts(_claims(some))[key] for key in COLUMNS]
        given_up = len(document(some)["given_up"])
        rows.append([" to ".join(sorted({days[0], days[-1]})), f"`{code}`", series, seed, *counted, given_up])
    head = ["date", "code", "series", "seed", *COLUMNS.values(), "cases given up"]
    wrong = [f"- {w['stage']}, {w['case']}, {w['of']}: {w['why']}" for w in tally["wrong"]]
    lines = [
        "# Attacks on verdicts and edges",
        "",
        "Written by `python -m benchmarks.truth --report --table docs/evidence/truth.md`. [How friso finds "
        "hunting](../hunting_method.md) says what an attack is. Right: not refuted; certain and neither right nor "
        "wrong: the attack ran out of work, or had nothing to try. Code: digests of the check and of the adversary.",
        "",
        *markdown(head, rows),
        "",
        f"Certain and wrong: {len(wrong) or 'none'}.",
        *wrong,
        "",
        "## By class of machine",
        "",
        *markdown(["class", *COLUMNS.values()], _rows(tally)),
    ]
    return "\n".join(lines) + "\n"


def _rows(tally: dict[str, Any]) -> list[list[Any]]:
    return [[name, *(row[key] for key in COLUMNS)] for name, row in {**tally["classes"], "all": tally["all"]}.items()]


def markdown(head: Sequence[Any], rows: Iterable[Sequence[Any]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    return [f"| {' | '.join(map(str, row))} |" for row in (head, ["---"] * len(head), *rows)]


def _claims(records: Iterable[Record]) -> list[tuple[Record, dict[str, Any]]]:
    return [(record, claim) for record in records for claim in record["claims"]]


def _name(record: Record) -> str:
    return f"{record['series']} {record['seed']}:{record['number']}"


def _witnesses(records: Iterable[Record], sure: bool) -> list[dict[str, Any]]:
    return [{"stage": _name(r), **witness} for r in records for witness in r["refuted"] if witness["sure"] == sure]


def _spread(seconds: Sequence[float]) -> dict[str, float]:
    seconds = seconds or [0.0]
    return {"median": float(np.median(seconds)), "mean": float(np.mean(seconds)), "worst": max(seconds)}


def _print_cycles(records: Iterable[Record]) -> None:
    """Print how far cycles under a law of friction differ at most from those of SciPy and of simulations."""
    cycles: dict[str, list[dict[str, float]]] = {}
    for record in records:
        cycles.setdefault(record["series"], []).extend(record.get("cycles", []))
    rows = []
    for law, some in ((law, some) for law, some in cycles.items() if some):
        grown = [abs(cycle["growth"] - cycle["multiplier"]) for cycle in some if np.isfinite(cycle["growth"])]
        worst = [*(max(cycle[name] for cycle in some) for name in ("gap", "size")), max(grown, default=0.0)]
        rows.append([law, len(some), *(f"{value:.1g}" for value in (*worst, max(c["brute"] for c in some)))])
    if rows:
        print_table(("law", "cycles", "open by", "size", "multiplier", "brute"), rows)


def _print_doubts(records: Iterable[Record]) -> None:
    """Print why claims are not certain, for which stages, and which checks take the most work."""
    stages: dict[tuple[str, str], list[str]] = {}
    for record, claim in _claims(records):
        for doubt in claim["doubts"].items():
            stages.setdefault(doubt, []).append(_name(record))
    rows = [[of, why, len(which), ", ".join(which)] for (of, why), which in stages.items()]
    print_table(("not certain", "why", "", "stages"), sorted(rows, key=lambda row: -row[2]))
    slowest = sorted((record for record in records if not record["error"]), key=lambda record: -record["work"])
    print_table(
        ("most work, in units of 12 ns", "", "CPU [s]"),
        [[_name(r), f"{r['work']:.1e}", f"{r['cpu']:.1f}"] for r in slowest[:SLOWEST]],
    )
