"""The JSON document of `friso bode`."""

from __future__ import annotations

from typing import Any

from friso.frequency.bode import Bode
from friso.frequency.crossover import Limits
from friso.frequency.margins import Margins
from friso.frequency.members import Members
from friso.views.bode.states import has_limiter, side
from friso.views.documents import plain_json


def bode_document(found: Bode) -> dict[str, Any]:
    """The JSON document of `bode`; infinite and undefined numbers are null."""
    given = found.stage.joint
    own = "given" if given is None else ("locked" if given.locked else "free")
    crossover = found.stage.controller.bandwidth_key is not None
    document = {
        "stage": found.stage.name,
        "cases": {name: _margins(case.margins) for name, case in found.cases.items()},
        "worst": _at(found, *found.worst),
        "worst_settled": _at(found, *found.settled),
        "unstable_speeds_m_per_s": [
            {"low": each.low, "high": each.high, "limiter": _limiter(found, each.touched), "forward": each.forward}
            for each in found.unstable
        ],
        "limits": {name: _limits(known, "hz" if crossover else "factor") for name, known in found.limits.items()},
        "highest_stable_crossover_hz": found.limits[own].highest_stable if crossover else None,
        "still_stable_there": found.limits[own].open_ended,
    }
    return plain_json(document)


def _margins(known: Margins) -> dict[str, Any]:
    return {
        "stable": known.stable,
        "crossovers_hz": list(known.crossovers),
        "phase_margin_deg": known.phase_margin,
        "gain_margin": known.gain_margin,
        "gain_reduction": known.gain_reduction,
        "delay_margin_s": known.delay_margin,
        "modulus_margin": known.modulus_margin,
        "peak_sensitivity": known.peak_sensitivity,
        "closest_hz": known.closest,
        "poles": [[pole.real, pole.imag] for pole in known.poles.tolist()],
    }


def _at(found: Bode, one: Members, known: Margins) -> dict[str, Any]:
    """The margins of a member of the family, and which one it is."""
    at = {
        "bias_n": float(one.bias[0]),
        "speed_m_per_s": float(one.speed[0]),
        "limiter": _limiter(found, bool(one.touched[0])),
        "forward": bool(one.forward[0]),
    }
    return {**_margins(known), "at": at}


def _limiter(found: Bode, touched: bool) -> str | None:
    return side(touched) if has_limiter(found) else None


def _limits(known: Limits, unit: str) -> dict[str, Any]:
    return {
        f"highest_stable_crossover_{unit}": known.highest_stable,
        "still_stable_there": known.open_ended,
        f"stable_{unit}": known.stable,
        f"modulus_margin_above_half_{unit}": known.comfortable,
        f"searched_{unit}": known.searched,
    }
