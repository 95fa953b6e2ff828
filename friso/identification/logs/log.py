"""Define the channels that a reader returns, and the log that an analysis takes.

A channel has its own time. A reader returns channels and single numbers. A log has measured signals by role, in SI
units, on one even time base.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friso.axis import LINEAR, AxisKind
from friso.errors import one_line


@dataclass(frozen=True)
class Channel:
    """A channel of a file: its values, (n,), as stored, and its unit ("" for none).

    `time` has the instants in seconds, shape (n,), or None if the file has no time; `source` is the place in the file
    ("column 3", "exp1.Y(2)"). Texts are one line each, escaped, because messages and tables show them.
    """

    name: str
    unit: str
    values: np.ndarray
    time: np.ndarray | None
    source: str

    def __post_init__(self) -> None:
        """Escape the texts of the channel."""
        for name in ("name", "unit", "source"):
            object.__setattr__(self, name, one_line(getattr(self, name)))


@dataclass(frozen=True)
class ChannelTable:
    """The channels of a file, under unique names (`unique`).

    `scalars` are single numbers of the file by name, and `read` has lines on how the file was read (format, delimiter,
    decimal sign, rows left out and why). `interval` is the sampling interval [s] that the file states above its
    columns, or None. `warnings` say which of its values are none.
    """

    channels: tuple[Channel, ...]
    scalars: Mapping[str, float] = field(default_factory=dict)
    read: tuple[str, ...] = ()
    interval: float | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make the names unique, and escape the texts."""
        names = unique([channel.name for channel in self.channels])
        channels = tuple(replace(c, name=name) for c, name in zip(self.channels, names, strict=True))
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "scalars", {one_line(name): value for name, value in self.scalars.items()})
        for name in ("read", "warnings"):
            object.__setattr__(self, name, tuple(map(one_line, getattr(self, name))))


def unique(names: Sequence[str]) -> list[str]:
    """Return names with numbers appended to repeated ones; empty names stay."""
    taken, counts, out = {*names}, Counter[str](), []
    for name in names:
        counts[name] += 1
        numbered = name
        if counts[name] > 1 and name:
            while (numbered := f"{name} #{counts[name]}") in taken:
                counts[name] += 1
            taken.add(numbered)
        out.append(numbered)
    return out


ROLES: Mapping[str, str] = {
    "reference": "m",
    "position": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "force": "N",
    "disturbance": "N",
    "cart_position": "m",
    "relative_position": "m",
}
"""Roles of channels, with the SI unit of each on a linear axis. `position` and `velocity` are the stage's (the
controlled body), `cart_position` is the cart's; `relative_position` is position minus cart position; `force` is the
actuator's, from a current or a voltage by a scale, including any `disturbance` that is added to the controller's
output."""


@dataclass(frozen=True)
class Log:
    """Measured signals by role (see `ROLES`): SI values at `time` [s], all of shape (n,).

    On a rotary `axis` angles replace lengths and torques replace forces, under the units of a linear axis. Samples are
    `sample_time` [s] apart within each of the `segments`, which are separated by gaps. `units` has the unit of each
    role whose channel could not be converted to SI (a force in volts without a scale).

    `scalars` are single numbers from the file, by name. `read` lists what was read and how, `warnings` what the
    engineer should know before trusting it. `setup` are keys of the stage file that had other values for this log
    ({"joint.stroke": "8 mm"}). `bridged`, shape (n,), marks lost samples that are interpolated; None without any.
    `is_excerpt` marks a part of a longer log, `is_integrated` a log whose position is the integral of its velocity. A
    log that `is_uneven` has the instants of the file, and `sample_time` is the usual step. Where samples were
    interpolated onto even instants because their time stamps scatter, `as_even` is the log with the samples as they
    are, taken as even.
    """

    name: str
    time: np.ndarray
    sample_time: float
    signals: Mapping[str, np.ndarray]
    segments: tuple[slice, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
    read: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    setup: Mapping[str, str] = field(default_factory=dict)
    axis: AxisKind = LINEAR
    bridged: np.ndarray | None = None
    is_excerpt: bool = False
    is_integrated: bool = False
    is_uneven: bool = False
    as_even: Log | None = None

    def __contains__(self, role: str) -> bool:
        """Tell whether the log has a role."""
        return role in self.signals

    def __getitem__(self, role: str) -> np.ndarray:
        """Return the signal of a role."""
        return self.signals[role]

    @property
    def longest(self) -> slice:
        """Return the longest stretch without gaps."""
        return max(self.segments, key=lambda part: part.stop - part.start)

    def measured(self, part: slice) -> np.ndarray:
        """Return 1 at measured and 0 at lost samples of a stretch, shape (k,)."""
        return np.ones(part.stop - part.start) if self.bridged is None else 1.0 - self.bridged[part]

    def excerpt(self, count: int) -> Log:
        """Return the `count` samples with the longest travel, from the longest stretch without gaps.

        If the stretch has no more than `count` samples, the whole log is returned.
        """
        part = self.longest
        if part.stop - part.start <= count:
            return self
        travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self["position"][part])))])
        first = part.start + int(np.argmax(travel[count - 1 :] - travel[: len(travel) - count + 1]))
        chosen = slice(first, first + count)
        signals = {role: values[chosen] for role, values in self.signals.items()}
        bridged = None if self.bridged is None else self.bridged[chosen]
        part = (slice(0, count),)
        even = self.as_even and self.as_even.excerpt(count)
        cut = replace(self, time=self.time[chosen], signals=signals, segments=part, bridged=bridged, as_even=even)
        return replace(cut, is_excerpt=True)

    def per_unit_of_force(self) -> Log:
        """Return the log with its force in the logged unit (such as amperes), if that is no force."""
        unit = self.units.get("force")
        if unit is None:
            return self
        units = {role: text for role, text in self.units.items() if role != "force"}
        return replace(self, axis=self.axis.per(unit), units=units)

    def unit(self, role: str) -> str:
        """Return the unit of a role's signal: SI on a linear axis, unless it could not be converted."""
        return self.units.get(role, ROLES[role])


SAMPLE_TIME_TOLERANCE = 1e-3
"""Largest relative difference between the sample times of joined logs."""


def joinable(one: Log, other: Log) -> bool:
    """Tell whether two logs have the same roles in the same units, sample time and set-up."""
    same = one.signals.keys() == other.signals.keys() and dict(one.units) == dict(other.units)
    same = same and dict(one.setup) == dict(other.setup) and one.axis == other.axis
    return same and abs(one.sample_time / other.sample_time - 1) <= SAMPLE_TIME_TOLERANCE


def join_logs(logs: Sequence[Log]) -> Log:
    """Join `joinable` logs, each beginning a second after the end of the previous one."""
    first = logs[0]
    times, segments, start, end = [], [], 0, 0.0
    for log in logs:
        times.append(log.time - log.time[0] + end)
        segments += [slice(part.start + start, part.stop + start) for part in log.segments]
        start += log.time.size
        end = float(times[-1][-1]) + 1.0
    return replace(
        first,
        name=", ".join(log.name for log in logs),
        time=np.concatenate(times),
        signals={role: np.concatenate([log[role] for log in logs]) for role in first.signals},
        segments=tuple(segments),
        read=tuple(dict.fromkeys(line for log in logs for line in log.read)),
        warnings=tuple(dict.fromkeys(line for log in logs for line in log.warnings)),
        bridged=np.concatenate([log.measured(slice(0, log.time.size)) == 0 for log in logs]),
        is_excerpt=False,
        as_even=join_logs([log.as_even or log for log in logs]) if any(log.as_even for log in logs) else None,
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
