"""What a linear analysis found, in sentences: where the controller is stable, why not elsewhere, how fast it may be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.frequency.bode import Bode, Unstable
from friso.frequency.crossover import WANTED, Limits
from friso.frequency.margins import Margins
from friso.frequency.members import Members
from friso.frequency.ranges import Range
from friso.views.bode.states import SERIES, cart, has_friction, has_limiter, in_words, place
from friso.views.bode.table import growth
from friso.views.drawing.prefixes import listed, range_with_unit, window_with_unit, with_unit

SETTLED = "the limit cases, and stuck under any bias force"


def sentences(found: Bode) -> list[str]:
    """All that is said, in order."""
    return [*stability(found), crossover_heading(found), *crossovers(found).values(), *caveats(found)]


def stability(found: Bode) -> list[str]:
    """Whether the one controller is stable in the settled states, and how well; whether in all others; and why not."""
    if len(found.scan.members) == 1:
        return [f"The loop is {_well(found.settled[1])}."]
    says = [_settled(found)]
    if found.stable:
        return [*says, f"So it is in every state: {_looked_at(found)}. Worst: {_worst(found)}."]
    return [*says, f"It is not stable in every state. Unstable: {'; '.join(_where(found))}.", *_why(found)]


def _settled(found: Bode) -> str:
    """The worst of the settled states, which is the answer to most questions."""
    one, known = found.settled
    states = f"all settled states ({SETTLED})" if has_friction(found) else "all limit cases"
    where = place(one, found)
    if known.stable:
        return f"{_tuned(found)}, this controller is stable in {states}. Worst: {where}, {_margin(known)}."
    return f"{_tuned(found)}, this controller is not stable in {states}. Worst: {where}, {growth(known)}."


def _tuned(found: Bode) -> str:
    flat = found.stage.flat()
    return f"At {with_unit(flat['controller.crossover'], 'Hz')}" if _crossing(found) else "As given"


def _well(known: Margins) -> str:
    return f"stable, {_margin(known)}" if known.stable else f"not stable: a deviation {growth(known)}"


def _margin(known: Margins) -> str:
    margin = f"modulus margin {known.modulus_margin:.3g} (peak sensitivity {known.peak_sensitivity:.3g})"
    return f"{margin} at {with_unit(known.closest, 'Hz')}"


def crossover_heading(found: Bode) -> str:
    """What the sentences of `crossovers` are about."""
    if len(found.scan.members) == 1:
        return f"How fast this controller may be, {_subject(found)}:"
    settled = "settled states" if has_friction(found) else "limit cases"
    return f"How fast this controller may be, {_subject(found)} that suit all {settled}:"


def crossovers(found: Bode) -> dict[str, str]:
    """By joint: at which crossovers (or bandwidths, of a controller by gains) it is stable, and comfortably so."""
    joint = found.stage.joint
    given = "" if joint is None else ("locked" if joint.locked else "free")
    labels = {name: f"{name.capitalize()}{' (as given)' if name == given else ''}" for name in found.limits}
    labels |= {"given": "As given"}
    return {name: f"{labels[name]}: {_limits(found, name)}" for name in found.limits}


def caveats(found: Bode) -> list[str]:
    """That stability does not go on for ever, where the search found no end."""
    ends = {known.searched[1] for known in found.limits.values() if known.open_ended}
    if not ends:
        return []
    drive = found.stage.drive
    timed = drive is not None and drive.sample_time is not None
    causes = [] if timed else ["sampling (drive.sample_time)"]
    causes += [] if drive is not None and drive.delay is not None else ["delay (drive.delay)"]
    half = ", half the sampling frequency" if timed and _crossing(found) else ""
    end, causes = with_unit(max(ends), _unit(found)), listed([*causes, "modes"], "and")
    return [
        f"The loop is still stable at {end}{half}, where the search ended; on the real machine {causes} that the stage "
        "file does not contain end that earlier."
    ]


def _crossing(found: Bode) -> bool:
    """Whether the controller has a crossover, or is given by its gains."""
    return "controller.crossover" in found.stage.flat()


def _subject(found: Bode) -> str:
    return "in crossovers" if _crossing(found) else "in multiples of its bandwidth"


def _unit(found: Bode) -> str:
    return "Hz" if _crossing(found) else "times this bandwidth"


def _looked_at(found: Bode) -> str:
    """The family in words."""
    members = found.scan.members
    parts = []
    if has_friction(found):
        speeds, biases = members.speed[~members.stuck], np.abs(members.bias)
        parts += [f"stuck under bias forces of up to {with_unit(biases.max(), 'N')}"] if biases.any() else []
        parts.append(f"sliding at {range_with_unit(speeds.min(), speeds.max(), 'm/s')}")
    if has_limiter(found):
        parts.append("limiter free and touched")
    return f"{', '.join(parts)} ({len(members)} states)"


def _where(found: Bode) -> list[str]:
    """The states that are not stable: stuck ones (or any, without friction), and the ranges of speed."""
    members, stable = found.scan.members, found.scan.stable
    said = []
    for touched in np.unique(members.touched[members.stuck & ~stable]).tolist():
        rest = members.stuck & (members.touched == touched)
        said.append(in_words(_stuck(members.bias[rest & ~stable], found), touched, has_limiter(found)))
    return said + [_speeds(each, found) for each in found.unstable]


def _stuck(lost: np.ndarray, found: Bode) -> str:
    """Stuck under these bias forces [N], or under any; nothing without friction."""
    if not has_friction(found):
        return ""
    low, high = float(lost.min()), float(lost.max())
    if (low, high) == (found.scan.members.bias.min(), found.scan.members.bias.max()):
        return "stuck"
    return f"stuck under a bias force of {with_unit(low, 'N') if low == high else range_with_unit(low, high, 'N')}"


def _speeds(lost: Unstable, found: Bode) -> str:
    speeds = found.scan.members.speed[~found.scan.members.stuck]
    window = window_with_unit(lost.low, lost.high, (float(speeds.min()), float(speeds.max())), "m/s")
    return in_words(f"sliding{'' if lost.forward else ' backwards'}, {window}", lost.touched, has_limiter(found))


def _why(found: Bode) -> list[str]:
    """What makes states unstable: friction that falls with speed, or tuning."""
    settled = all(case.margins.stable for name, case in found.cases.items() if not name.endswith(SERIES))
    if not (settled and found.scan.stable[found.scan.members.stuck].all()):
        even = ": not even the settled states (as below) are all stable" if has_friction(found) else ""
        return [f"That is a matter of tuning{even}."]
    if not all(each.falling for each in found.unstable):
        return []
    return [
        "There friction falls as the speed rises (Stribeck effect), which makes a stage stick and slip; a higher "
        "crossover may shrink the range. The settled states are stable; whether the stage hunts, friso check tells."
    ]


def _worst(found: Bode) -> str:
    one, known = found.worst
    return f"{place(one, found)}, {_margin(known)}"


def _limits(found: Bode, name: str) -> str:
    known = found.limits[name]
    stable = _remark(found, name, known.highest_stable, "lost first", known.first_lost)
    calm = _remark(found, name, known.highest_comfortable, "closest to −1", known.closest)
    return (
        f"stable: {_windows(known.stable, known, found)}{stable}; modulus margin above {WANTED:g}: "
        f"{_windows(known.comfortable, known, found)}{calm}."
    )


def _remark(found: Bode, name: str, end: float | None, what: str, one: Members | None) -> str:
    """Which state ends a range of crossovers, or is why there is none."""
    if one is None or len(found.scan.members) == 1:
        return ""
    where = f"above {with_unit(end, _unit(found))}" if end else "as given"
    return f" ({where}, {what}: {_state(found, name, one)})"


def _state(found: Bode, name: str, one: Members) -> str:
    """A state of a joint in words."""
    return in_words(cart(one) if has_friction(found) else "", bool(one.touched[0]), name == "free")


def _windows(ranges: Sequence[Range], known: Limits, found: Bode) -> str:
    unit = _unit(found)
    windows = [window_with_unit(*each, known.searched, unit) for each in ranges]
    return listed(windows, "and") or f"none from {range_with_unit(*known.searched, unit)}"
