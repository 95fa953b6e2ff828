"""Draws stages, checks them, and tries to refute every verdict and edge: `python -m benchmarks.truth`.

Prints the share of sure verdicts, how many of these are wrong (their stage files, each with a note, are written to a
folder), the CPU time of a check, and why what is not sure is not. Interrupted, it prints what there is. `--number`
takes single stages of a seed; `--checks` checks them and tries to refute nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded

import numpy as np

from benchmarks.report import Goal, print_goals, print_table
from benchmarks.truth.attack import attack
from benchmarks.truth.by_hand import NotWritten
from benchmarks.truth.draws import SERIES
from benchmarks.truth.positions import compared, summary

SLOWEST = 8
"""Checks that are listed for the work they take."""


def main() -> None:
    arguments = _arguments()
    numbers = arguments.number or range(arguments.first, arguments.first + arguments.stages)
    if arguments.simulate:
        _simulate(arguments.seed, numbers, arguments.series)
        return
    arguments.out.mkdir(parents=True, exist_ok=True)
    records: list[dict[str, Any]] = []
    start = time.perf_counter()
    try:
        with (arguments.out / "records.jsonl").open("a") as log:
            for record in _attacked(arguments, numbers):
                records.append(record)
                log.write(json.dumps(record) + "\n")
                log.flush()
                print(_line(record), flush=True)
    except KeyboardInterrupt:
        print("interrupted")
    _summary(records, time.perf_counter() - start)


def _simulate(seed: int, numbers: Iterable[int], series: str) -> None:
    """Compare runs with SciPy, stage by stage; those whose equations are not written by hand are left out."""
    records: list[dict[str, Any]] = []
    try:
        for number in numbers:
            try:
                records.append(compared(seed, number, series))
            except NotWritten as missing:
                print(f"  {number:5d}  no equations by hand ({missing})", flush=True)
                continue
            print(
                f"  {number:5d}  {records[-1]['off']:.1e}  {records[-1]['kind']}, {records[-1]['status']}", flush=True
            )
    except KeyboardInterrupt:
        print("interrupted")
    if records:
        summary(records)


def _attacked(arguments: argparse.Namespace, numbers: Any) -> Iterator[dict[str, Any]]:
    tasks = [
        (arguments.seed, number, arguments.scipy_share, arguments.out, arguments.checks, arguments.series)
        for number in numbers
    ]
    if arguments.workers == 1:
        yield from (attack(*task) for task in tasks)
        return
    pool = ProcessPoolExecutor(arguments.workers)
    try:
        for job in as_completed([pool.submit(attack, *task) for task in tasks]):
            yield job.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _line(record: dict[str, Any]) -> str:
    said = "; ".join(claim["says"] for claim in record["claims"])
    lines = [f"  {record['number']:5d}  {record['cpu']:6.2f} s  {said}"]
    for witness in record["refuted"]:
        word = "WRONG" if witness["sure"] else "wrong, but not sure"
        lines.append(f"      {word}: {witness['case']}, {witness['of']}: {witness['why']}")
    return "\n".join(lines)


def _summary(records: list[dict[str, Any]], seconds: float) -> None:
    if not records:
        return
    claims = [claim for record in records for claim in record["claims"]]
    sure = sum(claim["sure"] for claim in claims)
    edges = [claim for claim in claims if claim["edge"] is not None]
    wrong = [record["number"] for record in records if any(witness["sure"] for witness in record["refuted"])]
    unsure_wrong = sum(any(not witness["sure"] for witness in record["refuted"]) for record in records)
    cpu = [record["cpu"] for record in records]
    print()
    print_table(
        ("", ""),
        [
            ["stages, verdicts", f"{len(records)}, {len(claims)}"],
            ["sure verdicts", f"{sure} ({100 * sure / len(claims):.1f} %)"],
            ["edges, sure ones", f"{len(edges)}, {sum(claim['edge_sure'] for claim in edges)}"],
            ["stages with something sure that is wrong", f"{len(wrong)}: {', '.join(map(str, sorted(wrong)))}"],
            ["stages with something wrong that was not sure", unsure_wrong],
            ["claims whose attack was given up for its work", sum(len(record["given_up"]) for record in records)],
            ["wall time [s]", f"{seconds:.0f}"],
        ],
    )
    _doubts(records)
    share, median, worst = sure / len(claims), float(np.median(cpu)), max(cpu)
    print_goals(
        [
            Goal("sure verdicts", "97 %", f"{100 * share:.1f} %", share >= 0.97),
            Goal("wrong among the sure", "none", str(len(wrong)), not wrong),
            Goal("CPU of a check, median", "0.5 s", f"{median:.2f} s", median <= 0.5),
            Goal("CPU of a check, worst", "10 s", f"{worst:.1f} s", worst <= 10),
        ],
        "Goals of issue 21, section 3",
    )


def _doubts(records: list[dict[str, Any]]) -> None:
    """Print why what is not sure is not, and of which stages; and which checks take the most work."""
    stages: dict[tuple[str, str], list[str]] = {}
    for record in records:
        for claim in record["claims"]:
            for doubt in claim["doubts"].items():
                stages.setdefault(doubt, []).append(f"{record['seed']}:{record['number']}")
    rows = [[of, why, len(which), ", ".join(which)] for (of, why), which in stages.items()]
    print_table(("not sure", "why", "", "stages"), sorted(rows, key=lambda row: -row[2]))
    slowest = sorted(records, key=lambda record: -record["work"])[:SLOWEST]
    print_table(
        ("most work, in units of 12 ns", "", "CPU [s]"),
        [[f"{r['seed']}:{r['number']}", f"{r['work']:.1e}", f"{r['cpu']:.1f}"] for r in slowest],
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.truth", description=__doc__)
    parser.add_argument("--stages", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first stage")
    parser.add_argument("--number", type=int, action="append", help="a single stage; may be repeated")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scipy-share", type=float, default=0.1, help="share of stages that SciPy looks at too")
    parser.add_argument(
        "--series",
        choices=SERIES,
        default="stages",
        help="machines: cascades, transmissions, deadbands; axes: of machine tools, with settings against friction",
    )
    parser.add_argument("--checks", action="store_true", help="check the stages alone, and refute nothing")
    parser.add_argument("--simulate", action="store_true", help="compare runs of the stages with SciPy instead")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("benchmark_results/truth"), help="folder for refuted stages")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
