"""The files given: what each holds, how it is mapped, and which kind of experiment it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from friso.errors import InputError
from friso.identify.kind import Source
from friso.identify.kinds import KINDS
from friso.identify.logs.assemble import read_log
from friso.identify.logs.log import Log
from friso.identify.logs.mapping import SUFFIX, Mapping, load, place_for
from friso.identify.logs.read import is_frequency_response, read_frequency_response, read_table
from friso.identify.logs.roles import find
from friso.identify.readings.course import Course


@dataclass(frozen=True)
class LogFile:
    """A file with what it holds, its kind of experiment and why it counts as one, how it was mapped, and where that is
    kept (None: not yet, or nothing had to be said about it)."""

    path: Path
    source: Source
    kind: str
    reason: str
    mapping: Mapping = Mapping()  # noqa: RUF009 (frozen)
    mapping_file: Path | None = None


def read_all(paths: Sequence[Path], options: Mapping, folder: Path) -> list[LogFile]:
    """The files, mapped as the options say, or as kept from an earlier time beside them or in `folder`. Raises
    InputError.

    Of several files, each takes what the options say about channels that it has.
    """
    if options.experiment is not None:
        KINDS.checked(options.experiment, "--as", "--as {}")
    return [_read(path, _applicable(options, path, paths), folder) for path in paths]


def _applicable(options: Mapping, path: Path, paths: Sequence[Path]) -> Mapping:
    """Of the options what this file can use; what no file can use stays, to be answered where it is read."""
    if len(paths) < 2 or not options.roles or is_frequency_response(path):
        return options
    holders = {role: [_has(other, name, role) for other in paths] for role, name in options.roles.items()}
    place = paths.index(path)
    lacking = {role for role, held in holders.items() if any(held) and not held[place]}
    roles, scales = ({k: v for k, v in table.items() if k not in lacking} for table in (options.roles, options.scales))
    return replace(options, roles=roles, scales=scales)


def _has(path: Path, name: str, role: str) -> bool:
    """Whether a file has a channel of this name."""
    if is_frequency_response(path):
        return False
    try:
        find(read_table(path), name, role)
    except InputError:
        return False
    return True


def _read(path: Path, options: Mapping, folder: Path) -> LogFile:
    if is_frequency_response(path):
        kind = next(name for name in KINDS if KINDS[name].responses)
        return LogFile(path, read_frequency_response(path), kind, "the file holds a frequency response")
    stored = load(path, folder) or Mapping()
    if stored.experiment is not None:
        KINDS.checked(stored.experiment, f"{path}{SUFFIX}: experiment", 'experiment = "{}"')
    mapping = options.over(stored)
    if mapping.experiment is not None:
        KINDS.checked(mapping.experiment, "--as", "--as {}")
        log = _log(path, mapping, mapping.experiment)
        before = "" if stored.experiment in (None, mapping.experiment) else f", in place of {stored.experiment} as kept"
        return LogFile(path, log, mapping.experiment, f"as specified{before}", mapping)
    log = read_log(path, mapping, strict=False, needed=("position", "force"))
    kind, reason = recognised(log, path)
    return LogFile(path, _log(path, mapping, kind) if KINDS[kind].si else log, kind, reason, mapping)


def with_mapping_file(file: LogFile, folder: Path) -> LogFile:
    """The file with the place where its mapping is kept for the next time, if there is anything to keep: beside it, or
    in `folder`."""
    if file.mapping == Mapping():
        return file
    return replace(file, mapping_file=place_for(file.path, folder))


def _log(path: Path, mapping: Mapping, kind: str) -> Log:
    """The log with the signals that the kind of experiment needs."""
    return read_log(path, mapping, strict=KINDS[kind].si, needed=KINDS[kind].needed(mapping.roles))


def recognised(log: Log, path: Path) -> tuple[str, str]:
    """The only kind of experiment that a log of which nobody said what it is may be of, and why. Raises InputError
    where none claims it, or several do."""
    course = Course(log)
    asked = {name: claims for name in KINDS if (claims := KINDS[name].claims) is not None}
    reasons = {name: reason for name, claims in asked.items() if (reason := claims(course)) is not None}
    if len(reasons) == 1:
        return next(iter(reasons.items()))
    names = list(reasons or asked)
    expected = f"the kind of experiment: {', '.join(names)}"
    raise InputError("--as", course.words, expected, ", or ".join(f"--as {name}" for name in names), str(path))
