"""`friso rig`: the virtual test rig: an experiment on the drive as built, its logs, the truth behind them, a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Choices, Command
from friso.cli.common import AsJson, Overrides, StageFile, print_wrapped, say, with_overrides
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.studies.rig.outcome import Outcome

Experiment = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="See the list below.",
    ),
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the noise; the rail has its own, rail.seed.")
]

MOST_SEED = 10**15

MANY = 4
"""Samples from which a delay is worth a word."""


def rig(
    experiment: Experiment,
    stage_file: StageFile,
    overrides: Overrides = None,
    seed: Seed = 1,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Rehearse an experiment on the machine as built: sampled, quantised, saturated, on a rail that varies.

    Writes logs for friso identify and, in a separate folder, the true signals behind each.

    Example: friso rig stiffness examples/thesis_drive.toml --out rig
    """
    from friso.studies.rig.experiments import RIG_EXPERIMENTS

    run = RIG_EXPERIMENTS[RIG_EXPERIMENTS.checked(experiment, "EXPERIMENT", "friso rig {} rig.toml")]
    stage = with_overrides(load(stage_file), overrides)
    _announce(stage)
    if not 0 <= seed < MOST_SEED:
        raise InputError("--seed", str(seed), f"a whole number from 0, below {MOST_SEED:g}", "--seed 1")
    target = output_folder("rig", out, overwrite, [stage_file])
    if target is not None:
        target.check(["truth/stage.toml"])
    files = []
    with ProgressBar() as progress:
        outcome = run(stage, seed, progress)
        if target is not None:
            from friso.views.rig.page import rig_files

            files = target.write(rig_files(outcome), progress)
    if as_json:
        from friso.views.rig.document import rig_document

        print_document(rig_document(outcome), files)
    else:
        _print(outcome, files)
    if failed := [log.name for log in outcome.logs if log.failure]:
        say(f"{len(failed)} of {len(outcome.logs)} logs end where the run stopped")
        raise typer.Exit(1)


def _announce(stage: Stage) -> None:
    """What to know of the drive before it runs."""
    from friso.equations.as_built import whole_samples
    from friso.virtual_rig.run import SAMPLE_TIME, as_built_keys

    if stage.drive is None or stage.drive.sample_time is None:
        say(f"drive.sample_time is not given: {SAMPLE_TIME * 1e6:g} us, as in the thesis")
    samples = whole_samples(as_built_keys(stage))
    if samples >= MANY:
        say(f"drive.delay is {samples} samples: the force acts that much later than the reading it is computed from")
    if keys := [*stage.uncertain()]:
        say(f"uncertain keys ({', '.join(keys[:3])}{', ...' if len(keys) > 3 else ''}) are set to their centres")


def _print(outcome: Outcome, files: Sequence[Path]) -> None:
    from friso.views.rig.page import sentences

    for sentence in sentences(outcome):
        print_wrapped(sentence)
    print(f"seed of the noise: {outcome.seed}")
    for note in outcome.notes:
        print_wrapped(f"note: {note}")
    print_written(files)


def listed_experiments() -> list[tuple[str, str]]:
    """The experiments of the rig, each in one line."""
    from friso.studies.rig.experiments import RIG_EXPERIMENTS

    return [(name, RIG_EXPERIMENTS.one_line(name)) for name in RIG_EXPERIMENTS]


COMMAND = Command(rig, 110, Choices("Experiments", listed_experiments))
