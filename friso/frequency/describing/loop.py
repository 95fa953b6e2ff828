"""Compute the closed loop as friction sees it: positions per friction force on the cart.

The positions are those of cart and stage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from friso.equations.component import key
from friso.equations.model import assemble
from friso.equations.structure import Structure, shared_structure
from friso.frequency.system import Declared

FORCE, CART, STAGE = "force on cart", "cart", "stage"

TOUCHES = "the joint deflects beyond its stroke: the limiter, which this answer leaves out, would be touched"


def receptance(flat: Mapping[str, Any], frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of cart and stage per friction force on the cart [m/N], complex.

    Frequencies [Hz] and results have the shape (frequencies,). The reference rests, the limiter is not touched, and the
    force is below its limit.
    """
    loop = _loop(shared_structure(flat).standing).at(flat, 1)
    (answer,) = loop.take((FORCE,), (CART, STAGE)).at(2j * np.pi * frequencies)
    return -answer[:, 0, 0], -answer[:, 1, 0]


@cache
def _loop(form: Structure) -> Declared:
    """Return a stage's own equations in symbols, with a force in place of friction."""
    control = replace(form.controller, anti_windup=None) if form.controller else None
    linear = replace(form, friction="none", friction_variant=None, controller=control, biased=("cart",))
    model = assemble(linear)
    outputs = {CART: model.outputs["cart_position"].expression, STAGE: model.outputs["position"].expression}
    within: dict[Any, Any] = {kink.beyond: sp.S.Zero for kink in model.kinks}  # within the stroke and all limits
    rates = tuple(sp.sympify(rate).subs(within) for rate in model.rhs)
    return Declared(model.symbols, rates, {FORCE: key("bias.cart")}, outputs)


def beyond_stroke(flat: Mapping[str, Any], deflections: np.ndarray) -> np.ndarray:
    """Return where joint deflections [m] exceed the stroke of a free joint, in their shape."""
    free = "joint.stroke" in flat and not flat["joint.locked"]
    return deflections > flat["joint.stroke"] if free else np.zeros(np.shape(deflections), bool)
