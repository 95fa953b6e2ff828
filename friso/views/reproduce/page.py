"""The page of `friso reproduce`, and its files."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from markupsafe import Markup

from friso.studies.thesis import CONVENTIONS, STUDIES, thesis_rig
from friso.views.drawing import matplotlib_renderer, plotly_renderer
from friso.views.drawing.figure import GREEN, GREY, ORANGE, VERMILLION, Figure
from friso.views.files import Content, pictures
from friso.views.pages import Report, print_image
from friso.views.reproduce.document import numbers, reproduce_document
from friso.views.reproduce.figures import reproduction_figures
from friso.views.reproduce.laws import laws_rows, laws_sentences

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction, Verdict
    from friso.studies.thesis.laws import ConclusionsByLaw

_COLOURS = {"holds": GREEN, "holds in part": ORANGE, "differs": VERMILLION, "not yet covered": GREY}


@dataclass(frozen=True)
class FigureSection:
    """One figure of the thesis with the verdicts on the claims that it bears out; `figure` is None where the evidence
    is no drawing."""

    key: str
    title: str
    figure: Figure | None
    verdicts: tuple[Verdict, ...]


def reproduce_files(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> dict[str, Content]:
    """The page, the claims, and every figure as PNG and SVG in a folder of its own."""
    text = json.dumps(reproduce_document(reproduction, laws), indent=2, ensure_ascii=False, allow_nan=False)
    figures = pictures(reproduction_figures(reproduction).values(), ("png", "svg"))
    return {
        "reproduction.html": reproduce_html(reproduction, laws),
        "claims.json": text + "\n",
        **{f"figures/{name}": content for name, content in figures.items()},
    }


def reproduce_html(reproduction: Reproduction, laws: ConclusionsByLaw | None = None) -> str:
    """The whole page: a table of all claims, then the figures with theirs. It opens offline."""
    parts = sections(reproduction_figures(reproduction), reproduction.verdicts)
    figures = [section.figure for section in parts if section.figure]
    return Report(
        "reproduce",
        "Reproduction of the thesis",
        stage_file=thesis_rig().to_toml(),
        source=thesis_rig().source,
        scripted=bool(figures),
        values={
            "verdicts": reproduction.verdicts,
            "counts": _counts(reproduction.verdicts),
            "colours": _COLOURS,
            "numbers": numbers,
            "sections": parts,
            "images": {figure.name: _printed(figure) for figure in figures},
            "interactive": {
                figure.name: Markup(plotly_renderer.fragment(replace(figure, note=""))) for figure in figures
            },
            "conventions": CONVENTIONS,
            "law_names": laws.laws if laws else (),
            "law_rows": laws_rows(laws) if laws else [],
            "law_sentences": laws_sentences(laws) if laws else [],
            "cycles": [(STUDIES[name], edges.comparison) for name, edges in reproduction.cycles.items()],
            "points": reproduction.points,
            "rtol": f"{reproduction.rtol:g}",
        },
    ).html()


def sections(figures: Mapping[str, Figure], verdicts: Iterable[Verdict]) -> tuple[FigureSection, ...]:
    """The figures in their order, then whatever else judges name as evidence; claims that are not covered stand in
    the table alone. A panel's claims, such as those of "11A", stand with the figure."""
    groups: dict[str, list[Verdict]] = {number: [] for number in figures}
    for verdict in verdicts:
        if verdict.finding:
            groups.setdefault(verdict.figure.rstrip("ABCD"), []).append(verdict)
    return tuple(
        FigureSection(
            f"section-{place}",
            figures[number].title if number in figures else f"Figure {number}" if number.isdigit() else number,
            figures.get(number),
            tuple(group),
        )
        for place, (number, group) in enumerate(groups.items())
    )


def _printed(figure: Figure) -> str:
    """The figure for paper as a data address; maps as pixels, since thousands of cells make megabytes of lines."""
    if not any(panel.maps for panel in figure.panels):
        return print_image(figure)
    pixels = matplotlib_renderer.image(replace(figure, title="", note=""), "png")
    return "data:image/png;base64," + base64.b64encode(pixels).decode("ascii")


def _counts(verdicts: Iterable[Verdict]) -> dict[str, int]:
    """How many claims got each judgement, those that occur."""
    parts = [verdict.judgement for verdict in verdicts]
    return {judgement: parts.count(judgement) for judgement in _COLOURS if judgement in parts}
