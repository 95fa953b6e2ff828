"""A command whose help ends with what can be chosen, read from a registry only when the help is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from typer.core import TyperCommand

Rows = Iterable[tuple[str, str]]


def ending_with(title: str, rows: Callable[[], Rows]) -> type[TyperCommand]:
    """A class of commands whose help has a list below its options: names, and what each is in one line."""

    class ListingCommand(TyperCommand):
        def format_epilog(self, ctx: Any, formatter: Any) -> None:
            with formatter.section(title):
                formatter.write_dl([*rows()])

    return ListingCommand
