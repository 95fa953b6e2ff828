"""The commands that ask no question.

- `friso app`: check a stage live in the browser.
- `friso example`: the files that come with friso.
- `friso init`: a stage file to start from, or a specification.
- `friso schema`: the JSON Schema of the stage file, by which editors complete and check it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from friso.cli.app import Command
from friso.cli.asking import named_as_options
from friso.cli.terminal import Overrides, Replace
from friso.interface.question import HELP, HUNTS, MACHINE, Choices
from friso.platform.system import shell_word

BeginArgument = Annotated[Path | None, typer.Argument(metavar="STAGE.toml", help="The stage file to start with.")]
Port = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", min=0, max=65535, help="Port to listen on; default: 8741, or the next free one."
    ),
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the browser.")]


def app(
    stage_file: BeginArgument = None,
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Everything live in the browser, served to this machine alone: drag a value and see whether it hunts.

    Example: friso app examples/thesis_rig.toml
    """
    from friso.app.serve import serve

    serve(stage_file, port, browser)


APP = Command(app, 22, HUNTS)


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


EXAMPLE = Command(example, 145, HELP, Choices("Examples", listed_examples))


SourceArgument = Annotated[
    Path | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="Parameter file of a drive, such as a LinuxCNC INI; friso export --help lists them.",
    ),
]
AxisNameOption = Annotated[
    str | None, typer.Option("--axis", metavar="NAME", help="Which axis of that file, where it has several.")
]


def init(
    path: Annotated[
        Path | None, typer.Argument(metavar="STAGE.toml", help="The file to write; default: stage.toml, or spec.toml.")
    ] = None,
    spec_of: Annotated[
        Path | None,
        typer.Option("--spec", metavar="STAGE.toml", help="Write a specification for friso design of this stage."),
    ] = None,
    source: SourceArgument = None,
    axis: AxisNameOption = None,
    overrides: Overrides = None,
    overwrite: Replace = False,
) -> None:
    """Write a stage file to start from: a commented one, that of an axis of a drive (--from), or a specification.

    What a parameter file does not tell, of the machine above all, is asked for in one list; --set answers.

    Example: friso init my_stage.toml
    """
    from friso.interface.starting import init as write_start

    options = {"spec": spec_of, "from_": source, "axis": axis, "set": overrides}
    with named_as_options(options):
        written = write_start(path, overwrite, **options)
    then = ["check"] if spec_of is None else ["design", str(spec_of)]
    command = " ".join(map(shell_word, ["friso", *then, str(written)]))
    print(f"wrote {written}; {'look at it' if source else 'edit it'}, then: {command}")


INIT = Command(init, 10, MACHINE)


def schema(
    of: Annotated[
        str, typer.Option("--of", metavar="stage|specification", help="Which of the two files it describes.")
    ] = "stage",
) -> None:
    """JSON Schema of the stage file, or of the specification of a design: for completion in editors.

    Example: friso schema > stage.schema.json
    """
    from friso.interface.starting import schema as schema_of

    with named_as_options({"of": of}):
        print(json.dumps(schema_of(of), indent=2, ensure_ascii=False))


SCHEMA = Command(schema, 146, HELP)


TABLE: dict[str, tuple[Command, str]] = {
    "app": (APP, ""),
    "example": (EXAMPLE, ""),
    "init": (INIT, ""),
    "schema": (SCHEMA, ""),
}
"""The commands by name; their help is the docstring of their functions."""
