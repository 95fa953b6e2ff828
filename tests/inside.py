"""The command line run in the process of the tests, which need not import everything anew."""

import io
import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from friso.cli import main
from friso.cli.derived import ask_by_values
from friso.interface.question import QUESTIONS


def friso_inside(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Status and output of `friso ARGUMENTS` in a folder. What would end in a traceback there is raised here."""
    out, err, command = io.StringIO(), io.StringIO(), ["friso", *map(str, arguments)]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(folder)
        patch.setattr(sys, "argv", command)
        patch.setattr(sys.modules["__main__"], "__package__", None)  # of `python -m pytest`, which messages would name
        with pytest.raises(SystemExit) as left:
            main()
    return subprocess.CompletedProcess(command, int(left.value.code or 0), out.getvalue(), err.getvalue())


def strict_json(text: str) -> dict[str, Any]:
    """A JSON document, in which infinite and undefined numbers have no place."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the document"))


def command_of(name: str) -> Callable[..., None]:
    """Return the command of a question as a function: subjects first, then options as keywords."""
    question = QUESTIONS[name]

    def command(*about: Any, **options: Any) -> None:
        ask_by_values(
            question, dict.fromkeys(question.takes) | dict(zip(question.takes, about, strict=False)) | options
        )

    return command
