"""Of a log that is longer than an analysis needs, the part that moves most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.identification.logs.log import Log


def excerpt(log: Log, count: int) -> Log:
    """At most so many samples of the longest stretch without gaps: those in which the position goes the longest way.
    The whole log where that stretch is no longer."""
    part = log.longest
    if part.stop - part.start <= count:
        return log
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(log["position"][part])))])
    first = part.start + int(np.argmax(travel[count - 1 :] - travel[: len(travel) - count + 1]))
    chosen = slice(first, first + count)
    signals = {role: values[chosen] for role, values in log.signals.items()}
    return replace(log, time=log.time[chosen], signals=signals, segments=(slice(0, count),))
