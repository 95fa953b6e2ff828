"""`friso simulate`: its arguments are a stage file, or the numbers of a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from friso.cli.asking import Shown, ask
from friso.interface.question import Question


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Simulate the stage of a file or, with --cell, one cell of a map's store."""
    words = about[0] or []
    ask(question, [words if "cell" in options else [Path(word) for word in words]], options, shown)
