"""Stages whose controllers leave friso in tests: five controllers on three machines."""

from pathlib import Path

from book import CONTROLLERS as CONTROLLERS

import friso
from friso.stage import Stage

EXAMPLES = Path(__file__).parents[1] / "examples"


MACHINES = {"rigid_lugre": "lugre_stick_slip", "isolator": "thesis_rig", "gms": "thesis_rig_gms"}


def stage_of(controller: str, machine: str) -> Stage:
    """Return a stage of these two, with the move of the thesis."""
    stage = friso.load(EXAMPLES / f"{MACHINES[machine]}.toml")
    motion = friso.load(EXAMPLES / "thesis_rig.toml").as_written()["motion"]
    tables = {**stage.as_written(), "motion": motion, **CONTROLLERS[controller]}
    return Stage(**tables)
