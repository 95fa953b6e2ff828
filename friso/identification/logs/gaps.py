"""Collect all missing information about a log, with the options that supply it.

Channels for roles, units, or the sample time may be missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from friso.axis import ROTARY
from friso.errors import InputError, LogError
from friso.identification.logs.checks import samples_held
from friso.identification.logs.log import ROLES, Channel, ChannelTable
from friso.identification.logs.roles import (
    MEASURED,
    AssignedRole,
    Proposal,
    guess,
    is_wanted,
    listing,
    of_no_signal,
    option,
    role_of,
    wanted_of,
    words,
)
from friso.identification.logs.signals import (
    CORRELATION_OF_A_PAIR,
    KINDS,
    SAMPLES_OF_A_PAIR,
    SHARE_LEFT_BY_A_READING,
    TURNS,
    MotionReading,
    Notes,
    Reading,
    instants,
    is_ramp,
    leads,
    motion_readings,
    no_time,
    turning_names,
    unit_gap,
    with_positions_first,
)
from friso.identification.logs.units import OTHERS, unit_factor
from friso.quantities import quoted

OPTIONAL = ("velocity", "acceleration")
"""Roles that no analysis needs; with several candidates they stay empty."""

_INITIALS = {"reference": "rs", "position": "xyqps", "velocity": "v", "force": "fuivmk", "disturbance": "d"}
"""First letters that are usual for channels of a role, for choosing the example in a message."""


class GapsError(LogError):
    """Error with all information that is missing for reading logs.

    The example of each single error is the option that supplies the missing information. `proposed` has the proposed
    channels by role.
    """

    def __init__(self, gaps: Sequence[LogError], proposed: Mapping[str, str] | None = None) -> None:
        """Join the errors into one message, whose example supplies everything."""
        self.gaps, self.proposed = tuple(gaps), dict(proposed or {})
        (first, *more) = self.gaps
        if not more:
            super().__init__(first.key, first.actual, first.expected, first.example, first.origin)
            return
        sentences = [f"{gap.key}: {gap.expected}; given: {gap.actual}" for gap in self.gaps]
        origins = dict.fromkeys(gap.origin for gap in self.gaps)
        if len(origins) > 1:
            sentences = [f"{gap.origin}: {sentence}" for gap, sentence in zip(self.gaps, sentences, strict=True)]
        actual, expected = f"a log that leaves {len(sentences)} things open", "".join(map("\n    {}".format, sentences))
        super().__init__("", actual, expected, " ".join(self.options), ", ".join(origins))

    @property
    def options(self) -> tuple[str, ...]:
        """Return the options that supply all missing information, each once, quoted for a shell."""
        return tuple(dict.fromkeys(gap.example for gap in self.gaps if gap.example))


PAIRS_OF_A_READING = 1000
"""Largest number of pairs of a force and a motion that are tried. More take minutes, and one fits by chance."""

RATIO_OF_RIVAL_READINGS = 2.0
"""Ratio of residuals beyond which a reading is no rival of the best one."""


def told_by_mechanics(table: ChannelTable, proposal: Proposal, needed: Sequence[str]) -> list[MotionReading]:
    """Find force and motion among channels by mechanics, where names leave these roles open.

    Returns the best reading, then others that explain the force about as well; [] if nothing is open, or if no reading
    explains the force.
    """
    chosen, rivals = proposal.chosen, proposal.rivals
    if "position" not in needed or {"position", *({"force"} & {*needed})} <= chosen.keys():
        return []
    taken = [choice.channel for choice in chosen.values()]

    def candidates(role: str) -> list[Channel]:
        """List the channels that may have a role: its own, those competing for it, or all that fit."""
        if role in chosen:
            return [chosen[role].channel]
        every = rivals.get(role) or [channel for channel, _ in _fitting(role, table, taken)]
        return [channel for channel in every if not is_ramp(channel) and not wanted_of(channel.name, channel.unit)]

    kinds = KINDS if "position" not in {*chosen, *rivals} else KINDS[:1]
    kinds = KINDS[1:] if "velocity" in chosen and chosen["velocity"].by_user and "position" not in chosen else kinds
    motions = [(channel, kind) for kind in kinds for channel in candidates(kind)]
    forces = candidates("force")
    if len(forces) * len(motions) > PAIRS_OF_A_READING:
        return []
    readings = [one for one in motion_readings(forces, motions) if not _are_alike(one.force, one.motion)]
    if not readings or readings[0].unexplained > SHARE_LEFT_BY_A_READING:
        return []
    readings = with_positions_first(readings)
    most = max(RATIO_OF_RIVAL_READINGS * readings[0].unexplained, readings[0].unexplained + 0.01)
    return [reading for reading in readings if reading.unexplained <= most and reading.doubt == readings[0].doubt]


def check_gaps(
    reading: Reading, proposal: Proposal, needed: Sequence[str], readings: Sequence[MotionReading] = ()
) -> None:
    """Check that a log has every role in `needed`, with units and sample times.

    `readings` are pairs of channels that mechanics suggests as force and motion. Raises GapsError with everything that
    is missing.
    """
    table, origin = reading.table, reading.origin
    named = {id(choice.channel) for role, choice in proposal.chosen.items() if choice.by_user and role != "time"}
    signals = [c for c in table.channels if id(c) in named or (role_of(c.name, c.unit) or ("",))[0] != "time"]
    if len(signals) < len(needed):
        names = ", ".join(channel.name for channel in signals) or "none"
        missing = [role for role in needed if role not in {*proposal.chosen, *proposal.rivals}] or needed
        expected = f"channels for {' and '.join(needed)}: export the log with {' and '.join(missing)}"
        raise LogError("log", f"too few channels of signals: {names}", expected, "", origin)
    chosen = {role: choice for role, choice in proposal.chosen.items() if role in (*needed, "force")}
    gaps: list[LogError] = []
    for role, channels in proposal.rivals.items():
        if role in OPTIONAL and role not in needed:
            continue
        names = _named(channels)
        likely, why = _by_mechanics(role, readings, channels) or _of_alike(role, channels[0], channels)
        example = option("--map", role, likely.name) if likely else ""
        expected = "one channel" + (guess(likely.name) if likely else "")
        gaps.append(LogError(role, f"{len(channels)} candidates: {names}{why}", expected, example, origin))
        if role in needed and likely:
            chosen[role] = AssignedRole(role, likely, "", True)
    for role in [role for role in needed if role not in chosen and role not in proposal.rivals]:
        taken = {name: choice.channel for name, choice in (proposal.chosen | chosen).items()}
        free = [channel for channel, _ in _fitting(role, table, taken.values()) if not is_ramp(channel)]
        likely, why = _by_mechanics(role, readings, free) or _likeliest(role, table, taken)
        example = option("--map", role, likely.name) if likely else ""
        used = {id(channel) for channel in taken.values()}
        open_to_it = {id(channel) for channel in signals} - used
        left = listing(table, [channel for channel in table.channels if id(channel) not in open_to_it])
        missing = f"a channel of the {role}: export the log with it"
        expected = left + (guess(likely.name) if likely else "") if open_to_it else missing
        gaps.append(LogError(role, f"no channel whose name suggests it{why}", expected, example, origin))
        if likely:
            chosen[role] = AssignedRole(role, likely, "", True)
    gaps += _of_time(reading, proposal, [chosen[role] for role in needed if role in chosen])
    reference, place = proposal.chosen.get("reference"), chosen.get("position")
    if reference is not None and not reference.channel.unit and place is not None and unit_gap(place, reading):
        chosen.setdefault("reference", reference)
    gaps += _of_units(reading, chosen, bool(readings) and readings[0].sign < 0)
    if gaps:
        proposed = {role: choice.channel.name for role, choice in chosen.items() if role not in proposal.chosen}
        raise GapsError(gaps, proposed)


def _by_mechanics(
    role: str, readings: Sequence[MotionReading], channels: Sequence[Channel]
) -> tuple[Channel | None, str] | None:
    """Return the channel that mechanics suggests for a role, and the reason; None without one.

    The channel is None if two readings are about equally good.
    """
    named = {channel.name: channel for one in readings if (channel := one.channel(role)) is not None}
    if not named:
        return None
    best, *others = named.values()
    alike = [channel for channel in channels if channel is not best and _are_alike(channel, best)]
    if role in KINDS and alike:
        return _of_alike(role, best, [best, *alike])
    others = [channel for channel in others if not _are_alike(channel, best)]
    if others:
        either = " or ".join(option("--map", role, channel.name) for channel in (best, others[0]))
        return None, f"; by force, inertia and friction it is {either}"
    follows = "accelerates a mass" if role == "force" else "follows from the force as that of a mass with friction"
    return best, f"; {quoted(best.name)} {follows}"


def _of_units(reading: Reading, chosen: Mapping[str, AssignedRole], against: bool) -> list[LogError]:
    """List errors for missing units.

    If units or names of channels imply a rotary axis that the user did not state, the first error asks for the kind of
    axis. A force that acts `against` the motion that it causes gets a negative scale as its example.
    """
    gaps = {role: gap for role, choice in chosen.items() if (gap := unit_gap(choice, reading)) is not None}
    turning = [gap for gap in gaps.values() if gap.example == TURNS]
    names = turning_names([*chosen.values()]) if gaps and reading.mapping.axis is None else []
    if turning or names:
        guessed = "the kind of axis" + guess(ROTARY.name, "by the names")
        turning = turning or [LogError("--axis", f"channels {', '.join(names)}", guessed, TURNS, reading.origin)]
        rotary = replace(reading, mapping=replace(reading.mapping, axis=ROTARY.name))
        return [*turning, *_of_units(rotary, chosen, against)]
    force = gaps.get("force")
    if against and force is not None and not chosen["force"].channel.unit:
        unit = reading.unit("force")
        scale = f'--scale force="-1 {unit}/{unit}"'
        example = force.example.replace("NUMBER", "-NUMBER") if "NUMBER" in force.example else scale
        actual = f"{force.actual}, and accelerates the mass backward where it is positive"
        gaps["force"] = LogError("force", actual, force.expected, example, reading.origin)
    return [*gaps.values()]


def _likeliest(role: str, table: ChannelTable, taken: Mapping[str, Channel]) -> tuple[Channel | None, str]:
    """Return the channel that fits a role best (None without one), and the reason if unclear.

    Channels are compared by unit and first letter, if they change and are not `taken` for another role. A channel that
    follows the position, as a reference does, is no force.
    """
    fits = _fitting(role, table, taken.values())
    if role == "force":
        places = [taken[name] for name in ("position", "reference") if name in taken]
        places = places or [place for place, _ in _fitting("position", table, taken.values())[:1]]
        fits = [(channel, fit) for channel, fit in fits if not any(_are_alike(channel, place) for place in places)]
    if not fits:
        return None, ""
    best, fit = fits[0]
    return _of_alike(role, best, [channel for channel, other in fits if other[:4] == fit[:4]])


def _fitting(role: str, table: ChannelTable, taken: Iterable[Channel]) -> list[tuple[Channel, tuple[int, ...]]]:
    """Return the channels that may have a role, each rated by how well it fits, the best first.

    Channels with as many samples as most channels come first.
    """
    used = {id(channel) for channel in taken}
    usual = Counter(channel.values.size for channel in table.channels).most_common(1)[0][0]
    fits = [
        (channel, (channel.values.size == usual, *_fit(role, channel)))
        for channel in table.channels
        if id(channel) not in used
        and (role_of(channel.name, channel.unit) or ("",))[0] in ("", role)
        and not of_no_signal(channel.name)
        and not _is_of_another(role, channel.unit)
    ]
    return sorted(fits, key=lambda pair: pair[1], reverse=True)


def _kinds(role: str) -> tuple[str, ...]:
    """Return the units that a role may have on a linear or rotary axis."""
    return ROLES[role], *OTHERS.get(ROLES[role], ())


def _is_of_another(role: str, unit: str) -> bool:
    """Tell whether a unit is of another quantity, such as rpm for a position."""
    others = {"Hz", *ROLES.values(), *map(ROTARY.unit, ROLES.values())} - {*_kinds(role)}
    return bool(unit) and any(unit_factor(unit, kind) is not None for kind in others)


def _of_alike(role: str, best: Channel, channels: Sequence[Channel]) -> tuple[Channel | None, str]:
    """Choose the measured channel among channels that move alike, and say why.

    The measured channel is the only one whose name says that it was measured, or else the noisiest. The channel is None
    if that is unclear.
    """
    alike = [channel for channel in channels if channel is best or _are_alike(channel, best)]
    if role not in KINDS or len(alike) == 1:
        return best, ""
    said = [channel for channel in alike if MEASURED.intersection(words(channel.name))]
    if len(said) == 1:
        return said[0], f"; the name of {quoted(said[0].name)} says that it was measured"
    last = [one for one in alike if all(leads(other, one) for other in alike if other is not one)]
    (most, noisiest), (next_most, _) = sorted(((_noise(c), c) for c in alike), key=lambda pair: -pair[0])[:2]
    others = _named(channel for channel in alike if channel is not noisiest)
    held = any(samples_held(channel.values) > 1 for channel in alike)
    if last and (held or most < 2 * next_most or noisiest is last[0]):
        ahead = _named(channel for channel in alike if channel is not last[0])
        return last[0], f"; {ahead} goes ahead of {quoted(last[0].name)}, as a reference does"
    if last or most < 2 * next_most or held:
        return None, f"; {_named(alike)} are alike: one of them may be a reference"
    return noisiest, f"; {quoted(noisiest.name)} is like {others} with more noise, as what is measured has"


def _named(channels: Iterable[Channel]) -> str:
    """Return the names of channels in a sentence."""
    return " and ".join(quoted(channel.name) for channel in channels)


def _are_alike(one: Channel, other: Channel) -> bool:
    """Tell whether two channels correlate, as a position does with its reference."""
    if one.values.size != other.values.size:
        return False
    both = np.isfinite(one.values) & np.isfinite(other.values)
    if np.count_nonzero(both) < SAMPLES_OF_A_PAIR:
        return False
    first, second = one.values[both], other.values[both]
    with np.errstate(all="ignore"):
        less, more = sorted((np.ptp(first), np.ptp(second)))
        return bool(0 < more < 2 * less and np.corrcoef(first, second)[0, 1] > CORRELATION_OF_A_PAIR)


def _noise(channel: Channel) -> float:
    """Return a channel's noise relative to its range, by fourth differences."""
    finite = channel.values[np.isfinite(channel.values)]
    with np.errstate(all="ignore"):
        return float(np.std(np.diff(finite, 4)) / np.ptp(finite))


