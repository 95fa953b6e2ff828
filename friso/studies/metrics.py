"""The metrics of maps: a table of all, by name, with what each is.

Of what attracts a stage a cycle was closed as an orbit; a swing is one that simulations do not leave, of which no orbit
could be closed. It is unknown what attracts where simulations failed or had not settled when they were stopped, or
where something may attract beyond them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from friso.equations.motions import VELOCITY
from friso.hunting import lasting_swings
from friso.hunting.criteria import (
    CREEPS,
    DISTINCT_CRITERION,
    LASTING_RATIO,
    OUTCOME_CRITERION,
    PEAK_CRITERION,
    REST_BAND,
    RESTS,
    SWINGS,
    VERDICT_CRITERION,
)
from friso.hunting.measures import BANDS, Measures
from friso.quantities import percent
from friso.studies.metric import MapFinding, Metric, RunEvidence, StageEvidence, Word

CRITERION = (
    "what attracts the stage, by a survey of simulations from many starts: of several swings that attract the largest "
    "that was found"
)


def attractors(stage: StageEvidence) -> np.ndarray:
    """Say what attracts the stage of each cell: cycle, swing, nothing or unknown; (cells,)."""
    attracted = stage.attracted
    kind = np.where(attracted.attracts, np.where(attracted.closed, "cycle", "swing"), "nothing")
    return np.where(attracted.certain, kind, "unknown").astype(object)


def of_attractor(
    about: str, title: str, quantity: str, unit: str, place: int, limits: tuple[float, float] | None = None
) -> tuple[Metric, str]:
    """Return the entry of a metric that shows one quantity of the attractor, where it is certain what attracts.

    `about` says what it is.
    """
    metric = Metric(
        title,
        lambda stage: np.where(stage.attracted.certain, getattr(stage.attracted, quantity), np.nan),
        source="survey",
        unit=unit,
        usual=True,
        place=place,
        criterion=CRITERION,
        reasons="attractor",
        limits=limits,
        answered_by="attractor",
    )
    return metric, about


ATTRACTOR = Metric(
    "What attracts the stage",
    attractors,
    source="survey",
    words=(
        Word("cycle", "vermillion", label="a cycle attracts"),
        Word("swing", "pink", label="attracts, but not closed as an orbit"),
        Word("unknown", "mauve", label="not certain what attracts", is_open=True),
        Word("nothing", "quiet", label="nothing attracts"),
    ),
    usual=True,
    place=80,
    criterion=CRITERION,
    findings=(MapFinding("A lasting swing attracts the stage", ("cycle", "swing")),),
    doubt=("unknown", "In {count} of the cells it is not certain what attracts."),
    tallied=False,
)


OUTCOME = Metric(
    "What the run does at its end",
    lambda run: run.measures.outcome,
    words=(
        Word(
            SWINGS,
            "vermillion",
            f"the run still swings at its end: periodically, more than {2e6 * REST_BAND:g} µm peak to peak in the last "
            f"quarter, by at least {percent(LASTING_RATIO)} of what it swings in the last half",
        ),
        Word(
            CREEPS,
            "orange",
            f"the run ends more than {1e6 * REST_BAND:g} µm off its reference without swinging: "
            "it drifts, sticks or decays",
        ),
        Word(RESTS, "quiet", f"the run comes to rest within {1e6 * REST_BAND:g} µm of its reference"),
    ),
    usual=True,
    place=70,
    criterion=OUTCOME_CRITERION,
    band=REST_BAND,
    findings=(MapFinding("The run swings at its end", (SWINGS,)),),
    doubt=(
        CREEPS,
        "It still creeps at its end in {share} of the map: a longer run shows whether it hunts there, and, if the "
        "reference comes to stand, so does the verdict of every cell (--metric sketch).",
    ),
)


def sliding(run: RunEvidence) -> np.ndarray:
    """Say of each cell whether its stage sticks and slips at the speed of its reference; (cells,).

    A cell whose reference does not move at constant speed is "no ramp".
    """
    flat, count = run.flat, len(run.measures.peaks)
    if flat["motion.kind"] != "ramp" or flat.get("friction.model", "none") == "none":
        return np.full(count, "no ramp", dtype=object)
    speed = np.broadcast_to(np.asarray(flat[VELOCITY], float), (count,))
    lasts, decided, _ = lasting_swings({**flat, VELOCITY: speed}, count)
    return np.where(decided, np.where(lasts, "sticks", "slides"), "undecided").astype(object)


STICK_SLIP = Metric(
    "Motion at constant speed",
    sliding,
    words=(
        Word(
            "sticks",
            "vermillion",
            "the error about the moving reference keeps swinging, from rest",
            label="sticks and slips",
        ),
        Word("undecided", "mauve", "whether the swing lasts was not decided in long runs", is_open=True),
        Word("slides", "quiet", "the swing about the moving reference dies out", label="slides smoothly"),
        Word("no ramp", "pink", "the reference does not move at constant speed against friction", is_open=True),
    ),
    place=73,
    criterion="whether the swing of the error lasts from a long run to a longer one, from rest",
    findings=(MapFinding("The stage sticks and slips", ("sticks",)),),
    doubt=("undecided", "In {share} of the map it was not decided whether the swing lasts."),
)


VERDICT = Metric(
    "Verdict on the stage",
    lambda stage: stage.verdicts(),
    source="survey",
    words=(
        Word("hunts", "vermillion", "a cycle of the stage attracts, and the motion of the stage file ends in it"),
        Word(
            "bistable",
            "pink",
            "a cycle attracts, but this motion comes to rest; a kick or another move can start hunting",
        ),
        Word("transient", "orange", "no cycle attracts, but this motion is not at rest by its end"),
        Word("undecided", "mauve", "whether a cycle attracts, or where this motion ends, is not certain", is_open=True),
        Word("settles", "quiet", "no cycle attracts, and this motion comes to rest"),
    ),
    place=71,
    criterion=VERDICT_CRITERION,
    verdict=True,
    doubt=("undecided", "In {count} of the cells the verdict is not certain."),
    findings=(
        MapFinding("The stage hunts", ("hunts",)),
        MapFinding("It is bistable (a kick or another move can start hunting)", ("bistable",), if_any=True),
    ),
)


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
    VERDICT,
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
    "attractor": (ATTRACTOR, "What attracts the stage, by a survey from many starts"),
    "outcome": (OUTCOME, "What a run does at its end"),
    "stick_slip": (STICK_SLIP, "Whether a stage moved at constant speed slides smoothly, or sticks and slips"),
    "verdict": (VERDICT, "Whether the stage hunts, by a search of every cell"),
}  # fmt: skip
"""Metrics and what each is, by name."""
