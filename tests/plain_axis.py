"""A mass with viscous friction alone, in a PID loop with a force limit: its motion under a held force is known."""

from typing import Any

from friso.stage import Stage

MASS, DRAG, KP, KI, TIME = 2.0, 3.0, 4000.0, 9000.0, 1e-3


def plain_axis(kd: float, limit: float, motion: dict[str, str], **drive: Any) -> Stage:
    """Return an axis whose bristles are too soft to matter."""
    friction = {
        "model": "lugre",
        "static": "1 N",
        "coulomb": "1 N",
        "stribeck_velocity": "1 mm/s",
        "stribeck_exponent": 2,
        "bristle_stiffness": "1e-9 N/m",
        "bristle_damping": "0 N*s/m",
        "viscous": f"{DRAG} N*s/m",
    }
    controller = {"kind": "pid", "kp": f"{KP} N/m", "ki": f"{KI} N/(m*s)", "kd": f"{kd} N*s/m"}
    controller |= {"derivative_on": "measurement", "force_limit": f"{limit} N"}
    tables = {"drive": drive} if drive else {}
    return Stage(masses={"cart": f"{MASS} kg"}, friction=friction, controller=controller, motion=motion, **tables)
