"""Run cells with the real drive, on the shaking floor of their stage file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from friso.engine.arrays import Results
from friso.engine.batch import Runs, part_of
from friso.engine.kernel import empty_results
from friso.engine.simulate import usual_interval
from friso.hunting.measures import Measures
from friso.stage import Stage
from friso.stage.rig import is_as_built
from friso.studies.metric import metrics
from friso.virtual_rig.response import measured_recording
from friso.virtual_rig.run import run_flat, with_complete_drive
from friso.virtual_rig.task import motion_task

TIMING = tuple(
    f"drive.{name}"
    for name in ("sample_time", "delay", "velocity_samples", "velocity_sample_time", "position_sample_time")
)
"""Keys that change a drive's equations through whole numbers of samples."""


def runs_as_built(stage: Stage, names: Sequence[str]) -> bool:
    """Tell whether cells run with the real drive: if only metrics of runs are requested.

    `names` are the metrics. Verdicts, and the runs that they need, are those of the ideal machine.
    """
    return is_as_built(stage) and of_runs_alone(names)


def of_runs_alone(names: Sequence[str]) -> bool:
    """Tell whether all metrics in `names` are computed from runs; other names do not count."""
    every = metrics()
    return all(every[name].source == "run" for name in names if name in every)


def built_runs(
    stage: Stage, flat: Mapping[str, Any], count: int, threads: int | None, cancel: np.ndarray | None
) -> Iterator[tuple[Runs, Measures]]:
    """Run cells of one structure with their real drive, and yield runs and their measures.

    `flat` has keys such as "friction.static", with SI numbers or arrays (count,). All cells have the same noise. The
    runs hold only statistics and statuses: turning points come from the drive's samples, and are in the measures. Once
    `cancel` is set, no further chunk begins.
    """
    timing = [np.broadcast_to(flat[key], (count,)) for key in TIMING if key in flat]
    kinds, which = np.unique(np.stack([np.zeros(count), *timing]), axis=1, return_inverse=True)
    for kind in range(kinds.shape[1]):
        numbers = np.flatnonzero(which.ravel() == kind)
        part = part_of(flat, numbers)
        part = with_complete_drive(part | {key: float(np.ravel(part[key])[0]) for key in TIMING if key in part})
        task = motion_task(part, len(numbers))
        interval = max(1, round(usual_interval(task.duration) / part["drive.sample_time"])) * part["drive.sample_time"]
        for recorded in run_flat(part, stage.floor, task, [0] * len(numbers), interval, threads):
            if cancel is not None and cancel[0]:
                return
            results: Results = empty_results(len(recorded.numbers), 0, 0, 0)
            results = results._replace(statuses=recorded.statuses, statistics=recorded.statistics)
            yield (
                Runs(numbers[recorded.numbers], results),
                measured_recording(part_of(part, recorded.numbers), recorded),
            )
