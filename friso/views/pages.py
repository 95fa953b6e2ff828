"""Every page that friso writes: one skeleton, the answer first, whose blocks the template of a command fills."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from friso.escapes import escaped
from friso.stage.foreign import foreign
from friso.version import VERSION
from friso.views.drawing import matplotlib_renderer, plotly_renderer
from friso.views.drawing.figure import Figure
from friso.views.drawing.prefixes import listed

if TYPE_CHECKING:
    from friso.stage import Stage


def made_with() -> str:
    """The version of friso, and what other packages bring to it."""
    return " with ".join([VERSION, *filter(None, [listed(foreign(), "and")])])


@dataclass(frozen=True)
class Report:
    """A page: the name at its head, its figures, the stage file and its source, and what else the command's `template`
    names, `values`.

    Templates extend `page.html` and fill its blocks: answer, table, figures, footer. `scripted` pages load plotly
    without figures of their own kind.
    """

    template: str
    name: str
    figures: Sequence[Figure] = ()
    stage_file: str = ""
    source: str = ""
    version: str = field(default_factory=made_with)
    scripted: bool = False
    values: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of_stage(
        cls, template: str, stage: Stage | None, figures: Sequence[Figure], name: str = "Unnamed stage", **values: Any
    ) -> Report:
        """The page about a stage, or about none; `name` stands at the head where the stage has none."""
        if stage is None:
            return cls(template, name, figures, values=values)
        return cls(template, stage.name or name, figures, stage.to_toml(), stage.source, values=values)

    def html(self) -> str:
        """The page: it opens offline, prints, and is the same bytes on every run."""
        figures = [(figure, Markup(plotly_renderer.fragment(figure)), print_image(figure)) for figure in self.figures]
        scripts = Markup(plotly_renderer.script()) if figures or self.scripted else None
        common = {name: getattr(self, name) for name in ("name", "stage_file", "source", "version")}
        return (
            environment().get_template(self.template).render(figures=figures, plotly=scripts, **common, **self.values)
        )


def environment() -> Environment:
    """The templates of friso/views/templates; texts are escaped, a name without a value is an error."""
    templates = Environment(
        loader=PackageLoader("friso.views"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=_shown,
    )
    templates.tests["starting"] = str.startswith
    return templates


def _shown(value: Any) -> Any:
    """What a template puts into a page: texts escaped, markup of friso's own as it is."""
    return value if isinstance(value, Markup) or not isinstance(value, str) else escaped(value)


def print_image(figure: Figure) -> str:
    """The figure as an SVG data address: what is printed, and what is seen without scripts."""
    svg = matplotlib_renderer.image(replace(figure, title="", subject=""), "svg")
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
