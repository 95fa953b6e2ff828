"""The files given: what each holds, how it is mapped, and which kind of experiment it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from friso.identify.logs.assemble import read_log
from friso.identify.logs.log import Log
from friso.identify.logs.mapping import Mapping, load, save
from friso.identify.logs.read import is_frequency_response, read_frequency_response, read_table
from friso.identify.logs.roles import find
from friso.identify.method import FREQUENCY, KINDS, MOVES, STICK_SLIP, Source
from friso.identify.response.period import find_periods
from friso.quantities import StageError, quoted


@dataclass(frozen=True)
class Given:
    """A file with what it holds, its kind of experiment and why it counts as one, and where its mapping is kept (None:
    nothing had to be said about it)."""

    path: Path
    source: Source
    kind: str
    reason: str
    kept: Path | None


def read_all(paths: Sequence[Path], told: Mapping, folder: Path) -> list[Given]:
    """The files, mapped as told, or as kept from an earlier time beside them or in `folder`. Raises StageError.

    Of several files, each takes what is told about channels that it has.
    """
    if told.experiment is not None and told.experiment not in KINDS:
        raise StageError("--as", quoted(told.experiment), f"one of {', '.join(KINDS)}", f"--as {MOVES}")
    return [_read(path, _applicable(told, path, paths), folder) for path in paths]


def _applicable(told: Mapping, path: Path, paths: Sequence[Path]) -> Mapping:
    """What is told that this file can use; what no file can use stays, to be answered where it is read."""
    if len(paths) < 2 or not told.roles or is_frequency_response(path):
        return told
    has = {role: [_has(each, name, role) for each in paths] for role, name in told.roles.items()}
    own = paths.index(path)
    lacking = {role for role, found in has.items() if any(found) and not found[own]}
    roles, scales = ({k: v for k, v in table.items() if k not in lacking} for table in (told.roles, told.scales))
    return replace(told, roles=roles, scales=scales)


def _has(path: Path, name: str, role: str) -> bool:
    """Whether a file has a channel of this name."""
    if is_frequency_response(path):
        return False
    try:
        find(read_table(path), name, role)
    except StageError:
        return False
    return True


def _read(path: Path, told: Mapping, folder: Path) -> Given:
    if is_frequency_response(path):
        return Given(path, read_frequency_response(path), FREQUENCY, "the file holds a frequency response", None)
    mapping = told.over(load(path, folder) or Mapping())
    if mapping.experiment is not None:
        log = _log(path, mapping, mapping.experiment)
        return Given(path, log, mapping.experiment, "as told", save(mapping, path, folder))
    log = _log(path, mapping, FREQUENCY)
    kind, reason = _kind(log)
    log = log if kind == FREQUENCY else _log(path, mapping, kind)
    return Given(path, log, kind, reason, save(mapping, path, folder) if mapping != Mapping() else None)


def _log(path: Path, mapping: Mapping, kind: str) -> Log:
    """The log with the signals that the kind of experiment needs; a frequency response can do without SI units."""
    position = "relative_position" if kind == STICK_SLIP and "relative_position" in mapping.roles else "position"
    return read_log(path, mapping, strict=kind != FREQUENCY, needed=(position, "force"))


def _kind(log: Log) -> tuple[str, str]:
    """A frequency response where a periodic force moves a stage without reference, moves otherwise."""
    if "reference" in log:
        return MOVES, "it has a reference"
    part = max(log.segments, key=lambda each: each.stop - each.start)
    try:
        found = find_periods(log["force"][part])
    except StageError:
        return MOVES, "the force does not repeat, and there is no reference"
    return FREQUENCY, f"the force repeats every {found.samples} samples, and there is no reference"
