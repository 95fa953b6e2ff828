"""Read the given files of logs as sources of experiments, and describe what they hold.

A source has its contents, its mapping, and its kind of experiment. A description lists channels, proposed roles with
reasons, and open questions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from friso.axis import AxisKind
from friso.errors import InputError, LogError
from friso.identification.kind import Source
from friso.identification.kinds import KINDS
from friso.identification.logs.assemble import read_log
from friso.identification.logs.gaps import GapsError
from friso.identification.logs.log import Channel, Log
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.merge import merged
from friso.identification.logs.read import (
    FORMATS,
    ReadFile,
    file_format,
    glance,
    is_frequency_response,
    read_file,
    read_frequency_response,
)
from friso.identification.logs.roles import (
    SUFFIX,
    AssignedRole,
    Mapping,
    Proposal,
    find,
    load_mapping,
    place_for,
    propose,
    role_of,
    sidecar,
)
from friso.identification.logs.signals import Notes, Reading, instants, with_user_units
from friso.identification.logs.time_base import usual_step
from friso.identification.readings.course import Course

MOVED = ("position", "force")
"""Roles of channels from which the kind of experiment is recognised."""


@dataclass(frozen=True)
class LogFile:
    """A log file: its content, its kind of experiment, and the reason for that kind.

    `mapping` tells how the log was read, and `mapping_file` is the file that stores it (None: not stored). `earlier` is
    the part of the mapping read from this file, `replaced` the part that the user overrode.
    """

    path: Path
    source: Source
    kind: str
    reason: str
    mapping: Mapping = Mapping()  # noqa: RUF009 (frozen)
    mapping_file: Path | None = None
    earlier: Mapping = Mapping()  # noqa: RUF009 (frozen)
    replaced: str = ""

    @property
    def reused(self) -> str:
        """Return a sentence on reused and replaced parts of a stored mapping; "" for none."""
        words, place = self.earlier.words, self.mapping_file or sidecar(self.path)
        parts = [f"read as kept in {place.name}: {words}"] if words else []
        parts += [f"in place of {self.replaced}, as kept"] if self.replaced else []
        return f"{self.path.name}: {'; '.join(parts)}" if parts else ""


class OpenQuestions(GapsError):
    """Error that lists what the user must still state about several logs."""


def read_all(paths: Sequence[Path], options: Mapping, folder: Path) -> list[LogFile]:
    """Read log files; the options or stored mappings say which channel is what.

    Mappings are stored beside a file or in `folder`. Raises OpenQuestions for everything that is missing, InputError
    for unreadable files.
    """
    files, wrong = read_usable(paths, options, folder)
    if wrong:
        raise wrong[0]
    return files


def read_usable(
    paths: Sequence[Path], options: Mapping, folder: Path, others: Sequence[Path] = ()
) -> tuple[list[LogFile], list[InputError]]:
    """Read the files, and leave out unusable ones as long as one can be used.

    Returns the files and the errors of those left out. Each file, including `others` read besides, uses the options
    about its own channels only. Raises OpenQuestions for everything that is missing, and InputError if no file can be
    used.
    """
    if options.experiment is not None:
        KINDS.checked(options.experiment, "--as", "--as {}")
    files: list[LogFile] = []
    gaps: dict[tuple[str, ...], list[GapsError]] = {}
    wrong: list[InputError] = []
    read = cache(read_file)  # of one call: the next one finds a file that has changed
    holders = _holders(options, [*paths, *others], read) if len(paths) + len(others) > 1 else {}
    for number, path in enumerate(paths):
        mapping = options if is_frequency_response(path) else _applicable(options, number, holders)
        try:
            file = _read(path, mapping, folder, read)
            files.append(replace(file, mapping_file=kept_at(path, file.mapping, folder)))
        except GapsError as error:
            first, *more = error.gaps
            alike = tuple(channel.name for channel in read(path).table.channels)
            gaps.setdefault(alike, []).append(GapsError([_mentioning_kept(first, path, mapping, folder), *more]))
        except InputError as error:
            wrong.append(_mentioning_kept(error, path, mapping, folder))
    if gaps:
        raise OpenQuestions([gap for alike in gaps.values() for gap in _asked_once(alike)])
    if wrong and not files:
        raise wrong[0]
    return _recognised_together(files), wrong


def read_merged(paths: Sequence[Path], options: Mapping, folder: Path) -> LogFile:
    """Read two files of one run, recorded by two clocks, as one log.

    Raises InputError for another number of files, for files that cannot be aligned, and for everything that is missing.
    """
    if len(paths) != 2 or any(is_frequency_response(path) for path in paths):
        actual = f"{len(paths)} log{'s' * (len(paths) != 1)}" if len(paths) != 2 else "a frequency response"
        raise InputError("--merge", actual, "two logs of one run", "friso identify drive.csv daq.csv --merge")
    for path in reversed(paths):
        options = options.over(load_mapping(path, folder) or Mapping())
    file = merged(read_file(paths[0]), read_file(paths[1]), options)
    log, kind, reason = named(file, replace(options, sample_time=None))
    clocks = file.table.read[0]
    return LogFile(paths[0], replace(log, warnings=(clocks, *log.warnings)), kind, reason, options)


def named(file: ReadFile, mapping: Mapping) -> tuple[Log, str, str]:
    """Read a log; return it, its kind of experiment, stated or recognised, and the reason."""
    if mapping.experiment is None:
        return unnamed(file, mapping)
    KINDS.checked(mapping.experiment, "--as", "--as {}")
    return log_with_signals(file, mapping, mapping.experiment), mapping.experiment, "as specified"


def _mentioning_kept(error: InputError, path: Path, options: Mapping, folder: Path) -> LogError:
    """Return an error about a log with the hint that its stored mapping may be the cause."""
    try:
        kept = "" if is_frequency_response(path) else (load_mapping(path, folder) or Mapping()).beside(options).words
    except InputError:
        kept = ""  # the error itself says so
    actual = f"{error.actual} (read as kept in {sidecar(path).name}: {kept}; options override it)"
    return LogError(error.key, actual if kept else error.actual, error.expected, error.example, error.origin)


def _asked_once(alike: Sequence[GapsError]) -> list[LogError]:
    """Merge open questions about logs with equal channels; the most frequent suggestions count.

    A log with little motion may suggest other channels than the rest, but options hold for all logs.
    """
    votes = Counter(tuple(text for text in error.options if text.startswith("--map")) for error in alike)
    maps = votes.most_common(1)[0][0]
    agreed = [error for error in alike if {*maps} <= {*error.options}]
    options = Counter(error.options for error in agreed).most_common(1)[0][0]
    chosen = next(error for error in agreed if error.options == options)
    if len(alike) == 1:
        return [*chosen.gaps]
    more = f" and {len(alike) - 1} more with the same channels"
    return [LogError(gap.key, gap.actual, gap.expected, gap.example, f"{gap.origin}{more}") for gap in chosen.gaps]


def _recognised_together(files: list[LogFile]) -> list[LogFile]:
    """Set the kind of experiment of files without a stated one, if they are recognised together.

    If no kind recognises them as one experiment, the files are returned unchanged.
    """
    kindless = [
        number
        for number, file in enumerate(files)
        if file.mapping.experiment is None and not (isinstance(file.source, Log) and file.source.is_uneven)
    ]
    courses = [Course(source) for number in kindless if isinstance(source := files[number].source, Log)]
    for name in KINDS if len(courses) > 1 else ():
        if (reason := KINDS[name].claims_together(courses)) is not None:
            return [
                replace(file, kind=name, reason=reason) if number in kindless and isinstance(file.source, Log) else file
                for number, file in enumerate(files)
            ]
    return files


def per_unit_of_force(file: LogFile, beside: AxisKind | None) -> LogFile:
    """Keep a force in its logged unit, such as volts, for kinds analysed per unit of force.

    `beside` is the axis of a given stage file, or None. Files of other kinds, or with a force in newtons, are returned
    unchanged. Raises InputError for a force in another unit beside a stage file, whose numbers are in newtons.
    """
    unit = file.source.units.get("force") if isinstance(file.source, Log) else None
    if unit is None or not KINDS[file.kind].per_unit or not isinstance(file.source, Log):
        return file
    if beside is not None:
        expected, example = f"its factor to {beside.force}", f'--scale force="NUMBER {beside.force}/{unit}"'
        raise InputError("force", f"a channel in {unit}, beside a stage", expected, example, str(file.path))
    return replace(file, source=file.source.per_unit_of_force())


def _holders(options: Mapping, paths: Sequence[Path], read: Callable[[Path], ReadFile]) -> dict[str, list[bool]]:
    """Tell for each channel in the options which of the files have it."""
    return {name: [_has(path, name, read) for path in paths] for name in {*options.roles.values(), *options.units}}


def _applicable(options: Mapping, place: int, holders: dict[str, list[bool]]) -> Mapping:
    """Return the options that apply to file number `place`: those about channels that it has.

    `holders` tells, by channel, which files have it. Options about channels that no file has are kept, and raise an
    error when the file is read.
    """
    lacking = {name for name, held in holders.items() if any(held) and not held[place]}
    if not lacking:
        return options
    roles = {role: name for role, name in options.roles.items() if name not in lacking}
    units = {name: unit for name, unit in options.units.items() if name not in lacking}
    scales = {k: v for k, v in options.scales.items() if k in roles or k not in options.roles}
    return replace(options, roles=roles, units=units, scales=scales)


def _has(path: Path, name: str, read: Callable[[Path], ReadFile]) -> bool:
    """Tell whether a file has a channel of this name."""
    if is_frequency_response(path):
        return False
    try:
        find(read(path).table, name, "")
    except InputError:
        return False
    return True


def _read(path: Path, options: Mapping, folder: Path, read: Callable[[Path], ReadFile]) -> LogFile:
    """Read a file, mapped by the options and, beyond them, by its stored mapping."""
    if is_frequency_response(path):
        kind = next(name for name in KINDS if KINDS[name].responses)
        return LogFile(path, read_frequency_response(path), kind, "the file holds a frequency response")
    stored = load_mapping(path, folder) or Mapping()
    if stored.experiment is not None:
        KINDS.checked(stored.experiment, f"{path}{SUFFIX}: experiment", 'experiment = "{}"')
    mapping = options.over(stored)
    said = {"earlier": stored.beside(options), "replaced": stored.replaced_by(options)}
    before = (
        ""
        if None in (mapping.experiment, stored.experiment) or stored.experiment == mapping.experiment
        else f", in place of {stored.experiment} as kept"
    )
    log, kind, reason = named(read(path), mapping)
    return LogFile(path, log, kind, f"{reason}{before}", mapping, **said)


def unnamed(file: ReadFile, mapping: Mapping) -> tuple[Log, str, str]:
    """Read a log whose kind of experiment is not stated; return it, its kind, and the reason.

    Raises GapsError for everything that is missing, including units that most kinds need.
    """
    gaps: list[LogError] = []
    kind = reason = ""
    try:
        log = read_log(file, mapping, strict=False, needed=MOVED, stamped=True)
        log = log if "force" in log or not log.is_uneven else read_log(file, mapping, strict=False, needed=MOVED)
    except GapsError as error:
        gaps += error.gaps
        log = _without_clock(file, replace(mapping, roles={**mapping.roles, **error.proposed}))
    try:
        kind, reason = recognised(log, file.path) if log is not None else ("", "")
    except LogError as error:
        gaps.append(error)
    if not (kind and not KINDS[kind].si):
        try:
            log = log_with_signals(file, mapping, kind) if kind else read_log(file, mapping, needed=MOVED)
        except GapsError as error:
            gaps += [gap for gap in error.gaps if gap.example not in [other.example for other in gaps]]
    if gaps or log is None:
        raise GapsError(gaps)
    return log, kind, reason


def _without_clock(file: ReadFile, mapping: Mapping) -> Log | None:
    """Read a log without known instants as if sampled every second; None if impossible.

    The motion of this log then shows the kind of experiment.
    """
    try:
        return read_log(file, replace(mapping, sample_time=1.0), strict=False, needed=MOVED)
    except LogError:
        return None


def kept_at(path: Path, mapping: Mapping, folder: Path) -> Path | None:
    """Return the file of a log's mapping, beside it or in `folder`; None without one."""
    return None if mapping == Mapping() else place_for(path, folder)


