"""Metrics of a map: a table of the simple ones, and one module for each other, called as the metric, with `METRIC`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from friso.hunting.criteria import DISTINCT_CRITERION, PEAK_CRITERION, VERDICT_CRITERION
from friso.hunting.measures import BANDS, Measures
from friso.studies.metric import MapFinding, Metric
from friso.studies.metrics import verdict
from friso.studies.metrics.attractor import of_attractor


def _of_run(
    about: str, title: str, measure: Callable[[Measures], Any], unit: str, place: int, **more: Any
) -> tuple[Metric, str]:
    """Return the entry of a metric that shows one measure of a run, computed for every map.

    `about` says what it is. `more` are further fields of the metric.
    """
    return Metric(title, lambda run: measure(run.measures), unit=unit, usual=True, place=place, **more), about


def _settling(band: int) -> tuple[Metric, str]:
    """Return the entry of the settling time into one of the `BANDS`, by its number."""
    size = f"{1e6 * BANDS[band]:g} µm"
    return _of_run(
        f"Time until a run stays within {size} of its reference",
        f"Settling time into {size}",
        lambda of: of.settling_time[band],
        "s",
        30 + band,
        band=BANDS[band],
        missing=f"does not stay within {size}",
    )


_COUNTED: dict[str, Any] = {"counts": True, "findings": (MapFinding("Peaks are counted"),)}
_SKETCHED = replace(
    verdict.METRIC,
    title="Verdict on the stage, sketched",
    source="sketch",
    place=72,
    criterion=f"sketch of the {VERDICT_CRITERION}: what attracts from a narrow range of distances may be missed",
    basis="by this sketch",
)

TABLE: dict[str, tuple[Metric, str]] = {
    "peaks": _of_run(
        "Peaks of a run: maxima of the position that stand out late in it",
        "Counted peaks", lambda of: of.peaks, "1", 10, criterion=PEAK_CRITERION, **_COUNTED,
    ),
    "distinct_peaks": _of_run(
        "Peaks counted as in the thesis, but without ripple of less than 1 µm",
        "Counted peaks, distinct ones", lambda of: of.distinct_peaks, "1", 11, criterion=DISTINCT_CRITERION, **_COUNTED,
    ),
    "peak_to_peak": _of_run(
        "Deviation of a run over its last quarter, peak to peak",
        "Peak to peak, last quarter", lambda of: of.peak_to_peak, "m", 20,
    ),
    "period": _of_run(
        "Period of what a run does at its end; a map shows that of the hunting cycle",
        "Period", lambda of: of.period, "s", 21, missing="no period", shown_as="cycle_period",
    ),
    "settling_time": _settling(0),
    "settling_time_10um": _settling(1),
    "largest_force": _of_run(
        "Largest force of the actuator in a run",
        "Largest actuator force", lambda of: of.largest_force, "N", 40,
    ),
    "steps": _of_run("Steps of the solver in a run", "Solver steps", lambda of: of.steps, "1", 50),
    "rejected": _of_run(
        "Steps of the solver in a run that were rejected",
        "Rejected solver steps", lambda of: of.rejected, "1", 51,
    ),
    "multiplier": of_attractor(
        "Multiplier of the hunting cycle",
        "Multiplier of the cycle that attracts", "multiplier", "1", 60, limits=(-1.0, 1.0),
    ),
    "amplitude": of_attractor("Amplitude of the hunting cycle", "Amplitude of what attracts", "amplitude", "m", 61),
    "offset": of_attractor(
        "Middle of the hunting cycle, from the reference", "Offset of what attracts", "middle", "m", 61
    ),
    "cycle_period": of_attractor("Period of the hunting cycle", "Period of what attracts", "period", "s", 62),
    "sketch": (_SKETCHED, "Whether the stage hunts, by coarse return maps, or by closed orbits if maps do not decide"),
}  # fmt: skip
"""Metrics and what each is, by name."""
