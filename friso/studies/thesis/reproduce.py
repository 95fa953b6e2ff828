"""The reproduction of the thesis: every study and response, every claim judged, and what each judgement hangs on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from friso.engine.simulate import simulate
from friso.errors import InputError
from friso.frequency.bode import Bode, bode
from friso.hunting.criteria.peak_count import DISTINCT_CRITERION
from friso.hunting.criteria.run_outcome import CREEPS, CRITERION, RESTS, SWINGS
from friso.progress import Progress, Tally, silent
from friso.studies.sweep import sweep
from friso.studies.thesis.claims import Claim, Evidence, Finding, Registered, Response, claims, registered
from friso.studies.thesis.cycles import CyclesOnMap, map_cycles
from friso.studies.thesis.experiments import EXPERIMENTS, experiment, experiments_on
from friso.studies.thesis.judges.shares import NARROW, WIDE
from friso.studies.thesis.linear import NEEDS, Linear, analysed
from friso.studies.thesis.open_parameters import METHOD, OPEN, RTOL, Variant
from friso.studies.thesis.studies import LOCKED, NOTHING, STUDIES, ThesisStudy, thesis_rig
from friso.studies.thesis.verdicts import Verdict, not_covered, verdict

if TYPE_CHECKING:
    import xarray as xr

POINTS = 41
"""Values per axis: 0.4 Hz apart in Fig. 16."""

VERIFIED = 0.05
"""Share of the cells of a shown map that are run again at a tighter tolerance."""

TIGHT = 1e-8
"""Second relative tolerance for Fig. 14B, besides the thesis's own."""

RESPONSES: Mapping[str, Mapping[str, object]] = {
    "locked": LOCKED,
    WIDE: {**LOCKED, "friction.static": "4 N", "friction.coulomb": "0.5 N"},
    NARROW: {**LOCKED, "friction.static": "4 N", "friction.coulomb": "1.5 N"},
}
"""The runs shown in time, Fig. 5 and 13: what each changes in the rig."""

SHOWN = (1e-2, 3e3)
"""Frequencies [Hz] of Fig. 7 and 8."""

_PARTS = {**NEEDS, **EXPERIMENTS}
"""What every evidence has besides maps and responses."""


@dataclass(frozen=True)
class Reproduction:
    """All results.

    Maps by study name and responses by name; the linear analysis of the rig, and in `bode` its curves over the
    frequency; the map of Fig. 14B by relative tolerance and the shares of its cells in which peaks are counted at one
    of them only, and whose peak count differs between them (NaN if not computed); a verdict per claim; the hunting
    cycles behind each map by study name; values per axis of the maps (`points`), which are those of every variant too.
    """

    maps: Mapping[str, xr.Dataset]
    responses: Mapping[str, Response]
    linear: Linear
    bode: Bode
    tolerances: Mapping[float, xr.Dataset]
    changed: tuple[float, float]
    verdicts: tuple[Verdict, ...]
    cycles: Mapping[str, CyclesOnMap]
    points: int
    rtol: float


