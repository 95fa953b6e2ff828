"""Write every page of friso from one skeleton, with the answer first.

A command's own template may change parts of the skeleton.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from importlib import resources
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from friso.escapes import escaped
from friso.shown.blocks import AnswerBlock
from friso.shown.drawing import plotly_renderer
from friso.shown.drawing.figure import Figure
from friso.shown.drawing.images import ON_PAGE, draw_beforehand, image
from friso.shown.drawing.prefixes import listed
from friso.shown.files import Content, pictures
from friso.shown.glossary import Glossary
from friso.stage import Stage
from friso.stage.foreign import foreign
from friso.version import VERSION


def made_with() -> str:
    """Return the version of friso, and what other packages add to it."""
    return " with ".join([VERSION, *filter(None, [listed(foreign(), "and")])])


OWN_TEMPLATES = "friso.shown"
"""The package with friso's own templates, which other packages' templates extend."""

_SCRIPT = resources.files(OWN_TEMPLATES) / "templates" / "page.js"
"""The script of every page with figures."""


@dataclass(frozen=True)
class Report:
    """The page of a `command`: name, blocks of the answer, stage file, and values of the command's own template.

    The `condition` stands before the answer. `computed` says how the result was computed; it follows the version of
    friso and has no full stop. The command's own template, if there is one, is the file templates/COMMAND.html in the
    package that the field `templates` names. It extends `page.html` and changes its parts: style, answer, sections,
    footer; `values` are what it names besides.
    """

    command: str
    name: str
    blocks: Sequence[AnswerBlock] = ()
    condition: str = ""
    computed: str = ""
    stage_file: str = ""
    source: str = ""
    version: str = field(default_factory=made_with)
    templates: str = OWN_TEMPLATES
    values: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of_stage(
        cls, command: str, stage: Stage | None, blocks: Sequence[AnswerBlock], name: str = "Unnamed stage", **parts: Any
    ) -> Report:
        """Return the page about a stage, or about no stage, with other fields as `parts`.

        `name` stands at the head if the stage has no name.
        """
        about = {} if stage is None else {"stage_file": stage.to_toml(), "source": stage.source}
        return cls(command, (stage.name if stage else "") or name, blocks, **about, **parts)

    @property
    def figures(self) -> list[Figure]:
        """Return the figures of all blocks."""
        return [figure for block in self.blocks for figure in block.figures]

    def files(self) -> dict[str, Content]:
        """Return the page, and every figure in all formats, by file name.

        The page has the name of the command's question.
        """
        images = pictures(self.figures)  # other processes draw them while the page is written
        return {f"{self.command.partition(' ')[0]}.html": self.html(), **images}

    def html(self) -> str:
        """Return the page, which opens offline and prints; every run gives the same bytes."""
        draw_beforehand(self.figures, [ON_PAGE])
        sections = [(block, [_shown_figure(figure) for figure in block.figures]) for block in self.blocks]
        figures = [figure for _, several in sections for figure in several]
        scripts = plotly_renderer.script() if figures else None
        values: dict[str, Any] = {
            "figures": figures,
            "drawn_blocks": sections,
            "plotly": scripts,
            "page_script": Markup(_SCRIPT.read_text(encoding="utf-8")),
            **{part.name: getattr(self, part.name) for part in fields(self)},
        }
        assert not values.keys() & self.values.keys()  # a command's value must not replace one of these
        template = environment(self.templates).select_template([f"{self.command}.html", "page.html"])
        return template.render(**values, **self.values)


def _shown_figure(figure: Figure) -> tuple[Figure, Markup, Markup]:
    """Return a figure, and how it looks on a page with scripts and on paper."""
    return figure, Markup(plotly_renderer.fragment(figure)), print_image(figure)


def environment(package: str = OWN_TEMPLATES) -> Environment:
    """Return the templates of a package and of friso/shown/templates, for one page.

    Texts are escaped, and a name without a value is an error. The filter `explained` links words of a text to the
    `glossary` of the page.
    """
    templates = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in dict.fromkeys((package, OWN_TEMPLATES))]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=_escaped_text,
    )
    templates.tests["starting"] = str.startswith
    templates.globals["zip"] = zip
    glossary = Glossary()
    templates.filters["explained"], templates.globals["glossary"] = glossary.linked, glossary
    return templates


def _escaped_text(value: Any) -> Any:
    """Return what a template puts into a page: texts escaped, friso's own markup as it is."""
    return value if isinstance(value, Markup) or not isinstance(value, str) else escaped(value)


def print_image(figure: Figure, form: str = "svg", noted: bool = True) -> Markup:
    """Return a figure as a data address in quotation marks, in the format `form`.

    The image keeps its note if `noted`. It is printed, and seen in browsers without scripts.
    """
    content = image(figure, form, headed=False, noted=noted)
    if form == "svg":
        return Markup(f"data:image/svg+xml,{_plain(content.decode())}")
    return Markup(f"data:image/{form};base64,{base64.b64encode(content).decode('ascii')}")


def _plain(svg: str) -> str:
    """Return an SVG escaped for an address in quotation marks, half as long as in base64."""
    element = re.sub(r"\s+", " ", _UNSEEN.sub("", svg[svg.index("<svg") :]))
    return _PATH.sub(_shortened, element).translate(_IN_ADDRESSES)


_UNSEEN = re.compile(r'<!--.*?(?:-->|\Z)|<metadata>.*?(?:</metadata>|\Z)|(?<=<g) id="[^"]*"', re.DOTALL)
"""Parts of an SVG that are neither shown nor referred to, such as names of groups."""

_PATH, _SPACED = re.compile(r'(?<= d=")[^"]*'), re.compile(r" ?([A-Za-z]) ?")
"""Patterns of the path of an SVG element, and of its commands, which need no blanks."""

_STRAIGHT = re.compile(r"(?:[ML] -?[\d.]+ -?[\d.]+ ?|z ?)+")
"""Pattern of paths that consist of straight pieces alone."""

STEPS_PER_POINT = 10
"""Steps of a coordinate in a point of 1/72 inch, finer than printers' dots."""


def _shortened(path: re.Match[str]) -> str:
    """Write an SVG path in less text.

    All places are relative to the one before, to a tenth of a point.
    """
    if not _STRAIGHT.fullmatch(path[0]):
        return _SPACED.sub(r"\1", path[0])
    parts, here, last = [], (0, 0), ""
    for command, x, y in re.findall(r"([MLz])(?: (-?[\d.]+) (-?[\d.]+))?", path[0]):
        if command == "z":
            parts.append("z")
        else:
            there = round(STEPS_PER_POINT * float(x)), round(STEPS_PER_POINT * float(y))
            step = there if command == "M" else (there[0] - here[0], there[1] - here[1])
            if command == last == "L" and step == (0, 0):
                continue
            letter = "M" if command == "M" else "" if last == "L" else "l"
            parts.append(letter + "".join(map(_tenths, step, (not letter, True))))
            here = there
        last = command
    return "".join(parts)


def _tenths(number: int, apart: bool) -> str:
    """Write a number of tenths as a decimal number, without a leading 0.

    `apart` separates it from a number before it, unless its sign does.
    """
    text = (
        f"{number / STEPS_PER_POINT:g}".replace("0.", ".", 1)
        if abs(number) < STEPS_PER_POINT
        else f"{number / STEPS_PER_POINT:g}"
    )
    return f" {text}" if apart and number >= 0 else text


_IN_ADDRESSES = str.maketrans({"'": "&amp;apos;", '"': "'", "&": "&amp;", "%": "%25", "#": "%23"})
