"""The terminal: what stands in files may not steer it (`friso.escapes`), friso's own tables and bars may."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, Any, TextIO, cast

from friso.escapes import escaped
from friso.system import closed_pipes_told

if TYPE_CHECKING:
    from rich.console import Console


class Piped:
    """A stream that raises BrokenPipeError where nobody reads it any more, on every system."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text."""
        with closed_pipes_told():
            return self.stream.write(text)

    def flush(self) -> None:
        """Write what is held back."""
        with closed_pipes_told():
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class Escaping(Piped):
    """One on which everything is escaped that is written."""

    def write(self, text: str) -> int:
        """Write a text, escaped."""
        super().write(escaped(text))
        return len(text)


@contextmanager
def escaping() -> Iterator[None]:
    """What is printed and logged within is escaped."""
    out, err = cast(TextIO, Escaping(sys.stdout)), cast(TextIO, Escaping(sys.stderr))
    with redirect_stdout(out), redirect_stderr(err):
        yield


def console(stream: TextIO, **options: Any) -> Console:
    """What draws on a stream with escape sequences of its own: texts have to be escaped before they come here."""
    from rich.console import Console

    plain = cast("TextIO", Piped(stream.stream)) if isinstance(stream, Escaping) else stream
    return Console(file=plain, **options)