def reproduce(
    names: Iterable[str] | None = None,
    points: int = POINTS,
    rtol: float = 1e-6,
    progress: Progress = silent,
    with_cycles: bool = True,
) -> Reproduction:
    """Run the studies `names` (default: all of Table 3), `points` values per axis, and judge the claims.

    A claim that needs a study left out is "not yet covered". `with_cycles` the hunting cycles behind every map are
    computed too, which takes several times as long as all the maps. `progress` is called with steps done, steps in all
    and what comes next. Raises InputError for an unknown study or too few points, ValueError for an unusable rtol.
    """
    studies = _chosen(names)
    if points < 3:
        raise InputError("points", str(points), "3 or more values per axis", "41")
    variants = (*OPEN, *METHOD)
    tally = Tally(progress, 2 + len(variants) + (len(studies) if with_cycles else 0))
    tally.add(0, "maps")
    responses = {name: run_response(changes, NOTHING, rtol) for name, changes in RESPONSES.items()}
    maps = maps_of(studies, points, rtol, VERIFIED)
    baseline = Evidence(maps, responses, analysed(thesis_rig()), experiments_on(thesis_rig()))
    tally.add(1, "Fig. 14B at two tolerances")
    tolerances = {
        tolerance: _map(s, NOTHING, points, tolerance)
        for s in studies
        if s.panel == "14B"
        for tolerance in (RTOL, TIGHT)
    }
    entries = {claim: entry for claim, entry in registered().items() if not _missing(entry, baseline)}
    varied: list[tuple[Variant, Mapping[str, Finding]]] = []
    for variant in variants:
        tally.add(1, f"{variant.parameter} {variant.value}")
        varied.append((variant, _findings(entries, _with_variant(studies, points, rtol, variant, baseline))))
    behind: dict[str, CyclesOnMap] = {}
    for study in studies if with_cycles else ():
        tally.add(1, f"hunting cycles, {study.name}")
        behind[study.name] = map_cycles(study, baseline.maps[study.name])
    tally.add(1, "done")
    verdicts, curves = _verdicts(entries, baseline, varied), bode(thesis_rig(), SHOWN, series=True)
    results = (baseline.maps, baseline.responses, baseline.analysis, curves)
    return Reproduction(*results, tolerances, _changed(tolerances), verdicts, behind, points, rtol)


def _verdicts(
    entries: Mapping[str, Registered], baseline: Evidence, varied: Sequence[tuple[Variant, Mapping[str, Finding]]]
) -> tuple[Verdict, ...]:
    fine, coarse = _findings(entries, baseline), _findings(entries, _coarser(baseline))
    return tuple(_judge(claim, baseline, fine, coarse, varied) for claim in claims())


def _chosen(names: Iterable[str] | None) -> tuple[ThesisStudy, ...]:
    if names is None:
        return tuple(STUDIES.values())
    chosen = list(names)
    for name in chosen:
        if name not in STUDIES:
            raise InputError("study", repr(name), f"one of {', '.join(STUDIES)}", "path")
    return tuple(study for name, study in STUDIES.items() if name in chosen)


def _coarser(evidence: Evidence) -> Evidence:
    """The evidence with every second value of each axis of the maps, which shows what hangs on the grid; maps of less
    than five values stay."""
    second = slice(None, None, 2)
    maps = {
        name: runs.isel(dict.fromkeys(runs.dims, second)) if min(runs.sizes.values()) >= 5 else runs
        for name, runs in evidence.maps.items()
    }
    return replace(evidence, maps=maps)


def _missing(entry: Registered, evidence: Evidence) -> list[str]:
    return sorted(entry.needs - evidence.maps.keys() - evidence.responses.keys() - _PARTS.keys())


def _findings(entries: Mapping[str, Registered], evidence: Evidence) -> dict[str, Finding]:
    return {claim: entry.judge(evidence) for claim, entry in entries.items()}


def _with_variant(
    studies: Iterable[ThesisStudy], points: int, rtol: float, variant: Variant, plain: Evidence
) -> Evidence:
    """The evidence with one variant; what it does not touch is the baseline's."""
    tolerance = variant.rtol or rtol
    touched = [study for study in studies if variant.touches(study)]
    maps = {**plain.maps, **maps_of(touched, points, tolerance, changes=variant.changes)}
    responses = {name: run_response(changes, variant.changes, tolerance) for name, changes in RESPONSES.items()}
    if variant.kind == "metric":
        maps = {name: lasting(runs) for name, runs in maps.items()}
        responses = {name: Response(lasting(response.cell), response.trace) for name, response in responses.items()}
    stage, linear = thesis_rig().replace(dict(variant.changes)), plain.linear
    if any(variant.touches_part(need) for need in NEEDS.values()):
        linear = analysed(stage)
    other = {name: experiment(name, stage) for name, need in EXPERIMENTS.items() if variant.touches_part(need)}
    return Evidence(maps, responses, linear, replace(plain.experiments, **other))


