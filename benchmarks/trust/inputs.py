"""Provide inputs for the campaigns' commands: friso's examples, and a log."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing.util import Finalize
from pathlib import Path

from friso.platform.leftovers import temporary_folder

EXAMPLES = Path(__file__).parents[2] / "examples"
RIG, DRIVE, LEAVES = (str(EXAMPLES / f"thesis_{name}.toml") for name in ("rig", "drive", "leaves"))
STICK_SLIP = str(EXAMPLES / "lugre_stick_slip.toml")
SPEC = str(EXAMPLES / "specs" / "thesis.toml")

AXIS = str(EXAMPLES / "drives" / "linuxcnc_torque_axis.ini")
ANSWERS = ("force_per_output=10 N", "masses.stage=3 kg", "friction.model=none", "motion.acceleration=1 m/s^2",
           "motion.acceleration_time=30 ms")  # fmt: skip
"""Answers that the parameter file does not contain."""

LOG = "time [s],position [m],force [N]\n" + "".join(f"{k / 1000},{(k % 50) * 1e-6},{k % 7}\n" for k in range(200))


def folder_until_the_end(name: str) -> Path:
    """Make a folder that is removed with this process; remove folders of killed processes."""
    held = ExitStack()
    folder = held.enter_context(temporary_folder("friso-undisturbed-")) / name
    Finalize(None, held.close, exitpriority=1)  # processes of a pool end without what atexit knows
    folder.mkdir()
    return folder


@contextmanager
def ready(folder: Path) -> Iterator[None]:
    """Work in a folder with a log and folders in it, within the block."""
    (folder / "log.csv").write_text(LOG)
    for name in ("folder", "folder.nc"):
        (folder / name).mkdir()
        (folder / name / "of_others.txt").write_text("of others")
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
