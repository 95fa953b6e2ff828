"""Show how far a stage wanders at standstill."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identification.experiments.standstill import StandstillResult
from friso.identification.kind import Source
from friso.questions.identify.kind_view import TIME, Facts, KindView
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, INK, ORANGE, PINK, VERMILLION
from friso.shown.drawing.prefixes import with_unit

_COLOURS = (INK, VERMILLION, BLUE, GREEN, ORANGE, PINK)


def _facts(result: StandstillResult) -> Facts:
    """List RMS and peak of every log, and their ratios to the first log."""
    rows = []
    for row, (rms, peak) in zip(result.logs, result.ratios, strict=True):
        against = "" if row is result.logs[0] or not np.isfinite(rms) else f"; {rms:.3g} and {peak:.3g} times the first"
        rows.append((row.name, f"{with_unit(row.rms, 'm')} RMS, {with_unit(row.peak, 'm')} at most{against}"))
    return tuple(rows)


def _numbers(result: StandstillResult) -> dict[str, Any]:
    """Return RMS, peak, drift and ratios of every log, for the document."""
    logs = [
        {**entries(row, "name", "rms_m", "peak_m", "drift_m"), "rms_ratio": rms, "peak_ratio": peak}
        for row, (rms, peak) in zip(result.logs, result.ratios, strict=True)
    ]
    return {"logs": logs, "warnings": result.warnings}


def _figures(result: StandstillResult, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw the deviation of every log over time."""
    lines = tuple(
        Series(row.time - row.time[0], row.deviation, row.name, _COLOURS[number % len(_COLOURS)], width=0.9)
        for number, row in enumerate(result.logs)
    )
    panel = Panel("", TIME, Axis("Position less its mean", "m"), lines)
    return [Figure(f"{name}_record", "Standstill", "Position about its mean while the reference stands.", (panel,))]


def _headline(result: StandstillResult) -> str:
    """Say how far the stage wanders in each log."""
    return "Standstill: " + "; ".join(f"{name} {text}" for name, text in _facts(result)) + "."


VIEW = KindView[StandstillResult]("Standstill", _facts, _numbers, _figures, headline=_headline, longest=True)
