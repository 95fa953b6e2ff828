"""Records that show next to nothing, read as every kind of experiment: an answer or a refusal, and no warning."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import friso
from friso.identification.kinds import KINDS

TIME = np.arange(0, 2, 2e-3)
STEP = np.where(TIME > 1, 1.0, 0.0)
STAIRS = np.floor(4 * TIME)
SQUARE = np.sign(np.sin(9 * TIME))

RECORDS: Mapping[str, tuple[np.ndarray, np.ndarray]] = {
    "nothing": (0 * TIME, 0 * TIME),
    "a step": (STEP, 5e-6 * STEP),
    "a force alone": (STEP, 0 * TIME),
    "a ramp": (TIME, 1e-3 * TIME),
    "stairs": (STAIRS, 1e-5 * STAIRS),
    "back and forth": (SQUARE, 1e-5 * np.cumsum(SQUARE)),
    "gaps": (np.where(np.arange(len(TIME)) % 7 == 0, np.nan, STEP), 1e-5 * STEP),
    "two samples": (STEP[:2], STEP[:2]),
}


@pytest.mark.cases(first=4)
@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_answered_or_refused_as_every_kind(tmp_path: Path, name: str) -> None:
    path, (force, position) = tmp_path / "record.csv", RECORDS[name]
    rows = [f"{t:.4f},{f:.9g},{x:.9g}" for t, f, x in zip(TIME, force, position, strict=False)]
    path.write_text("\n".join(["time [s],force [N],position [m]", *rows]))
    for kind in (None, *KINDS):
        try:
            answered = friso.identify([path], as_=kind)
        except friso.InputError:
            continue
        assert answered.sentences()
        assert answered.document()
        answered.tables()
        answered.figures()
