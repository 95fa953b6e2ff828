"""Write every page of friso from one skeleton, with the answer first.

A command's own template may change parts of the skeleton. Words on a page link to the glossary at its end, each word at
its first occurrence.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from friso.errors import escaped
from friso.shown.blocks import AnswerBlock, Content, image, pictures
from friso.shown.drawing import plotly_renderer
from friso.shown.drawing.figure import Figure
from friso.shown.text import listed
from friso.stage import Stage
from friso.stage.arguments import foreign
from friso.version import VERSION

_ROW = re.compile(r"^\| ([^|]+) \| (.+) \|$", flags=re.MULTILINE)
_HEADING = "word"


@dataclass(frozen=True)
class GlossaryRow:
    """A row of the glossary: its words, and what they mean."""

    words: tuple[str, ...]
    meaning: str

    @property
    def name(self) -> str:
        """Return all words of the row as text."""
        return ", ".join(self.words)

    @property
    def place(self) -> str:
        """Return the row's anchor on a page."""
        return "word-" + re.sub(r"\W+", "-", self.words[0].lower())


@cache
def entries() -> Mapping[str, GlossaryRow]:
    """Return the rows of the glossary by their words in small letters.

    A word that has its meaning in one context only, such as "slope (of the return map)", is left out, because pages
    also use it in other contexts.
    """
    text = (resources.files("friso.shown") / "templates" / "glossary.md").read_text(encoding="utf-8")
    plain = re.sub(r"[*`]", "", text)
    rows = [
        GlossaryRow(tuple(words.split(", ")), meaning) for words, meaning in _ROW.findall(plain) if "(" not in words
    ]
    return {word.lower(): entry for entry in rows for word in entry.words if word != _HEADING}


@cache
def _any_word() -> re.Pattern[str]:
    """Return a pattern for any word of the glossary or its plural; longer words come first."""
    words = sorted(entries(), key=len, reverse=True)
    return re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, words))})s?(?![\w-])", flags=re.IGNORECASE)


class Glossary:
    """The rows of the glossary used by one page, by the first occurrence of their words."""

    def __init__(self) -> None:
        self.used: dict[str, GlossaryRow] = {}

    def linked(self, text: str) -> Markup:
        """Return a text, escaped, with links from words that are new on the page."""
        parts, end = [], 0
        text = escaped(text)
        for match in _any_word().finditer(text):
            entry = entries()[match[1].lower()]
            if entry.name not in self.used:
                self.used[entry.name] = entry
                parts += [escape(text[end : match.start()]), self._link(match[0], entry)]
                end = match.end()
        return Markup("").join([*parts, escape(text[end:])])

    @staticmethod
    def _link(word: str, entry: GlossaryRow) -> Markup:
        """Return a link from a word to its row."""
        return Markup('<a class="word" href="#{}" title="{}">{}</a>').format(entry.place, entry.meaning, word)


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
