"""Write every page of friso from one skeleton, with the answer first.

A command's own template may change parts of the skeleton.
"""

from __future__ import annotations

import base64
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
from friso.shown.drawing.prefixes import listed
from friso.shown.files import Content, image, pictures
from friso.shown.glossary import Glossary
from friso.stage import Stage
from friso.stage.arguments import foreign
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
    footer; `values` are what it names besides. Pages that are `scripted` load plotly even without figures.
    """

    command: str
    name: str
    blocks: Sequence[AnswerBlock] = ()
    condition: str = ""
    computed: str = ""
    stage_file: str = ""
    source: str = ""
    version: str = field(default_factory=made_with)
    scripted: bool = False
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
        return {f"{self.command.partition(' ')[0]}.html": self.html(), **pictures(self.figures)}

    def html(self) -> str:
        """Return the page, which opens offline and prints; every run gives the same bytes."""
        sections = [(block, [_shown_figure(figure) for figure in block.figures]) for block in self.blocks]
        figures = [figure for _, several in sections for figure in several]
        scripts = plotly_renderer.script() if figures or self.scripted else None
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


def print_image(figure: Figure) -> Markup:
    """Return a figure without its heading as the address of a PNG, in quotation marks.

    The image is printed, and seen in browsers without scripts.
    """
    return Markup(f"data:image/png;base64,{base64.b64encode(image(figure, 'png', headed=False)).decode('ascii')}")
