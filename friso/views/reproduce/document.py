"""The JSON document of `friso reproduce`: the claims of the thesis with their judgements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.studies.thesis import CONVENTIONS, thesis_rig
from friso.version import VERSION
from friso.views.documents import plain_json

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction, Verdict


def claims_document(reproduction: Reproduction) -> dict[str, Any]:
    """All claims with their judgements, ready for JSON; how they were judged stands before them."""
    tolerances = sorted(reproduction.tolerances)
    verdicts, counts = reproduction.changed
    document = {
        "source": thesis_rig().source,
        "friso": VERSION,
        "points": reproduction.points,
        "rtol": reproduction.rtol,
        "conventions": CONVENTIONS,
        "figure_14b": {"rtol": tolerances, "verdicts_changed": verdicts, "counts_changed": counts}
        if tolerances
        else None,
        "cycles": {name: vars(cycles.comparison) for name, cycles in reproduction.cycles.items()},
        "claims": [_entry(verdict) for verdict in reproduction.verdicts],
    }
    return plain_json(document)


def _entry(verdict: Verdict) -> dict[str, Any]:
    return {
        "id": verdict.claim.id,
        "where": verdict.claim.where,
        "claim": verdict.claim.text,
        "judgement": verdict.judgement,
        "figure": verdict.figure or None,
        "number": numbers(verdict) or None,
        "criterion": "; ".join(part.criterion for part in verdict.finding.parts) if verdict.finding else None,
        "reason": verdict.reason or None,
        "values_varied": verdict.tried if verdict.finding else None,
        "depends_on": [
            {
                "kind": dependence.variant.kind,
                "parameter": dependence.variant.parameter,
                "value": dependence.variant.value,
                "judgement": dependence.judgement,
                "number": "; ".join(dependence.numbers),
            }
            for dependence in (*verdict.depends_on, *verdict.hangs_on)
        ],
    }


def numbers(verdict: Verdict) -> str:
    """The numbers of all parts in one line; empty for a claim that is not covered."""
    return "; ".join(part.number for part in verdict.finding.parts) if verdict.finding else ""
