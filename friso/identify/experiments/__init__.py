"""Experiments in time: what stiffness and friction a log of each kind shows, with intervals and reasons."""

from friso.identify.experiments.break_away import BreakAway, static_from_ramps
from friso.identify.experiments.common import record
from friso.identify.experiments.friction_position import FrictionPosition, friction_position
from friso.identify.experiments.friction_velocity import FrictionVelocity, friction_velocity
from friso.identify.experiments.presliding import Presliding, bristles_from_presliding
from friso.identify.experiments.slow_sliding import SlowSliding, stribeck_from_slow_sliding
from friso.identify.experiments.steps import StepStiffness, stiffness_from_steps
from friso.identify.experiments.stick_slip import StickSlip, static_from_stick_slip

__all__ = [
    "BreakAway",
    "FrictionPosition",
    "FrictionVelocity",
    "Presliding",
    "SlowSliding",
    "StepStiffness",
    "StickSlip",
    "bristles_from_presliding",
    "friction_position",
    "friction_velocity",
    "record",
    "static_from_ramps",
    "static_from_stick_slip",
    "stiffness_from_steps",
    "stribeck_from_slow_sliding",
]
