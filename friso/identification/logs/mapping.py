"""Store the user's statements about a log, such as channels of roles and their units, in a file beside the log."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable
from collections.abc import Mapping as Table
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from friso.axis import KINDS, LINEAR, ROTARY, AxisKind
from friso.errors import InputError, LogError
from friso.identification.logs.log import ROLES
from friso.identification.logs.roles import role_of
from friso.identification.logs.settings import settings
from friso.platform.system import shell_word
from friso.quantities import Bound, Quantity, as_toml, quoted
from friso.stage.tables_of_files import parsed, text_of

SUFFIX = ".friso.toml"
MAPPABLE = ("time", *ROLES)
"""Names to which a channel can be mapped."""
TABLES, SINGLE = ("roles", "units", "scales", "setup"), ("sample_time", "experiment", "axis")
_INTERVALS = Bound("1 ns to 1 h", lambda value: (value >= 1e-9) & (value <= 3600))
_SAMPLE_TIME = Quantity("s", _INTERVALS, "1 ms")


@dataclass(frozen=True)
class Mapping:
    """The user's statements about a log.

    Fields are roles ({role: channel name}), units ({channel name: unit}), scales ({role: "35.1507 N/V"}), the sample
    time [s] if the file states none, and the kinds of experiment and axis. `setup` has stage-file keys that had other
    values for this log ({dotted key: "8 mm"}).
    """

    roles: Table[str, str] = field(default_factory=dict)
    units: Table[str, str] = field(default_factory=dict)
    scales: Table[str, str] = field(default_factory=dict)
    sample_time: float | None = None
    experiment: str | None = None
    axis: str | None = None
    setup: Table[str, str] = field(default_factory=dict)

    @property
    def axis_kind(self) -> AxisKind:
        """Return the kind of axis: linear unless the user said otherwise."""
        return LINEAR if self.axis is None else KINDS[self.axis]

    def over(self, older: Mapping) -> Mapping:
        """Return this mapping, completed by statements of an older one."""
        rest = older.beside(self)
        tables = {name: {**getattr(rest, name), **getattr(self, name)} for name in TABLES}
        own = {name: value for name in SINGLE if (value := getattr(self, name)) is not None}
        return replace(rest, **tables, **own)

    def beside(self, newer: Mapping) -> Mapping:
        """Return the statements of this mapping that a newer one does not replace.

        Statements are replaced by others on the same role or channel. A sample time is also replaced by a channel of
        times or its unit, and a channel of times by a sample time. A scale ends if its role gets another channel, and a
        role if its channel gets another role.
        """
        timed = "time" in newer.roles or any((role_of(name) or ("",))[0] == "time" for name in newer.units)
        used = {*newer.roles.values()}
        roles = {role: name for role, name in self.roles.items() if role not in newer.roles and name not in used}
        if newer.sample_time is not None:
            roles.pop("time", None)
        other = {role for role, name in newer.roles.items() if self.roles.get(role, name) != name}
        other |= {role for role, name in self.roles.items() if role not in newer.roles and name in used}
        units, setup = (
            {key: text for key, text in getattr(self, name).items() if key not in getattr(newer, name)}
            for name in ("units", "setup")
        )
        scales = {role: scale for role, scale in self.scales.items() if role not in {*newer.scales, *other}}
        gone = {name: None for name in SINGLE if getattr(newer, name) is not None or (name == "sample_time" and timed)}
        return replace(self, roles=roles, units=units, scales=scales, setup=setup, **gone)

    def replaced_by(self, newer: Mapping) -> str:
        """Return which roles and units of this mapping a newer one contradicts, in words; "" for none."""
        used = {name: role for role, name in newer.roles.items()}
        roles = [
            f"{role} is {name}"
            for role, name in self.roles.items()
            if newer.roles.get(role, name) != name or used.get(name, role) != role
        ]
        units = [f"{name} in {unit}" for name, unit in self.units.items() if newer.units.get(name, unit) != unit]
        return ", ".join([*roles, *units])

    @property
    def words(self) -> str:
        """Return the mapping in words; "" if it is empty."""
        time = [] if self.sample_time is None else [f"one sample every {self.sample_time:.6g} s"]
        kinds = [text for text in (self.experiment, self.axis) if text is not None]
        roles = [f"{role} is {name}" for role, name in self.roles.items()]
        scales = [f"{role} by {scale}" for role, scale in self.scales.items()]
        units = [f"{name} in {unit}" for name, unit in self.units.items()]
        setup = [f"{key} = {text}" for key, text in self.setup.items()]
        return ", ".join([*time, *roles, *units, *scales, *kinds, *setup])

    @property
    def options(self) -> tuple[str, ...]:
        """Return the mapping as options of the command line, without the set-up, which has none."""
        pairs = (("--map", self.roles), ("--unit", self.units), ("--scale", self.scales))
        several = [option(name, left, right) for name, values in pairs for left, right in values.items()]
        time = None if self.sample_time is None else f"{self.sample_time!r} s"
        single = (("--dt", time), ("--as", self.experiment), ("--axis", self.axis))
        return (*several, *(f"{name} {shell_word(text)}" for name, text in single if text is not None))


def from_options(
    maps: Iterable[str] = (),
    units: Iterable[str] = (),
    scales: Iterable[str] = (),
    dt: str | None = None,
    experiment: str | None = None,
    axis: str | None = None,
) -> Mapping:
    """Make a mapping from the texts of options.

    The options are `--map ROLE=CHANNEL`, `--unit CHANNEL=UNIT`, `--scale ROLE=SCALE`, `--dt "1 ms"`, `--axis rotary`.
    Raises LogError for a text in another form, or for an unknown role or axis.
    """
    roles = dict(_pair(text, "--map", 'position="Axis1.ActPos"', MAPPABLE) for text in maps)
    channel_units = dict(_pair(text, "--unit", 'Axis1.ActPos="mm"', last=True) for text in units)
    factors = dict(_pair(text, "--scale", 'force="35.1507 N/V"', tuple(ROLES)) for text in scales)
    try:
        sample_time = None if dt is None else float(_SAMPLE_TIME.read(dt))
    except InputError as error:
        raise error.found_in("--dt") from None
    if axis is not None and axis not in KINDS:
        raise LogError("--axis", quoted(axis), f"one of {', '.join(KINDS)}", f"--axis {ROTARY.name}")
    return Mapping(roles, channel_units, factors, sample_time, experiment, axis)


def _pair(
    text: str, option: str, example: str, left: tuple[str, ...] | None = None, last: bool = False
) -> tuple[str, str]:
    """Split the text of an option at its first (or last) equals sign.

    Raises LogError, with the `example`, for a text without one, or with a left side that is not in `left`.
    """
    first, sign, second = text.rpartition("=") if last else text.partition("=")
    first, second = first.strip(), second.strip().strip('"')
    if not sign or not first or not second:
        raise LogError(option, quoted(text), "two texts separated by =", f"{option} {example}")
    if left is not None and first not in left:
        raise LogError(option, quoted(first), f"one of {', '.join(left)}", f"{option} {example}")
    return first, second


def guess(what: str, reason: str = "") -> str:
    """Write a note that an example rests on a guess, to be checked before it is copied.

    `what` was guessed; the `reason` may be "".
    """
    return f" (guessed: {what}{f', {reason}' if reason else ''}; check it)"


def option(name: str, left: str, right: str) -> str:
    """Return an option LEFT=RIGHT quoted for a shell."""
    return f"{name} {shell_word(f'{left}={right}')}"


def sidecar(log: Path, folder: Path | None = None) -> Path:
    """Return the path of a log's mapping file, beside the log or in a folder.

    In a folder, logs with equal names from several folders, and those whose long names begin alike, have separate
    files.
    """
    if folder is None:
        return log.parent / f"{log.name}{SUFFIX}"
    own = hashlib.sha256(os.fsencode(os.path.abspath(log))).hexdigest()[:8]
    name = log.name.encode(errors="ignore")[: settings.bytes_of_a_log_name].decode(errors="ignore")
    return folder / f"{name}.{own}{SUFFIX}"


def mapping_text(mapping: Mapping) -> str:
    """Return the text of a mapping file."""
    lines = ["# How this log was read by `friso identify`: reused next time, options override it."]
    if mapping.sample_time is not None:
        lines.append(f'sample_time = "{mapping.sample_time!r} s"')
    stated = {"experiment": mapping.experiment, "axis": mapping.axis}
    lines += [f"{name} = {as_toml(text)}" for name, text in stated.items() if text is not None]
    for name in TABLES:
        table = getattr(mapping, name)
        rows = [f"{as_toml(key)} = {as_toml(value)}" for key, value in table.items()]
        lines += ["", f"[{name}]", *rows] if rows else []
    return "\n".join(lines) + "\n"


def place_for(log: Path, folder: Path) -> Path:
    """Return a writable place for a log's mapping: beside it, or else the folder.

    A folder marked read-only is not used, even for a superuser.
    """
    beside = sidecar(log)
    writable = os.access(beside.parent, os.W_OK) and beside.parent.stat().st_mode & stat.S_IWUSR
    return beside if writable else sidecar(log, folder)


def load_mapping(log: Path, folder: Path | None = None) -> Mapping | None:
    """Load the mapping file beside a log, or else in the folder; None if there is none.

    Raises LogError for a file that is not a mapping.
    """
    for place in [sidecar(log)] + ([sidecar(log, folder)] if folder is not None else []):
        if os.path.isfile(place):  # a file whose name would be too long does not exist either
            return _parsed(place)
    return None


_KEPT = "a mapping kept by friso; delete the file to map again"


def _parsed(place: Path) -> Mapping:
    """Read the mapping in a file.

    Raises LogError for a file that is no mapping.
    """
    try:
        document = parsed(text_of(place, _KEPT), _KEPT)
    except InputError as error:
        raise LogError("", error.actual, _KEPT, "", str(place)) from None
    for key, expected in (("experiment", "the name of a kind of experiment"), ("axis", f"one of {', '.join(KINDS)}")):
        if not isinstance(document.get(key), str | None):
            raise LogError(key, quoted(document[key]), expected, "", str(place))
    names = {entry.name for entry in fields(Mapping)}
    for key, value in document.items():
        if key not in names or (key in TABLES) != isinstance(value, dict):
            raise LogError(key, quoted(value), f"tables {', '.join(TABLES)}; sample_time, axis", "", str(place))
    texts = {key: _texts(document.get(key, {}), key, place) for key in TABLES}
    try:
        options = from_options(
            dt=document.get("sample_time"), experiment=document.get("experiment"), axis=document.get("axis")
        )
        for group, allowed in (("roles", MAPPABLE), ("scales", tuple(ROLES))):
            for key in texts[group]:
                if key not in allowed:
                    raise LogError(group, quoted(key), f"one of {', '.join(allowed)}")
    except InputError as error:
        raise error.found_in(str(place)) from None
    return replace(options, **texts)


def _texts(table: dict[str, Any], key: str, place: Path) -> dict[str, str]:
    """Check that a table of a mapping file holds texts, and return it.

    The table [setup] may also have numbers and booleans, which become texts. Raises LogError for any other value.
    """
    if key == "setup":
        table = {name: as_toml(value) if isinstance(value, int | float) else value for name, value in table.items()}
    for name, value in table.items():
        if not isinstance(value, str):
            raise LogError(f"{key}.{name}", quoted(value), "a text", "", str(place))
    return table
