"""The record of the EMPS benchmark (Janot, Gautier, Brunot 2019), which is no part of the repository."""

import shutil
from pathlib import Path

import pytest

from friso.identification.logs.assemble import read_log
from friso.identification.logs.log import Log
from friso.identification.logs.roles import from_options

EMPS = Path(__file__).parents[2] / "shared" / "data" / "emps" / "DATA_EMPS.mat"


def emps_log(folder: Path) -> Log:
    """The log, read from a copy in the folder; the test is skipped where there is none."""
    if not EMPS.exists():
        pytest.skip(f"the EMPS record is not at {EMPS}")
    path = folder / EMPS.name
    shutil.copy(EMPS, path)
    roles = ["time=t", "reference=qg", "position=qm", "force=vir"]
    return read_log(path, from_options(roles, ["t=s", "qg=m", "qm=m"], ["force=35.15065188 N/V"]))
