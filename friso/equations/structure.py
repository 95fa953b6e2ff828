"""Describe a stage's structure; stages of one structure differ in numbers only."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.equations.conditions import DECISIVE, load_follows
from friso.stage.controllers import (
    ANTI_WINDUP,
    CONTROLLERS,
    DEFAULT_ANTI_WINDUP,
    FILTER_RULE,
    FILTERS_KEY,
    FORCE_LIMIT,
    KIND,
    NO_SETTINGS,
    AntiWindup,
    ControllerSection,
    FilterForm,
    FilterRule,
    FrictionSettings,
    controller_of,
    filter_forms,
    settings_of,
)
from friso.stage.rig import KIND as MOTION_KIND
from friso.stage.rig import LOOPS, QUADRATIC, IntegralRule, ReferenceForm, motion_of
from friso.stage.tables import BACKLASH, BRAKING, ENCODER, MOTOR_FRICTION, MOTOR_MASS, Side, as_friction, friction_law

JointForm = Literal["rigid", "locked", "free", "touching"]


@dataclass(frozen=True)
class ControllerForm:
    """The structure of a controller: its kind, the class that declares it, and further choices.

    Its equations depend on integral action, its anti-windup at the force limit (None: no limit), its filters, its
    settings against friction, and the loops with their own sample times. A drive may also choose how integrals (None:
    as the controller says) and low-pass filters are computed.
    """

    kind: str
    form: str
    variant: Hashable
    integral: bool
    anti_windup: AntiWindup | None = None
    filters: tuple[FilterForm, ...] = ()
    settings: FrictionSettings = NO_SETTINGS
    loops: tuple[str, ...] = ()
    integral_rule: IntegralRule | None = None
    filter_rule: FilterRule = "bilinear"

    @property
    def section(self) -> type[ControllerSection]:
        """Return the class that declares the blocks of the controller."""
        return CONTROLLERS.form(self.kind, self.form)

    @property
    def title(self) -> str:
        """Describe the controller in a few words."""
        words = [
            *(["no integral"] if not self.integral else []),
            *([f"force limit, {self.anti_windup}"] if self.anti_windup else []),
            *(filter.kind for filter in self.filters),
            *self.settings.names,
        ]
        return f"{self.kind} ({', '.join(words)})" if words else self.kind


@dataclass(frozen=True)
class TransmissionForm:
    """Structure of a transmission.

    `backlash` is true if there is any. `friction` is the law at the motor ("none": no friction), with its further
    choices. `position` and `velocity` are the sides, motor or load, on which these are measured.
    """

    backlash: bool
    friction: str
    friction_variant: Hashable
    position: Side
    velocity: Side


@dataclass(frozen=True)
class Structure:
    """The choices that decide which states, terms and kinks the equations of a stage have.

    At a kink derivatives jump.

    - `masses` are the names of the masses given, for a rigid stage.
    - `biased` are the names of the masses on which a constant force acts.
    - `friction_variant` is any further choice of the friction law, such as a Stribeck exponent that is a whole number.
    - `load_follows`: friction changes with the acceleration of the reference.
    - `reference` describes the pieces of the reference.
    - `limiter_pulls`: a touched limiter may pull by its damping.
    - `braked`: the motor brakes by its back-EMF.
    """

    masses: tuple[str, ...]
    joint: JointForm
    parasitic: bool
    friction: str
    friction_variant: Hashable
    controller: ControllerForm | None
    biased: tuple[str, ...] = ()
    load_follows: bool = False
    transmission: TransmissionForm | None = None
    reference: ReferenceForm = QUADRATIC
    limiter_pulls: bool = True
    braked: bool = False

    @property
    def standing(self) -> Structure:
        """Return the structure with a reference that stands still."""
        return replace(self, reference=QUADRATIC)

    @property
    def follows_drive(self) -> bool:
        """Tell whether friction at guide or motor grows with the force of the drive."""
        laws = (self.friction, self.transmission.friction if self.transmission else "none")
        return any(friction_law(law).follows_drive for law in laws)

    @property
    def plays(self) -> bool:
        """Tell whether there is backlash."""
        return self.transmission is not None and self.transmission.backlash

    @property
    def title(self) -> str:
        """Describe the structure in a few words."""
        axis = f"rigid {' and '.join(self.masses)}" if self.joint == "rigid" else f"{self.joint} joint"
        words = {
            axis: True,
            "limiter that only pushes": not self.limiter_pulls,
            "transmission": self.transmission and not self.plays,
            "transmission with backlash": self.plays,
            "parasitic mode": self.parasitic,
            f"constant force on {' and '.join(self.biased)}": self.biased,
            "no friction" if self.friction == "none" else f"{self.friction} friction": True,
            "load that follows": self.load_follows,
            "back-EMF": self.braked,
            self.controller.title if self.controller else "": self.controller,
            f"reference of degree {self.reference.degree}": self.reference.degree != QUADRATIC.degree,
            f"{self.reference.tones} tones": self.reference.tones,
        }
        return ", ".join(word for word, present in words.items() if present)


def structure(flat: Mapping[str, Any]) -> Structure:
    """Return the structure of a stage; `flat` has its keys, such as "friction.static", in SI."""
    law = flat["friction.model"]
    return Structure(
        masses=tuple(name for name in ("cart", "stage") if f"masses.{name}" in flat),
        joint=_joint_form(flat),
        parasitic="parasitic.frequency" in flat,
        friction=law,
        friction_variant=friction_law(law).variant(flat),
        controller=controller_form(flat) if KIND in flat else None,
        biased=tuple(name for name in ("cart", "stage") if flat.get(f"bias.{name}", 0.0) != 0),
        load_follows=load_follows(flat),
        transmission=_transmission_form(flat) if MOTOR_MASS in flat else None,
        reference=motion_of(flat).form(flat) if MOTION_KIND in flat else QUADRATIC,
        limiter_pulls=_joint_form(flat) != "free" or flat.get("joint.limiter_pulls", True),
        braked=BRAKING in flat,
    )


def carrying_force(flat: Mapping[str, Any]) -> Any:
    """Return the actuator force [N] that carries the constant forces of [bias].

    A vertical axis, for example, has such forces.
    """
    return 0.0 - sum(np.asarray(flat.get(f"bias.{name}", 0.0)) for name in ("cart", "stage"))


def shared_structure(flat: Mapping[str, Any]) -> Structure:
    """Return the common structure of stages, read from the first of them; `flat` has their keys."""
    return structure({key: value[0] if np.ndim(value) else value for key, value in flat.items()})


def decisive_keys(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the numeric keys that decide on the structure, for example by being zero."""
    law, control = friction_law(flat["friction.model"]), controller_of(flat)
    of_stage = ("joint.stroke", "bias.cart", "bias.stage", BACKLASH, *DECISIVE)
    at_motor: tuple[str, ...] = ()
    if f"{MOTOR_FRICTION}.model" in flat:
        names = friction_law(flat[f"{MOTOR_FRICTION}.model"]).decisive
        at_motor = tuple(name.replace("friction.", f"{MOTOR_FRICTION}.", 1) for name in names)
    return (*of_stage, *map(control.key, control.decisive), *law.decisive, *at_motor)


