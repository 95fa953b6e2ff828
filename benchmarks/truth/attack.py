"""One stage, drawn, checked and attacked; as a record that can be written to a file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.truth.claims import Claim, checked
from benchmarks.truth.draws import draw
from benchmarks.truth.refute import Refutation, refutations
from benchmarks.truth.second_opinion import scipy_refutations
from friso.engine.allowance import Exhausted, allowance
from friso.stage import Stage

WORK = 4e9
"""Work of an attack on a claim (see `friso.engine.allowance`), about 50 s on one core: verdict, own motion and edge in
this order. SciPy's is not counted. Free joints whose limiter rattles would take a hundred times that."""


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def attack(seed: int, number: int, scipy_share: float, folder: Path, checks: bool, series: str) -> dict[str, Any]:
    """What friso says of the stage with this number, of a series, and what refutes it
    (nothing is tried for `checks` alone); refuted stages are written to a folder."""
    stage = draw(seed, number, series)
    said = checked(stage)
    start = time.process_time()
    refuted: list[dict[str, Any]] = []
    given_up: list[str] = []
    for claim in () if checks else said.claims:
        try:
            with allowance(WORK):
                for refutation in _against(claim, number, scipy_share):
                    refuted.append({"case": claim.case, **asdict(refutation)})
        except Exhausted:
            given_up.append(claim.case)
    record = {
        "seed": seed,
        "number": number,
        "cpu": said.cpu,
        "work": said.work,
        "attack_cpu": time.process_time() - start,
        "given_up": given_up,
        "claims": [
            {
                "says": str(claim),
                "case": claim.case,
                "verdict": claim.verdict,
                "sure": claim.sure,
                "edge": claim.edge.factor if claim.edge else None,
                "edge_sure": bool(claim.edge and claim.edge.sure),
                "doubts": dict(claim.doubts),
            }
            for claim in said.claims
        ],
        "refuted": refuted,
    }
    if refuted:
        _write(folder / f"{series}-{seed}-{number}", stage, record)
    return record


def _against(claim: Claim, number: int, scipy_share: float) -> Iterator[Refutation]:
    yield from refutations(claim, number)
    if np.random.default_rng([number, 5]).random() < scipy_share:
        yield from scipy_refutations(claim)


def _write(name: Path, stage: Stage, record: dict[str, Any]) -> None:
    """The stage file, and a note of what was said and what refutes it."""
    lines = [f"friso says {claim['says']}" for claim in record["claims"]]
    for refutation in record["refuted"]:
        word = "wrong" if refutation["sure"] else "wrong (not sure)"
        lines.append(f"{word}, {refutation['case']}, {refutation['of']}: {refutation['why']}")
    name.with_suffix(".toml").write_text(stage.to_toml())
    name.with_suffix(".txt").write_text("\n".join(lines) + "\n")
