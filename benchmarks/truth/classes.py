"""Define classes of machines, by which attacks are counted.

A stage belongs to one law, one joint and one controller, and to each further class that fits.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.by_hand import joint_state
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.tables import BACKLASH, MOTOR_FRICTION, TRANSMISSION

BY_KEY = {
    "controller.error_deadband": "dead band of the error",
    "controller.integral_leak": "leak of the integral",
    "controller.integral_limit": "limit of the integral",
    "controller.integral_deadband": "dead band of the integral",
    "controller.integral_reset": "reset of the integral",
    "controller.standstill_window": "gains at standstill",
    "controller.schedule_error.1": "gains over the error",
    "controller.freeze_window": "freeze at the target",
    "controller.integral_rests_in_moves": "integral that rests in moves",
    "controller.stiction_push": "push at standstill",
    "controller.filters.1.kind": "filters",
    "friction.asymmetry": "asymmetric friction",
    "bias.cart": "constant force",
    "bias.stage": "constant force",
    "parasitic.frequency": "parasitic mode",
    f"{TRANSMISSION}.stiffness": "transmission",
    BACKLASH: "backlash",
}
"""Classes of stages that have a key other than 0, by the key."""


def classes_of(flat: Mapping[str, Any]) -> list[str]:
    """Return the classes of a stage given as flat keys, in alphabetical order."""
    return sorted({*_by_structure(flat), *(name for key, name in BY_KEY.items() if flat.get(key))})


def _by_structure(flat: Mapping[str, Any]) -> Iterator[str]:
    law, motor = flat["friction.model"], flat.get(f"{MOTOR_FRICTION}.model", "none")
    yield f"friction: {law}"
    yield f"joint: {joint_state(flat)}"
    yield f"controller: {flat['controller.kind']}"
    if "none" not in (law, motor):
        yield "two frictions"
    if FORCE_LIMIT in flat:
        yield "force limit, " + ("no anti-windup" if flat["controller.anti_windup"] == "none" else "anti-windup")
