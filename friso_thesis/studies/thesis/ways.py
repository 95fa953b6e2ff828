"""The three ways in which a run, or its stage, is said to hunt, and what a claim comes to that is judged in all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting.criteria import BAND, COUNTED_ABOVE, CREEPS, FAILED, OUTCOME_CRITERION, RESTS, SWINGS
from friso.hunting.criteria import PEAK_CRITERION as PEAK_CRITERION
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, Response

if TYPE_CHECKING:
    import xarray as xr

COUNT, SWING, CYCLE = "the thesis's count", "swinging at the end", "an attracting cycle"
"""The ways by name: peaks are counted (plain `findpeaks`, Sec. 3.2.2); the run swings at its end; a cycle attracts,
whatever the move."""


def by_peak_count(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by the thesis's count.

    They are whether at least one peak is counted, the count, the final swing over the height from which peaks count,
    and whether the stage hunts for good (`lasts`): here, whether the run swings at its end.
    """
    return runs.assign(
        keeps_moving=(runs["peaks"] > 0).assign_attrs(criterion=PEAK_CRITERION),
        count=runs["peaks"],
        size=runs["peak_to_peak"] / COUNTED_ABOVE,
        lasts=runs["outcome"] == SWINGS,
    )


def by_swing_at_end(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs with the numbers that judges read, by whether each run swings at its end.

    Peaks of other runs do not count, except in invalid and failed cells.
    """
    swings = (runs["outcome"] == SWINGS).assign_attrs(criterion=OUTCOME_CRITERION)
    ended = runs["outcome"].isin([SWINGS, CREEPS, RESTS])
    return runs.assign(
        keeps_moving=swings,
        count=runs["peaks"].where(swings | ~ended, 0.0),
        size=runs["peak_to_peak"] / (2 * BAND),
        lasts=runs["outcome"] == SWINGS,
    )


def by_attraction(runs: xr.Dataset, attracts: np.ndarray, decided: np.ndarray) -> xr.Dataset:
    """Return the runs with the numbers that judges read,
    by whether something attracts the stage of each cell.

    The flags have the runs' shape; uncertain cells are left out. A stage with an attractor also `lasts`. How often a
    cycle repeats in a run is known only if the move ended in it.
    """
    moving = runs["keeps_moving"].copy(data=attracts & decided).assign_attrs(criterion="a cycle attracts the stage")
    outcome = runs["outcome"].where(runs["keeps_moving"].copy(data=decided) | (runs["outcome"] == "invalid"), FAILED)
    count = runs["peaks"].where(moving & (runs["peaks"] > 0)).where(moving, 0.0)
    return runs.assign(keeps_moving=moving, count=count, outcome=outcome, lasts=moving).drop_vars(
        "size", errors="ignore"
    )


def by_way(evidence: Evidence, read: Callable[[xr.Dataset], xr.Dataset]) -> Evidence:
    """Return the evidence with its maps and responses read in one way."""
    responses = {name: Response(read(item.cell), item.trace) for name, item in evidence.responses.items()}
    return replace(evidence, maps={name: read(runs) for name, runs in evidence.maps.items()}, responses=responses)


READ: Mapping[str, Callable[[xr.Dataset], xr.Dataset]] = MappingProxyType(
    {COUNT: by_peak_count, SWING: by_swing_at_end}
)
"""The two ways that need no more than the runs themselves."""


def weakest(findings: Mapping[str, Finding]) -> Finding:
    """Return the finding that all ways allow, the thesis's first:
    a part holds where it does in each of them; where the ways differ, the numbers of all stand beside, of those in
    which it fails first."""
    first = next(iter(findings.values()))
    parts = []
    for number in range(len(first.parts)):
        parts.append(_together({name: finding.parts[number] for name, finding in findings.items()}))
    return Finding(tuple(parts), first.table)


def _together(parts: Mapping[str, Part]) -> Part:
    first = next(iter(parts.values()))
    failing = {name: part for name, part in parts.items() if not part.holds}
    if len(failing) in (0, len(parts)):
        return first
    ordered = {**failing, **parts}
    number = "; ".join(
        f"by {name} {'met' if part.holds else 'not met'}: {part.number}" for name, part in ordered.items()
    )
    agreeing = [name for name in parts if name not in failing]
    decides = f"It depends on how hunting is judged: met by {' and '.join(agreeing)}, not by {' or '.join(failing)}."
    why = next((part.why for part in failing.values() if part.why), decides)
    return replace(first, holds=False, number=number, why=why)
