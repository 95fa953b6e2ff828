"""Build the JSON document of `friso reproduce`: the thesis's claims and judgements."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from friso.shown.documents import plain_json
from friso.shown.text import listed
from friso.version import VERSION
from friso_thesis.questions.reproduce.words import laws_document, numbers
from friso_thesis.studies.thesis.claims import COUNT, CYCLE, ClaimJudgement, Part
from friso_thesis.studies.thesis.reading import CONVENTIONS
from friso_thesis.studies.thesis.space import DRAW_SEED, OPEN, OpenValue
from friso_thesis.studies.thesis.studies import thesis_rig

if TYPE_CHECKING:
    from friso.intervals import Share
    from friso_thesis.studies.thesis.laws import ConclusionsByLaw
    from friso_thesis.studies.thesis.plausible import ClaimInSpace, Plausible
    from friso_thesis.studies.thesis.reproduce import Reproduction
    from friso_thesis.studies.thesis.verdicts import ClaimVerdict


def conclusion(reproduction: Reproduction) -> str:
    """Say how many claims of the thesis hold, or whether the only one that was asked for does."""
    counts = Counter(verdict.judgement for verdict in reproduction.verdicts)
    parts = [
        f"{counts[judgement]} {singular if counts[judgement] == 1 else plural}"
        for judgement, singular, plural in _VERBS
        if counts[judgement]
    ]
    if len(reproduction.verdicts) == 1:
        (only,) = reproduction.verdicts
        return f"Claim {only.claim.id} of the thesis {parts[0].removeprefix('1 ')}."
    return f"Of {len(reproduction.verdicts)} claims of the thesis {listed(parts, 'and')}."


_VERBS: tuple[tuple[ClaimJudgement, str, str], ...] = (
    ("holds", "holds", "hold"),
    ("depends", "depends on what the thesis leaves open", "depend on what the thesis leaves open"),
    ("holds in part", "holds in part", "hold in part"),
    ("differs", "does not hold", "do not hold"),
    ("not decided enough", "is not decided by enough draws", "are not decided by enough draws"),
    ("not decided yet", "is not decided yet", "are not decided yet"),
    ("cannot be decided", "cannot be decided", "cannot be decided"),
    ("not yet covered", "is not covered", "are not covered"),
)
"""Verbs for each judgement, of one claim and of several."""


def reproduce_document(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> dict[str, Any]:
    """Return all claims with their judgements, ready for JSON.

    A note before them says how they were judged. With `laws`, judgements under each friction law are added.
    """
    tolerances = sorted(reproduction.tolerances)
    verdicts, counts = reproduction.changed
    document = {
        "conclusion": conclusion(reproduction),
        "source": thesis_rig().source,
        "friso": VERSION,
        "points": reproduction.points,
        "points_judged": reproduction.judged_points,
        "rtol": reproduction.rtol,
        "conventions": CONVENTIONS,
        "figure_14b": {"rtol": tolerances, "verdicts_changed": verdicts, "counts_changed": counts}
        if tolerances
        else None,
        "cycles": {name: vars(cycles.comparison) for name, cycles in reproduction.cycles.items()},
        "ways": [COUNT, CYCLE],
        "unstated_values": [_open(value) for value in OPEN],
        "draws": [
            {"seed": [DRAW_SEED, draw.number], "values": dict(draw.values)} for draw in reproduction.plausible.draws
        ],
        "best_fit": _fit(reproduction.plausible),
        "claims": [_entry(verdict) for verdict in reproduction.verdicts],
        **({"friction_laws": laws_document(laws)} if laws else {}),
    }
    return plain_json(document)


def _entry(verdict: ClaimVerdict) -> dict[str, Any]:
    table = verdict.finding.table if verdict.finding else None
    return {
        "id": verdict.claim.id,
        "where": verdict.claim.where,
        "claim": verdict.claim.text,
        "quotes": verdict.claim.quotes,
        "judgement": verdict.judgement,
        "figure": verdict.figure or None,
        "number": numbers(verdict) or None,
        "criterion": "; ".join(part.criterion for part in verdict.finding.stated) if verdict.finding else None,
        "section": verdict.claim.section,
        "parts": [_part(part) for part in verdict.finding.stated] if verdict.finding else [],
        "table": {"columns": table.columns, "rows": table.rows} if table else None,
        "self_tests": [_part(part) for part in verdict.finding.parts if part.self_test] if verdict.finding else [],
        "ways": _ways(verdict),
        "attracts": [_part(part) for part in verdict.attracts.stated] if verdict.attracts else [],
        "reason": verdict.reason or None,
        "robust": verdict.robust,
        "hangs_on_undrawn": verdict.undrawn or None,
        "method": list(verdict.turned.values()),
        "read_otherwise": {name: finding.judgement for name, finding in verdict.reread.items()},
        "space": _space(verdict.space) if verdict.space else None,
    }


def _ways(verdict: ClaimVerdict) -> dict[str, ClaimJudgement]:
    """Return how a claim is judged, by the thesis's peak count and by what attracts the stages.

    The result is by the name of the criterion. A criterion is left out if it was not computed or does not matter.
    """
    findings = {COUNT: verdict.finding, CYCLE: verdict.attracts}
    return {way: finding.judgement for way, finding in findings.items() if finding}


def _part(part: Part) -> dict[str, Any]:
    return {
        "criterion": part.criterion,
        "holds": part.holds,
        "number": part.number,
        "why": part.why or None,
        "beyond": part.beyond or None,
        "undecided": part.undecided or None,
        "printed": part.printed,
        "read": part.read,
    }


def _space(space: ClaimInSpace) -> dict[str, Any]:
    """Return in how many draws of the open values a claim holds, and on which values it depends."""
    return {
        "draws": space.draws,
        "undecided": space.undecided,
        "decided": space.decided,
        "failures": {str(number): text for number, text in space.failures.items()},
        "holds": space.count,
        "share": _share(space.holds),
        "parts": [_share(part.share) for part in space.parts],
        "hangs_on": [vars(item) for item in space.hangs_on],
        "seeds": [list(seed) for seed in space.seeds],
    }


def _share(share: Share) -> dict[str, float]:
    return {"share": share.probability, "low": share.low, "high": share.high}


def _open(value: OpenValue) -> dict[str, Any]:
    keep = ("name", "low", "high", "unit", "scale", "baseline", "reason")
    return {name: getattr(value, name) for name in keep} | {"keys": sorted(value.keys)}


def _fit(plausible: Plausible) -> dict[str, Any] | None:
    fit = plausible.fit
    if fit is None:
        return None
    return {
        "draw": fit.draw.number,
        "values": dict(fit.draw.values),
        "misfit": fit.misfit,
        "misfit_at_baseline": fit.at_baseline,
        "numbers": [vars(item) for item in fit.numbers],
    }
