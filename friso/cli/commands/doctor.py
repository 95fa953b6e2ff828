"""`friso doctor`: whether friso works on this machine, and what it runs on."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, print_wrapped
from friso.cli.output import print_document


def doctor(
    full_paths: Annotated[
        bool, typer.Option("--full-paths", help="Name folders in full, with the user's name in them.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Does friso work on this machine? Text to paste into a bug report.

    Example: friso doctor
    """
    from friso.studies.doctor import checks
    from friso.views.doctor.document import conclusion, doctor_document

    looked_at = [*checks(full_paths)]
    if as_json:
        print_document(doctor_document(looked_at))
    else:
        print_wrapped(conclusion(looked_at))
        for check in looked_at:
            print(f"{check.subject}: {check.text}")
            if check.remedy and not check.works:
                print(f"  remedy: {check.remedy}")
    if not all(check.works for check in looked_at):
        raise typer.Exit(1)


COMMAND = Command(doctor, 150)
