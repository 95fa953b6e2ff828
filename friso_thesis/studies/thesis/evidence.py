"""Compute the evidence for judges: maps of studies, and runs of the changed rig."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from friso.engine.batch import simulate
from friso.equations.controllers.pid import ALPHA
from friso.studies.study import Request
from friso.studies.sweep import sweep
from friso_thesis.studies.thesis.claims import Evidence, Response
from friso_thesis.studies.thesis.experiments import Experiments
from friso_thesis.studies.thesis.judges.arguments import HEAVIEST, HEAVY, HIGH_ALPHA, LIGHT, LOW_ALPHA
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE
from friso_thesis.studies.thesis.kept import NOT_KEPT, Kept
from friso_thesis.studies.thesis.linear import NEEDS, analysed
from friso_thesis.studies.thesis.studies import LOCKED, NOTHING, STUDIES, ThesisStudy, masses, thesis_rig

if TYPE_CHECKING:
    import xarray as xr


RESPONSES: Mapping[str, Mapping[str, object]] = {
    "locked": LOCKED,
    WIDE: {**LOCKED, "friction.static": "4 N", "friction.coulomb": "0.5 N"},
    NARROW: {**LOCKED, "friction.static": "4 N", "friction.coulomb": "1.5 N"},
    LIGHT: {**LOCKED, **masses(1.7)},
    HEAVY: {**LOCKED, **masses(2.5)},
    LOW_ALPHA: {**LOCKED, ALPHA: 0.1},
    HIGH_ALPHA: {**LOCKED, ALPHA: 0.2},
    HEAVIEST: {**LOCKED, **masses(5.1)},
}
"""Changes of the rig for each run in time. They are those of Fig. 5 and 13, and some that change only the masses or
alpha, whatever values the rig has."""


def maps_of(
    studies: Iterable[ThesisStudy],
    points: int,
    rtol: float,
    changes: Mapping[str, object] = NOTHING,
) -> dict[str, xr.Dataset]:
    """Compute the maps of some studies by name, with `points` values per axis.

    `changes` are made to the rig first.
    """
    return {study.name: map_of(study, points, rtol, changes) for study in studies}


def map_of(
    study: ThesisStudy,
    points: int,
    rtol: float,
    changes: Mapping[str, object] = NOTHING,
    kept: Kept = NOT_KEPT,
) -> xr.Dataset:
    """Return the map of one study with `points` values per axis, as saved or computed now.

    `changes` are made to the rig first.
    """
    stage, axes, links = study.stage(changes), study.axes(points), dict(study.links)
    request = Request(stage, axes, None, links).study(None, rtol)
    return kept.runs(request, lambda: sweep(stage, axes, links=links, rtol=rtol))


def run_response(own_changes: Mapping[str, object], changes: Mapping[str, object], rtol: float) -> Response:
    """Run the rig once in time.

    The run's own changes, which distinguish it, come after the other changes of the rig.
    """
    stage = thesis_rig().replace(dict(changes)).replace(dict(own_changes))
    cell = sweep(stage, {"joint.locked": [stage.flat()["joint.locked"]]}, rtol=rtol).isel({"joint.locked": 0})
    return Response(cell, simulate(stage, rtol))


def evidence(
    needs: Iterable[str],
    points: int,
    rtol: float,
    changes: Mapping[str, object] = NOTHING,
    kept: Kept = NOT_KEPT,
) -> Evidence:
    """Compute all that is needed, for the rig with `changes`.

    Needs are names of maps, responses, and parts of the analysis. Experiments are run later, when they are requested.
    """
    wanted, rig = set(needs), thesis_rig().replace(dict(changes))
    return Evidence(
        {name: map_of(study, points, rtol, changes, kept) for name, study in STUDIES.items() if name in wanted},
        {name: run_response(own, changes, rtol) for name, own in RESPONSES.items() if name in wanted},
        analysed(rig) if wanted & NEEDS.keys() else None,
        Experiments(rig, kept),
        rig,
    )
