"""What the thesis leaves to others, with the command that answers it; and its design method, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from friso.studies.thesis.gains import rig_crossover, rig_gains

if TYPE_CHECKING:
    from friso.studies.thesis import Reproduction

QUESTIONS: tuple[tuple[str, str, str], ...] = (
    (
        "Friction cannot be identified exactly (Sec. 4.2.3, 5)",
        "friso rig constant-speed examples/thesis_drive.toml",
        "which experiment reveals static, Coulomb and viscous friction and the Stribeck velocity, with intervals; "
        "friso identify reads them from measured logs",
    ),
    (
        "Little damping in the joint, and less stability in position (Sec. 4.3.2)",
        "friso rig in-position examples/thesis_drive.toml",
        "which disturbance moves the stage, and what more damping recovers",
    ),
    (
        "Not all relations between parameters are taken into account (Sec. 5)",
        "friso tune examples/thesis_rig.toml",
        "all settings at once: the least change that stops hunting; friso guideline has the law over all groups",
    ),
    (
        "Friction depends on the position (Sec. 4.2.3, 4.3.2)",
        "friso rig hunting examples/thesis_drive.toml",
        "the same moves on twenty rails along which friction varies",
    ),
    (
        "The count of peaks is no proper measure (Sec. 5)",
        "friso check examples/thesis_rig.toml",
        "the cycle itself, its amplitude, its multiplier, and the crossover above which none attracts",
    ),
    (
        "Other control than PID is out of scope (Sec. 5)",
        "friso compare examples/thesis_rig.toml",
        "the isolator beside faster controllers, a deadband, a reset integral and friction feedforward",
    ),
)
"""Open question (where), command, and what it answers."""

_STATIC, _STROKE = 3.0, 1e-3
_PARASITIC, _LARGEST = 360.0, 2.5


def method_rows(reproduction: Reproduction) -> list[Sequence[str]]:
    """The steps of Sec. 3.4: what the thesis does, what friso finds at the same step."""
    single = reproduction.linear.locked.single if reproduction.linear else None
    reached = (
        f"by Sec. 3.4.2 up to {single:.3g} Hz, where a mode reaches 0 dB too" if single else "not computed in this run"
    )
    limits = {v.claim.id: v for v in reproduction.verdicts}
    gap = _number(limits["F12A"], 0)
    softest = _STATIC / _STROKE
    gains = [_gains(mass) for mass in (1.7, _LARGEST)]
    return [
        ("1. Crossover that can be reached", "8 Hz chosen, so that it hunts; up to 60 Hz possible", reached),
        ("2. Friction of the bearing, its gap", "static 1 to 2.5 N measured; hunting from a gap of about 1 N", gap),
        (
            "3. Drive stiffness from static friction and stroke",
            f"{_STATIC:g} N over {_STROKE * 1e3:g} mm allow {softest / 1e3:g} N/mm; built: 2.4 N/mm, first parasitic "
            f"mode {_PARASITIC:g} Hz",
            f"built: {2.4e3 * _STROKE:.2g} N at full stroke; parasitic mode at {_PARASITIC / rig_crossover():.3g} "
            f"times the crossover (10 wanted): it would allow {_PARASITIC / 10:.3g} Hz",
        ),
        (
            "4. Gains for the largest mass",
            "Eq. 7, 8 with the mass identified",
            "; ".join(f"{mass:g} kg: {text}" for mass, text in zip((1.7, _LARGEST), gains, strict=True)),
        ),
    ]


def _number(verdict: object, part: int) -> str:
    finding = getattr(verdict, "finding", None)
    return finding.parts[part].number if finding else "not computed in this run"


def _gains(mass: float) -> str:
    """The gains for a mass [kg]."""
    proportional, integral, derivative = rig_gains(mass)
    return f"kp {proportional:.4g} N/m, ki {integral:.4g} N/(m s), kd {derivative:.4g} N s/m"
