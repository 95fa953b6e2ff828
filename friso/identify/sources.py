"""The files given: what each holds, how it is mapped, and which kind of experiment it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from friso.errors import InputError
from friso.identify.logs.assemble import read_log
from friso.identify.logs.log import Log
from friso.identify.logs.mapping import Mapping, load, save
from friso.identify.logs.read import is_frequency_response, read_frequency_response, read_table
from friso.identify.logs.roles import find
from friso.identify.method import FREQUENCY, KINDS, MOVES, STICK_SLIP, Source
from friso.identify.response.analysis import external
from friso.identify.response.period import find_periods
from friso.quantities import quoted

FEW, BACK = 7.0, 0.1
"""Harmonics that an excitation has at least, and as many turns in each period, each by such a share of the range: our
choice. A multisine of 8 equal lines is one; moves have 1 to 7, or narrow peaks that turn less often than that."""

STILL, RESTS = 0.01, 0.1
"""Share of the travel within which a position rests, and of the time for which an excitation does so at most."""


@dataclass(frozen=True)
class Given:
    """A file with what it holds, its kind of experiment and why it counts as one, how it was mapped, and where that is
    kept (None: not yet, or nothing had to be said about it)."""

    path: Path
    source: Source
    kind: str
    reason: str
    mapping: Mapping = Mapping()  # noqa: RUF009 (frozen)
    kept: Path | None = None


def read_all(paths: Sequence[Path], told: Mapping, folder: Path) -> list[Given]:
    """The files, mapped as told, or as kept from an earlier time beside them or in `folder`. Raises InputError.

    Of several files, each takes what is told about channels that it has.
    """
    if told.experiment is not None and told.experiment not in KINDS:
        like = next(iter(get_close_matches(told.experiment, KINDS, 1)), MOVES)
        raise InputError("--as", quoted(told.experiment), f"one of {', '.join(KINDS)}", f"--as {like}")
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
    except InputError:
        return False
    return True


def _read(path: Path, told: Mapping, folder: Path) -> Given:
    if is_frequency_response(path):
        return Given(path, read_frequency_response(path), FREQUENCY, "the file holds a frequency response")
    kept = load(path, folder) or Mapping()
    mapping = told.over(kept)
    if mapping.experiment is not None:
        log = _log(path, mapping, mapping.experiment)
        before = "" if kept.experiment in (None, mapping.experiment) else f", in place of {kept.experiment} as kept"
        return Given(path, log, mapping.experiment, f"as told{before}", mapping)
    log = _log(path, mapping, FREQUENCY)
    kind, reason = _kind(log, path)
    log = log if kind == FREQUENCY else _log(path, mapping, kind)
    return Given(path, log, kind, reason, mapping)


def keep(given: Given, folder: Path) -> Given:
    """The file with its mapping kept beside it, or in `folder`, for the next time: once something came of it. Raises
    InputError."""
    if given.mapping == Mapping():
        return given
    return replace(given, kept=save(given.mapping, given.path, folder))


def _log(path: Path, mapping: Mapping, kind: str) -> Log:
    """The log with the signals that the kind of experiment needs; a frequency response can do without SI units."""
    position = "relative_position" if kind == STICK_SLIP and "relative_position" in mapping.roles else "position"
    return read_log(path, mapping, strict=kind != FREQUENCY, needed=(position, "force"))


def _kind(log: Log, path: Path) -> tuple[str, str]:
    """A frequency response where a periodic excitation moves a stage whose reference does not move, moves otherwise.

    A move that is repeated is periodic too: it rests in between, or holds few frequencies and turns its force seldom.
    Raises InputError where the two cannot be told apart.
    """
    part = log.longest
    if "reference" in log and np.ptp(log["reference"][part]) > 0:
        return MOVES, "it has a reference that moves"
    signal = external(log) or "force"
    try:
        found = find_periods(log[signal][part])
    except InputError:
        if "reference" in log:
            given = "a log whose reference stands still, with nothing periodic in it"
            raise InputError("--as", given, "a log in which the stage is moved", f"--as {MOVES}", str(path)) from None
        return MOVES, f"the {signal} does not repeat, and there is no reference that moves"
    repeats = f"the {signal} repeats every {found.samples} samples"
    if _rest(log["position"][part][found.start : found.stop], found.samples) > RESTS:
        return MOVES, f"{repeats}, but the position rests in between"
    one = found.cut(log[signal][part]).mean(axis=0)
    lines, turns = _lines(one), _turns(one)
    if lines >= FEW and turns >= lines:
        return FREQUENCY, f"{repeats}, with about {lines:.0f} harmonics"
    if lines < FEW and turns < FEW:
        return MOVES, f"{repeats}, but turns seldom and holds few frequencies"
    given = f"a log in which {repeats}, holds about {lines:.0f} harmonics and turns {turns} times in between"
    expected = "to be told whether that is a move which is repeated (moves) or an excitation (frequency)"
    raise InputError("--as", given, expected, f"--as {MOVES}, or --as {FREQUENCY}", str(path))


def _lines(period: np.ndarray) -> float:
    """How many harmonics of equal power would spread as those of a signal over one period, shape (samples,), do."""
    power = np.abs(np.fft.rfft(period)[1:]) ** 2
    return float(power.sum() ** 2 / np.sum(power**2))


def _rest(position: np.ndarray, samples: int) -> float:
    """Share of the time in which the position stays within `STILL` of its travel for a tenth of a period.

    A sine does so at no time: about its turning points it moves by 2.4 % of its travel.
    """
    size = max(samples // 10, 2)
    moved = maximum_filter1d(position, size) - minimum_filter1d(position, size)
    return float(np.mean(moved < STILL * np.ptp(position)))


def _turns(period: np.ndarray) -> int:
    """How often a signal over one period, shape (samples,), turns back by more than `BACK` of its range."""
    least, turns, way, last = BACK * np.ptp(period), 0, 1.0, period[0]
    for value in period:
        if (value - last) * way > 0:
            last = value
        elif (last - value) * way > least:
            way, last, turns = -way, value, turns + 1
    return turns
