"""Turn channels into signals, and find force and motion among channels by mechanics.

A force accelerates a mass and overcomes its friction. So each pair of channels is read as force and position, and as
force and velocity: force = M a + F_v v + F_c sign(v) + offset is fitted at several time scales. It needs no units,
because a factor changes nothing. With the right channels, the fit leaves little of the force on any scale, and inertia
and friction have equal signs.

A signal has its instants in seconds and its values in the unit of its role.
"""

from __future__ import annotations

import re
from collections.abc import Mapping as Roles
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate

from friso.axis import LENGTH, ROTARY
from friso.errors import InputError, LogError
from friso.identification.logs.checks import rises_evenly, unwrapped
from friso.identification.logs.log import ROLES, Channel, ChannelTable
from friso.identification.logs.roles import AssignedRole, Mapping, find, guess, is_clock, option, words
from friso.identification.logs.text import RATES, STEPS, with_times
from friso.identification.logs.units import FOREIGN, RMS, in_si, is_unit, likely_unit, read_scale, unit_factor
from friso.quantities import quoted

KINDS = ("position", "velocity")
"""Kinds of motion channels, with the number of derivatives that lead to a velocity."""


@dataclass(frozen=True)
class MotionReading:
    """Two channels read as a force and the motion that it causes.

    `kind` tells whether the motion is a position or a velocity. `unexplained` is the fraction of the force's variance
    that inertia and friction leave, the mean over time scales; 1 if their signs contradict each other. `sign` is -1 if
    the force acts against the motion. `doubt` is 1 if the force is proportional to the acceleration alone, 2 if it is
    proportional to the velocity alone at some time scale, and 4 more if the sign is -1.
    """

    force: Channel
    motion: Channel
    kind: str
    unexplained: float
    sign: int = 1
    doubt: int = 0

    def channel(self, role: str) -> Channel | None:
        """Return the channel to which this reading gives a role; None for other roles."""
        return self.force if role == "force" else self.motion if role == self.kind else None


SHARE_LEFT_BY_A_READING = 0.5
"""Largest fraction of a force that a useful reading by mechanics leaves."""


def motion_readings(forces: Sequence[Channel], motions: Sequence[tuple[Channel, str]]) -> list[MotionReading]:
    """Fit every force with every motion (a channel and its kind); the best reading comes first.

    Readings that mechanics refutes come last; before them, readings in which the force opposes the motion, or is
    proportional to velocity or acceleration alone (one channel may be the reference or the derivative of the other).
    """
    signals = {id(channel): _filled(channel) for channel in (*forces, *(motion for motion, _ in motions))}
    readings = []
    for force, (motion, kind) in product(forces, motions):
        values, moved = signals[id(force)], signals[id(motion)]
        if force is not motion and values is not None and moved is not None and len(values) == len(moved):
            readings.append(_reading(force, motion, kind, values, moved))
    refuted = SHARE_LEFT_BY_A_READING
    return sorted(readings, key=lambda one: (one.unexplained > refuted, one.doubt, one.unexplained))


def with_positions_first(readings: Sequence[MotionReading]) -> list[MotionReading]:
    """Move a position first whose derivative is the velocity of the best reading.

    A position contains all that its derivative contains, and also the micrometres of bending bristles.
    """
    best, refuted = readings[0], SHARE_LEFT_BY_A_READING
    as_good = [one for one in readings if one.doubt == best.doubt and one.unexplained <= refuted]
    first = [one for one in as_good if one.force is best.force and _is_integral(one, best)]
    return [*first, *(one for one in readings if one not in first)]


CORRELATION_OF_A_PAIR = 0.99
"""Correlation above which two channels may be the commanded and the measured one."""


def _is_integral(one: MotionReading, best: MotionReading) -> bool:
    """Tell whether a reading's position has the best reading's velocity as its derivative."""
    signals = [_filled(one.motion), _filled(best.motion)]
    if one.kind != "position" or best.kind != "velocity" or any(signal is None for signal in signals):
        return False
    place, speed = (signal for signal in signals if signal is not None)
    if len(place) != len(speed):
        return False
    columns = np.stack([np.cumsum(speed), np.arange(len(speed)), np.ones_like(speed)], axis=1)
    columns /= np.abs(columns).max(axis=0)
    solution, *_ = np.linalg.lstsq(columns, place, rcond=None)
    correlation = np.corrcoef(place - columns[:, 1:] @ solution[1:], columns[:, 0])[0, 1]
    return bool(correlation > CORRELATION_OF_A_PAIR)


