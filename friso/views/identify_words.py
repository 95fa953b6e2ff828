"""What an identification found, in words that the terminal and the page share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from friso.views.figure import GREEN, ORANGE, VERMILLION
from friso.views.map_words import quantity
from friso.views.prefixes import NOTHING, choose, listed, pretty

if TYPE_CHECKING:
    from friso.identify.estimate import Estimate
    from friso.identify.method import Experiment, Identification, Prediction
    from friso.identify.sources import Given

_NAMES = {
    "bias.cart": "Constant force on the cart",
    "bias.stage": "Constant force on the stage",
    "friction.viscous_asymmetry": "Viscous friction, forward over backward",
    "joint.damping": "Joint damping",
    "joint.stiffness": "Joint stiffness",
}
_PEOPLE = ("Coulomb", "Stribeck")

COLUMNS = ("Quantity", "Value", "95 % interval", "How, or why not")
"""Of the table of estimates."""

POOR = 0.5
"""Relative error of a predicted record from which it says that little was predicted."""


def name_of(key: str) -> str:
    """A key of the stage file, or another quantity, in words."""
    return _NAMES.get(key) or quantity(key.removeprefix("friction.")) if "." not in key else _named(key)


def _named(key: str) -> str:
    return _NAMES.get(key) or quantity(key)


def inside(key: str) -> str:
    """The same inside a sentence: names of people keep their capital."""
    name = name_of(key)
    return name if name.startswith(_PEOPLE) else name[0].lower() + name[1:]