def maps_of(
    studies: Iterable[ThesisStudy],
    points: int,
    rtol: float,
    verify: float = 0.0,
    changes: Mapping[str, object] = NOTHING,
) -> dict[str, xr.Dataset]:
    """The maps of some studies by name, `points` values per axis, `changes` being made to the rig before."""
    return {study.name: _map(study, changes, points, rtol, verify) for study in studies}


def _map(
    study: ThesisStudy, changes: Mapping[str, object], points: int, rtol: float, verify: float = 0.0
) -> xr.Dataset:
    runs = sweep(study.stage(changes), study.axes(points), links=dict(study.links), rtol=rtol, verify=verify)
    return by_peak_count(runs)


def run_response(own_changes: Mapping[str, object], changes: Mapping[str, object], rtol: float) -> Response:
    """One run in time; a variant's changes come before the run's own, which distinguish it from the others."""
    stage = thesis_rig().replace(dict(changes)).replace(dict(own_changes))
    cell = sweep(stage, {"joint.locked": [stage.flat()["joint.locked"]]}, rtol=rtol).isel({"joint.locked": 0})
    return Response(by_peak_count(cell), simulate(stage, rtol))


def by_peak_count(runs: xr.Dataset) -> xr.Dataset:
    """The runs with `keeps_moving` by the thesis's metric: whether distinct peaks are counted."""
    return runs.assign(keeps_moving=(runs["distinct_peaks"] > 0).assign_attrs(criterion=DISTINCT_CRITERION))


def lasting(runs: xr.Dataset) -> xr.Dataset:
    """The same by the end of the run: whether it swings there; the peaks of others do not count, but for invalid and
    failed cells."""
    swings = (runs["outcome"] == SWINGS).assign_attrs(criterion=CRITERION)
    ended = runs["outcome"].isin([SWINGS, CREEPS, RESTS])
    return runs.assign(keeps_moving=swings, distinct_peaks=runs["distinct_peaks"].where(swings | ~ended, 0.0))


def _changed(tolerances: Mapping[float, xr.Dataset]) -> tuple[float, float]:
    """Shares of cells in which peaks are counted at one of the two tolerances only, and whose peak count differs; a
    count that is unknown in both does not differ."""
    if not tolerances:
        return np.nan, np.nan
    loose, tight = tolerances.values()
    first, second = loose["distinct_peaks"].values, tight["distinct_peaks"].values
    other_count = (first != second) & ~(np.isnan(first) & np.isnan(second))
    return float((loose["keeps_moving"] != tight["keeps_moving"]).mean()), float(other_count.mean())


def _judge(
    claim: Claim,
    baseline: Evidence,
    fine: Mapping[str, Finding],
    coarse: Mapping[str, Finding],
    varied: Iterable[tuple[Variant, Mapping[str, Finding]]],
) -> Verdict:
    entry = registered().get(claim.id)
    if entry is None:
        return not_covered(claim, "work of a later step")
    missing = _missing(entry, baseline)
    if missing:
        return not_covered(claim, f"not computed in this run: {', '.join(missing)}")
    findings = [(variant, other[claim.id]) for variant, other in varied if _enters(variant, entry.needs)]
    return verdict(claim, entry.figure, fine[claim.id], coarse[claim.id], findings)


def _enters(variant: Variant, needs: Iterable[str]) -> bool:
    """Whether a variant changes anything of what is named."""
    return any(_changes(variant, name) for name in needs)


def _changes(variant: Variant, name: str) -> bool:
    """Whether a variant changes the map, the part of the linear analysis, the experiment or the response named."""
    if name in STUDIES:
        return variant.touches(STUDIES[name])
    if need := _PARTS.get(name):
        return variant.touches_part(need)
    response = RESPONSES[name]
    return variant.changes_more_than(response.keys(), bool(response.get("joint.locked")))
