"""Judge the thesis's conclusions under each friction law.

Some survive other laws, and some hold for LuGre alone. The friction of the rig is converted to every other law
(`friso.studies.laws`), the maps are computed again, and the same judges apply the same criteria.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.progress import Progress, silent
from friso.stage import Stage
from friso.studies.laws import LawConversion, MeasuredKind, compared, kept_laws
from friso_thesis.studies.thesis.claims import (
    Claim,
    ClaimJudgement,
    Evidence,
    Finding,
    Response,
    by_peak_count,
    by_way,
    claims,
    registered,
)
from friso_thesis.studies.thesis.evidence import RESPONSES, maps_of, run_response
from friso_thesis.studies.thesis.linear import analysed
from friso_thesis.studies.thesis.reproduce import Reproduction
from friso_thesis.studies.thesis.studies import STUDIES, thesis_rig

if TYPE_CHECKING:
    import xarray as xr

CONCLUSIONS = ("E1", *(f"F{figure}{panel}" for figure in (11, 12, 13, 14, 15, 16) for panel in ("", "A", "B")))
"""Claims that are judged under each law, if they exist."""


@dataclass(frozen=True)
class ConclusionByLaw:
    """A claim, and its judgement under each law by name, the thesis's own law first."""

    claim: Claim
    findings: Mapping[str, Finding]

    def judgement(self, law: str) -> ClaimJudgement:
        """Return the judgement of the conclusion under a law."""
        return self.findings[law].judgement

    def turned(self, law: str) -> tuple[str, ...]:
        """Return the numbers, as texts, of the criteria that hold under just one of two laws.

        The laws are the given one and the thesis's own.
        """
        first = next(iter(self.findings.values()))
        pairs = zip(first.parts, self.findings[law].parts, strict=True)
        return tuple(other.number for own, other in pairs if own.holds != other.holds)


@dataclass(frozen=True)
class ConclusionsByLaw:
    """Conclusions under each law that can match measured friction, the thesis's own law first.

    `left_out` lists the other laws, each with the kinds of measured friction that it cannot match.
    """

    laws: tuple[str, ...]
    left_out: Mapping[str, tuple[MeasuredKind, ...]]
    conclusions: tuple[ConclusionByLaw, ...]

    @property
    def dependent(self) -> tuple[ConclusionByLaw, ...]:
        """Return the conclusions that do not survive every law."""
        return tuple(c for c in self.conclusions if any(c.turned(law) for law in self.laws[1:]))


def conclusions_by_law(reproduction: Reproduction, progress: Progress = silent) -> ConclusionsByLaw:
    """Judge the claims of a reproduction under each law, on its studies and its grid."""
    studies, rig = [STUDIES[name] for name in reproduction.judged], thesis_rig()
    own = rig.flat()["friction.model"]
    judged = {item.claim.id for item in reproduction.verdicts if item.finding}
    of_runs = {name: RESPONSES[name] for name in reproduction.responses}
    entries = {
        claim.id: entry
        for claim in claims()
        if claim.id in CONCLUSIONS and (entry := registered().get(claim.id)) and claim.id in judged
    }
    evidences = {own: _evidence(reproduction.judged, reproduction.responses, rig)}
    (_, *kept), left_out = kept_laws(rig)
    converted = [_apart(rig, conversion) for conversion in kept]
    for number, conversion in enumerate(converted):
        progress(number, len(converted), conversion.law)
        changes = {"friction": conversion.stage.as_written()["friction"]}
        maps = maps_of(studies, reproduction.judged_points, reproduction.rtol, changes=changes)
        responses = {name: run_response(of_run, changes, reproduction.rtol) for name, of_run in of_runs.items()}
        evidences[conversion.law] = _evidence(maps, responses, rig.replace(changes))
    progress(len(converted), len(converted), "laws")
    findings = {
        law: {name: entry.judge(evidence) for name, entry in entries.items()} for law, evidence in evidences.items()
    }
    return ConclusionsByLaw(
        tuple(evidences),
        left_out,
        tuple(
            ConclusionByLaw(claim, {law: by_claim[claim.id] for law, by_claim in findings.items()})
            for claim in claims()
            if claim.id in entries
        ),
    )


def _evidence(maps: Mapping[str, xr.Dataset], responses: Mapping[str, Response], stage: Stage) -> Evidence:
    return by_way(Evidence(maps, responses, analysed(stage), rig=stage), by_peak_count)


def _apart(rig: Stage, conversion: LawConversion) -> LawConversion:
    """Return the rig converted to a law, in the variant that differs most from the rig itself.

    `conversion` is the converted rig. If measurements hardly tell it from the rig, values that they leave open are
    moved to the upper end of what they allow.
    """
    same = all(change.off <= change.allowed / 10 for change in conversion.compared)
    if not same:
        return conversion
    far = {key: high for key, (_, high) in conversion.open.items()}
    return compared(rig, conversion.stage.with_numbers(far))
