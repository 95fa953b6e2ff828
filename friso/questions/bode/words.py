"""Say in sentences where the controller is stable, why not elsewhere, and how fast it may be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.equations.structure import structure
from friso.frequency.bode import Bode, Unstable
from friso.frequency.crossover import COMFORTABLE_MARGIN, Limits, Range
from friso.frequency.margins import Margins
from friso.frequency.members import Members
from friso.questions.bode.numbers import growth
from friso.questions.bode.states import SERIES, cart, has_friction, has_limiter, in_words, place
from friso.shown.drawing.prefixes import listed, range_with_unit, window_with_unit, with_unit

SETTLED = "the limit cases, and stuck under any bias force"


BACKLASH = (
    "All this is for a load that stays on one flank of the backlash; friso check says whether the loop, however stable "
    "there, swings across it."
)


TARGET = (
    "The crossover that is set is the target of van Dijk's rules, for the tuned mass alone; the loop itself crosses "
    "0 dB where the table says, since friction, joint, sampling and delay are in it."
)


def sentences(bode: Bode) -> list[str]:
    """Return all sentences: stability, how fast the controller may be, and caveats."""
    limits = [crossover_heading(bode), *crossovers(bode).values()]
    return [*stability(bode), *limits, *crossover_meaning(bode), *caveats(bode)]


def stability(bode: Bode) -> list[str]:
    """Say whether the loop is stable in the settled states, and with which margin.

    Settled states are the limit cases, and all states stuck under a bias force. Further sentences say whether the loop
    is stable in all other states, and why not.
    """
    if len(bode.scan.members) == 1:
        margins = bode.settled[1]
        state = f"stable, {_margin(margins)}" if margins.stable else f"not stable: a deviation {growth(margins)}"
        return [f"The loop is {state}."]
    member, margins = bode.settled
    states = f"all settled states ({SETTLED})" if has_friction(bode) else "all limit cases"
    worst = f"Worst: {place(member, bode)}, {_margin(margins) if margins.stable else growth(margins)}."
    but = f", but not {'; '.join(_where(bode))}" if margins.stable and not bode.stable else ""
    sentence = f"{_tuned(bode)}, this controller is {'' if margins.stable else 'not '}stable in {states}{but}. {worst}"
    if bode.stable:
        anywhere, least = bode.worst
        where = f"{place(anywhere, bode)}, {_margin(least)}"
        return [sentence, f"It is stable in every state: {_states_checked(bode)}. Worst: {where}."]
    elsewhere = [] if but else [f"Unstable: {'; '.join(_where(bode))}."]
    return [sentence, *elsewhere, *_why(bode)]


def _tuned(bode: Bode) -> str:
    """Say at which crossover or bandwidth the controller is tuned."""
    crossover = bandwidth(bode.stage.flat())
    return "As given" if crossover is None else f"At {with_unit(crossover, 'Hz')}"


def _margin(margins: Margins) -> str:
    """Write the modulus margin with the frequency at which the loop is closest to -1."""
    margin = f"modulus margin {margins.modulus_margin:.3g} (peak sensitivity {margins.peak_sensitivity:.3g})"
    return f"{margin} at {with_unit(margins.closest, 'Hz')}"


def crossover_heading(bode: Bode) -> str:
    """Return the heading of the sentences on how fast the controller can be."""
    if len(bode.scan.members) == 1:
        return f"How fast this controller can be, {_subject(bode)}:"
    settled = "settled states" if has_friction(bode) else "limit cases"
    return f"How fast this controller can be, {_subject(bode)} at which all {settled} are stable:"


def crossovers(bode: Bode) -> dict[str, str]:
    """Say, for each state of the joint, at which crossovers the loop is stable and robust.

    A controller given by gains has bandwidths in place of crossovers.
    """
    joint = bode.stage.joint
    as_given = "" if joint is None else ("locked" if joint.locked else "free")
    labels = {name: f"{name.capitalize()}{' (as given)' if name == as_given else ''}" for name in bode.limits}
    labels |= {"given": "As given"}
    return {name: f"{labels[name]}: {_limits(bode, name)}" for name in bode.limits}


def crossover_meaning(bode: Bode) -> list[str]:
    """Say that the crossover of a stage file is not where the loop crosses 0 dB."""
    return [TARGET] if _crossing(bode) and bode.stage.controller.bandwidth_name == "crossover" else []


def caveats(bode: Bode) -> list[str]:
    """Return the limits of the analysis in sentences.

    The loop is analysed on one flank of a backlash. If the search found no upper limit, effects that the stage file
    leaves out will set one.
    """
    ends = {limits.searched[1] for limits in bode.limits.values() if limits.open_ended}
    flanks = [BACKLASH] if structure(bode.stage.flat()).plays else []
    if not ends:
        return flanks
    drive = bode.stage.drive
    timed = drive is not None and drive.sample_time is not None
    causes = [] if timed else ["sampling (drive.sample_time)"]
    causes += [] if drive is not None and drive.delay is not None else ["delay (drive.delay)"]
    half = ", half the sampling frequency" if timed and _crossing(bode) else ""
    end, causes = with_unit(max(ends), _unit(bode)), listed([*causes, "modes"], "and")
    return [
        *flanks,
        f"The loop is still stable at {end}{half}, where the search ended; on the real machine {causes}, which the "
        "stage file leaves out, set a lower limit.",
    ]


def _crossing(bode: Bode) -> bool:
    """Tell whether a key of the controller sets its bandwidth."""
    return bode.stage.controller.bandwidth_key is not None


def _subject(bode: Bode) -> str:
    """Say in what the bandwidth is given: in crossovers, or multiples of the present bandwidth."""
    return f"in {bode.stage.controller.bandwidth_name}s" if _crossing(bode) else "in multiples of its bandwidth"


def _unit(bode: Bode) -> str:
    """Return the unit of the bandwidth: hertz, or multiples of the present bandwidth."""
    return "Hz" if _crossing(bode) else "times this bandwidth"


def _states_checked(bode: Bode) -> str:
    """Describe which states of friction were checked."""
    members = bode.scan.members
    parts = []
    if has_friction(bode):
        speeds, biases = members.speed[~members.stuck], np.abs(members.bias)
        parts += [f"stuck under bias forces of up to {with_unit(biases.max(), 'N')}"] if biases.any() else []
        parts.append(f"sliding at {range_with_unit(speeds.min(), speeds.max(), 'm/s')}")
    if has_limiter(bode):
        parts.append("limiter free and touched")
    return f"{', '.join(parts)} ({len(members)} states)"


def _where(bode: Bode) -> list[str]:
    """List the unstable states: stuck ones by bias force, sliding ones by range of speed."""
    members, stable = bode.scan.members, bode.scan.stable
    states = []
    for touched in np.unique(members.touched[members.stuck & ~stable]).tolist():
        rest = members.stuck & (members.touched == touched)
        states.append(in_words(_stuck(members.bias[rest & ~stable], bode), touched, has_limiter(bode)))
    return states + [_speeds(speeds, bode) for speeds in bode.unstable]


def _stuck(unstable: np.ndarray, bode: Bode) -> str:
    """Name the unstable stuck states by their bias forces [N]; empty without friction."""
    if not has_friction(bode):
        return ""
    low, high = float(unstable.min()), float(unstable.max())
    if (low, high) == (bode.scan.members.bias.min(), bode.scan.members.bias.max()):
        return "stuck"
    return f"stuck under a bias force of {with_unit(low, 'N') if low == high else range_with_unit(low, high, 'N')}"


def _speeds(unstable: Unstable, bode: Bode) -> str:
    """Name a range of sliding speeds in which the loop is unstable."""
    speeds = bode.scan.members.speed[~bode.scan.members.stuck]
    window = window_with_unit(unstable.low, unstable.high, (float(speeds.min()), float(speeds.max())), "m/s")
    return in_words(f"sliding{'' if unstable.forward else ' backwards'}, {window}", unstable.touched, has_limiter(bode))


def _why(bode: Bode) -> list[str]:
    """Say why states are unstable: by friction that falls with speed, or by tuning.

    The list is empty if neither explains all unstable states.
    """
    settled = all(case.margins.stable for name, case in bode.cases.items() if not name.endswith(SERIES))
    if not (settled and bode.scan.stable[bode.scan.members.stuck].all()):
        even = ": not even all settled states (listed below) are stable" if has_friction(bode) else ""
        return [f"This is a matter of tuning{even}."]
    if not all(speeds.falling for speeds in bode.unstable):
        return []
    return [
        "Friction falls with speed there (Stribeck effect), so the stage sticks and slips; a higher crossover may "
        "shrink the range. The settled states are stable; friso check determines whether the stage hunts."
    ]


def _limits(bode: Bode, name: str) -> str:
    """Say over which crossovers the loop is stable, and over which its modulus margin is good.

    `name` is the state of the joint.
    """
    limits = bode.limits[name]
    stable = _remark(bode, name, limits.highest_stable, "lost first", limits.first_lost)
    calm = _remark(bode, name, limits.highest_comfortable, "closest to −1", limits.closest)
    return (
        f"stable: {_windows(limits.stable, limits, bode)}{stable}; modulus margin above {COMFORTABLE_MARGIN:g}: "
        f"{_windows(limits.comfortable, limits, bode)}{calm}."
    )


def _remark(bode: Bode, name: str, end: float | None, meaning: str, member: Members | None) -> str:
    """Name in brackets the state that is unstable first, or closest to -1, as bandwidth rises.

    `member` is this state; with None the text is empty. `meaning` says in words why the state is named. The remark
    holds above the bandwidth `end` or, with None, for the stage as in the file. `name` is the state of the joint.
    """
    if member is None or len(bode.scan.members) == 1:
        return ""
    where = f"above {with_unit(end, _unit(bode))}" if end else "as given"
    state = in_words(cart(member, bode), bool(member.touched[0]), name == "free")
    return f" ({where}, {meaning}: {state})"


def _windows(ranges: Sequence[Range], limits: Limits, bode: Bode) -> str:
    """Write ranges of the bandwidth in words; without any, say in which range none was found."""
    unit = _unit(bode)
    windows = [window_with_unit(*window, limits.searched, unit) for window in ranges]
    return listed(windows, "and") or f"none from {range_with_unit(*limits.searched, unit)}"
