"""`friso rig`: the virtual test rig: an experiment on the drive as built, its logs, the truth behind them, a figure."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import MACHINE, Choices, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite

ExperimentArgument = Annotated[str, typer.Argument(metavar="EXPERIMENT", help="See the list below.")]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the noise; the rail has its own, rail.seed.")
]


def rig(
    experiment: ExperimentArgument,
    stage_file: StageFile,
    overrides: Overrides = None,
    seed: SeedOption = 1,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Rehearse an experiment on the machine as built: sampled, quantised, saturated, on a rail that varies.

    Writes logs for friso identify and, in a separate folder, the true signals behind each.

    Example: friso rig stiffness examples/thesis_drive.toml --out rig
    """
    from friso.questions.rig.question import rig as question

    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("rig", question, experiment, stage_file, set=overrides, seed=seed, **shown, writes=["truth/stage.toml"])


def listed_experiments() -> list[tuple[str, str]]:
    """The experiments of the rig, each in one line."""
    from friso.studies.rig.experiments import RIG_EXPERIMENTS

    return [(name, RIG_EXPERIMENTS.one_line(name)) for name in RIG_EXPERIMENTS]


COMMAND = Command(rig, 110, MACHINE, Choices("Experiments", listed_experiments))
