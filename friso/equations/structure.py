"""Which equations a stage needs. Stages with equal structure share one set of equations and differ in numbers only."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from friso.stage.tables import friction_law

JointForm = Literal["rigid", "locked", "free", "touching"]


@dataclass(frozen=True)
class ControllerForm:
    """Which terms the controller has; each absent term is absent from the equations."""

    tuned: bool
    integral: bool = True
    filtered: bool = True
    derivative_on: Literal["none", "error", "measurement"] = "error"
    limited: bool = False


@dataclass(frozen=True)
class Structure:
    """The choices that decide which states, terms and kinks there are.

    `masses` names those given, for a rigid stage, `biased` those on which a constant force acts; `friction_variant` is
    whatever else the friction law's equations depend on (the Stribeck exponent where it is a whole number).
    """

    masses: tuple[str, ...]
    joint: JointForm
    parasitic: bool
    friction: str
    friction_variant: Hashable
    controller: ControllerForm | None
    biased: tuple[str, ...] = ()


def structure(flat: Mapping[str, Any]) -> Structure:
    """The structure of a stage given as flat mapping of keys to SI values."""
    law = flat["friction.model"]
    return Structure(
        masses=tuple(name for name in ("cart", "stage") if f"masses.{name}" in flat),
        joint=_joint_form(flat),
        parasitic="parasitic.frequency" in flat,
        friction=law,
        friction_variant=friction_law(law).variant(flat),
        controller=_controller_form(flat) if "controller.kind" in flat else None,
        biased=tuple(name for name in ("cart", "stage") if flat.get(f"bias.{name}", 0.0) != 0),
    )


def shared_structure(flat: Mapping[str, Any]) -> Structure:
    """The structure of stages that all have the same, told by the first of them."""
    return structure({key: value[0] if np.ndim(value) else value for key, value in flat.items()})


def decisive_keys(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """The numeric keys on which the structure depends, by being zero or a whole number, for instance."""
    law = friction_law(flat["friction.model"])
    own = ("joint.stroke", "controller.ki", "controller.kd", "controller.tau", "bias.cart", "bias.stage")
    return (*own, *law.decisive)


def _joint_form(flat: Mapping[str, Any]) -> JointForm:
    if "joint.limiter_stiffness" not in flat:
        return "rigid"
    if flat["joint.locked"]:
        return "locked"
    return "touching" if flat["joint.stroke"] == 0 else "free"


def _controller_form(flat: Mapping[str, Any]) -> ControllerForm:
    limited = "controller.force_limit" in flat
    if "controller.crossover" in flat:
        return ControllerForm(tuned=True, limited=limited)
    filtered = flat["controller.tau"] > 0
    return ControllerForm(
        tuned=False,
        integral=flat["controller.ki"] > 0,
        filtered=filtered and flat["controller.kd"] > 0,
        derivative_on=flat["controller.derivative_on"] if flat["controller.kd"] > 0 else "none",
        limited=limited,
    )
