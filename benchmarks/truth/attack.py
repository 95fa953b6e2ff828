"""Draw, check and attack one stage, and record it for a file."""

import time
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.truth.claims import Claim, checked
from benchmarks.truth.classes import classes_of
from benchmarks.truth.cycles import cycles_of
from benchmarks.truth.draws import UNDER_LAWS, draw
from benchmarks.truth.refute import Refutation, attempts
from benchmarks.truth.second_opinion import scipy_refutations
from friso.engine.allowance import Exhausted, allowance
from friso.stage import Stage

WORK = 2e9
"""Work of an attack on a claim (see `friso.engine.allowance`), about 25 s on one core: verdict, own motion, edge and
margin in static friction in this order, without SciPy's. Free joints whose limiter chatters would take a hundred times
that."""

STOOD, WRONG, GIVEN_UP = "stood", "wrong", "given up"
"""What becomes of a verdict or an edge that is attacked."""


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def attack(seed: int, number: int, scipy_share: float, folder: Path, checks: bool, series: str) -> dict[str, Any]:
    """Return what friso says about a numbered stage of a series, and what refutes it.

    With `checks` nothing is attacked. Stages that are refuted, or raise an error, are written to a folder.
    """
    stage = draw(seed, number, series)
    record: dict[str, Any] = {"series": series, "seed": seed, "number": number, "claims": [], "refuted": []}
    try:
        _attack(stage, record, scipy_share, checks)
        record["error"] = ""
    except Exception as error:  # an error is a finding as well
        record["error"] = f"{type(error).__name__}: {error}"
    if record["refuted"] or record["error"]:
        _write(folder / f"{series}-{seed}-{number}", stage, record)
    return record


def _attack(stage: Stage, record: dict[str, Any], scipy_share: float, checks: bool) -> None:
    said = checked(stage)
    record |= {"cpu": said.cpu, "work": said.work}
    start = time.process_time()
    for claim in said.claims:
        if record["series"] in UNDER_LAWS and not checks:
            for cycle in cycles_of(claim):
                record.setdefault("cycles", []).append(asdict(cycle))
                if cycle.wrong:
                    why = f"of {cycle.amplitude:.4g} m: {cycle.wrong}"
                    record["refuted"].append({"case": claim.case, "of": "cycle", "sure": True, "why": why})
        tried = {} if checks else _tried(claim, record["number"], scipy_share)
        outcomes, refuted = _outcomes(tried)
        record["claims"].append(_as_data(claim) | {"outcomes": outcomes})
        record["refuted"] += [{"case": claim.case, **asdict(refutation)} for refutation in refuted]
    record["attack_cpu"] = time.process_time() - start


def _as_data(claim: Claim) -> dict[str, Any]:
    return {
        "says": str(claim),
        "case": claim.case,
        "classes": classes_of(claim.stage.flat()),
        "verdict": claim.verdict,
        "sure": claim.sure,
        "edge": claim.edge.factor if claim.edge else None,
        "edge_sure": bool(claim.edge and claim.edge.sure),
        "friction_sure": None if claim.friction is None else claim.sure and claim.friction.certain,
        "doubts": dict(claim.doubts),
    }


def _tried(claim: Claim, number: int, scipy_share: float) -> dict[str, Iterator[Refutation]]:
    """Return the attempts to refute a claim, including SciPy's when it is its turn."""
    tried = attempts(claim, number)
    if "verdict" in tried and np.random.default_rng([number, 5]).random() < scipy_share:
        tried["verdict"] = chain(tried["verdict"], scipy_refutations(claim))
    return tried


def _outcomes(tried: dict[str, Iterator[Refutation]]) -> tuple[dict[str, str], list[Refutation]]:
    """Return what becomes of the parts of an attacked claim, and what refutes them.

    All parts share one allowance.
    """
    outcomes, refuted = {}, []
    with allowance(WORK):
        for part, attempt in tried.items():
            before, ends_as = len(refuted), STOOD
            try:
                refuted += attempt  # those found before the attack is given up stay
            except Exhausted:
                ends_as = GIVEN_UP
            outcomes[part] = WRONG if len(refuted) > before else ends_as
    return outcomes, refuted


def _write(name: Path, stage: Stage, record: dict[str, Any]) -> None:
    """Write the stage file, and a note on what was said and what refutes it."""
    lines = [f"friso says {claim['says']}" for claim in record["claims"]]
    for refutation in record["refuted"]:
        word = "wrong" if refutation["sure"] else "wrong (not sure)"
        lines.append(f"{word}, {refutation['case']}, {refutation['of']}: {refutation['why']}")
    lines += [record["error"]] if record["error"] else []
    name.with_suffix(".toml").write_text(stage.to_toml())
    name.with_suffix(".txt").write_text("\n".join(lines) + "\n")
