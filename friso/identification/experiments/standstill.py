"""Standstill in position: how far the stage wanders while its reference stands still, compared between logs.

Thesis, Sec. 4.3.2, Fig. 28.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.identification.kind import TIME, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel
from friso.identification.readings.course import Course
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, GREEN, INK, ORANGE, PINK, VERMILLION, Axis, Figure, Panel, Series
from friso.shown.text import with_unit


@dataclass(frozen=True)
class Wandering:
    """Deviation of a stage in one log while its reference stands.

    Fields are RMS and largest deviation from the mean [m], drift over the log [m] by a straight line, and the deviation
    [m] over time [s], both of shape (n,).
    """

    name: str
    rms: float
    peak: float
    drift: float
    time: np.ndarray
    deviation: np.ndarray


@dataclass(frozen=True)
class StandstillResult:
    """Deviations in several logs at standstill; all others are compared with the first."""

    logs: tuple[Wandering, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ratios(self) -> tuple[tuple[float, float], ...]:
        """Return the ratios of RMS and peak of every log to the first's; NaN where that is 0."""
        first = self.logs[0]
        pairs = ((log.rms / first.rms if first.rms else np.nan, log.peak, first.peak) for log in self.logs)
        return tuple((rms, peak / least if least else np.nan) for rms, peak, least in pairs)


def wandering(log: Log) -> Wandering:
    """Return the deviation of the stage in a log about its mean distance from the reference.

    Raises InputError for a log without a position in SI units.
    """
    part = log.longest
    time = log.time[part]
    away = channel(log, "position")[part] - (channel(log, "reference")[part] if "reference" in log else 0.0)
    deviation = away - away.mean()
    drift = float(np.polyfit(time - time.mean(), deviation, 1)[0] * np.ptp(time)) if len(time) > 1 else 0.0
    size = np.abs(deviation)
    return Wandering(log.name, float(np.sqrt(np.mean(deviation**2))), float(size.max()), drift, time, deviation)


_COLOURS = (INK, VERMILLION, BLUE, GREEN, ORANGE, PINK)


class StandstillKind(ExperimentKind[StandstillResult]):
    """Standstill in position, compared between logs."""

    title = "Standstill"
    roles = ("position",)
    together = True
    longest = True

    def analyse(self, logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> StandstillResult:
        """Analyse logs at standstill together."""
        rows = tuple(wandering(log) for log in logs if isinstance(log, Log))
        moved = [row.name for row in rows if abs(row.drift) > row.rms]
        warnings = (f"{', '.join(moved)}: most of the deviation is a drift.",) if moved else ()
        return StandstillResult(rows, warnings)

    def claims(self, course: Course) -> str | None:
        """Return why a log is of standstill, or None: its reference stands, and it has no force."""
        log = course.log
        if "reference" not in log or course.reference_moves or "force" in log:
            return None
        return "the reference stands still, and no force is logged"

    def facts(self, result: StandstillResult) -> Facts:
        """List RMS and peak of every log, and their ratios to the first log."""
        rows = []
        for row, (rms, peak) in zip(result.logs, result.ratios, strict=True):
            against = (
                "" if row is result.logs[0] or not np.isfinite(rms) else f"; {rms:.3g} and {peak:.3g} times the first"
            )
            rows.append((row.name, f"{with_unit(row.rms, 'm')} RMS, {with_unit(row.peak, 'm')} at most{against}"))
        return tuple(rows)

    def headline(self, result: StandstillResult) -> str:
        """Say how far the stage wanders in each log."""
        return "Standstill: " + "; ".join(f"{name} {text}" for name, text in self.facts(result)) + "."

    def numbers(self, result: StandstillResult) -> dict[str, Any]:
        """Return RMS, peak, drift and ratios of every log, for the document."""
        logs = [
            {**entries(row, "name", "rms_m", "peak_m", "drift_m"), "rms_ratio": rms, "peak_ratio": peak}
            for row, (rms, peak) in zip(result.logs, result.ratios, strict=True)
        ]
        return {"logs": logs, "warnings": result.warnings}

    def figures(self, result: StandstillResult, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw the deviation of every log over time."""
        lines = tuple(
            Series(row.time - row.time[0], row.deviation, row.name, _COLOURS[number % len(_COLOURS)], width=0.9)
            for number, row in enumerate(result.logs)
        )
        panel = Panel("", TIME, Axis("Position less its mean", "m"), lines)
        return [Figure(f"{name}_record", "Standstill", "Position about its mean while the reference stands.", (panel,))]


KIND = StandstillKind()
