"""The thesis's conclusions and a design's edges under several friction laws: what of each counts."""

from friso_thesis.questions.reproduce.words import laws_document, laws_rows
from friso_thesis.studies.thesis.claims import Finding, Part, claims
from friso_thesis.studies.thesis.laws import ConclusionByLaw, ConclusionsByLaw

LAWS = ("lugre", "gms", "rolling")


def finding(*holds: bool) -> Finding:
    return Finding(tuple(Part("criterion", held, f"number {place}") for place, held in enumerate(holds)))


def by_law_of(*patterns: tuple[bool, ...]) -> dict[str, Finding]:
    return {law: finding(*pattern) for law, pattern in zip(LAWS, patterns, strict=True)}


def test_a_conclusion_survives_the_laws_under_which_the_same_parts_hold() -> None:
    first, second = (claim for claim in claims() if claim.id in ("F12A", "F12B"))
    conclusions = (
        ConclusionByLaw(first, by_law_of((True, True), (True, True), (True, True))),
        ConclusionByLaw(second, by_law_of((True, False), (False, True), (True, False))),
    )
    by_law = ConclusionsByLaw(LAWS, {"dahl": ("static",)}, conclusions)
    assert [conclusion.claim.id for conclusion in by_law.dependent] == ["F12B"]
    assert conclusions[1].turned("gms") == ("number 0", "number 1")
    document = laws_document(by_law)
    assert [row["turned"] for row in document["conclusions"]] == [{}, {"gms": ["number 0", "number 1"]}]
    assert len(laws_rows(by_law)) == 2
