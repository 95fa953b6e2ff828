"""Experiments of the rig by name, as `friso rig` takes them.

Each is one file, with a class that says how it is run and what its outcome means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.registry import Registry

if TYPE_CHECKING:  # the names are asked for by --help
    from friso.progress import Progress
    from friso.shown.drawing.figure import Figure
    from friso.stage import Stage
    from friso_thesis.studies.rig.outcome import Outcome


class RigExperiment:
    """An experiment of the rig, named by its module; its outcome is shown by its logs unless a subclass says more."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run the experiment on a stage. Raises InputError for a stage that it does not suit."""
        raise NotImplementedError

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say what the outcome means: by default, name the logs with their durations."""
        from friso.shown.text import with_unit

        logs = [f"{log.name}, {with_unit(len(log.log.time) * log.interval, 's')}" for log in outcome.logs]
        return [f"Logs of {outcome.experiment}: {'; '.join(logs)}."]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw the outcome: by default the signals of each log over time, one figure per log."""
        from friso.identification.kind import log_figure

        return [log_figure(log.log, [*log.logged], f"rig_{log.name}") for log in outcome.logs]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return the outcome for the JSON document; nothing by default."""
        return {}


RIG_EXPERIMENTS: Registry[RigExperiment] = Registry(
    "friso_thesis.studies.rig.experiments", "EXPERIMENT", "friso.rig_experiments", RigExperiment
)
"""All experiments of the rig. Every module of this folder, and every module named by an installed package, declares an
object of its class."""
