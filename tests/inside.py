"""The command line run in the process of the tests, which need not import everything anew."""

import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from friso.cli import main


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
