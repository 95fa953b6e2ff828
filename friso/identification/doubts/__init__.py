"""Doubts about logs: a table of all, by name, with what each is."""

from __future__ import annotations

from friso.identification.doubt import Doubt
from friso.identification.doubts.controller import CHANGING_GAINS, MISSING_FEEDFORWARD, PERHAPS_FEEDFORWARD, WRONG_SIGN
from friso.identification.doubts.forces import (
    CHANGING_FRICTION,
    COGGING,
    COUPLING,
    FORCE_BY_PLACE,
    FRICTION_BY_DIRECTION,
    FRICTION_BY_PLACE,
    LOAD_FRICTION,
    PLAY,
)
from friso.identification.doubts.record import (
    ABOUT_RECORDS,
    CONSTANT_FORCE,
    DELAY,
    DIFFERING_HALVES,
    DRIFTING_DELAY,
    DRIFTING_FORCE,
    OSCILLATION,
)
from friso.identification.doubts.values import (
    BREAK_AWAY_FRICTION,
    DECAYING_DAMPING,
    IMPLAUSIBLE_VALUE,
    IMPOSSIBLE_VALUE,
    LITTLE_FRICTION,
    LOST_INERTIA,
    SLOW_MOTION,
    STIFFER_BRISTLES,
)

TABLE: dict[str, tuple[Doubt, str]] = {
    **ABOUT_RECORDS,
    "break-away-friction": (
        BREAK_AWAY_FRICTION,
        "Doubt: motions begin with more friction than the fitted static friction, "
        "because the fit leaves these moments out",
    ),
    "changing-friction": (
        CHANGING_FRICTION,
        "Doubt: friction or a constant force changes during the record, by warming up or by drift",
    ),
    "changing-gains": (
        CHANGING_GAINS,
        "Doubt: the controller's gains change during the record, by speed, by place, or at an instant",
    ),
    "cogging": (
        COGGING,
        "Doubt: a force that varies along the way, such as cogging, a cable or a slope, passes for friction and mass",
    ),
    "constant-force": (
        CONSTANT_FORCE,
        "Doubt: a constant force exceeds the friction, by gravity or by an offset of the channel",
    ),
    "coupling": (
        COUPLING,
        "Doubt: a compliant coupling between force and position makes the mass too large or too small",
    ),
    "decaying-damping": (
        DECAYING_DAMPING,
        "Doubt: damping of the bristles that falls with the speed makes them look stiffer",
    ),
    "delay": (
        DELAY,
        "Doubt: a delay between force and motion, too short to show in the inverse model, passes for damping",
    ),
    "differing-halves": (DIFFERING_HALVES, "Doubt: mass or friction differs between the halves of a record"),
    "drifting-delay": (DRIFTING_DELAY, "Doubt: the delay between force and motion drifts along the record"),
    "drifting-force": (DRIFTING_FORCE, "Doubt: the force drifts along the record"),
    "force-by-place": (FORCE_BY_PLACE, "Doubt: a force depends on the position, such as a spring, a cable or cogging"),
    "friction-by-direction": (FRICTION_BY_DIRECTION, "Doubt: dry friction differs between forward and backward motion"),
    "friction-by-place": (
        FRICTION_BY_PLACE,
        "Doubt: friction differs along the way, by a worn stretch, a varying preload or a dry place",
    ),
    "implausible-value": (IMPLAUSIBLE_VALUE, "Doubt: an identified value is implausible for a positioning stage"),
    "impossible-value": (
        IMPOSSIBLE_VALUE,
        "Doubt: an estimate or its interval contains values that the key cannot have, such as a negative friction",
    ),
    "little-friction": (LITTLE_FRICTION, "Doubt: Coulomb friction is zero, negative or impossibly small"),
    "load-friction": (
        LOAD_FRICTION,
        "Doubt: friction grows with the force of the motor, as in worm gears, belts and preloaded screws",
    ),
    "lost-inertia": (
        LOST_INERTIA,
        "Doubt: the force that accelerates a mass is smaller than what the fit leaves unexplained",
    ),
    "missing-feedforward": (MISSING_FEEDFORWARD, "Doubt: the logged force lacks a feedforward of the drive"),
    "oscillation": (
        OSCILLATION,
        "Doubt: the residual oscillates at one frequency, by a mode in the band or by cogging at constant speed",
    ),
    "perhaps-feedforward": (
        PERHAPS_FEEDFORWARD,
        "Doubt: a feedforward may be missing from the logged force, but the log does not decide",
    ),
    "play": (PLAY, "Doubt: play between motor and load passes for soft bristles"),
    "slow-motion": (SLOW_MOTION, "Doubt: the record is so slow that the Stribeck effect acts throughout"),
    "stiffer-bristles": (STIFFER_BRISTLES, "Doubt: errors of the position make stiff bristles look soft"),
    "wrong-sign": (
        WRONG_SIGN,
        "Doubt: in a frequency response the motion opposes the force, because one of them has the wrong sign",
    ),
}