def log_with_signals(file: ReadFile, mapping: Mapping, kind: str) -> Log:
    """Read a log with the signals that a kind of experiment needs, in the units that it needs."""
    chosen = KINDS[kind]
    return read_log(file, mapping, chosen.si, chosen.needed(mapping.roles), chosen.foreign, chosen.stamped)


def recognised(log: Log, path: Path) -> tuple[str, str]:
    """Recognise the kind of experiment of a log, and return it with the reason.

    Raises InputError if no kind claims it, or several do.
    """
    course = Course(log)
    kinds = [name for name in KINDS if KINDS[name].stamped == log.is_uneven]
    reasons = {name: reason for name in kinds if (reason := KINDS[name].claims(course)) is not None}
    replaced = {other for name in reasons for other in KINDS[name].instead_of}
    reasons = {name: reason for name, reason in reasons.items() if name not in replaced}
    if len(reasons) == 1:
        return next(iter(reasons.items()))
    names = sorted(reasons or KINDS, key=lambda name: not KINDS[name].makes_stage)
    expected = f"the kind of experiment: {', '.join(names)}"
    likely = "standstill" if course.rests and not reasons else names[0]
    raise LogError("--as", course.words, expected, f"--as {likely}", str(path))


BINS_OF_A_SMALL_PLOT = 24
"""Number of parts of a channel whose means make its small plot."""


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
        parts = np.array_split(self.values, min(BINS_OF_A_SMALL_PLOT, max(self.values.size, 1)))
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
