"""Outcome of an experiment of the rig: logs, the true motion behind each, and the analysis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.errors import InputError
from friso.identification.logs.log import Log
from friso.identification.readings.common import record
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.virtual_rig.run import RecordedRuns


@dataclass(frozen=True)
class RigLog:
    """A log as the drive writes it, with the true motion behind it.

    `kind` is the kind of experiment for `friso identify` (None: recognised from the log), and `interval` the sample
    time [s]. `logged` and `true` are SI arrays of shape (n,) by role, such as "position". Further fields are the stage
    that ran, the seed of its noise, and why the run ended early ("": it did not).
    """

    name: str
    kind: str | None
    interval: float
    logged: Mapping[str, np.ndarray]
    true: Mapping[str, np.ndarray]
    stage: Stage
    seed: int
    failure: str = ""

    @property
    def log(self) -> Log:
        """Return the log as `friso identify` reads it, without the true motion."""
        return record(self.name, self.interval, **self.logged)


@dataclass(frozen=True)
class Outcome:
    """Outcome of an experiment on a stage: logs, a result of its own class, and `notes`."""

    experiment: str
    stage: Stage
    seed: int
    logs: tuple[RigLog, ...]
    result: Any
    notes: tuple[str, ...] = ()


def rig_log(recorded: RecordedRuns, row: int, name: str, kind: str | None, stage: Stage, seed: int) -> RigLog:
    """Return one run of a chunk, in `row`, as a log up to a failure.

    The log also ends early if, from some time on, the command only swings between its limits. `kind` is the kind of
    experiment for `friso identify` (None: recognised from the log).
    """
    status = int(recorded.statuses[row])
    count = recorded.logged["position"].shape[1]
    if status != Status.DONE:
        count = int(np.isfinite(recorded.logged["position"][row]).sum())
    logged, true = (
        {role: np.array(values[row, :count]) for role, values in signals.items()}
        for signals in (recorded.logged, recorded.true)
    )
    why = "" if status == Status.DONE else Status(status).text
    if not why and (end := _swings_between_limits(recorded.logged["force"][row], stage)):
        count, why = end, "the command swings between its limits to the end: the sampled loop is unstable"
    logged, true = ({role: values[:count] for role, values in channels.items()} for channels in (logged, true))
    why = why and f"after {count * recorded.interval:.3g} s: {why}"
    return RigLog(name, kind, recorded.interval, logged, true, stage, seed, why)


def stopped(log: RigLog) -> InputError:
    """Return the error for a log that stopped before it shows anything."""
    return InputError("controller", f"a loop that stopped {log.failure}", "a stable one", 'crossover = "8 Hz"')


WINDOWS, SATURATED = 20, 0.1
"""Number of parts into which a log is divided to test stability, and a fraction of a part.

The command of an unstable loop spends at least this fraction of a part at its two limits.
"""


def _swings_between_limits(force: np.ndarray, stage: Stage) -> int:
    """Return the number of samples after which a command [N] only swings between its limits.

    `force` has the shape (n,). The result is 0 if the command does not end so, or has no limits.
    """
    limit = stage.flat().get(FORCE_LIMIT, np.inf)
    parts = np.array_split(force, WINDOWS)
    ways = [(np.mean(part >= 0.999 * limit), np.mean(part <= -0.999 * limit)) for part in parts]
    swings = np.array([min(sides) > 0 and sum(sides) > SATURATED for sides in ways])
    if not swings[-1]:
        return 0
    rests = np.flatnonzero(~swings)
    first = int(rests[-1]) + 1 if len(rests) else 0
    return sum(len(part) for part in parts[: first + 1])
