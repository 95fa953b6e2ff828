"""Reproduce the thesis: run its studies, judge its claims, and find what they depend on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.errors import InputError
from friso.frequency.bode import Bode, bode
from friso.progress import Progress, Tally, silent
from friso.quantities import quoted
from friso_thesis.studies.thesis.claims import (
    Claim,
    Evidence,
    Finding,
    Registered,
    Response,
    by_peak_count,
    by_way,
    claims,
    registered,
)
from friso_thesis.studies.thesis.cycles import CyclesOnMap, Surveyed, map_cycles, survey
from friso_thesis.studies.thesis.evidence import RESPONSES, evidence, map_of
from friso_thesis.studies.thesis.experiments import EXPERIMENTS, Experiments
from friso_thesis.studies.thesis.kept import NOT_KEPT, Kept
from friso_thesis.studies.thesis.linear import NEEDS, Linear
from friso_thesis.studies.thesis.plausible import (
    DRAW_COUNT,
    EXPERIMENT_WORK,
    LINEAR_WORK,
    PARTS,
    Plausible,
    counted,
    plausible,
    work_of,
)
from friso_thesis.studies.thesis.reading import others_of, read_as, words_read
from friso_thesis.studies.thesis.studies import STUDIES, ThesisStudy, thesis_rig
from friso_thesis.studies.thesis.verdicts import ClaimVerdict, not_covered, verdict

if TYPE_CHECKING:
    import xarray as xr

MAP_POINTS, MOST_POINTS = 41, 1001
"""Default and largest number of values per axis. The default gives 0.4 Hz steps in Fig. 16, the largest a million cells
per map."""

JUDGED_POINTS = 21
"""Smallest number of values per axis of maps on which claims are judged. Coarser maps miss regions between two values,
and "few" or a trend has no meaning on a handful of cells."""

MOST_DRAWS = 10_000

THESIS_RTOL = 1e-4
"""The thesis's relative tolerance (Sec. 3.2.3)."""

TIGHT_RTOL = 1e-8
"""Second relative tolerance for Fig. 14B, besides the thesis's own."""

SHOWN_FREQUENCIES = (1e-2, 3e3)
"""Frequencies [Hz] of Fig. 7 and 8."""

LOCKED_SURVEY_WORK, FREE_SURVEY_WORK = 5000, 65_000
"""Progress steps, in units of a run's processor time, for the survey of a map with the joint locked and free."""


@dataclass(frozen=True)
class Reproduction:
    """All results of reproducing the thesis.

    - Maps by study name and responses by name, judged by the thesis's count. `judged` are the maps on which the claims
      were judged, which are finer if few values per axis were asked for.
    - The linear analysis of the rig, its curves over frequency in `bode`, and the experiments, each None if no claim of
      this run needs it. `experimented` names the experiments made.
    - The map of Fig. 14B by relative tolerance. The fractions of its cells with peaks at one tolerance only, and with a
      different peak count (NaN if not computed).
    - A verdict per claim, or per claim that was asked for, and the claims over the joint draws of the values that the
      thesis leaves open.
    - The hunting cycles behind each map, by study name.
    - Values per axis of the maps (`points`), and of those judged (`judged_points`).
    """

    maps: Mapping[str, xr.Dataset]
    judged: Mapping[str, xr.Dataset]
    responses: Mapping[str, Response]
    linear: Linear | None
    bode: Bode | None
    experiments: Experiments | None
    experimented: frozenset[str]
    tolerances: Mapping[float, xr.Dataset]
    changed: tuple[float, float]
    verdicts: tuple[ClaimVerdict, ...]
    plausible: Plausible
    cycles: Mapping[str, CyclesOnMap]
    points: int
    judged_points: int
    rtol: float


