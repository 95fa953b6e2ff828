"""Say in one sentence what a run does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.arrays import Status
from friso.hunting.criteria import CREEPS, OUTCOME_CRITERION, RESTS, SWINGS
from friso.hunting.measures import LAST_QUARTER, Measures
from friso.shown.documents import dwells_document, plain_json
from friso.shown.motion_words import off_its_reference
from friso.shown.text import listed, swing_with_unit, with_unit
from friso.stage import Stage
from friso.stage.rig import AS_BUILT

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from friso.hunting import Dwell


GROWTH_RATIO = 1.1
"""Ratio of errors in the last quarter of a run and before it, above which the run counts as diverging."""


def conclusion(
    name: str, measures: Measures, deviation: np.ndarray, moves_on: bool = False, evenly: bool = True
) -> str:
    """Say what the run of a stage does.

    `moves_on` is true if the reference moves at the end, and `evenly` if its velocity is then constant. `deviation` has
    evenly timed samples of the deviation from the reference [m], shape (n,).
    """
    before, late = np.split(np.abs(deviation), [int(LAST_QUARTER * len(deviation))])
    middle = 0.0 if moves_on else _value(measures.offset)
    grows = bool(late.max() > GROWTH_RATIO * before.max(initial=0.0))
    clauses = {
        SWINGS: lambda: (
            f"swings {swing_with_unit(_value(measures.peak_to_peak) / 2, middle, 'm')} every "
            f"{with_unit(_value(measures.period), 's')} at the end of the run{', and ever farther' if grows else ''}"
        ),
        CREEPS: lambda: _restless(float(late.max()), float(late[-1]), _value(measures.peak_to_peak), grows),
        RESTS: lambda: f"rests {_settling(measures)}",
    }
    outcome = str(measures.outcome[0])
    if outcome not in clauses:
        return f"{name}: the run was not completed ({Status(int(measures.status[0])).text})."
    if moves_on:
        swings = f"; its deviation {clauses[SWINGS]()}" if outcome == SWINGS and evenly else ""
        return f"{name} {off_its_reference(float(late.max()), float(np.sqrt(np.mean(late**2))))}{swings}."
    return f"{name}: {clauses[outcome]()}."


def built_sentence(stage: Stage) -> str:
    """Say which properties of the machine as built the run includes."""
    tables = listed([f"[{name}]" for name in AS_BUILT if getattr(stage, name)], "and")
    what = f", with {tables}" if tables else ""
    return f"The drive ran as built, sample by sample{what}; --continuous leaves that out."


def _restless(farthest: float, final: float, moved: float, grows: bool) -> str:
    """Describe a run that is off its reference at the end but does not swing.

    In the last quarter, the stage was off by at most `farthest` [m], and its peak-to-peak motion was `moved` [m]. At
    the end it is off by `final` [m]. `grows` is true if the deviation keeps growing.
    """
    if grows:
        return (
            f"goes ever farther off its reference, by up to {with_unit(farthest, 'm')} in the last quarter of the run"
        )
    end = f"{with_unit(final, 'm')} off its reference at the end of the run, without a lasting swing"
    return f"creeps: {end}" if moved < final else f"does not come to rest: {end}"


def _settling(measures: Measures) -> str:
    """Write how long after the last corner of the reference the stage stays within the bands.

    Settling at the far end of a move there and back is named if it takes longer.
    """
    (fine, coarse), (last_fine, last_coarse) = (
        tuple(map(_value, times)) for times in (measures.settling_time, measures.in_the_end)
    )
    small, wide = (with_unit(band, "m") for band in measures.bands)
    text = f"within {wide} of its reference, {with_unit(last_coarse, 's')} after its last corner"
    if not np.isnan(last_fine):
        text = f"{text}; within {small} after {with_unit(last_fine, 's')}"
    if np.isnan(coarse):
        return f"{text}; not within {wide} at the far end before it returned"
    if np.isnan(fine) and not np.isnan(last_fine):
        return f"{text}; not within {small} at the far end before it returned"
    far = f"{with_unit(coarse, 's')} and {with_unit(fine, 's')}" if fine > last_fine else with_unit(coarse, "s")
    return f"{text} (at the far end {far})" if coarse > last_coarse or fine > last_fine else text


def _value(array: np.ndarray) -> float:
    """Return the only number of an array."""
    return float(array[0])


def simulate_document(
    response: xr.Dataset, measures: Measures, name: str, conclusion: str, dwells: Sequence[Dwell]
) -> dict[str, Any]:
    """Return the JSON document of a run: what it does, and how the solver fared.

    `name` is the name of the stage.
    """
    into_fine, into_coarse = measures.settling_time
    return plain_json(
        {
            "conclusion": conclusion,
            "stage": name,
            "outcome": measures.outcome[0],
            "criterion": OUTCOME_CRITERION,
            "peak_to_peak_m": measures.peak_to_peak[0],
            "period_s": measures.period[0],
            "bands_m": measures.bands,
            "settling_time_s": into_fine[0],
            "settling_time_10um_s": into_coarse[0],
            **({"dwells": dwells_document(dwells)} if dwells else {}),
            "solver": {key: response.attrs[key] for key in ("status", "steps", "rejected", "rtol")},
        }
    )
