"""What the pages that friso writes share: their templates, and figures as pictures for paper."""

from __future__ import annotations

import base64
from dataclasses import replace

from jinja2 import Environment, PackageLoader, StrictUndefined

from friso.views import matplotlib_renderer
from friso.views.figure import Figure


def environment() -> Environment:
    """The templates of friso/views/templates; texts are escaped, a name without a value is an error."""
    return Environment(
        loader=PackageLoader("friso.views"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )


def print_image(figure: Figure) -> str:
    """The figure as an SVG data address: what is printed, and what is seen without scripts."""
    svg = matplotlib_renderer.image(replace(figure, title="", subject=""), "svg")
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
