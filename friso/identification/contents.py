"""Describe the contents of a log file: channels, proposed roles with reasons, and open questions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from friso.errors import LogError
from friso.identification.kinds import KINDS
from friso.identification.logs.assemble import read_log
from friso.identification.logs.channel import Channel
from friso.identification.logs.format import FORMATS
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.mapping import Mapping, load_mapping
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.read import ReadFile, file_format, glance, is_frequency_response, read_frequency_response
from friso.identification.logs.roles import AssignedRole, Proposal, propose, role_of
from friso.identification.logs.signals import Notes, Reading, instants, with_user_units
from friso.identification.logs.time_base import usual_step
from friso.identification.settings import identification_settings
from friso.identification.sources import named


@dataclass(frozen=True)
class ChannelContent:
    """A channel of a log file, with the role, such as position, that friso proposes for it.

    `values`, shape (n,), are in the `unit` ("" for none). `time`, shape (n,), has their instants [s], or is None.
    `role` is "" if none is proposed; `reason` says why a role is proposed, or how many channels compete for it.
    `growth` is None, or how many times larger the file is than the sample of it that the values are.
    """

    name: str
    unit: str
    values: np.ndarray
    time: np.ndarray | None
    role: str
    reason: str
    growth: float | None = None

    @property
    def count(self) -> int:
        """Return the number of samples, to three digits if it is estimated from a part of the file."""
        return self.values.size if self.growth is None else int(float(f"{self.growth * self.values.size:.3g}"))

    @property
    def duration(self) -> float | None:
        """Return the time from the first to the last sample [s]; None without instants.

        Of a sample it follows from number and rate, unless its instants, which may be those of the file, reach further.
        """
        if self.time is None or not self.time.size:
            return None
        span, rate = float(self.time[-1] - self.time[0]), self.sample_rate
        return span if self.growth is None or not rate else max(span, self.count / rate)

    @property
    def range(self) -> tuple[float, float] | None:
        """Return the least and the greatest finite value; None if there is none."""
        finite = self.values[np.isfinite(self.values)]
        return (float(finite.min()), float(finite.max())) if finite.size else None

    @property
    def missing(self) -> int:
        """Return the number of samples that are NaN."""
        return int(np.count_nonzero(~np.isfinite(self.values)))

    @property
    def sample_rate(self) -> float | None:
        """Return the usual rate of finite samples [Hz]; None if the instants are not known or never increase."""
        steps = np.diff(self.time[np.isfinite(self.values)]) if self.time is not None else np.empty(0)
        steps = steps[steps > 0]
        return 1 / usual_step(steps) if steps.size else None

    def course(self) -> np.ndarray:
        """Return the means of successive parts of the channel, for a small plot, shape (parts,).

        The mean of a part without finite values is NaN.
        """
        parts = np.array_split(self.values, min(identification_settings.bins_of_a_small_plot, max(self.values.size, 1)))
        finite = [part[np.isfinite(part)] for part in parts]
        # divided first, because the sum of huge values is infinite
        return np.array([(part / part.size).sum() if part.size else np.nan for part in finite])


@dataclass(frozen=True)
class LogContent:
    """Contents of a log file, before anything is identified.

    Fields are the title of the file's format, its channels or frequency response, and the kind of experiment with the
    reason for it ("" if open). `read` has lines on how the file was read. `gaps` lists what the user must state before
    identification, and `options` has the options used for reading. `sampled` says which part of a large file was read.
    """

    path: Path
    title: str
    channels: tuple[ChannelContent, ...]
    response: MeasuredResponse | None
    kind: str
    reason: str
    read: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    gaps: tuple[LogError, ...] = ()
    options: tuple[str, ...] = ()
    sampled: str = ""

    @property
    def lost(self) -> tuple[str, ...]:
        """Return the lines of `read` that tell of parts left out or missing, and of contradictions."""
        return tuple(
            line for line in self.read if line.startswith(("left out", "contradiction")) or " ends early: " in line
        )


def log_content(path: Path, options: Mapping, folder: Path | None = None) -> LogContent:
    """Describe the contents of a log file, before anything is identified.

    The `options`, or a mapping stored beside the file or in `folder`, say which channel is what. Raises LogError for a
    file that cannot be read.
    """
    name = file_format(path)
    title = FORMATS[name].title
    if is_frequency_response(path):
        response = read_frequency_response(path)
        kind = next(kind for kind in KINDS if KINDS[kind].responses)
        return LogContent(path, title, (), response, kind, "the file holds a frequency response", response.read)
    mapping = options.over(load_mapping(path, folder) or Mapping())
    file = glance(path)
    table = with_user_units(file.table, mapping, file.form.times, str(path))
    reading = Reading(table, mapping, False, not file.form.units, str(path))
    if not table.channels:
        raise LogError("", "no channel of numbers", "a log with columns of numbers", "", str(path))
    proposal = propose(table, mapping.roles, str(path))
    channels = tuple(_content(channel, proposal, reading, file.growth) for channel in table.channels)
    content = LogContent(path, title, channels, None, "", "", table.read, options=options.options, sampled=file.sampled)
    begun = file.beginning()
    try:
        source, kind, reason = named(begun, mapping)
    except LogError as error:
        gaps = error.gaps if isinstance(error, GapsError) else (error,)
        return replace(content, warnings=_warnings(begun, mapping), gaps=gaps)
    return replace(content, kind=kind, reason=reason, read=source.read, warnings=getattr(source, "warnings", ()))


def _warnings(file: ReadFile, mapping: Mapping) -> tuple[str, ...]:
    """Return the warnings about a log whose kind of experiment is open; none if something else is open, too."""
    try:
        return read_log(file, mapping, strict=False).warnings
    except LogError:
        return ()


def _content(channel: Channel, proposal: Proposal, reading: Reading, growth: float | None) -> ChannelContent:
    """Describe a channel, with its instants and the role that the proposal gives it."""
    role, reason = "", ""
    for choice in proposal.chosen.values():
        if choice.channel is channel:
            role, reason = choice.role, choice.reason
    for name, rivals in proposal.rivals.items():
        if any(rival is channel for rival in rivals):
            reason = f"one of {len(rivals)} that could be the {name.replace('_', ' ')}"
    meaning = role_of(channel.name)
    if not (role or reason) and meaning and meaning[0] == "time" and channel.unit and not reading.mapping.sample_time:
        role, reason = "time", f'the name says "{meaning[1]}"'
    return ChannelContent(
        channel.name, channel.unit, channel.values, _time(channel, proposal, reading), role, reason, growth
    )


def _time(channel: Channel, proposal: Proposal, reading: Reading) -> np.ndarray | None:
    """Return the instants of a channel's samples [s]; None if neither file nor mapping has any."""
    clock = proposal.chosen.get("time")
    try:
        return instants(AssignedRole("", channel, "", False), clock, reading, Notes())
    except LogError:
        return None
