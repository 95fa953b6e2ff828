"""A page as its tests read it."""

import base64
import gzip
import json
import re
from html.parser import HTMLParser
from typing import Any

from friso.shown.drawing import plotly_renderer


class Page(HTMLParser):
    """Tags, addresses that a browser would load, and the text outside scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.loads: list[str] = []
        self.words: list[str] = []
        self.feed(text.replace(plotly_renderer.script(), ""))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        addresses = [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        self.loads += [address for address in addresses if not address.startswith("#")]

    def handle_data(self, data: str) -> None:
        if self.tags[-1:] not in (["script"], ["style"]):
            self.words.append(data)

    @property
    def text(self) -> str:
        """Return all words of the page as one text."""
        return "".join(self.words)

    @property
    def lines(self) -> str:
        """Return the page's text without blank lines and surrounding white space."""
        rows = (" ".join(row.split()) for row in self.text.splitlines())
        return "\n".join(row for row in rows if row)


def packed_values(page: str) -> list[Any]:
    """The values that a page carries packed as JSON, in its order: what plotly draws."""
    texts = re.findall(r'<script type="application/gzip" class="figure">(.*?)</script>', page)
    return [json.loads(gzip.decompress(base64.b64decode(text))) for text in texts]
