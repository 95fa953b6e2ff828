"""Assemble a log from a file and the user's mapping: roles, units, one time base, checks."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from friso.errors import InputError, LogError
from friso.identification.logs import checks
from friso.identification.logs.gaps import GapsError, check_gaps, told_by_mechanics
from friso.identification.logs.log import ROLES, Channel, ChannelTable, Log
from friso.identification.logs.read import ReadFile, read_file
from friso.identification.logs.roles import AssignedRole, Mapping, Proposal, option, propose, role_of, wanted_of
from friso.identification.logs.signals import (
    MotionReading,
    Notes,
    Reading,
    instants,
    is_ramp,
    no_time,
    signal,
    unused,
    with_user_units,
)
from friso.identification.logs.time_base import SAMPLES_OF_A_LOG, Track, as_stamped, is_uneven, resample_tracks, track
from friso.identification.logs.units import unit_factor
from friso.quantities import percent, quoted


def read_log(
    source: Path | str | ReadFile,
    mapping: Mapping | None = None,
    strict: bool = True,
    needed: Sequence[str] = ("position",),
    foreign: Sequence[str] = (),
    stamped: bool = False,
) -> Log:
    """Read the log in a file, which may have been read: signals by role, in SI units, on one time base, with warnings.

    With `strict`, every signal must convert to the SI unit of its role, except for the `foreign` roles; without, other
    units are kept and listed in `Log.units`. `needed` are the roles that must be present; a position may be the
    integral of the velocity. With `stamped`, a log without an even clock keeps its own instants, and its velocity.
    Raises LogError (one message) for files that cannot be read or used.
    """
    file, mapping = source if isinstance(source, ReadFile) else read_file(source), mapping or Mapping()
    path, form = file.path, file.form
    table = with_user_units(file.table, mapping, form.times, str(path))
    reading = Reading(table, mapping, strict, not form.units, str(path), tuple(foreign))
    proposal = propose(table, mapping.roles, str(path))
    readings = told_by_mechanics(table, proposal, needed)
    by_velocity = is_needed(table, proposal, needed, readings[0] if readings else None)
    if by_velocity:
        needed = ["velocity" if role == "position" else role for role in needed]
    check_gaps(reading, proposal, needed, readings)
    chosen = proposal.chosen
    unused(mapping, chosen, str(path))
    notes, even = Notes([*table.read], [*_undecided(proposal), *table.warnings]), None
    try:
        signals = _stamped(chosen, reading, notes, needed) if stamped else {}
        uneven = bool(signals)
        if uneven:
            base, signals = as_stamped(signals)
        else:
            tracks = _tracks(chosen, reading, notes, needed)
            base, signals = resample_tracks(tracks)
            even = None if by_velocity else _as_even(tracks)
        notes.read += base.read
        notes.warnings += base.warnings
        _check(base, signals, needed)
        if by_velocity and not uneven:
            signals["position"] = integrated(signals["velocity"], base.period, base.segments)
            notes.warnings.append(NOTE)
            if "velocity" in notes.units:
                notes.units["position"] = notes.units["velocity"].removesuffix("/s")
    except InputError as error:
        raise error.found_in(str(path)) from None
    _no_doubtful_unit(base, reading)
    notes.warnings += [*_lost(base), *_missing(base), *([] if uneven else _doubts(base, signals, notes))]
    notes.read.append(_spans(base))
    log = Log(
        path.stem, base.time, base.period, signals, tuple(base.segments), notes.units, dict(table.scalars),
        tuple(notes.read), tuple(notes.warnings), dict(mapping.setup), mapping.axis_kind,
        base.bridged if base.bridged.any() else None, is_integrated=by_velocity and not uneven, is_uneven=uneven,
    )  # fmt: skip
    if even is None:
        return log
    clock, taken = even
    bridged = clock.bridged if clock.bridged.any() else None
    same = {"sample_time": clock.period, "signals": taken, "segments": tuple(clock.segments), "bridged": bridged}
    return replace(log, as_even=replace(log, time=clock.time, **same))


def _as_even(tracks: dict[str, Track]) -> tuple[Track, dict[str, np.ndarray]] | None:
    """Bring tracks, samples of which are taken as even, to one base; None if no track was interpolated."""
    if any(track.as_even for track in tracks.values()):
        with suppress(LogError):
            return resample_tracks({role: track.as_even or track for role, track in tracks.items()})
    return None


def _undecided(proposal: Proposal) -> list[str]:
    """Return a line for each role with several possible channels, and an option to choose one."""
    return [
        f"{role}: several candidates ({', '.join(channel.name for channel in channels)}); to use one: "
        f"{option('--map', role, channels[0].name)}"
        for role, channels in proposal.rivals.items()
    ]


def _tracks(chosen: dict[str, AssignedRole], reading: Reading, notes: Notes, needed: Sequence[str]) -> dict[str, Track]:
    """Return each role's channel at even instants in the unit of the role.

    A channel that was proposed by its name and is not `needed` is left out, with a warning, if it lacks instants or a
    unit. Any other channel without them raises LogError.
    """
    clock = chosen.get("time")
    tracks: dict[str, Track] = {}
    sizes = [choice.channel.values.size for role, choice in chosen.items() if role in needed or choice.by_user]
    for role in [role for role in ROLES if role in chosen]:
        choice = chosen[role]
        optional = not choice.by_user and role not in needed
        time = instants(choice, clock, reading, notes)
        foreign = reading.mapping.sample_time is not None and choice.channel.values.size not in sizes
        if optional and (time is None or foreign):
            name = choice.channel.name
            notes.warnings.append(f"{role}: {name} left out: its length differs, or it has no time stamps")
            continue
        if time is None:
            raise no_time(choice.channel, reading)
        try:
            values = signal(choice, reading, notes)
        except InputError as error:
            if not optional or role == "force":
                raise
            notes.warnings.append(f"{role}: {error.actual} left out; to use it: {error.example}")
            continue
        if time.size != values.size:
            actual = f"{values.size} values for {time.size} time stamps"
            raise LogError(role, actual, "one value per time stamp", "", reading.origin)
        tracks[role] = _track(role, choice, time, values, notes)
    notes.read += _clocks(clock, reading)
    notes.warnings += _contradicted(chosen, reading, notes)
    return tracks


def _stamped(
    chosen: dict[str, AssignedRole], reading: Reading, notes: Notes, needed: Sequence[str]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return instants and values by role of a log without an even clock, the motion first; {} for an even one.

    Roles beside those `needed` and the force are left out where they lack instants or a unit.
    """
    clock, pairs = chosen.get("time"), {}
    for role in [*needed, *(role for role in ("velocity", "force", *ROLES) if role in chosen and role not in needed)]:
        time = instants(chosen[role], clock, reading, Notes())
        if role == needed[0] and (time is None or not is_uneven(time)):
            return {}
        if role in pairs or time is None or time.size != chosen[role].channel.values.size:
            continue
        with suppress(*(() if role in (*needed, "force") or chosen[role].by_user else (InputError,))):
            pairs[role] = time, signal(chosen[role], reading, notes)
    notes.read += _clocks(clock, reading)
    return pairs


