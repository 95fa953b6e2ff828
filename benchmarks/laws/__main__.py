"""Test random stages under each friction law.

Run by `python -m benchmarks.laws --law gms --stages 20`. Every stage is checked. SciPy's Radau follows its cycles event
by event with equations written by hand (closing, amplitude, multiplier), and simulations follow them at two tolerances.
Brute force attacks its verdict, its own motion and its edge (`benchmarks.truth`). Errors are printed; records go to a
file, and stages in it are not repeated.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from dataclasses import astuple
from itertools import chain
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded

import numpy as np

from benchmarks.laws.by_hand import LAWS
from benchmarks.laws.cycles import cycles_of
from benchmarks.laws.draws import numbers, under
from benchmarks.report import Goal, print_goals, print_table
from benchmarks.truth.claims import checked
from benchmarks.truth.refute import attempts


def main() -> None:
    arguments = _arguments()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    records = [json.loads(line) for line in arguments.out.read_text().splitlines()] if arguments.out.exists() else []
    done, begun = {(record["law"], record["number"]) for record in records}, time.monotonic()
    with arguments.out.open("a") as log:
        for law in arguments.law or LAWS:
            for number in numbers(arguments.stages):
                if (law, number) in done or time.monotonic() - begun > arguments.seconds:
                    continue
                records.append(_record(law, arguments.seed, number))
                log.write(json.dumps(records[-1]) + "\n")
                log.flush()
                print(f"  {law:15s}{number:5d}  {'; '.join(records[-1]['says'])}", flush=True)
                for wrong in records[-1]["wrong"]:
                    print(f"      {wrong}", flush=True)
    _summary(records)


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def _record(law: str, seed: int, number: int) -> dict[str, Any]:
    stage = under(law, seed, number)
    said = checked(stage)
    cycles, wrong, start = [], [], time.process_time()
    for claim in said.claims:
        if claim.surveyed is not None:
            for cycle in cycles_of(claim, claim.surveyed):
                cycles.append(list(astuple(cycle)))
                if cycle.wrong:
                    wrong.append(f"WRONG: {claim.case}, cycle of {cycle.amplitude:.4g} m: {cycle.wrong}")
        for refutation in chain.from_iterable(attempts(claim, number).values()):
            word = "WRONG" if refutation.sure else "wrong, but not sure"
            wrong.append(f"{word}: {claim.case}, {refutation.of}: {refutation.why}")
    return {
        "law": law, "number": number, "cpu": said.cpu, "attack_cpu": time.process_time() - start,
        "says": [str(claim) for claim in said.claims], "sure": [claim.sure for claim in said.claims],
        "edges": [bool(claim.edge and claim.edge.sure) for claim in said.claims if claim.edge],
        "cycles": cycles, "wrong": wrong, "stage": stage.to_toml(),
    }  # fmt: skip


def _summary(records: list[dict[str, Any]]) -> None:
    rows, laws = [], sorted({record["law"] for record in records})
    for law in laws:
        own = [record for record in records if record["law"] == law]
        sure = [answer for record in own for answer in record["sure"]]
        edges = [answer for record in own for answer in record["edges"]]
        cycles = [cycle for record in own for cycle in record["cycles"]]
        apart = [abs(cycle[5] - cycle[2]) for cycle in cycles if np.isfinite(cycle[5])]
        rows.append(
            [
                law, len(own), f"{sum(sure)} of {len(sure)}", f"{sum(edges)} of {len(edges)}", len(cycles),
                *(f"{max((c[column] for c in cycles), default=0.0):.1g}" for column in (3, 4)),
                f"{max(apart, default=0.0):.1g}", f"{max((c[6] for c in cycles), default=0.0):.1g}",
                f"{np.median([record['cpu'] for record in own]):.1f}",
            ]
        )  # fmt: skip
    heads = (
        "law",
        "stages",
        "sure verdicts",
        "sure edges",
        "cycles",
        "open by",
        "size",
        "multiplier",
        "brute",
        "CPU [s]",
    )
    print_table(heads, rows)
    wrong = sum(line.startswith("WRONG") for record in records for line in record["wrong"])
    print_goals([Goal("wrong among the sure", "none", str(wrong), not wrong)], "Issue 26, section 4")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.laws", description=__doc__)
    parser.add_argument("--law", action="append", choices=LAWS, help="may be repeated; all by default")
    parser.add_argument("--stages", type=int, default=20, help="of each law")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=np.inf, help="after which no other stage is begun")
    parser.add_argument("--out", type=Path, default=Path("benchmark_results/laws.jsonl"), help="file of the records")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
