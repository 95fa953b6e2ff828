"""A time response in one sentence: what the run does."""

from __future__ import annotations

import numpy as np

from friso.engine.arrays import Status
from friso.hunting.criteria.run_outcome import BAND, CREEPS, RESTS, SWINGS
from friso.hunting.measures import BANDS, Measures
from friso.views.drawing.prefixes import plus_minus, with_unit


def conclusion(name: str, measures: Measures, final: float) -> str:
    """What the run of the stage of that name does, with its deviation [m] at the `final` sample."""
    clauses = {
        SWINGS: lambda: (
            f"swings {plus_minus(_value(measures.peak_to_peak) / 2, 'm')} every "
            f"{with_unit(_value(measures.period), 's')} at the end of the run"
        ),
        CREEPS: lambda: (
            f"creeps: {with_unit(abs(final), 'm')} off its reference at the end of the run, without a lasting swing"
        ),
        RESTS: lambda: f"rests {_settling(measures)}",
    }
    outcome = str(measures.outcome[0])
    if outcome not in clauses:
        return f"{name}: the run was not completed ({Status(int(measures.status[0])).text})."
    return f"{name}: {clauses[outcome]()}."


def _settling(measures: Measures) -> str:
    """How long after the last corner of the reference the stage stays within the bands."""
    into_1um, into_10um = (_value(time) for time in measures.settling_time)
    text = f"within {with_unit(BAND, 'm')} of its reference, {with_unit(into_10um, 's')} after its last corner"
    return (
        text if into_1um != into_1um else f"{text}; within {with_unit(BANDS[0], 'm')} after {with_unit(into_1um, 's')}"
    )


def _value(array: np.ndarray) -> float:
    return float(array[0])
