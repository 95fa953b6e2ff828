"""Print the answers of all commands: the names of files written, and the JSON document."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from friso.escapes import one_line

Replace = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")]


def print_document(document: Mapping[str, Any], files: Iterable[Path] = ()) -> None:
    """Print the JSON document of a command, with the files written and the plug-ins loaded."""
    from friso.stage.foreign import foreign

    written = {"files": [str(file) for file in files], "plug_ins": foreign()}
    print(json.dumps({**document, **written}, allow_nan=False))


def print_written(files: Iterable[Path]) -> None:
    """Print every file written on a line of its own; many pictures share one line."""
    every = [*files]
    pictures = [file for file in every if file.suffix in _PICTURES]
    listed = every if len(pictures) <= _FEW else [file for file in every if file not in pictures]
    for file in listed:
        print(f"wrote {one_line(str(file))}")
    if len(listed) < len(every):
        figures, forms = (
            len({file.stem for file in pictures}),
            ", ".join(sorted({f.suffix[1:].upper() for f in pictures})),
        )
        print(f"wrote {figures} figures as {forms}")


_PICTURES, _FEW = (".png", ".svg", ".pdf"), 6
"""Suffixes of pictures, and the largest number of pictures listed one by one."""
