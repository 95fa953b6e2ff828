"""`friso doctor`: whether friso works on this machine, and what it runs on."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import HELP, Command
from friso.cli.common import AsJson


def doctor(
    full_paths: Annotated[
        bool, typer.Option("--full-paths", help="Name folders in full, with the user's name in them.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Does friso work on this machine? Text to paste into a bug report.

    Example: friso doctor
    """
    from friso.questions.doctor.question import doctor as question

    ask("doctor", question, full_paths=full_paths, as_json=as_json)


COMMAND = Command(doctor, 150, HELP)