def _joint_form(flat: Mapping[str, Any]) -> JointForm:
    if "joint.limiter_stiffness" not in flat:
        return "rigid"
    if flat["joint.locked"]:
        return "locked"
    return "touching" if flat["joint.stroke"] == 0 else "free"


def _transmission_form(flat: Mapping[str, Any]) -> TransmissionForm:
    """Return the structure of a stage's transmission; `flat` has the stage's keys in SI."""
    at_motor = {"friction.model": "none", **as_friction(flat)}
    law = at_motor["friction.model"]
    return TransmissionForm(
        backlash=flat.get(BACKLASH, 0.0) != 0,
        friction=law,
        friction_variant=friction_law(law).variant(at_motor),
        position=flat[f"{ENCODER}.position"],
        velocity=flat[f"{ENCODER}.velocity"],
    )


def controller_form(flat: Mapping[str, Any]) -> ControllerForm:
    """Return the structure of a stage's controller; `flat` has the stage's keys in SI."""
    controller = controller_of(flat)
    return ControllerForm(
        kind=flat[KIND],
        form=controller.__name__,
        variant=controller.variant(flat),
        integral=controller.integrates(flat),
        anti_windup=flat.get(ANTI_WINDUP, DEFAULT_ANTI_WINDUP) if FORCE_LIMIT in flat else None,
        filters=filter_forms(flat, FILTERS_KEY),
        settings=settings_of(flat),
        loops=tuple(name for name in LOOPS if f"drive.{name}_sample_time" in flat),
        integral_rule=flat.get("drive.integral_discretisation"),
        filter_rule=flat.get(FILTER_RULE, "bilinear"),
    )