SAMPLES_OF_A_PAIR = 20
"""Fewest samples from which the correlation of two channels is judged."""

RANGE_SHARE_OFF_A_CLOCK = 0.01
"""Largest deviation of a clock from a straight line, over its range."""


def is_ramp(channel: Channel) -> bool:
    """Tell whether a channel rises with every sample, as a counter or a clock with jitter does."""
    finite = channel.values[np.isfinite(channel.values)]
    if len(finite) < SAMPLES_OF_A_PAIR or not (np.diff(finite) > 0).all():
        return False
    line = np.linspace(finite[0], finite[-1], len(finite))
    off = float(np.abs(finite - line).max())
    return rises_evenly(finite) or off < RANGE_SHARE_OFF_A_CLOCK * float(np.ptp(finite))


def is_counter(channel: Channel) -> bool:
    """Tell whether a channel counts samples: it rises by 1 from whole number to whole number."""
    return len(channel.values) > 1 and bool((np.diff(channel.values) == 1).all()) and channel.values[0] % 1 == 0


SAMPLES_OF_A_SCALE = 2.0
"""Width of smoothing before differentiation on each time scale, in samples. With less, noise dominates."""


def leads(one: Channel, other: Channel) -> bool:
    """Tell whether a channel runs ahead of another with a similar motion, as a reference does.

    The velocities of both correlate best if the other is shifted back by a sample or more, up to a tenth of the record.
    """
    signals = [_filled(one), _filled(other)]
    size = len(one.values)
    if size != len(other.values) or any(signal is None for signal in signals):
        return False
    width = SAMPLES_OF_A_SCALE
    first, second = (gaussian_filter1d(signal, width, order=1) for signal in signals if signal is not None)
    products = correlate(second - second.mean(), first - first.mean(), method="fft")
    shift = int(np.argmax(products[size - 1 - size // 10 : size + size // 10])) - size // 10
    return shift >= 1


SAMPLES_OF_A_READING = 64
"""Fewest samples from which channels are recognised by mechanics (force, acceleration). Fewer fit by chance."""


def _filled(channel: Channel) -> np.ndarray | None:
    """Return a channel's values minus their mean, over their range; lost ones interpolated.

    Returns None for a channel with few values, or a constant one.
    """
    finite = np.isfinite(channel.values)
    if finite.sum() < SAMPLES_OF_A_READING or not np.ptp(channel.values[finite]) > 0:
        return None
    places = np.arange(len(channel.values))
    with np.errstate(all="ignore"):
        values = np.interp(places, places[finite], channel.values[finite])
        values = (values - values.mean()) / np.ptp(values) if channel.values.max() < np.inf else values
    return values if np.isfinite(values).all() else None


def _reading(force: Channel, motion: Channel, kind: str, values: np.ndarray, moved: np.ndarray) -> MotionReading:
    """Fit inertia and friction to a pair of channels, at several time scales.

    `values` and `moved`, shape (n,), are the samples of force and motion, without gaps. `kind` tells whether the motion
    is a position or a velocity.
    """
    rows = []
    while len(values) >= SAMPLES_OF_A_READING:
        rows += [row for row in [_fitted(values, moved, kind)] if row is not None]
        even = len(values) // 2 * 2
        values, moved = (array[:even].reshape(-1, 2).mean(axis=1) for array in (values, moved))
    if not rows:
        return MotionReading(force, motion, kind, 1.0)
    left, inertia, friction, alike = np.array(rows).T
    mean = float(np.where(inertia * friction >= 0, left, 1.0).mean())
    against = float(np.sum((1 - left) * (inertia + friction))) < 0
    same, size = CORRELATION_OF_A_PAIR, np.abs(inertia) + np.abs(friction)
    alone = 1 if (np.abs(inertia) > same * size).all() else 2 if alike.max() > same else 0
    return MotionReading(force, motion, kind, mean, -1 if against else 1, alone + 4 * against)


ROWS_OF_A_SCALE = 4000
"""Largest number of rows fitted on each time scale. More change nothing."""

SPEED_SHARE_OF_A_REST = 0.03
"""Fraction of the highest speed below which a body may rest, with unknown friction."""


def _fitted(values: np.ndarray, moved: np.ndarray, kind: str) -> tuple[float, float, float, float] | None:
    """Fit inertia and friction at one time scale; None if hardly anything moves.

    Returns the remaining fraction of the variance, the sizes of inertia and friction with their signs, and the
    correlation of the force with the velocity.
    """
    width, order = SAMPLES_OF_A_SCALE, 1 - KINDS.index(kind)
    edge, step = int(4 * width), max(1, len(values) // ROWS_OF_A_SCALE)
    inner = slice(edge, -edge, step)
    push = gaussian_filter1d(values, width)[inner]
    velocity, acceleration = (gaussian_filter1d(moved, width, order=order + more)[inner] for more in (0, 1))
    moves = np.abs(velocity) > SPEED_SHARE_OF_A_REST * np.percentile(np.abs(velocity), 99)
    push, velocity, acceleration = push[moves], velocity[moves], acceleration[moves]
    if len(push) < SAMPLES_OF_A_PAIR or not np.var(push) > 0:
        return None
    columns = np.stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)
    columns /= np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
    solution, *_ = np.linalg.lstsq(columns, push, rcond=1e-9)
    left = float(np.var(push - columns @ solution) / np.var(push))
    friction = float(solution[1] * np.std(columns[:, 1]) + solution[2] * np.std(columns[:, 2]))
    alike = abs(float(np.corrcoef(push, velocity)[0, 1])) if np.var(velocity) > 0 else 0.0
    return left, float(solution[0] * np.std(columns[:, 0])), friction, alike


SPEED = ROLES["velocity"]

TURNS = f"--axis {ROTARY.name}"
"""The option for a rotary axis."""

_TURNED = {ROTARY.unit(unit) for unit in ROLES.values()} - {*ROLES.values()}
"""Units that only a rotary axis has."""


@dataclass
class Notes:
    """Remarks and unconverted units, collected while a log is read."""

    read: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Reading:
    """Rules for reading channels: the table, the user's mapping, and the accepted units.

    With `strict`, only units that convert to the roles' are accepted, except for `foreign` roles (a force in volts).
    `bare` is true if the file's format has no units; `origin` is the path.
    """

    table: ChannelTable
    mapping: Mapping
    strict: bool
    bare: bool
    origin: str
    foreign: tuple[str, ...] = ()

    def unit(self, role: str) -> str:
        """Return the SI unit of a role on the logged axis, linear or rotary."""
        return self.mapping.axis_kind.unit(ROLES[role])

    def takes(self, role: str, si: str) -> bool:
        """Tell whether a signal of a role may stay in the unit `si`.

        This is so for the role's own unit, for any unit unless reading is `strict`, and for foreign roles in volts or
        amperes.
        """
        return si == self.unit(role) or not self.strict or (role in self.foreign and si in FOREIGN)


def with_user_units(table: ChannelTable, mapping: Mapping, times: bool, origin: str) -> ChannelTable:
    """Return the table with the user's units, and with times derived from time columns.

    Times are derived if the format has no `times` of its own. Raises LogError for an unknown unit, or for a channel
    that the table lacks.
    """
    if not mapping.units:
        return table
    units = {id(find(table, name, "unit", origin)): unit for name, unit in mapping.units.items()}
    for name, unit in mapping.units.items():
        if not is_unit(unit):
            expected = "a unit such as mm, um, rad, V, A or counts"
            raise LogError("unit", quoted(unit), expected, option("--unit", name, "mm"), origin)
    channels = [replace(channel, unit=units.get(id(channel), channel.unit)) for channel in table.channels]
    if not times:  # times come from the table's columns
        channels = [replace(channel, time=None) for channel in channels]
    timed = zip(channels, with_times(channels, table.interval), strict=True)
    timed_channels = tuple(new if old.time is None else old for old, new in timed)
    return replace(table, channels=timed_channels)


LARGEST_VALUE = 1e30
"""Largest number of an instrument. Beyond it, squares of squares overflow."""


def signal(choice: AssignedRole, reading: Reading, notes: Notes) -> np.ndarray:
    """Return the values of a channel in the unit of its role, and add notes on the conversion.

    Raises LogError for a unit that does not fit, and for values that no instrument measures.
    """
    channel, role = choice.channel, choice.role
    values, bits = unwrapped(channel.values) if ROLES[role] == "m" else (channel.values, 0)  # encoder counters overflow
    if bits:
        notes.warnings.append(f"{role}: {channel.name} treated as a {bits}-bit counter that overflows: unwrapped")
    scale = reading.mapping.scales.get(role)
    unit = channel.unit
    if unit in RMS:
        notes.warnings.append(
            f"{role}: {channel.name} is in amperes RMS, and so is what is told per ampere; a motor constant per ampere "
            "of peak is 0.707 times that per ampere RMS"
        )
    if scale is not None:
        value, implied = _scaled(role, scale, unit, reading)
        line = f"{scale}" + ("" if unit else f", its values taken to be in {implied} as the scale implies")
    elif _taken_as_si(choice, reading):
        assumed = f"assumed to be in {reading.unit(role)}"
        value, line = 1.0, f"no unit in the file: {assumed}"
        notes.warnings.append(f"{role}: {channel.name} has no unit (this format has none): {assumed}")
    else:
        value, si = in_si(unit, reading.unit(role))
        line = f"in {unit}" if unit else "without a unit"
        if si != reading.unit(role):
            if not reading.takes(role, si):
                raise _wrong_unit(choice, unit, si, reading)
            notes.units[role] = si
    notes.read.append(f"{role}: {channel.name} ({channel.source}), {choice.reason}; {line}")
    with np.errstate(all="ignore"):  # NaN is left to the time base
        values = values * value
        most = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    if most > LARGEST_VALUE:
        actual = f"values up to {most:.3g} {notes.units.get(role, reading.unit(role))}"
        raise LogError(role, actual, "values that an instrument can measure; is the file damaged?", "", reading.origin)
    return values


def _scaled(role: str, scale: str, unit: str, reading: Reading) -> tuple[float, str]:
    """Return the factor of a scale to SI, and the unit that the channel has or must have for it.

    Raises LogError for a scale that does not fit.
    """
    try:
        return read_scale(role, scale, unit, reading.mapping.axis_kind)
    except InputError as error:
        raise error.found_in(reading.origin) from None


def unit_gap(choice: AssignedRole, reading: Reading) -> LogError | None:
    """Return the error for a missing or wrong unit of a channel; None if its unit fits.

    Raises LogError for a scale that does not fit.
    """
    si = in_si(choice.channel.unit, reading.unit(choice.role))[1]
    scale = reading.mapping.scales.get(choice.role)
    if scale is not None:
        _scaled(choice.role, scale, choice.channel.unit, reading)
    if scale is not None or reading.takes(choice.role, si) or _taken_as_si(choice, reading):
        return None
    return _wrong_unit(choice, choice.channel.unit, si, reading)


def _taken_as_si(choice: AssignedRole, reading: Reading) -> bool:
    """Tell whether a channel without a unit is taken as SI.

    The user must have assigned the channel, and the format must have no units. A current or voltage in place of a force
    is never taken as SI.
    """
    bare = not choice.channel.unit and reading.strict and choice.by_user and reading.bare
    return bare and not _electric_unit(choice)


def turning_names(choices: Sequence[AssignedRole]) -> list[str]:
    """List names of channels without a unit that imply angles or torques.

    The list is empty if a motion channel has a unit, which tells whether the axis turns.
    """
    has_unit = any(choice.channel.unit and LENGTH in ROLES[choice.role] for choice in choices)
    bare = [choice.channel.name for choice in choices if not choice.channel.unit and not has_unit]
    return [name for name in bare if likely_unit(words(name)) in _TURNED]


def _electric_unit(choice: AssignedRole) -> str:
    """Return A or V if the name of a channel for a force implies it, else ""."""
    parts = words(choice.channel.name) if choice.role == "force" else []
    unit = "A" if parts == ["i"] else likely_unit(parts)
    return unit if unit in ("A", "V") else ""


def _wrong_unit(choice: AssignedRole, unit: str, si: str, reading: Reading) -> LogError:
    """Build the error for a channel whose unit does not fit its role or is missing."""
    role, name, wanted = choice.role, choice.channel.name, reading.unit(choice.role)
    if not unit:
        usual, travel = _likely_length(choice.channel, wanted)
        counted = LENGTH in ROLES[role] and _counted(choice.channel.values)
        usual = "rpm" if wanted == ROTARY.unit(SPEED) and "rpm" in words(name) else usual
        actual = f"{quoted(name)}, which has no unit{_span(choice.channel.values)}"
        expected = f"a unit convertible to {wanted}"
        example, electric = option("--unit", name, usual), _electric_unit(choice)
        if role == "force":
            scale = f"{wanted}/{electric or 'V'}"
            expected += f", or a scale such as {option('--scale', role, f'35 {scale}')}"
            example = f'--scale {role}="NUMBER {scale}"' if electric else example
        if electric and role in reading.foreign:
            usual, example = electric, option("--unit", name, electric)
            expected += f"; without one, all is told per {electric}"
        if counted:
            scale = f'--scale {role}="NUMBER {wanted}/count"'
            return LogError(role, actual, f"{expected}; whole numbers like these may be counts", scale, reading.origin)
        if not electric or role in reading.foreign:
            expected += guess(usual, travel)
        return LogError(role, actual, expected, example, reading.origin)
    number = "35.1507" if role in ("force", "disturbance") else "5e-7" if si == "count" else "1.5"
    scale = f"{wanted}/({si})" if "/" in si else f"{wanted}/{si}"
    expected = f'a scale to {wanted}, such as --scale {role}="{number} {scale}"'
    example = f'--scale {role}="NUMBER {scale}"'  # an invented scale could be copied by mistake
    if si == ROTARY.unit(wanted) and LENGTH in ROLES[role]:
        expected, example = f"{expected}; or {TURNS} for an axis that turns", TURNS
    return LogError(role, f"{quoted(name)} in {unit}", expected, example, reading.origin)


LARGEST_TRAVEL_IN_WHOLE_UNITS = 1000.0
"""Largest travel of whole numbers without a unit that is no counter. A travel of more is at least in um."""


def _counted(values: np.ndarray) -> bool:
    """Tell whether a channel holds whole numbers that change by more than one unit would on a machine."""
    finite = values[np.isfinite(values)]
    wide = finite.size > 0 and np.ptp(finite) > LARGEST_TRAVEL_IN_WHOLE_UNITS
    return bool(wide and (finite == np.round(finite)).all())


def _likely_length(channel: Channel, wanted: str) -> tuple[str, str]:
    """Return the likely unit of a position or velocity, and its range in words in that unit.

    A travel between 0.5 mm and 0.5 m is likely, and a speed between 5 mm/s and 5 m/s. Other quantities keep the unit
    `wanted`.
    """
    most = {LENGTH: 0.5, SPEED: 5.0}.get(wanted)
    if most is None:
        return wanted, ""
    finite = channel.values[np.isfinite(channel.values)]
    fast = float(np.abs(finite).max()) if wanted == SPEED and finite.size else 0.0
    size = float(np.ptp(finite)) if wanted == LENGTH and finite.size else fast
    unit, factor = ("m", 1.0) if size <= most else ("mm", 1e-3) if size <= 1e3 * most else ("um", 1e-6)
    rate, what = ("/s", "speeds up to") if wanted == SPEED else ("", "a travel of")
    return f"{unit}{rate}", f"{what} {1e3 * factor * size:.3g} mm{rate}"


def _span(values: np.ndarray) -> str:
    """Return the range of a channel in words."""
    finite = values[np.isfinite(values)]
    return f" and runs from {finite.min():.4g} to {finite.max():.4g}" if finite.size else ""


def instants(choice: AssignedRole, clock: AssignedRole | None, reading: Reading, notes: Notes) -> np.ndarray | None:
    """Return the instants of a channel [s]; None if nothing states them.

    Raises LogError for a time column in an unusable unit.
    """
    channel = choice.channel
    if reading.mapping.sample_time is not None:
        return reading.mapping.sample_time * np.arange(channel.values.size)
    fits = clock is not None and clock.channel.values.size == channel.values.size
    if clock is not None and fits and (clock.by_user or channel.time is None):
        return clock.channel.values * _seconds(clock, reading, notes)
    return channel.time


def _seconds(clock: AssignedRole, reading: Reading, notes: Notes) -> float:
    """Return how many seconds the unit of the time channel has.

    Raises LogError for a channel without a unit of time.
    """
    name, unit = clock.channel.name, clock.channel.unit
    if not unit and clock.by_user and reading.bare:
        line = f"time: {name} has no unit (this format has none): assumed to be in s"
        notes.warnings += [line] if line not in notes.warnings else []
        return 1.0
    value = unit_factor(unit, "s") if unit else None
    if value is None:
        actual = f"{quoted(name)} in {unit}" if unit else f"{quoted(name)}, which has no unit"
        expected = "; or ".join(text for text in ("a unit convertible to s", _offers(reading.table)) if text)
        likely, step = _likely_unit(clock.channel)
        expected += guess(likely, step)
        raise LogError("time", actual, expected, option("--unit", name, likely), reading.origin)
    return value


def _likely_unit(clock: Channel) -> tuple[str, str]:
    """Return the likely unit of a time channel, and its time step in words."""
    steps = np.diff(clock.values)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    unit, size = ("s", 1e3) if step <= 0.1 else ("ms", 1.0) if step <= 100 else ("us", 1e-3)
    unit, size = (unit, size) if step <= 1e5 else ("ns", 1e-6)
    return unit, f"a sample time of {size * step:.3g} ms"


def no_time(channel: Channel, reading: Reading) -> LogError:
    """Build the error for a channel without instants."""
    offers = _offers(reading.table)
    expected = "; or ".join(text for text in ("a time channel or a sample time", offers) if text)
    offer = re.match(r'--dt "[^"]*"', offers)
    clocks = [other for other in reading.table.channels if other is not channel and _may_be_a_clock(other)]
    counters = [other.name for other in reading.table.channels if is_counter(other)]
    example = offer[0] if offer else '--dt "NUMBER ms"'
    if clocks and not offer:
        expected += guess(clocks[0].name, "it rises evenly")
        likely, step = ("", "") if clocks[0].unit else _likely_unit(clocks[0])
        expected += guess(likely, step) if likely else ""
        units = [option("--unit", clocks[0].name, likely)] if likely and not reading.bare else []
        example = " ".join([option("--map", "time", clocks[0].name), *units])
    elif counters:
        expected += f" ({quoted(counters[0])} counts samples)"
    return LogError("time", f"no time stamps for {quoted(channel.name)}", expected, example, reading.origin)


def _may_be_a_clock(channel: Channel) -> bool:
    """Tell whether a channel may be a clock: rising, in a unit of time or none, and no counter."""
    return is_clock(channel) or (not channel.unit and is_ramp(channel) and not is_counter(channel))


def _offers(table: ChannelTable) -> str:
    """Write which single numbers in the file could be the sample time; "" if none could.

    The user has to choose one; none is used unasked.
    """
    offers = []
    for name, value in table.scalars.items():
        plain = name.rpartition(".")[2].lower().replace("_", "")
        if plain in RATES and value > 0:
            offers.append(f'--dt "{1e3 / value:.9g} ms", if {name} = {value:g} in the file is the sample rate in Hz')
        if plain in STEPS and value > 0:
            offers.append(f'--dt "{value:.9g} s", if {name} = {value:g} in the file is the sample time in s')
    return "; ".join(offers)


def unused(mapping: Mapping, chosen: Roles[str, AssignedRole], origin: str) -> None:
    """Check that every scale is for a role that has a channel.

    Raises LogError for a scale without one.
    """
    for role in mapping.scales:
        if role not in chosen:
            raise LogError("scale", f"a scale for {role}, which has no channel", "a channel for it",
                             f'--map {role}="CHANNEL"', origin)  # fmt: skip
