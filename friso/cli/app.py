"""The command line: `friso COMMAND STAGE.toml`. Reads what the analyses return and prints or draws it.

Exit status: 0 done, 1 the computation could not be completed, 2 the input is wrong, 130 interrupted.
"""

from __future__ import annotations

import io
import logging
import sys
from collections.abc import Callable, Iterable
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand

from friso.cli.bode import bode
from friso.cli.boundary import boundary
from friso.cli.check import check
from friso.cli.common import INTERRUPTED, say
from friso.cli.compare import compare
from friso.cli.design import design
from friso.cli.doctor import doctor
from friso.cli.flexure import flexure
from friso.cli.guideline import guideline
from friso.cli.identify import identify, listed_kinds
from friso.cli.init import init
from friso.cli.map import map_cells
from friso.cli.reproduce import reproduce
from friso.cli.rig import listed_experiments, rig
from friso.cli.simulate import simulate
from friso.errors import InputError
from friso.stage.foreign import installed
from friso.version import VERSION

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def ending_with(title: str, rows: Callable[[], Iterable[tuple[str, str]]]) -> type[TyperCommand]:
    """A class of commands whose help ends with a list, read only when the help is asked for: names, and what each is
    in one line."""

    class ListingCommand(TyperCommand):
        def format_epilog(self, ctx: Any, formatter: Any) -> None:
            with formatter.section(title):
                formatter.write_dl([*rows()])

    return ListingCommand


LISTS = {
    "identify": ending_with("Kinds of experiment (--as)", listed_kinds),
    "rig": ending_with("Experiments", listed_experiments),
}
"""Commands whose help lists what can be chosen."""

for name, command in (
    ("init", init),
    ("check", check),
    ("simulate", simulate),
    ("map", map_cells),
    ("bode", bode),
    ("boundary", boundary),
    ("flexure", flexure),
    ("design", design),
    ("identify", identify),
    ("rig", rig),
    ("compare", compare),
    ("reproduce", reproduce),
    ("guideline", guideline),
    ("doctor", doctor),
):
    app.command(name, cls=LISTS.get(name))(command)


def main() -> NoReturn:
    """Run the command line; wrong input ends in one message and status 2, never in a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no dash still gets its answer
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    messages = logging.StreamHandler(sys.stderr)
    messages.setFormatter(logging.Formatter("friso: %(message)s"))
    logging.getLogger("friso").addHandler(messages)
    try:
        if {"-h", "--help"} & {*sys.argv[1:2]}:
            app.info.epilog = _plug_ins()
        status = app(standalone_mode=False) or 0
        if status == INTERRUPTED:  # typer's word for Ctrl-C
            say("interrupted")
        sys.exit(status)
    except typer.Exit as leave:
        sys.exit(leave.exit_code)
    except (typer.Abort, KeyboardInterrupt):
        say("interrupted")
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except InputError as error:
        say(str(error))
        sys.exit(2)
    except Exception as error:
        usage = getattr(error, "format_message", None)
        if usage is not None:
            say(f"{usage()}\n  try: friso --help")
            sys.exit(2)
        if isinstance(error, RuntimeError | OSError | MemoryError):
            say(f"the computation could not be completed: {error}")
            sys.exit(1)
        raise


def _plug_ins() -> str:
    """What installed packages add, for the help. Raises InputError for a name that is taken."""
    names = installed()
    return f"From other packages: {', '.join(names)}." if names else ""


def _version(requested: bool) -> None:
    if requested:
        print(f"friso {VERSION}")
        raise typer.Exit


@app.callback()
def friso(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Does a positioning stage on contact bearings hunt, why, and what stops it?

    Start with: friso init stage.toml && friso check stage.toml
    """