DIFFERENCE_OF_A_CONTRADICTION = 0.05
"""Relative difference of a specified sample time from that of the time stamps, above which it is mentioned."""


def _contradicted(chosen: dict[str, AssignedRole], reading: Reading, notes: Notes) -> list[str]:
    """Write what time stamps say against a specified sample time; nothing if they agree, or are no seconds."""
    specified = reading.mapping.sample_time
    if specified is None:
        return []
    stamped = replace(reading, mapping=replace(reading.mapping, sample_time=None))
    choice = next(choice for role, choice in chosen.items() if role != "time")
    try:
        stamps = instants(choice, chosen.get("time"), stamped, notes)
    except InputError:  # in a unit that is none of time
        return []
    if stamps is None or stamps.size < 2 or not (np.diff(stamps) >= 0).all():
        return []
    usual = float(stamps[-1] - stamps[0]) / (stamps.size - 1)
    if abs(usual / specified - 1) <= DIFFERENCE_OF_A_CONTRADICTION:
        return []
    return [
        f"time: the time stamps are {usual:.4g} s apart, not {specified:.4g} s as specified: a mass follows from the "
        "square of it"
    ]


def _clocks(clock: AssignedRole | None, reading: Reading) -> list[str]:
    """Write lines that say where the sample times of the log come from."""
    if (specified := reading.mapping.sample_time) is not None:
        return [f"time: one sample every {specified:.9g} s, as specified; the times in the file are not used"]
    if clock is not None:
        return [f"time: {clock.channel.name} ({clock.channel.source}), {clock.reason}"]
    columns = [c for c in reading.table.channels if c.unit and (role_of(c.name) or ("",))[0] == "time"]
    return [f"time: {c.name} ({c.source}), in {c.unit}" for c in columns] or ["time: as stored with the signals"]


