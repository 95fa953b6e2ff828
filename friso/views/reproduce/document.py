"""The JSON document of `friso reproduce`: the claims of the thesis with their judgements."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from friso.studies.thesis import CONVENTIONS, thesis_rig
from friso.version import VERSION
from friso.views.documents import plain_json
from friso.views.drawing.prefixes import listed
from friso.views.reproduce.laws import laws_document

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction, Verdict
    from friso.studies.thesis.claims import Judgement
    from friso.studies.thesis.laws import ConclusionsByLaw


def conclusion(reproduction: Reproduction) -> str:
    """How many claims of the thesis hold."""
    counts = Counter(verdict.judgement for verdict in reproduction.verdicts)
    parts = [
        f"{counts[judgement]} {singular if counts[judgement] == 1 else plural}"
        for judgement, singular, plural in _VERBS
        if counts[judgement]
    ]
    return f"Of {len(reproduction.verdicts)} claims of the thesis {listed(parts, 'and')}."


_VERBS: tuple[tuple[Judgement, str, str], ...] = (
    ("holds", "holds", "hold"),
    ("holds in part", "holds in part", "hold in part"),
    ("differs", "does not hold", "do not hold"),
    ("not yet covered", "is not covered", "are not covered"),
)
"""The judgements as said of one claim, and of several."""


def reproduce_document(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> dict[str, Any]:
    """All claims with their judgements, ready for JSON; how they were judged stands before them. With those under each
    friction law, where they were asked."""
    tolerances = sorted(reproduction.tolerances)
    verdicts, counts = reproduction.changed
    document = {
        "conclusion": conclusion(reproduction),
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
        **({"friction_laws": laws_document(laws)} if laws else {}),
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
