"""Write to the terminal safely.

Texts from files cannot steer the terminal (`friso.escapes`); friso's own tables and bars can. Characters that the
terminal's encoding lacks are spelled out.
"""

from __future__ import annotations

import codecs
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, Any, TextIO, cast

from friso.escapes import escaped
from friso.platform.system import closed_pipes_told

if TYPE_CHECKING:
    from rich.console import Console


class Piped:
    """A stream that raises BrokenPipeError when its reader has gone, on every system."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text to the stream."""
        with closed_pipes_told():
            return self.stream.write(text)

    def flush(self) -> None:
        """Flush the stream."""
        with closed_pipes_told():
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class Escaping(Piped):
    """A stream that escapes everything written to it."""

    def write(self, text: str) -> int:
        """Write a text, escaped."""
        super().write(escaped(text))
        return len(text)


@contextmanager
def escaping() -> Iterator[None]:
    """Escape everything that is printed or logged in the `with` block."""
    out, err = cast(TextIO, Escaping(sys.stdout)), cast(TextIO, Escaping(sys.stderr))
    with redirect_stdout(out), redirect_stderr(err):
        yield


def console(stream: TextIO, **options: Any) -> Console:
    """Return rich's console for a stream.

    Escape sequences of rich reach the stream, so texts must be escaped beforehand. Names such as ":x:" stay text.
    """
    from rich.console import Console

    plain = cast("TextIO", Piped(stream.stream)) if isinstance(stream, Escaping) else stream
    return Console(file=plain, emoji=False, **options)


SPELLED = "friso.spelled"
"""Name of the error handler of streams, which spells characters that the encoding lacks."""


def spelled(text: str, encoding: str) -> str:
    """Return a text with the characters that an encoding lacks spelled out."""
    return text.encode(encoding, SPELLED).decode(encoding)


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """Return a replacement for characters that an encoding lacks, and where to go on.

    This is the error handler of streams. Any other error is raised again.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelling, error.object[error.start : error.end])), error.end


def _spelling(character: str) -> str:
    """Spell a character in ASCII.

    Exponents follow "^", Greek letters become their names, and unknown characters become "?".
    """
    if character.isascii() or character in _SPELLINGS:
        return _SPELLINGS.get(character, character)
    if unicodedata.decomposition(character).startswith("<super>"):
        return "^" + "".join(map(_spelling, unicodedata.normalize("NFKC", character)))
    match unicodedata.name(character, "").split():
        case ["GREEK", "SMALL" | "CAPITAL" as size, "LETTER", name]:
            return name.lower() if size == "SMALL" else name.capitalize()
    return "?"


_SPELLINGS = {
    **dict.fromkeys("−–—", "-"),
    **dict.fromkeys("“”", "'"),  # no JSON text ends there
    **{block: str(height) for height, block in enumerate("▁▂▃▄▅▆▇█", 1)},
    **{"…": "...", "×": "x", "·": "*", "±": "+-", "≤": "<=", "√": "sqrt ", "°": " deg", "µ": "u", "μ": "u"},
}

codecs.register_error(SPELLED, _spelled)