def _track(role: str, choice: AssignedRole, time: np.ndarray, values: np.ndarray, notes: Notes) -> Track:
    """Bring one role's channel, with its instants [s] and values, to even instants.

    Its remarks are added to the notes.
    """
    channel_track = track(role, time, values)
    notes.read += channel_track.read
    notes.warnings += channel_track.warnings
    name, slower = f"{role}: {choice.channel.name}", "it is sampled {} times slower"
    if (n := checks.samples_held(values)) > 1:
        notes.warnings.append(f"{name} holds each value for {n} samples: {slower.format(n)}")
    elif role not in ("reference", "disturbance") and (n := checks.interpolated(values)) > 1:
        notes.warnings.append(f"{name} runs in straight lines of {n} samples: {slower.format(n)} and interpolated")
    return channel_track


def _check(base: Track, signals: dict[str, np.ndarray], needed: Sequence[str]) -> None:
    """Check that a log is long enough, and that signals that should change do.

    Position, force and the `needed` roles should change. Raises LogError if not, and for samples implausibly close or
    far apart.
    """
    if base.time.size < SAMPLES_OF_A_LOG:
        raise LogError("log", f"{base.time.size} samples", f"at least {SAMPLES_OF_A_LOG} samples", "")
    if not 1e-9 <= base.period <= 3600:
        expected = "1 ns to 1 h between samples: is the time in another unit?"
        raise LogError("time", f"{base.period:g} s between samples", expected, '--unit TIME="ms"')
    for role in {*needed, "position", "force"} & set(signals):
        if checks.constant(role, signals[role]):
            actual = f"a constant signal, {quoted(float(signals[role][0]))} throughout"
            raise LogError(role, actual, "a signal that changes", f'--map {role}="CHANNEL"')


SHORTEST_SAMPLE_TIME = 1e-5  # [s]
"""Sample time up to which the unit of the time is doubted. Drives sample at 62.5 us and more slowly."""


def _no_doubtful_unit(base: Track, reading: Reading) -> None:
    """Check that a clock is not too fast for a machine because its heading has a smaller unit than its values.

    Raises GapsError, which asks for the unit, unless the user stated it.
    """
    mapping, clocks = reading.mapping, [c for c in reading.table.channels if c.unit not in ("", "s")]
    clocks = [c for c in clocks if (role_of(c.name, c.unit) or ("",))[0] == "time" and c.name not in mapping.units]
    if clocks and mapping.sample_time is None and base.period <= SHORTEST_SAMPLE_TIME:
        actual = f"{base.period * 1e6:.3g} us between samples by a heading in {clocks[0].unit}, faster than drives log"
        example = option("--unit", clocks[0].name, "s")
        raise GapsError([LogError("time", actual, f"the unit of {quoted(clocks[0].name)}", example, reading.origin)])


SHARE_OF_CLIPPED_SAMPLES = 1e-3
"""Fraction of samples in flat tops above which a signal counts as clipped. Noise has no flat tops."""


def _doubts(base: Track, signals: dict[str, np.ndarray], notes: Notes) -> list[str]:
    """List warnings for the engineer about the signals of a log.

    Signals may be constant or clipped, and position may contradict velocity or lag behind the force. `base` has the
    common instants.
    """
    lines, parts, period = [], base.segments, base.period
    for role, values in signals.items():
        if checks.constant(role, values):
            lines.append(f"{role}: constant throughout")
        share = 0.0 if role in ("reference", "disturbance") else checks.clipped_share(values)
        if share > SHARE_OF_CLIPPED_SAMPLES:
            on_tops = f"{percent(share, 3)} of the samples lie on flat tops at its extremes"
            lines.append(f"{role}: {on_tops}: saturated or clipped")
    position, velocity, force = (signals.get(role) for role in ("position", "velocity", "force"))
    same_kind = ("position" in notes.units) == ("velocity" in notes.units)
    if position is not None and velocity is not None and same_kind:
        lines.append(checks.velocity_warning(position, velocity, period, parts))
        lines.append(checks.velocity_line(position, velocity, period, parts))
    if position is not None and force is not None:
        lines.append(checks.force_line(position, force, period, parts))
    return [line for line in lines if line]


