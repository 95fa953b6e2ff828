"""Assign roles to channels, and store what the user says of a log.

A role is as the user said, or follows from a name or unit with a reason. Ambiguous roles stay open. The user's
statements, such as channels of roles and their units, are stored in a file beside the log.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import stat
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as Names
from collections.abc import Mapping as Table
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from friso.axis import KINDS, LINEAR, ROTARY, AxisKind
from friso.errors import InputError, LogError
from friso.identification.logs.log import ROLES, Channel, ChannelTable
from friso.identification.logs.units import channel_words, split_heading, unit_factor, without_accents
from friso.platform.system import shell_word
from friso.quantities import Bound, Quantity, as_toml, quoted
from friso.stage.tables_of_files import parsed, text_of

_WORDS = channel_words()
_SET, _NOT_MEASURED, _CART, _RELATIVE = (_WORDS[name] for name in ("wanted", "not_measured", "cart", "relative"))
_KEYS, _CURRENTS, _OTHERS_WANTED, MEASURED = (
    _WORDS[name] for name in ("roles", "currents", "other_wanted", "measured")
)

_LETTERS = frozenset("vfinw")
"""Symbols of commanded quantities other than a position, when directly before the word for commanded: v_soll."""

_TOLD_BY_UNIT = {"position": ("m", "rad"), "force": ("N", "N*m", "A"), "velocity": ("m/s", "rad/s")}
"""Units that imply a role if a single channel without a role has them."""

_RATES = ("m/s", "rad/s", "m/s^2", "rad/s^2")
"""Units that exclude a position, whatever the name."""

_NEVER_WANTED = (*_RATES, "N", "N*m", "A")
"""Units that exclude a commanded position."""

_SYMBOLS = {
    "v": ("velocity", ("m/s", "rad/s")),
    "n": ("velocity", ("rad/s",)),
    "w": ("velocity", ("rad/s",)),
    "a": ("acceleration", ("m/s^2", "rad/s^2")),
    "f": ("force", ("N",)),
    "m": ("force", ("N*m",)),
    "i": ("force", ("A",)),
}
"""Symbols that name a quantity rather than an axis, by their unit, with their role, directly before the word for
measured: v_ist in mm/s."""

_FIRST_LETTERS = {"F": "fbk", "R": "ref", "C": "cmd"}
"""Meaning of the first letters of FPOS, RPOS, CPOS and similar names in motion controllers. APOS is a reference at ACS
and measured elsewhere, so it is left out."""

_GERMAN = re.compile(
    r"(?P<before>soll|ist)(?P<what>[a-z]{3,})|(?P<what_too>[a-z]{3,})(?P<behind>soll|ist)(?:wert)?"
    r"|(?:motor|antriebs?)(?P<of_motor>strom|kraft|drehmoment)"
)
"""German compounds with the word for commanded or measured at either end, and names of motor channels: Sollposition,
Istposition, Lagesollwert, Motorstrom."""


@dataclass(frozen=True)
class AssignedRole:
    """A log channel that was assigned a role, such as position or force, and the reason.

    `by_user` is true if the user assigned it.
    """

    role: str
    channel: Channel
    reason: str
    by_user: bool


def words(name: str) -> list[str]:
    """Return the lower-case words of the last part of a dotted name, without accents.

    "Axis1.NcToPlc.ActPos" is ["act", "pos"].
    """
    plain = re.sub(r"\([^()]*\d\.\d[^()]*\)$", "", without_accents(name))  # (0.1 %) is a resolution
    last = plain.rstrip(". ").rsplit(".", 1)[-1]
    last = re.sub(r"\b([FRC])(POS|VEL)\b", lambda match: f"{_FIRST_LETTERS[match[1]]} {match[2]}", last)
    last = re.sub(r"([a-z])([A-Z])", r"\1 \2", last)
    parts = [part for part in re.split(r"[^A-Za-z]+", last.lower()) if part]
    return [word for part in parts for word in _compound(part)]


def _compound(word: str) -> list[str]:
    """Return the parts of a German compound, or the word alone."""
    match = _GERMAN.fullmatch(word)
    return [word] if match is None else [own for part in match.groups() if part for own in _compound(part)]


@lru_cache(maxsize=4096)  # asked again and again of all channels of a file
def role_of(name: str, unit: str = "") -> tuple[str, str] | None:
    """Return the role that a name implies, and the word that implies it; None without one.

    The `unit` distinguishes a symbol from the name of an axis: V_soll in mm, v_ist in mm/s.
    """
    parts = words(name)
    name_words = set(parts)
    if name_words & _NOT_MEASURED:
        return None
    key = {role: next((part for part in parts if part in keys), "") for role, keys in _KEYS.items()}
    key["force"] = key["force"] or next((part for part in parts[:1] if part in _CURRENTS), "")
    of_time = not unit or _has_unit_of(unit, ("s",)) or not _has_unit_of(unit, (*_NEVER_WANTED, "m", "rad", "V"))
    if key["time"] and of_time and len(parts) <= 2 and not any(key[role] for role in _KEYS if role != "time"):
        return "time", key["time"]
    wanted = next((part for part in parts if part in _SET), "d" if key["position"] and parts[-1] == "d" else "")
    if wanted:
        others = key["velocity"] or key["acceleration"] or key["force"] or key["disturbance"]
        others = others or _has_unit_of(unit, _NEVER_WANTED)
        others = others or (not key["position"] and (name_words & _OTHERS_WANTED or _is_symbol(parts, unit)))
        return None if others else ("reference", wanted)
    is_rate = key["velocity"] or key["acceleration"] or _has_unit_of(unit, _RATES)  # encoder velocity, theta_dot
    if (key["position"] or "actpos" in name_words) and not is_rate:
        word = key["position"] or "actpos"
        kind = "relative_position" if name_words & _RELATIVE else "cart_position" if name_words & _CART else "position"
        return kind, word
    named = ((role, key[role]) for role in ("velocity", "acceleration", "disturbance", "force") if key[role])
    return next(named, _of_symbol(parts, unit))


def wanted_of(name: str, unit: str = "") -> bool:
    """Tell whether a name denotes a commanded speed, acceleration or force: rpm_ref."""
    parts = words(name)
    rate = any(part in _KEYS[role] for part in parts for role in ("velocity", "acceleration"))
    return bool({*parts} & _SET) and (rate or _has_unit_of(unit, _RATES)) and role_of(name, unit) is None


def _of_symbol(parts: Sequence[str], unit: str) -> tuple[str, str] | None:
    """Return role and letter of a name like v_ist, in a fitting unit; else None.

    The name consists of a symbol and a word for measured values.
    """
    if len(parts) != 2 or parts[0] not in _SYMBOLS or parts[1] not in MEASURED or not unit:
        return None
    role, units = _SYMBOLS[parts[0]]
    return (role, parts[0]) if _has_unit_of(unit, units) else None


def _has_unit_of(unit: str, kinds: Sequence[str]) -> bool:
    """Tell whether a unit converts to one of the units in `kinds`."""
    return bool(unit) and any(unit_factor(unit, kind) is not None for kind in kinds)


def _is_symbol(parts: Sequence[str], unit: str) -> bool:
    """Tell whether a name is a symbol of a commanded quantity other than a position: v_soll."""
    of_position = _has_unit_of(unit, _TOLD_BY_UNIT["position"])
    return len(parts) > 1 and parts[0] in _LETTERS and parts[1] in _SET and not of_position


def is_wanted(name: str) -> bool:
    """Tell whether a name says, or suggests, that the value was commanded, not measured."""
    return any(word in (name.lower() if len(word) > 2 else words(name)) for word in _SET)


def find(table: ChannelTable, name: str, role: str, origin: str = "") -> Channel:
    """Find the channel with a name, with or without its unit in brackets, for a role.

    Raises LogError that lists the channels, if there is none or several.
    """
    plain = split_heading(name)[0]
    for matches in ([c for c in table.channels if c.name == name], [c for c in table.channels if c.name == plain]):
        if len(matches) == 1:
            return matches[0]
    nearest = _nearest(table, name, role)
    example = f'--unit "{nearest}"=mm' if role == "unit" else f'--map {role}="{nearest}"'
    raise LogError(role, f"{quoted(name)}, which the log does not contain", listing(table), example, origin)


def _nearest(table: ChannelTable, name: str, role: str) -> str:
    """Return the name of the channel that a misspelled `name` probably means.

    Channels of the role come first, then all others except clocks.
    """
    meant = {channel.name: (role_of(channel.name) or ("",))[0] for channel in table.channels}
    fitting = [one for one, its in meant.items() if its == role] or [one for one, its in meant.items() if its != "time"]
    written = {one.lower(): one for one in fitting or meant}
    near = difflib.get_close_matches(name.lower(), list(written), 1, 0.6)
    return written[near[0]] if near else next(iter(written.values()))


def listing(table: ChannelTable, taken: Sequence[Channel] = ()) -> str:
    """Return a list of the channels for a message, without those `taken` for other roles.

    The list also names MATLAB objects that were left out.
    """
    used = {id(channel) for channel in taken}
    labels = [c.name + (f" [{c.unit}]" if c.unit else "") for c in table.channels if id(c) not in used]
    text = ", ".join(labels[:40]) + (f" and {len(labels) - 40} more" if len(labels) > 40 else "")
    objects = "".join(f"; {line}" for line in table.read if "structure with time" in line)
    return f"one of the channels {text}{objects}"


@dataclass(frozen=True)
class Proposal:
    """Channels that are `chosen` for roles such as position, and those that compete for a role.

    `rivals` has the competing channels by role.
    """

    chosen: dict[str, AssignedRole]
    rivals: dict[str, tuple[Channel, ...]]


def propose(table: ChannelTable, assigned: Names[str, str], origin: str = "") -> Proposal:
    """Give roles to channels: as the user assigned them, then by names, then by units.

    Of several channels whose names imply a role, the channel whose name has no other word gets it. Raises LogError for
    an assigned channel that does not exist, or that is assigned to two roles.
    """
    channels = {role: find(table, name, role, origin) for role, name in assigned.items()}
    chosen = {role: AssignedRole(role, channel, "as specified", True) for role, channel in channels.items()}
    for role, name in assigned.items():
        others = [other for other in assigned if other != role and chosen[other].channel is chosen[role].channel]
        if others:
            actual = f"{quoted(name)} for two roles, {role} and {others[0]}"
            raise LogError("--map", actual, "one role for a channel", f'--map {role}="{name}"', origin)
    by_user = {id(choice.channel) for choice in chosen.values()}
    candidates: dict[str, list[tuple[Channel, str]]] = {}
    for channel in table.channels:
        role = role_of(channel.name, channel.unit)
        if role is not None and role[0] not in assigned and id(channel) not in by_user:
            candidates.setdefault(role[0], []).append((channel, role[1]))
    rivals = {}
    for role, matches in candidates.items():
        if role == "time" and _own_times(table):
            continue
        exact = _exact(role, matches)
        if exact is not None:
            chosen[role] = AssignedRole(role, exact[0], f'the name is "{exact[0].name}"', False)
        elif len(matches) > 1:
            rivals[role] = tuple(channel for channel, _ in matches)
        else:
            channel, word = matches[0]
            chosen[role] = AssignedRole(role, channel, f'the name says "{word}"', False)
    if not ({"time"} & {*chosen, *rivals} or _own_times(table)):
        clocks = [channel for channel in table.channels if is_clock(channel) and id(channel) not in by_user]
        if len(clocks) == 1:
            chosen["time"] = AssignedRole("time", clocks[0], f"the only channel in {clocks[0].unit} that rises", False)
    integrated = {"position"} if "velocity" in assigned else set()
    for role in _TOLD_BY_UNIT.keys() - {*chosen, *rivals, *integrated}:
        channel = _only_one(role, table, [choice.channel for choice in chosen.values()])
        if channel is not None:
            chosen[role] = AssignedRole(role, channel, f"the only channel in {channel.unit} without a role", False)
    return Proposal(chosen, rivals)


def _only_one(role: str, table: ChannelTable, taken: Sequence[Channel]) -> Channel | None:
    """Return the only channel in a unit of the role whose name implies none; else None."""
    used = {id(channel) for channel in taken}
    fits = [
        channel
        for channel in table.channels
        if id(channel) not in used
        and role_of(channel.name, channel.unit) is None
        and not {*words(channel.name)} & (_SET | _NOT_MEASURED)
        and _has_unit_of(channel.unit, _TOLD_BY_UNIT[role])
    ]
    return fits[0] if len(fits) == 1 else None


def is_clock(channel: Channel) -> bool:
    """Tell whether a channel is in a unit of time and always rises."""
    return _has_unit_of(channel.unit, ("s",)) and channel.values.size > 1 and bool((np.diff(channel.values) > 0).all())


def of_no_signal(name: str) -> bool:
    """Tell whether a name says that a channel is no signal: an error, a limit, a counter."""
    return bool({*words(name)} & _NOT_MEASURED)


def _exact(role: str, matches: Sequence[tuple[Channel, str]]) -> tuple[Channel, str] | None:
    """Return the only candidate whose name is exactly the role, or the word for it; else None.

    `matches` are the candidates with the words that imply the role. If there is just one candidate, the result is None,
    too.
    """
    if len(matches) < 2:
        return None
    for alone in (
        [match for match in matches if match[0].name.strip().lower().replace(" ", "_") == role],
        [match for match in matches if match[0].name.strip().lower() == match[1]],
    ):
        if len(alone) == 1:
            return alone[0]
    return None


def _own_times(table: ChannelTable) -> bool:
    """Tell whether the file itself gives instants to channels other than clocks."""
    others = [channel for channel in table.channels if (role_of(channel.name) or ("",))[0] != "time"]
    return any(channel.time is not None for channel in others)


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


BYTES_OF_A_LOG_NAME = 150  # [B]
"""Longest part of a log's name that is used in its mapping file's name. File systems allow 255 bytes."""


def sidecar(log: Path, folder: Path | None = None) -> Path:
    """Return the path of a log's mapping file, beside the log or in a folder.

    In a folder, logs with equal names from several folders, and those whose long names begin alike, have separate
    files.
    """
    if folder is None:
        return log.parent / f"{log.name}{SUFFIX}"
    own = hashlib.sha256(os.fsencode(os.path.abspath(log))).hexdigest()[:8]
    name = log.name.encode(errors="ignore")[:BYTES_OF_A_LOG_NAME].decode(errors="ignore")
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
