"""Experiments of the rig by name, as `friso rig` takes them.

Each is one file, which declares how it is run.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from friso.registry import Registry

if TYPE_CHECKING:  # the names are asked for by --help
    from friso.progress import Progress
    from friso.stage import Stage
    from friso.studies.rig.outcome import Outcome

RIG_EXPERIMENTS: Registry[Callable[[Stage, int, Progress], Outcome]] = Registry(
    "friso.studies.rig.experiments", "run_experiment", "friso.rig_experiments"
)
"""All experiments of the rig. Every module of this folder, and every module named by an installed package, declares the
function that runs its experiment on a stage with a seed."""
