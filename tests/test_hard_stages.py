"""Stages that are hard to judge, and the verdicts that an adversary established by brute force (`benchmarks.truth`)."""

import tomllib
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from friso.equations.structure import structure
from friso.hunting import judge_many
from friso.stage import Stage

ENTRIES = tomllib.loads(Path(__file__).with_name("hard_stages.toml").read_text(encoding="utf-8"))["stages"]
SAID = ("name", "attracts", "own_motion", "evidence")


def flat_of(entry: dict[str, Any]) -> dict[str, Any]:
    return Stage(**{key: table for key, table in entry.items() if key not in SAID}).flat()


def groups() -> dict[str, list[dict[str, Any]]]:
    """The entries that are judged together: of one structure and one kind of motion."""
    by_kind = defaultdict(list)
    for entry in ENTRIES:
        flat = flat_of(entry)
        form = structure(flat)
        by_kind[f"{form.joint}{', parasitic' * form.parasitic}, {flat['motion.kind']}"].append(entry)
    return by_kind


def established(entry: dict[str, Any]) -> tuple[str, ...]:
    """Return the verdicts that agree with what is known of a stage."""
    if not entry["attracts"]:
        return ("settles", "transient")
    return ("hunts",) if entry["own_motion"] == "swings" else ("bistable",)


@pytest.mark.cases(first=1, slow=5)
@pytest.mark.parametrize("kind", groups())
def test_verdicts_near_the_edge(kind: str) -> None:
    entries = groups()[kind]
    flats = [flat_of(entry) for entry in entries]
    columns = {key: [flat[key] for flat in flats] for key in flats[0]}
    numbers = {key: np.array(values) for key, values in columns.items() if isinstance(values[0], float)}
    result = judge_many({**flats[0], **numbers}, len(entries), 1e-6)
    text = zip(entries, result, strict=True)
    wrong = [(entry["name"], verdict) for entry, verdict in text if verdict not in established(entry)]
    assert not wrong


def test_both_kinds_are_among_them() -> None:
    """Otherwise a constant verdict would pass."""
    assert {entry["attracts"] for entry in ENTRIES} == {True, False}
