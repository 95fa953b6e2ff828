"""Write the page of `friso reproduce`, and its files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from typing import TYPE_CHECKING

from markupsafe import Markup

from friso.shown.blocks import Content, pictures
from friso.shown.drawing import plotly_renderer
from friso.shown.drawing.figure import BLUE, GREEN, GREY, MAUVE, ORANGE, PINK, SKY, VERMILLION, Figure
from friso.shown.pages import Report, print_image
from friso.version import VERSION
from friso_thesis.questions.reproduce import words
from friso_thesis.questions.reproduce.document import conclusion, reproduce_document
from friso_thesis.questions.reproduce.figures import reproduction_figures
from friso_thesis.questions.reproduce.questions import method_rows, question_rows
from friso_thesis.questions.reproduce.summary import save_summary
from friso_thesis.questions.reproduce.words import laws_rows, laws_sentences
from friso_thesis.studies.thesis.reading import CONVENTIONS
from friso_thesis.studies.thesis.studies import STUDIES, thesis_rig

if TYPE_CHECKING:
    from friso_thesis.studies.thesis.laws import ConclusionsByLaw
    from friso_thesis.studies.thesis.reproduce import Reproduction
    from friso_thesis.studies.thesis.verdicts import ClaimVerdict

COLOURS = {
    "holds": GREEN,
    "depends": BLUE,
    "holds in part": ORANGE,
    "differs": VERMILLION,
    "not decided enough": SKY,
    "not decided yet": MAUVE,
    "cannot be decided": PINK,
    "not yet covered": GREY,
}


FAILS_FIRST = ("differs", "holds in part", "depends", *[*COLOURS][4:-1], "holds")
"""Judgements in the order of the claims as text."""


@dataclass(frozen=True)
class FigureSection:
    """A figure or table of the thesis, with the verdicts on its claims.

    `figure` is None if the evidence is not a drawing.
    """

    key: str
    title: str
    figure: Figure | None
    verdicts: tuple[ClaimVerdict, ...]


def reproduce_files(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> dict[str, Content]:
    """Return the page, a one-sheet summary, the claims, and every figure.

    Figures are PNG and SVG files in a folder of their own.
    """
    text = json.dumps(reproduce_document(reproduction, laws), indent=2, ensure_ascii=False, allow_nan=False)
    figures = pictures(reproduction_figures(reproduction).values(), ("png", "svg"))
    return {
        "reproduction.html": reproduce_html(reproduction, laws),
        "claims.md": claims_markdown(reproduction),
        "summary.pdf": partial(save_summary, reproduction.verdicts, conclusion(reproduction), COLOURS),
        "claims.json": text + "\n",
        **{f"figures/{name}": content for name, content in figures.items()},
    }


def reproduce_html(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> str:
    """Return the whole page: all claims at a glance, then item by item in the thesis's order.

    It opens offline.
    """
    verdicts = words.in_order(reproduction.verdicts)
    by_claim = {verdict.claim.id: verdict for verdict in verdicts}
    numbered = reproduction_figures(reproduction)
    parts = sections(numbered, verdicts)
    figures = [section.figure for section in parts if section.figure]
    keys = {section.figure.name: section.key for section in parts if section.figure}
    return Report(
        "reproduce",
        "Reproduction of the thesis",
        stage_file=thesis_rig().to_toml(),
        source=thesis_rig().source,
        scripted=bool(figures),
        templates="friso_thesis.shown",
        values={
            "verdicts": verdicts,
            "right": words.right(verdicts),
            "as_far": words.as_far,
            "more_right": words.more_right(verdicts),
            "other_reason": words.remarks(words.OTHER_REASON, by_claim),
            "slips": words.remarks(words.SLIPS, by_claim),
            "counts": _counts(verdicts),
            "colours": COLOURS,
            "words": words,
            "places": {verdict.claim.id: s.key for s in parts for verdict in s.verdicts},
            "sections": parts,
            "figure_links": [(number, keys[figure.name]) for number, figure in numbered.items()],
            "images": {figure.name: print_image(figure) for figure in figures},
            "interactive": {
                figure.name: Markup(plotly_renderer.fragment(replace(figure, note=""))) for figure in figures
            },
            "conventions": CONVENTIONS,
            "law_names": laws.laws if laws else (),
            "law_rows": laws_rows(laws) if laws else [],
            "law_sentences": laws_sentences(laws) if laws else [],
            "cycles": [(STUDIES[name], edges.comparison) for name, edges in reproduction.cycles.items()],
            "self_tests": words.self_tests(verdicts),
            "open_rows": words.open_rows(),
            "fit_sentence": words.fit_sentence(reproduction.plausible),
            "fit_rows": words.fit_rows(reproduction.plausible),
            "questions": question_rows(),
            "method_rows": method_rows(reproduction),
            "draws": len(reproduction.plausible.draws),
            "points": reproduction.points,
            "judged_points": reproduction.judged_points,
            "rtol": f"{reproduction.rtol:g}",
        },
    ).html()


def claims_markdown(reproduction: Reproduction) -> str:
    """Return all claims with their reasons as a Markdown page, as the documentation has that of a whole run."""
    verdicts = words.in_order(reproduction.verdicts)
    heads = ("Claim", "Where", "What the thesis claims, in short", "By its count", "By what attracts", "Holds in draws")
    rows = [heads, ("---",) * len(heads)]
    rows += [
        (
            item.claim.id,
            item.claim.where,
            item.claim.text,
            words.AGREEMENT[item.judgement],
            words.attracts(item),
            words.share(item) + (f": {item.depends_on}" if item.depends_on else ""),
        )
        for item in verdicts
    ]
    today = date.today()
    how = (
        f"Computed by `friso reproduce` (friso {VERSION}) on {today.day} {today:%B %Y}: {reproduction.judged_points} "
        f"values per axis, up to {len(reproduction.plausible.draws)} joint draws of what the thesis leaves open. The "
        "figures, the quotes and the criteria are on the page that it writes besides. Below the table stand numbers "
        "and reasons: what fails first."
    )
    table = "\n".join("| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows)
    parts = ["# The thesis, claim by claim", conclusion(reproduction), how, table]
    for judgement in FAILS_FIRST:
        those = [item for item in verdicts if item.finding and item.judgement == judgement]
        if those:
            parts += [f"## {words.AGREEMENT[judgement].capitalize()}", "\n".join(map(_reasoned, those))]
    return "\n\n".join(parts) + "\n"


def _reasoned(verdict: ClaimVerdict) -> str:
    """Return the numbers and reasons of a judgement as an item of a list: what is met in short, the rest whole."""
    numbers: dict[str, list[str]] = {}
    for part in verdict.finding.stated if verdict.finding else ():
        met = words.criterion_word(part) == "agrees"
        numbers.setdefault(words.criterion_word(part), []).append(words.short(part.number) if met else part.number)
    texts = [f"{word}: {'; '.join(of_word).rstrip('.')}." for word, of_word in numbers.items()]
    reason = words.whole_reasons(verdict)
    return " ".join([f"- **{verdict.claim.id}**", *texts, *([f"Why: {reason}"] if reason else []), *verdict.besides])


def sections(figures: Mapping[str, Figure], verdicts: Iterable[ClaimVerdict]) -> tuple[FigureSection, ...]:
    """Return figures, tables and sections of the thesis with their claims, in its order.

    Each figure stands with its first claim, and figures without a claim at the end. A panel's claims, such as those of
    "11A", stand with their figure. Claims that are not covered stand only in the table.
    """
    groups: dict[str, list[ClaimVerdict]] = {}
    for verdict in verdicts:
        if verdict.finding:
            groups.setdefault(verdict.figure.rstrip("ABCD"), []).append(verdict)
    groups |= {number: [] for number in figures if number not in groups}
    return tuple(
        FigureSection(
            f"section-{place}",
            figures[number].title if number in figures else _titled(number, group),
            figures.get(number),
            tuple(group),
        )
        for place, (number, group) in enumerate(groups.items())
    )


def _titled(place: str, group: Iterable[ClaimVerdict]) -> str:
    """Name the place in the thesis where an item's claims stand, such as Figure 12 or Sec. 3.2."""
    if place.isdigit():
        return f"Figure {place}"
    return place if place.startswith("Sec. ") else ", ".join(dict.fromkeys(item.claim.where for item in group))


def _counts(verdicts: Iterable[ClaimVerdict]) -> dict[str, int]:
    """Return how many claims got each judgement, for judgements that occur."""
    parts = [verdict.judgement for verdict in verdicts]
    return {judgement: parts.count(judgement) for judgement in COLOURS if judgement in parts}
