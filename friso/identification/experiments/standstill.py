"""Standstill in position: how far the stage wanders while its reference stands still, compared between logs.

Thesis, Sec. 4.3.2, Fig. 28.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.identification.kind import AnalysisSettings, ExperimentKind, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel
from friso.identification.readings.course import Course


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


def _analyse(logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> StandstillResult:
    """Analyse logs at standstill together."""
    rows = tuple(wandering(log) for log in logs if isinstance(log, Log))
    moved = [row.name for row in rows if abs(row.drift) > row.rms]
    warnings = (f"{', '.join(moved)}: most of the deviation is a drift.",) if moved else ()
    return StandstillResult(rows, warnings)


def _claims(course: Course) -> str | None:
    """Return why a log is of standstill, or None: its reference stands, and it has no force."""
    log = course.log
    if "reference" not in log or course.reference_moves or "force" in log:
        return None
    return "the reference stands still, and no force is logged"


KIND = ExperimentKind[StandstillResult](_analyse, roles=("position",), together=True, claims=_claims)