def _fit(role: str, channel: Channel) -> tuple[bool, int, bool, bool]:
    """Rate how well a channel fits a role, as a tuple to compare.

    The tuple rates whether the channel changes (but not like a clock), its unit, whether it was commanded or measured,
    and its first letter.
    """
    finite = channel.values[np.isfinite(channel.values)]
    changes = bool(finite.size and np.ptp(finite) > 0) and not is_ramp(channel)
    fits = bool(channel.unit) and any(unit_factor(channel.unit, kind) is not None for kind in _kinds(role))
    unit = 2 if fits else 1 if not channel.unit else 0
    first = next(iter(words(channel.name)), " ")[0]
    return changes, unit, is_wanted(channel.name) == (role == "reference"), first in _INITIALS.get(role, "")


def _of_time(reading: Reading, proposal: Proposal, choices: Sequence[AssignedRole]) -> list[LogError]:
    """List the error for the first channel without sample times; [] if all have them.

    The list is empty, too, if several channels compete to be the time, which is another error.
    """
    if "time" in proposal.rivals:
        return []
    for choice in choices:
        try:
            time = instants(choice, proposal.chosen.get("time"), reading, Notes())
        except InputError as error:
            return [LogError.of(error)]
        if time is None:
            return [no_time(choice.channel, reading)]
    return []
