"""`friso example`: the files that come with friso."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import Replace
from friso.interface.question import HELP, Choices


def example(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="See the list below; left out, it is printed.")
    ] = None,
    path: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="The file to write; default: its own name, here.")
    ] = None,
    overwrite: Replace = False,
) -> None:
    """Copy an example that comes with friso, a stage file with its sources.

    Example: friso example thesis_rig
    """
    from friso.interface.output_folder import write_file
    from friso.interface.starting import example as example_path

    if name is None:
        examples = listed_examples()
        width = max(len(listed) for listed, _ in examples) + 2
        for listed, title in examples:
            print(f"{listed:<{width}}{title}")
        return
    source = example_path(name)
    target = path or Path(source.name)
    write_file("FILE", target, source.read_text(encoding="utf-8"), overwrite)
    print(f"wrote {target}")
    for beside in named_files(source):
        write_file("FILE", target.parent / beside.name, beside.read_text(encoding="utf-8"), overwrite)
        print(f"wrote {target.parent / beside.name}")


def named_files(source: Path) -> list[Path]:
    """Return the files beside an example that its tables name."""
    import tomllib

    tables = tomllib.loads(source.read_text("utf-8")).values() if source.suffix == ".toml" else ()
    return [source.parent / table["file"] for table in tables if isinstance(table, dict) and "file" in table]


def listed_examples() -> list[tuple[str, str]]:
    """Return the examples, each with the name of its stage, or with its purpose."""
    import tomllib

    from friso.interface.starting import example as example_path
    from friso.interface.starting import example_names

    paths = {name: example_path(name) for name in example_names()}
    return [
        (name, str(tomllib.loads(path.read_text("utf-8")).get("name", "")) if path.suffix == ".toml" else PARAMETERS)
        for name, path in paths.items()
    ]


PARAMETERS = "Parameters of a drive, for friso init --from"
"""Description of an example that is not a stage file."""


COMMAND = Command(example, 145, HELP, Choices("Examples", listed_examples))