def reproduce(
    names: Iterable[str] | None = None,
    points: int = MAP_POINTS,
    rtol: float = 1e-6,
    progress: Progress = silent,
    with_cycles: bool = True,
    draws: int = DRAW_COUNT,
    only: Iterable[str] | None = None,
    kept: Kept = NOT_KEPT,
) -> Reproduction:
    """Run the studies `names` (default: all of Table 3), and judge the claims.

    Maps have `points` values per axis, and for judging at least `JUDGED_POINTS`. With `only`, just these claims are
    judged, with what they need, and the result has no others. `with_cycles` also computes the hunting
    cycles behind every map, and adds to each judgement what attracts the stages. With `draws`, every claim is judged in
    up to as many joint draws of the values that the thesis leaves open. What is `kept` of an earlier run is not
    computed again. `progress` is called with steps done, steps in all and what comes next. Raises InputError for an
    unknown study or claim and for numbers that are too low or too high, ValueError for an unusable rtol.
    """
    chosen, asked = _studies(names), _claims(only)
    _check("points", points, 3, MOST_POINTS, "41")
    _check("draws", draws, 0, MOST_DRAWS, str(DRAW_COUNT))
    entries = {
        name: entry
        for name, entry in registered().items()
        if (asked is None or name in asked) and not {n for n in entry.needs if n in STUDIES} - chosen.keys()
    }
    needs = _needs(entries, chosen, asked)
    studies = {name: study for name, study in chosen.items() if name in needs}
    parts = sorted(needs & PARTS.keys())
    judged_points = max(points, JUDGED_POINTS)
    half = -(-judged_points // 2)
    total = len(studies) * (judged_points**2 + half**2) + sum(map(_part_work, parts)) + work_of(entries, draws)
    surveyed_studies = _surveyed_studies(entries, studies, asked) if with_cycles else []
    total += sum(map(_survey_work, surveyed_studies)) + 2 * points**2 * ("isolator-damping" in studies)
    tally = Tally(progress, total)
    tally.add(0, "responses")
    base = evidence(needs - STUDIES.keys(), judged_points, rtol, kept=kept)
    maps: dict[str, xr.Dataset] = {}
    loose: dict[str, xr.Dataset] = {}
    for name, study in studies.items():
        maps[name] = map_of(study, judged_points, rtol, kept=kept)
        tally.add(judged_points**2, f"map {study.panel}")
        loose[name] = map_of(study, half, THESIS_RTOL, kept=kept)
        tally.add(half**2, f"map {study.panel} at the thesis's tolerance")
    base = replace(base, maps=maps)
    tolerances = _tolerances(studies, points, kept, tally)
    for part in parts:
        if part in EXPERIMENTS:
            getattr(base.experiments, part)
        tally.add(_part_work(part), part.replace("_", " "))

    def behind(study: ThesisStudy) -> tuple[Surveyed, CyclesOnMap]:
        surveyed = survey(maps[study.name], kept)
        tally.add(_survey_work(study) // 2, f"what attracts, map {study.panel}")
        cycles = map_cycles(study, maps[study.name], surveyed, kept)
        tally.add(_survey_work(study) // 2, f"edges of hunting, map {study.panel}")
        return surveyed, cycles

    studied = side_by_side([partial(behind, study) for study in surveyed_studies])
    surveyed = {study.name: of_map for study, (of_map, _) in zip(surveyed_studies, studied, strict=True)}
    cycles = {study.name: of_map for study, (_, of_map) in zip(surveyed_studies, studied, strict=True)}
    by_count, readings, attracting = {}, {}, {}
    for name, entry in entries.items():
        with words_read() as words:
            by_count[name] = counted(entry, base)
        readings[name] = _read_otherwise(entry, base, words)
        if (attracts := _by_attraction(entry, base, surveyed, cycles)) is not None:
            attracting[name] = attracts
    space = plausible(entries, by_count, draws, kept, tally)
    others = _others(entries, base, loose)
    verdicts = tuple(
        verdict(
            claim,
            entries[claim.id].figure,
            by_count[claim.id],
            attracting.get(claim.id),
            space.claims.get(claim.id),
            {name: by_claim[claim.id] for name, by_claim in others.items() if claim.id in by_claim},
            entries[claim.id].undrawn,
            readings[claim.id],
        )
        if claim.id in entries
        else _left_out(claim, chosen)
        for claim in claims()
        if asked is None or claim.id in asked
    )
    curves = bode(thesis_rig(), SHOWN_FREQUENCIES, series=True) if base.linear is not None else None
    judged = by_way(base, by_peak_count)
    shown = judged.maps
    if points < judged_points:
        shown = {name: by_peak_count(map_of(study, points, rtol)) for name, study in studies.items()}
    return Reproduction(
        shown, judged.maps, judged.responses, base.linear, curves, base.identified if parts else None,
        frozenset(parts) & EXPERIMENTS.keys(), tolerances,
        _changed(tolerances), verdicts, space, cycles, points, judged_points, rtol,
    )  # fmt: skip


def _part_work(part: str) -> int:
    """Return the progress steps that a part of the linear analysis, or an experiment, takes."""
    return dict(EXPERIMENT_WORK).get(part, LINEAR_WORK)


def _surveyed_studies(
    entries: Mapping[str, Registered], studies: Mapping[str, ThesisStudy], asked: frozenset[str] | None
) -> list[ThesisStudy]:
    """Return the studies behind whose maps cycles are looked for: all, or those of claims `asked` for by name.

    Claims about runs alone need none.
    """
    needs = {need for entry in entries.values() if not entry.of_runs for need in entry.needs}
    return [study for name, study in studies.items() if asked is None or name in needs]


def _survey_work(study: ThesisStudy) -> int:
    """Return the progress steps that the survey of a map takes."""
    return LOCKED_SURVEY_WORK if study.changes.get("joint.locked") else FREE_SURVEY_WORK


def _left_out(claim: Claim, chosen: Mapping[str, ThesisStudy]) -> ClaimVerdict:
    """Return the verdict "not covered" on a claim that is not judged here, with the reason."""
    entry = registered().get(claim.id)
    if entry is None:
        return not_covered(claim, "no judge decides on it")
    missing = sorted({need for need in entry.needs if need in STUDIES} - chosen.keys())
    return not_covered(claim, f"not computed in this run: {', '.join(missing)}")


def _by_attraction(
    entry: Registered, base: Evidence, surveyed: Mapping[str, Surveyed], cycles: Mapping[str, CyclesOnMap]
) -> Finding | None:
    """Judge a claim by what attracts the stages of its maps, instead of by counted peaks.

    Returns None for a claim without maps, for a claim about runs alone, and if a map was not surveyed. Returns None as
    well if all its maps vary only the motion, on which attractors do not depend.
    """
    maps = entry.needs & STUDIES.keys()
    if entry.of_runs or not maps or not maps <= surveyed.keys() or all(STUDIES[name].of_motion for name in maps):
        return None
    lasting = by_way(replace(base, maps={}), by_peak_count)
    attracted = {name: surveyed[name].attracted(cycles[name].edges) for name in maps}
    return entry.judge(replace(lasting, maps=attracted))


def _read_otherwise(entry: Registered, base: Evidence, words: Set[str]) -> dict[str, Finding]:
    """Return the findings by other meanings of the thesis's `words`, such as “about”.

    Only words by which the claim is judged are read otherwise. The result is by the change of meaning.
    """
    findings = {}
    for name, other in others_of(words).items():
        with read_as(other):
            findings[name] = counted(entry, base)
    return findings


def _others(
    entries: Mapping[str, Registered], base: Evidence, loose: Mapping[str, xr.Dataset]
) -> dict[str, dict[str, Finding]]:
    """Return the findings on other maps, by the method that made the maps and by claim.

    The maps are coarser ones, with every second value of each axis, and the maps `loose`, at the thesis's tolerance.
    Claims without maps are left out.
    """
    grids = {
        "every second value of each axis": {name: _second(runs) for name, runs in base.maps.items()},
        f"the thesis's relative tolerance, {THESIS_RTOL:g},": dict(loose),
    }
    return {
        method: {
            name: counted(entry, replace(base, maps=maps))
            for name, entry in entries.items()
            if entry.needs & STUDIES.keys()
        }
        for method, maps in grids.items()
    }


def _second(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs at every second value of each axis; an axis of fewer than five keeps all."""
    return runs.isel(dict.fromkeys(runs.dims, slice(None, None, 2))) if min(runs.sizes.values()) >= 5 else runs


def _needs(
    entries: Mapping[str, Registered], chosen: Mapping[str, ThesisStudy], asked: frozenset[str] | None
) -> set[str]:
    """Return the names of all that must be computed for the claims.

    If no claims were `asked` for by name, the `chosen` studies are added, and all responses and parts of the analysis.
    """
    needs = {need for entry in entries.values() for need in entry.needs}
    return needs if asked is not None else needs | chosen.keys() | RESPONSES.keys() | NEEDS.keys()


def _tolerances(studies: Mapping[str, ThesisStudy], points: int, kept: Kept, tally: Tally) -> dict[float, xr.Dataset]:
    """Return the map of Fig. 14B at the thesis's tolerance and at a tight one, by tolerance."""
    maps = {}
    for study in studies.values():
        for tolerance in (THESIS_RTOL, TIGHT_RTOL) if study.panel == "14B" else ():
            maps[tolerance] = by_peak_count(map_of(study, points, tolerance, kept=kept))
            tally.add(points**2, f"map 14B at {tolerance:g}")
    return maps


def _studies(names: Iterable[str] | None) -> dict[str, ThesisStudy]:
    if names is None:
        return dict(STUDIES)
    chosen = list(names)
    for name in chosen:
        if name not in STUDIES:
            raise InputError("study", quoted(name), f"one of {', '.join(STUDIES)}", "path")
    return {name: study for name, study in STUDIES.items() if name in chosen}


def _claims(only: Iterable[str] | None) -> frozenset[str] | None:
    """Return the names of the claims requested, in their usual spelling; None if all are.

    Raises InputError for an unknown claim.
    """
    if only is None:
        return None
    ids = {claim.id.upper(): claim.id for claim in claims()}
    chosen = set()
    for name in only:
        if name.upper() not in ids:
            raise InputError("only", quoted(name), f"a claim, one of {', '.join(ids.values())}", "only=F15B")
        chosen.add(ids[name.upper()])
    return frozenset(chosen)


def _check(name: str, value: int, least: int, most: int, example: str) -> None:
    if not least <= value <= most:
        raise InputError(name, str(value), f"from {least} to {most}", f"{name}={example}")


def _changed(tolerances: Mapping[float, xr.Dataset]) -> tuple[float, float]:
    """Return how many cells change between two tolerances, as fractions.

    The first counts cells with peaks at one tolerance only, the second cells whose peak count differs. Counts unknown
    at both tolerances do not differ.
    """
    if not tolerances:
        return np.nan, np.nan
    loose, tight = tolerances.values()
    first, second = loose["count"].values, tight["count"].values
    other_count = (first != second) & ~(np.isnan(first) & np.isnan(second))
    return float((loose["keeps_moving"] != tight["keeps_moving"]).mean()), float(other_count.mean())
