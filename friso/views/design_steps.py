"""A design step by step: what was decided, with which numbers, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.design.controller import WANTED
from friso.design.method import Design
from friso.frequency.members import Members
from friso.views.design_leaves import leaves_step
from friso.views.design_words import (
    Step,
    brings,
    corner,
    edge,
    gaps,
    hertz,
    hunting,
    need,
    plain,
    probability,
    seconds,
    settling,
    size,
)
from friso.views.design_window import lower, upper
from friso.views.flexure_table import newtons_per

GAP = 1.0
"""Static less Coulomb friction [N] that hunting needs, as the thesis found it."""

LITTLE = 0.05
"""Share by which more joint damping has to raise the modulus margin to be worth its trouble."""


def steps(found: Design) -> tuple[Step, ...]:
    """All steps of the method, in order."""
    return isolator_step(found), joint_step(found), leaves_step(found), controller_step(found), moves_step(found)
