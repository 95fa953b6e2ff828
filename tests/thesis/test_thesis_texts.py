"""The claims and quotations of the thesis, against its text where that is at hand."""

from pathlib import Path

import pytest

from friso_thesis.studies.thesis.claims import claims

ROOT = Path(__file__).parents[2]


def test_every_claim_is_in_the_table() -> None:
    source = ROOT.parent / "shared" / "claims.md"
    if not source.exists():
        pytest.skip("the list of claims is not at hand")
    rows = [line.strip().strip("|").split("|") for line in source.read_text(encoding="utf-8").splitlines()]
    printed = [[cell.strip() for cell in row] for row in rows if len(row) == 3][2:]
    listed = [claim for claim in claims() if claim.listed]
    assert [claim.id for claim in listed] == [row[0] for row in printed]
    own_words = {"E1", "F26"}  # of which the list says what to check, and the page what the thesis says
    for claim, (name, _, text) in zip(listed, printed, strict=True):
        assert (claim.text == text) == (name not in own_words)
    assert all(claim.where and claim.place for claim in claims())


def test_the_thesis_is_quoted_word_for_word() -> None:
    source = ROOT.parent / "shared" / "thesis.txt"
    if not source.exists():
        pytest.skip("the text of the thesis is not at hand")
    text = source.read_text(encoding="utf-8")
    for formula, plain in (("$", ""), (r"\mu\text{m}", "μm"), (r" \cdot ", "·"), ("^{-4}", "^-4"), (" ,", ",")):
        text = text.replace(formula, plain)
    text = " ".join(text.split())
    for claim in claims():
        assert claim.quotes
        for quote in claim.quotes:
            assert quote in text, claim.id
