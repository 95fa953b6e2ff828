"""Give the one block of `friso bode`: stability, margins and Bode plots."""

from __future__ import annotations

from functools import partial
from typing import Any

from friso.frequency.bode import Bode, Limits
from friso.frequency.margins import Margins
from friso.frequency.system import Members
from friso.questions.bode.figures import bode_figures
from friso.questions.bode.numbers import rows
from friso.questions.bode.states import has_limiter, shown_states, side
from friso.questions.bode.words import details, sentences
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import GREEN, VERMILLION


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
        "worst": _at(bode, *bode.worst),
        "worst_settled": _at(bode, *bode.settled),
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


def _at(bode: Bode, member: Members, margins: Margins, gains: str) -> dict[str, Any]:
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
