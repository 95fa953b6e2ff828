"""The page, the claims and the figure files of a reproduction of the thesis."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from friso.studies.thesis import CONVENTIONS, STUDIES, rig
from friso.version import VERSION
from friso.views.drawing import matplotlib_renderer, plotly_renderer
from friso.views.drawing.figure import GREEN, GREY, ORANGE, VERMILLION, Figure
from friso.views.pages import environment, print_image
from friso.views.reproduce.figures import reproduction_figures

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction, Verdict

_COLOURS = {"holds": GREEN, "holds in part": ORANGE, "differs": VERMILLION, "not yet covered": GREY}


@dataclass(frozen=True)
class Section:
    """One figure of the thesis with the verdicts on the claims that it bears out; `figure` is None where the evidence
    is no drawing."""

    key: str
    title: str
    figure: Figure | None
    verdicts: tuple[Verdict, ...]


def write_reproduction(reproduction: Reproduction, folder: Path) -> list[Path]:
    """Write reproduction.html, claims.json and the figures (PNG and SVG, in `figures`) into the folder, which is made
    where it is missing. Returns the paths; OSError where that is impossible."""
    folder.mkdir(parents=True, exist_ok=True)
    page, document = folder / "reproduction.html", folder / "claims.json"
    page.write_text(reproduction_html(reproduction), encoding="utf-8", newline="\n")
    text = json.dumps(claims_document(reproduction), indent=2, ensure_ascii=False, allow_nan=False)
    document.write_text(text + "\n", encoding="utf-8", newline="\n")
    return [page, document, *write_figures(reproduction, folder / "figures")]


def write_figures(reproduction: Reproduction, folder: Path) -> list[Path]:
    """Every figure as PNG and SVG. Returns the paths; OSError where that is impossible."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for figure in reproduction_figures(reproduction).values():
        for form in ("png", "svg"):
            paths.append(folder / f"{figure.name}.{form}")
            matplotlib_renderer.save(figure, paths[-1])
    return paths


def claims_document(reproduction: Reproduction) -> dict[str, Any]:
    """All claims with their judgements, ready for JSON; how they were judged stands before them."""
    tolerances = sorted(reproduction.tolerances)
    verdicts, counts = reproduction.changed
    return {
        "source": rig().source,
        "friso": VERSION,
        "points": reproduction.points,
        "rtol": reproduction.rtol,
        "conventions": CONVENTIONS,
        "figure_14b": {"rtol": tolerances, "verdicts_changed": verdicts, "counts_changed": counts}
        if tolerances
        else None,
        "cycles": {name: vars(found.comparison) for name, found in reproduction.cycles.items()},
        "claims": [_entry(verdict) for verdict in reproduction.verdicts],
    }


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
                "kind": each.variant.kind,
                "parameter": each.variant.parameter,
                "value": each.variant.value,
                "judgement": each.judgement,
                "number": "; ".join(each.numbers),
            }
            for each in (*verdict.depends_on, *verdict.hangs_on)
        ],
    }


def numbers(verdict: Verdict) -> str:
    """The numbers of all parts in one line; empty for a claim that is not covered."""
    return "; ".join(part.number for part in verdict.finding.parts) if verdict.finding else ""


def reproduction_html(reproduction: Reproduction) -> str:
    """The whole page: a table of all claims, then the figures with theirs. It opens offline."""
    found = sections(reproduction_figures(reproduction), reproduction.verdicts)
    drawn = [section.figure for section in found if section.figure]
    return (
        environment()
        .get_template("reproduction.html")
        .render(
            source=rig().source,
            verdicts=reproduction.verdicts,
            counts=_counts(reproduction.verdicts),
            colours=_COLOURS,
            numbers=numbers,
            sections=found,
            images={figure.name: _printed(figure) for figure in drawn},
            interactive={figure.name: Markup(plotly_renderer.fragment(replace(figure, note=""))) for figure in drawn},
            plotly=Markup(plotly_renderer.script()) if drawn else None,
            conventions=CONVENTIONS,
            cycles=[(STUDIES[name], found.comparison) for name, found in reproduction.cycles.items()],
            points=reproduction.points,
            rtol=f"{reproduction.rtol:g}",
            stage_file=rig().to_toml(),
            version=VERSION,
        )
    )


def sections(figures: Mapping[str, Figure], verdicts: Iterable[Verdict]) -> tuple[Section, ...]:
    """The figures in their order, then whatever else judges name as evidence; claims that are not covered stand in
    the table alone. A panel's claims, such as those of "11A", stand with the figure."""
    groups: dict[str, list[Verdict]] = {number: [] for number in figures}
    for verdict in verdicts:
        if verdict.finding:
            groups.setdefault(verdict.figure.rstrip("ABCD"), []).append(verdict)
    return tuple(
        Section(
            f"section-{place}",
            figures[number].title if number in figures else _untitled(number),
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


def _untitled(number: str) -> str:
    return f"Figure {number}" if number.isdigit() else number


def _counts(verdicts: Iterable[Verdict]) -> dict[str, int]:
    """How many claims got each judgement, those that occur."""
    found = [verdict.judgement for verdict in verdicts]
    return {judgement: found.count(judgement) for judgement in _COLOURS if judgement in found}
