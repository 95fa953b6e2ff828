"""Rehearse an experiment on the machine as built, with its logs and the true signals behind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from friso.axis import speak_of
from friso.equations.as_built import whole_samples
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import LOGGER, Changes, ExperimentName, Seed, StageLike
from friso.platform.system import shell_word
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.virtual_rig.run import as_built_keys
from friso_thesis.studies.rig.experiments import RIG_EXPERIMENTS

if TYPE_CHECKING:
    from friso.shown.pages import Report

TRUTH = "truth"
"""Folder of the true signals behind the logs."""

LEAST_DELAY = 4
"""Smallest delay, in samples, that is mentioned."""


class RigAnswer(Answer):
    """An experiment on the machine as built; `result` is its `Outcome` with logs and their truth."""

    stage_file: str = ""

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that identifies the stage from the logs written."""
        folders = {file.parent for file in files if file.suffix == ".csv" and file.parent.name != TRUTH}
        logs = " ".join(f"{shell_word(str(folder))}/*.csv" for folder in sorted(folders))
        return [f"friso identify {logs} --stage {self.stage_file}"] if self.stage_file and logs else []

    @property
    def failure(self) -> str:
        """Say how many logs end early; empty if none does."""
        failed = sum(bool(log.failure) for log in self.result.logs)
        return f"{failed} of {len(self.result.logs)} logs end where the run stopped" if failed else ""

    def page(self) -> Report:
        """Return the page of the experiment."""
        return replace(super().page(), command=f"rig {self.result.experiment}")


@question
def rig(
    experiment: ExperimentName, stage: StageLike, *, seed: Seed = 1, set: Changes = None, progress: Progress = silent
) -> RigAnswer:
    """Rehearse an experiment on the machine as built: sampled, quantised, saturated, on a rail that varies.

    Writes logs for friso identify and, in a separate folder, the true signals behind each.

    Parameters
    ----------
    experiment : str
        Its name, such as "stiffness" or "hunting"; friso rig --help lists them.
    seed : int
        Seed of the noise; the rail has its own, `rail.seed`.

    Returns
    -------
    RigAnswer
        The outcome, ``answer.logs``; `report` writes logs that `identify` reads.

    Raises
    ------
    InputError
        For an experiment, a stage or a seed that is not usable.

    Examples
    --------
    >>> import friso
    >>> friso.rig("stiffness", friso.example("thesis_drive"))  # doctest: +SKIP
    """
    chosen_experiment = RIG_EXPERIMENTS[RIG_EXPERIMENTS.checked(experiment, "EXPERIMENT", "friso rig {} rig.toml")]
    chosen = inputs.stage_of(stage, set)
    speak_of(chosen.axis_kind)
    _announce(chosen)
    inputs.mention_unstable_loop(chosen)
    return RigAnswer(chosen_experiment.run(chosen, seed, progress), stage_file=inputs.file_of(stage, set))


def _announce(stage: Stage) -> None:
    """Warn before the run of assumptions about the drive and of uncertain keys."""
    if stage.drive is None or stage.drive.sample_time is None:
        inputs.mention_sampling(stage)
    samples = whole_samples(as_built_keys(stage))
    if samples >= LEAST_DELAY:
        LOGGER.warning(
            f"drive.delay is {samples} samples: the force acts that much later than the reading it is computed from"
        )
    if keys := [*stage.uncertain()]:
        names = f"{', '.join(keys[:3])}{', ...' if len(keys) > 3 else ''}"
        LOGGER.warning(f"uncertain keys ({names}) are set to their centres")
