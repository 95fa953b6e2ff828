"""Show the thesis's conclusions under other friction laws, as text, table and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.questions.convert.words import SHOWN
from friso.shown.drawing.prefixes import listed

if TYPE_CHECKING:
    from friso_thesis.studies.thesis.laws import ConclusionByLaw, ConclusionsByLaw

TITLE = "Conclusions of the thesis under each friction law"


def laws_sentences(laws: ConclusionsByLaw) -> list[str]:
    """Say how many conclusions survive other friction laws, and which do not.

    Laws under which nothing was judged are named, each with the measured friction that it does not match.
    """
    count, of_one = len(laws.conclusions), [conclusion.claim.id for conclusion in laws.dependent]
    others = ", ".join(laws.laws[1:])
    alike = f"{count - len(of_one)} of {count} conclusions have the same judgement"
    lines = [f"{alike} under every law that preserves what is measured ({others})."]
    if of_one:
        lines.append(f"These depend on the law: {listed(of_one, 'and')}.")
    lines += [f"{law} does not keep {listed([SHOWN[k] for k in lost], 'and')}." for law, lost in laws.left_out.items()]
    return lines


def laws_rows(laws: ConclusionsByLaw) -> list[tuple[str, list[str]]]:
    """Return the judgement of every claim under each law, as table rows."""
    return [(c.claim.id, [_judgement_by_law(c, law) for law in laws.laws]) for c in laws.conclusions]


def _judgement_by_law(conclusion: ConclusionByLaw, law: str) -> str:
    turned = conclusion.turned(law)
    return f"{conclusion.judgement(law)}: {'; '.join(turned)}" if turned else str(conclusion.judgement(law))


def laws_document(laws: ConclusionsByLaw) -> dict[str, Any]:
    """Return the judgements under each law for the JSON document."""
    return {
        "laws": list(laws.laws),
        "left_out": {law: [SHOWN[kind] for kind in lost] for law, lost in laws.left_out.items()},
        "conclusions": [
            {
                "id": conclusion.claim.id,
                "claim": conclusion.claim.text,
                "judgements": {law: conclusion.judgement(law) for law in laws.laws},
                "turned": {law: list(turned) for law in laws.laws if (turned := conclusion.turned(law))},
            }
            for conclusion in laws.conclusions
        ],
    }
