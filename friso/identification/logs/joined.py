"""Join several logs of one event each into one log with gaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.identification.logs.log import Log
from friso.identification.logs.settings import settings


def joinable(one: Log, other: Log) -> bool:
    """Tell whether two logs have the same roles in the same units, sample time and set-up."""
    same = one.signals.keys() == other.signals.keys() and dict(one.units) == dict(other.units)
    same = same and dict(one.setup) == dict(other.setup) and one.axis == other.axis
    return same and abs(one.sample_time / other.sample_time - 1) <= settings.sample_time_tolerance


def join_logs(logs: Sequence[Log]) -> Log:
    """Join `joinable` logs, each beginning a second after the end of the previous one."""
    first = logs[0]
    times, segments, start, end = [], [], 0, 0.0
    for log in logs:
        times.append(log.time - log.time[0] + end)
        segments += [slice(part.start + start, part.stop + start) for part in log.segments]
        start += log.time.size
        end = float(times[-1][-1]) + 1.0
    return Log(
        ", ".join(log.name for log in logs),
        np.concatenate(times),
        first.sample_time,
        {role: np.concatenate([log[role] for log in logs]) for role in first.signals},
        tuple(segments),
        first.units,
        first.scalars,
        tuple(dict.fromkeys(line for log in logs for line in log.read)),
        tuple(dict.fromkeys(line for log in logs for line in log.warnings)),
        first.setup,
        first.axis,
        np.concatenate([log.measured(slice(0, log.time.size)) == 0 for log in logs]),
        is_integrated=any(log.is_integrated for log in logs),
    )


def join_alike(logs: Sequence[Log]) -> list[Log]:
    """Join logs that are joinable, and return the others as they are."""
    groups: list[list[Log]] = []
    for log in logs:
        alike = next((group for group in groups if joinable(group[0], log)), None)
        if alike is None:
            groups.append([log])
        else:
            alike.append(log)
    return [group[0] if len(group) == 1 else join_logs(group) for group in groups]