def _lost(base: Track) -> list[str]:
    """Write how many samples were lost and interpolated, as a list of one line; [] if none were."""
    if not base.bridged.any():
        return []
    places = len(checks.runs(base.bridged))
    where = "1 place" if places == 1 else f"{places} places"
    return [
        f"{np.count_nonzero(base.bridged)} of {base.bridged.size} samples lost, in {where}, interpolated by a cubic "
        "spline; the fit of a whole model does not count them"
    ]


def _missing(base: Track) -> list[str]:
    """Write which parts of a log are missing, and whether its clock is too fast for a machine; [] without either."""
    lines = []
    if base.period <= SHORTEST_SAMPLE_TIME:
        lines.append(
            f"time: {base.period * 1e6:.3g} us between samples ({1e-6 / base.period:.3g} MHz), faster than drives log: "
            "is the time in a larger unit than its heading says? --unit states another"
        )
    holes = [(base.time[left.stop - 1], base.time[right.start]) for left, right in pairwise(base.segments)]
    if holes:
        whole, lost = float(base.time[-1] - base.time[0]), sum(end - start - base.period for start, end in holes)
        first = ", ".join(f"{start:.4g} to {end:.4g} s" for start, end in holes[:3])
        more = f" and {len(holes) - 3} more" if len(holes) > 3 else ""
        lines.append(f"time: {lost:.3g} s of {whole:.3g} s are missing ({first}{more})")
    return lines


def _spans(base: Track) -> str:
    """Describe the segments of a log in words."""
    parts = base.segments
    listed = ", ".join(f"{_instant(base, p.start)} to {_instant(base, p.stop - 1)}" for p in parts[:6])
    more = f" and {len(parts) - 6} more" if len(parts) > 6 else ""
    count = "1 segment" if len(parts) == 1 else f"{len(parts)} segments"
    return f"{base.time.size} samples at {1 / base.period:.6g} Hz in {count}: {listed}{more}"


def _instant(base: Track, number: int) -> str:
    """Write the time of a sample [s], by its number; rounding errors about 0 become 0."""
    time = float(base.time[number])
    return f"{0.0 if abs(time) < 1e-6 * base.period else time:.6g} s"


NOTE = (
    "position: the integral of the velocity, since no channel holds one; where the log begins counts as 0, after a gap "
    "as well, an offset of the velocity becomes a drift, and the first micrometres of a motion are not resolved"
)
"""Remark in the log on a position that is the integral of the velocity."""

LENGTHS = ("m", "rad")
"""Units of a position."""


def is_needed(
    table: ChannelTable, proposal: Proposal, needed: Sequence[str], best: MotionReading | None = None
) -> bool:
    """Tell whether a needed position must be computed as the integral of the velocity.

    This is never so if a channel has, or competes for, the role of position. Otherwise the `best` reading by mechanics
    decides, if there is one. Without it, there must be a velocity, which the user assigned, or beside which no other
    channel could be a position.
    """
    velocity = proposal.chosen.get("velocity")
    if "position" not in needed or "position" in {*proposal.chosen, *proposal.rivals}:
        return False
    if best is not None:
        return best.kind == "velocity"
    if velocity is None:
        return False
    taken = {id(choice.channel) for choice in proposal.chosen.values()}
    others = [channel for channel in table.channels if id(channel) not in taken]
    return velocity.by_user or not any(map(_may_be_a_position, others))


def _may_be_a_position(channel: Channel) -> bool:
    """Tell whether a channel may be a position.

    Such a channel has no role yet, changes, and has a fitting unit or none.
    """
    finite = channel.values[np.isfinite(channel.values)]
    if not finite.size or not np.ptp(finite) > 0 or role_of(channel.name) is not None or is_ramp(channel):
        return False
    if wanted_of(channel.name, channel.unit):
        return False
    return not channel.unit or any(unit_factor(channel.unit, unit) is not None for unit in LENGTHS)


def integrated(velocity: np.ndarray, sample_time: float, segments: Sequence[slice]) -> np.ndarray:
    """Integrate a velocity [m/s], (n,), over each segment by the trapezoidal rule [m]."""
    position = np.zeros(len(velocity))
    for part in segments:
        position[part] = cumulative_trapezoid(velocity[part], dx=sample_time, initial=0.0)
    return position
