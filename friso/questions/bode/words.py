"""Say where the controller is stable, why not elsewhere, and how fast it may be.

The one block of `friso bode` holds these sentences, with stability, margins and Bode plots.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.equations.structure import structure
from friso.frequency.bode import COMFORTABLE_MARGIN, Bode, Limits, Range, Unstable
from friso.frequency.margins import Margins
from friso.frequency.system import Members
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.numbers import (
    SERIES,
    cart,
    growth,
    has_friction,
    has_limiter,
    in_words,
    place,
    rows,
    shown_states,
    side,
    with_gains,
)
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import GREEN, VERMILLION
from friso.shown.text import (
    Alternatives,
    Words,
    always,
    listed,
    range_with_unit,
    say,
    say_all,
    window_with_unit,
    with_unit,
)


def sentences(bode: Bode) -> list[str]:
    """Say whether the loop is stable, why not, and how fast the controller may be."""
    return say(bode, _SAYS, _WORDS)


def details(bode: Bode) -> list[str]:
    """Say which state is worst, how fast the controller may be in other states of the joint, and what that means."""
    others = [
        f"Joint {name}: {_fast(bode, name)}{_ends(bode.limits[name], name, bode)}."
        for name in bode.limits
        if name != "given"
    ]
    return [*say_all(bode, _MORE, _WORDS), *others]


def _alone(bode: Bode) -> bool:
    """Tell whether the loop has a single state, as without friction and limiter."""
    return len(bode.scan.members) * len(bode.scans) == 1


def _settled_stable(bode: Bode) -> bool:
    """Tell whether the loop is stable in all settled states: the limit cases, and stuck under any bias force."""
    return bode.settled[1].stable


def _of_tuning(bode: Bode) -> bool:
    """Tell whether the loop is unstable in a limit case or a stuck state, where friction does not fall with speed."""
    settled = all(case.margins.stable for name, case in bode.cases.items() if not name.endswith(SERIES))
    return not (settled and all(scan.stable[scan.members.settled].all() for scan in bode.scans.values()))


def _by_crossover(bode: Bode) -> bool:
    """Tell whether a key of the controller sets its bandwidth."""
    return bode.stage.controller.bandwidth_key is not None


def _left_out(bode: Bode) -> list[str]:
    """List what limits the bandwidth of a real machine and is not in the stage file."""
    drive = bode.stage.drive
    causes = [] if drive is not None and drive.sample_time is not None else ["sampling (drive.sample_time)"]
    causes += [] if drive is not None and drive.delay is not None else ["delay (drive.delay)"]
    return [*causes, "modes" if bode.stage.parasitic is None else "modes beyond the one in [parasitic]"]


def _unit(bode: Bode) -> str:
    """Return the unit of the bandwidth: hertz, or multiples of the present bandwidth."""
    return "Hz" if _by_crossover(bode) else "times this one"


def _margin(margins: Margins) -> str:
    """Write the modulus margin with the frequency at which the loop is closest to -1."""
    return f"modulus margin {margins.modulus_margin:.3g} at {with_unit(margins.closest, 'Hz')}"


def _worst(bode: Bode, member: Members, margins: Margins, gains: str) -> str:
    """Write a state of the loop, and its margin or how fast a deviation grows in it."""
    size = _margin(margins) if margins.stable else f"where a deviation {growth(margins)}"
    return f"{with_gains(place(member, bode), gains)}, {size}"


def _states_checked(bode: Bode) -> str:
    """Write which states of friction were checked."""
    members = bode.scan.members
    speeds, biases = members.speed[~members.stuck], np.abs(members.bias)
    parts = [f"stuck under bias forces of up to {with_unit(biases.max(), 'N')}"] if biases.any() else []
    parts += [f"sliding at {range_with_unit(speeds.min(), speeds.max(), 'm/s')}"] if has_friction(bode) else []
    parts += ["limiter free and touched"] if has_limiter(bode) else []
    parts += [gains for gains in bode.scans if gains]
    return f"{', '.join(parts)} ({len(members) * len(bode.scans)} states)"


def _where(bode: Bode) -> str:
    """List the unstable states: stuck ones by bias force, sliding ones by range of speed."""
    members, states = bode.scan.members, []
    for gains, scan in bode.scans.items():
        for touched in np.unique(members.touched[members.stuck & ~scan.stable]).tolist():
            rest = members.stuck & (members.touched == touched) & ~scan.stable
            state = in_words(_stuck(members.bias[rest], bode), touched, has_limiter(bode))
            states.append(with_gains(state, gains))
    return "; ".join([*states, *(_speeds(speeds, bode) for speeds in bode.unstable)])


def _stuck(unstable: np.ndarray, bode: Bode) -> str:
    """Name the unstable stuck states by their bias forces [N]; empty without friction."""
    if not has_friction(bode):
        return ""
    low, high = float(unstable.min()), float(unstable.max())
    if (low, high) == (bode.scan.members.bias.min(), bode.scan.members.bias.max()):
        return "stuck"
    return f"stuck under a bias force of {with_unit(low, 'N') if low == high else range_with_unit(low, high, 'N')}"


def _speeds(speeds: Unstable, bode: Bode) -> str:
    """Name a range of sliding speeds in which the loop is unstable."""
    searched = bode.scan.members.speed[~bode.scan.members.stuck]
    window = window_with_unit(speeds.low, speeds.high, (float(searched.min()), float(searched.max())), "m/s")
    way, whole = "sliding" if speeds.forward else "sliding backwards", window.startswith("all")
    at = "any speed" if whole else window if window[0].isdigit() else f"speeds {window}"
    return with_gains(in_words(f"{way} at {at}", speeds.touched, has_limiter(bode)), speeds.gains)


def _own(bode: Bode) -> str:
    """Return the name of the limits of the stage as given: by the state of its joint, if it has one."""
    joint = bode.stage.joint
    return "given" if joint is None else "locked" if joint.locked else "free"


def _fast(bode: Bode, name: str) -> str:
    """Say at which bandwidths the modulus margin is good, and at which the loop is stable; `name` is the joint's state.

    Only settled states count: the limit cases, and stuck under any bias force.
    """
    limits = bode.limits[name]
    if not limits.stable:
        return f"the loop is stable {_at((), limits, bode)}"
    if limits.comfortable == limits.stable:
        where = _at(limits.stable, limits, bode)
        return f"the loop is stable, with a modulus margin above {COMFORTABLE_MARGIN:g}, {where}"
    return (
        f"the modulus margin is above {COMFORTABLE_MARGIN:g} {_at(limits.comfortable, limits, bode)}, and the loop is "
        f"stable {_at(limits.stable, limits, bode)}"
    )


def _at(ranges: Sequence[Range], limits: Limits, bode: Bode) -> str:
    """Write ranges of the bandwidth, as "at crossovers of 2.00 to 14.1 Hz"."""
    name, unit = bode.stage.controller.bandwidth_name if _by_crossover(bode) else "bandwidth", _unit(bode)
    if not ranges:
        return f"at no {name} from {range_with_unit(*limits.searched, unit)}"
    if [*ranges] == [limits.searched]:
        return f"at every {name} from {range_with_unit(*limits.searched, unit)}"
    return f"at a {name} {listed([window_with_unit(*window, limits.searched, unit) for window in ranges], 'and')}"


def _ends(limits: Limits, name: str, bode: Bode) -> str:
    """Name in brackets the states that come closest to -1, and become unstable first, as the bandwidth rises."""
    ends = ((limits.closest, "closest to −1"), (limits.first_lost, "lost first"))
    states = []
    for state, meaning in ends:
        if state is not None and not _alone(bode):
            member, gains = state
            where = in_words(cart(member, bode), bool(member.touched[0]), name == "free")
            states.append(f"{meaning}: {with_gains(where, gains)}")
    return f" ({'; '.join(states)})" if states else ""


def _ends_open(bode: Bode) -> bool:
    """Tell whether the loop of the stage as given is still stable at the end of the search."""
    return bode.limits[_own(bode)].open_ended


_WORDS: Words[Bode] = {
    "at": lambda of: (
        "as given," if bandwidth(of.stage.flat()) is None else f"at {with_unit(bandwidth(of.stage.flat()), 'Hz')}"
    ),
    "margin": lambda of: _margin(of.settled[1]),
    "growth": lambda of: growth(of.settled[1]),
    "settled": lambda of: "at rest and sliding fast" if has_friction(of) else "in all limit cases",
    "where": _where,
    "worst": lambda of: _worst(of, *of.worst),
    "worst_settled": lambda of: _worst(of, *of.settled),
    "fast": lambda of: _fast(of, _own(of)),
    "left_out": lambda of: listed(_left_out(of), "and"),
    "states": _states_checked,
}

_SAYS: Sequence[Alternatives[Bode]] = (
    (
        (lambda of: _alone(of) and _settled_stable(of), "{at} the loop is stable, {margin}."),
        (_alone, "{at} the loop is unstable: a deviation {growth}."),
        (lambda of: of.stable, "{at} the loop is stable in every state; the worst is {worst}."),
        (_settled_stable, "{at} the loop is stable {settled}, but not {where}."),
        (always, "{at} the loop is unstable; the worst state is {worst_settled}."),
    ),
    (
        (lambda of: of.stable or _alone(of), ""),
        (_of_tuning, "This is a matter of tuning, not of friction."),
        (
            lambda of: all(speeds.falling for speeds in of.unstable),
            "Friction falls with speed there (Stribeck effect), so the stage sticks and slips; friso check says "
            "whether it hunts.",
        ),
    ),
    (
        (_ends_open, "{fast}; what limits it on the real machine, {left_out}, is not in the stage file."),
        (always, "{fast}."),
    ),
)
"""Sentences on the stability of the loop, why it is unstable, and how fast the controller may be."""

_MORE: Alternatives[Bode] = (
    (lambda of: not (_alone(of) or of.stable), "Unstable states: {where}."),
    (lambda of: not _alone(of), "Worst settled state: {worst_settled}."),
    (lambda of: not _alone(of), "States checked: {states}."),
    (
        lambda of: _by_crossover(of) and of.stage.controller.bandwidth_name == "crossover",
        "The crossover that is set is the target of van Dijk's rules, for the tuned mass alone; the loop itself "
        "crosses 0 dB where the table says, since friction, joint, sampling and delay are in it.",
    ),
    (
        lambda of: structure(of.stage.flat()).plays,
        "All this is for a load that stays on one flank of the backlash; friso check says whether the loop, however "
        "stable there, swings across it.",
    ),
)
"""Details: the worst settled state, what was checked, and what the crossover and a backlash mean for the analysis."""


def basis(bode: Bode) -> str:
    """Say from what the margins were computed, and how they are defined."""
    states = len(bode.scan.members) * len(bode.scans)
    return (
        f" from the equations of the simulation, linearised in {states} states. Margins follow their "
        "definitions: how much gain, phase or delay takes the loop to the edge of stability; phase margins count both "
        "lag and lead"
    )


def blocks(bode: Bode) -> list[AnswerBlock]:
    """Return the block of the answer."""
    states = shown_states(bode)
    block = AnswerBlock(
        title=bode.stage.name,
        sentences=sentences(bode),
        colours=[GREEN if bode.worst[1].stable else VERMILLION],
        columns=states,
        rows=rows(states),
        details=details(bode),
        draw=partial(bode_figures, bode),
        numbers=partial(bode_document, bode),
    )
    return [block]


def bode_document(bode: Bode) -> dict[str, Any]:
    """Return the JSON document of a linear analysis.

    Infinite and undefined numbers become null.
    """
    joint = bode.stage.joint
    state = "given" if joint is None else ("locked" if joint.locked else "free")
    crossover = bode.stage.controller.bandwidth_key is not None
    document = {
        "conclusion": sentences(bode)[0],
        "stage": bode.stage.name,
        "cases": {name: _margins(case.margins) for name, case in bode.cases.items()},
        "cascade_loops": {
            name: {loop: _margins(margins) for loop, margins in cascade.margins.items()}
            for name, cascade in bode.cascades.items()
        },
        "worst": _margins_at(bode, *bode.worst),
        "worst_settled": _margins_at(bode, *bode.settled),
        "unstable_speeds_m_per_s": [
            {
                **entries(unstable, "low", "high", "forward"),
                "limiter": _limiter(bode, unstable.touched),
                "gains": unstable.gains or None,
            }
            for unstable in bode.unstable
        ],
        "limits": {name: _limits(margins, "hz" if crossover else "factor") for name, margins in bode.limits.items()},
        "highest_stable_crossover_hz": bode.limits[state].highest_stable if crossover else None,
        "still_stable_there": bode.limits[state].open_ended,
    }
    return plain_json(document)


def _margins(margins: Margins) -> dict[str, Any]:
    """Return the stability margins and poles of one loop."""
    ratios = entries(margins, "stable", "crossovers_hz", "phase_margin_deg", "gain_margin", "gain_reduction")
    distances = entries(margins, "delay_margin_s", "modulus_margin", "peak_sensitivity", "closest_hz")
    return {**ratios, **distances, "poles": [[pole.real, pole.imag] for pole in margins.poles.tolist()]}


def _margins_at(bode: Bode, member: Members, margins: Margins, gains: str) -> dict[str, Any]:
    """Return the margins in one state of friction, with its bias force, speed, limiter and gains."""
    at = {
        "bias_n": float(member.bias[0]),
        "speed_m_per_s": float(member.speed[0]),
        "limiter": _limiter(bode, bool(member.touched[0])),
        "forward": bool(member.forward[0]),
        "gains": gains or None,
    }
    return {**_margins(margins), "at": at}


def _limiter(bode: Bode, touched: bool) -> str | None:
    """Return the state of the limiter, "free" or "touched"; None if it can have only one."""
    return side(touched) if has_limiter(bode) else None


def _limits(margins: Limits, unit: str) -> dict[str, Any]:
    """Return the crossovers at which the loop is stable, or has a good modulus margin.

    `unit` is a part of each key of the result: "hz", or "factor" for multiples of the bandwidth.
    """
    return {
        f"highest_stable_crossover_{unit}": margins.highest_stable,
        "still_stable_there": margins.open_ended,
        f"stable_{unit}": margins.stable,
        f"modulus_margin_above_half_{unit}": margins.comfortable,
        f"searched_{unit}": margins.searched,
    }
