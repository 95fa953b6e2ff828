"""What the pages that friso writes share: their templates, figures as pictures for paper, and the page of a stage."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from friso.stage.foreign import foreign
from friso.version import VERSION
from friso.views.drawing import matplotlib_renderer, plotly_renderer
from friso.views.drawing.figure import Figure
from friso.views.drawing.prefixes import listed

if TYPE_CHECKING:
    from friso.stage import Stage


def environment() -> Environment:
    """The templates of friso/views/templates; texts are escaped, a name without a value is an error."""
    return Environment(
        loader=PackageLoader("friso.views"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )


def print_image(figure: Figure) -> str:
    """The figure as an SVG data address: what is printed, and what is seen without scripts."""
    svg = matplotlib_renderer.image(replace(figure, title="", subject=""), "svg")
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")


def stage_page(
    template: str, stage: Stage | None, figures: Sequence[Figure], name: str = "Unnamed stage", **shown: Any
) -> str:
    """The page of a template about a stage (or None) and its figures; `name` is told where the stage has none, `shown`
    are the other values that the template names."""
    return (
        environment()
        .get_template(template)
        .render(
            name=stage.name if stage and stage.name else name,
            source=stage.source if stage else "",
            figures=[(figure, Markup(plotly_renderer.fragment(figure)), print_image(figure)) for figure in figures],
            plotly=Markup(plotly_renderer.script()) if figures else None,
            stage_file=stage.to_toml() if stage else "",
            version=" with ".join([VERSION, *filter(None, [listed(foreign(), "and")])]),
            **shown,
        )
    )
