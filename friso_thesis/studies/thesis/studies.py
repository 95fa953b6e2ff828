"""Define the ten studies of the thesis's Table 3: ranges as printed, including zeros."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER, TUNED_MASS, as_gains, numbers
from friso.stage import Stage, loads

NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class AxisSpan:
    """Range of one axis: its key in the stage file or a free name, its ends [unit], its scale.

    If `log` is true, the scale is logarithmic, otherwise linear.
    """

    key: str
    low: float
    high: float
    unit: str = ""
    log: bool = False

    def text(self, points: int) -> str:
        """Return the range as `friso.sweep` reads it, with `points` values including both ends."""
        ends = "..".join(f"{end!r} {self.unit}".rstrip() for end in (self.low, self.high))
        return f"{ends}:{points}:{'log' if self.log else 'linear'}"


@dataclass(frozen=True)
class ThesisStudy:
    """A study: a pair of rows of Table 3.

    `panel` is the figure that shows it, such as "11A". `changes` make its stage out of the rig of Table 2 and Sec. 3.5;
    `spans` are its two axes and `links` the keys that follow them. `marker` is the evaluation point of the other
    studies, SI values by axis. `zeros` says what a zero of its ranges means.
    """

    name: str
    panel: str
    title: str
    spans: tuple[AxisSpan, AxisSpan]
    marker: Mapping[str, float]
    changes: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    links: Mapping[str, str] = field(default_factory=lambda: NOTHING)
    zeros: str = ""

    @property
    def sets(self) -> frozenset[str]:
        """Return the keys that the study sets itself: its changes, axes and links."""
        return frozenset(span.key for span in self.spans) | frozenset(self.links) | frozenset(self.changes)

    @property
    def of_motion(self) -> bool:
        """Tell whether the study's axes belong to the motion, on which attractors do not depend."""
        return all(span.key.startswith("motion.") for span in self.spans)

    def axes(self, points: int) -> dict[str, str]:
        """Return the axes as `friso.sweep` takes them, `points` values each."""
        return {span.key: span.text(points) for span in self.spans}

    def stage(self, changes: Mapping[str, Any] = NOTHING) -> Stage:
        """Return the stage of the study; `changes` are made to the rig before those of the study."""
        return thesis_rig().replace(dict(changes)).replace(dict(self.changes))


@cache
def thesis_rig() -> Stage:
    """Return the rig of Table 2 and Sec. 3.5, with our choice of what the thesis leaves open."""
    return loads(files("friso_thesis.studies.thesis").joinpath("thesis_rig.toml").read_text(encoding="utf-8"))


def rig_crossover() -> float:
    """Return the crossover of the rig [Hz]."""
    return float(thesis_rig().flat()[CROSSOVER])


def rig_gains(mass: float) -> tuple[float, float, float]:
    """Return k_p [N/m], k_i [N/(m s)] and k_d [N s/m] of Eq. 6 for a mass [kg].

    The gains follow from Eq. 7 and 8, at the crossover, alpha and beta of the rig.
    """
    gains = as_gains(**numbers({**thesis_rig().flat(), TUNED_MASS: mass}))
    return gains["kp"], gains["ki"], gains["kd"]


def masses(whole: float) -> dict[str, object]:
    """Return masses that add up to `whole` [kg], in the weighed proportions.

    The controller is tuned for the whole mass.
    """
    shares = {"masses.cart": 1.2, "masses.stage": 0.5, "parasitic.mass": 0.25, TUNED_MASS: 1.7}
    return {key: f"{whole * share / 1.7!r} kg" for key, share in shares.items()}


LOCKED: Mapping[str, Any] = MappingProxyType({"joint.locked": True})
SOFT: Mapping[str, Any] = MappingProxyType({"joint.stiffness": "1e3 N/m"})

_FRICTION = (AxisSpan("friction.static", 0.0, 4.9, "N"), AxisSpan("friction.coulomb", 0.0, 4.9, "N"))
_FRICTION_MARKER = {"friction.static": 3.0, "friction.coulomb": 1.0}
_FRICTION_ZEROS = (
    "F_s or F_c of 0 N divides by zero in the LuGre model, and F_c above F_s leaves no stick-slip model: such cells "
    "are invalid."
)
_STROKE = AxisSpan("joint.stroke", 0.0, 1e-3, "m")
_STROKE_ZERO = "Stroke 0: the joint always rests on its limiter, k_j + k_l."
_CROSSOVER = (AxisSpan(CROSSOVER, 1.0, 16.0, "Hz"), _STROKE)
_CROSSOVER_MARKER = {CROSSOVER: 8.0, "joint.stroke": 1e-3}

# The rig's 1.7 kg are 1.2 kg of cart and 0.5 kg of stage, half of it the parasitic mode's: this ratio is kept.
_SAME_SHARES = {
    "masses.cart": "mass*1.2/1.7",
    "masses.stage": "mass*0.5/1.7",
    "parasitic.mass": "mass*0.25/1.7",
    TUNED_MASS: "mass",
}

_ALL = (
    ThesisStudy(
        "path",
        "11A",
        "Path",
        (AxisSpan("motion.acceleration", 0.0, 150.0, "m/s^2"), AxisSpan("motion.acceleration_time", 0.0, 0.15, "s")),
        {"motion.acceleration": 100.0, "motion.acceleration_time": 0.03},
        LOCKED,
        zeros="No acceleration or no time of acceleration: the stage is not moved, and stays at rest.",
    ),
    ThesisStudy(
        "system",
        "11B",
        "System parameters",
        (AxisSpan(CROSSOVER, 1.0, 40.0, "Hz"), AxisSpan("mass", 0.1, 5.1, "kg")),
        {CROSSOVER: 8.0, "mass": 1.7},
        LOCKED,
        _SAME_SHARES,
    ),
    ThesisStudy("friction", "12A", "Friction forces", _FRICTION, _FRICTION_MARKER, LOCKED, zeros=_FRICTION_ZEROS),
    ThesisStudy(
        "control",
        "12B",
        "Control parameters",
        (AxisSpan(ALPHA, 0.1, 0.3), AxisSpan(BETA, 1.0, 3.0)),
        {ALPHA: 0.1, BETA: 2.0},
        LOCKED,
    ),
    ThesisStudy(
        "isolator-stiffness",
        "14A",
        "Joint stiffness and stroke",
        (AxisSpan("joint.stiffness", 0.5e3, 15e3, "N/m"), _STROKE),
        {"joint.stiffness": 2.4e3, "joint.stroke": 1e-3},
        zeros=_STROKE_ZERO,
    ),
    ThesisStudy(
        "isolator-damping",
        "14B",
        "Limiter damping and stroke",
        (
            AxisSpan("joint.limiter_damping", 1e-2, 1e4, "N*s/m", log=True),
            AxisSpan("joint.stroke", 1e-5, 1e-2, "m", log=True),
        ),
        {"joint.limiter_damping": 100.0, "joint.stroke": 1e-3},
    ),
    ThesisStudy(
        "isolator-masses",
        "15A",
        "Masses of cart and stage",
        (AxisSpan("masses.cart", 0.5, 3.0, "kg"), AxisSpan("masses.stage", 0.1, 1.0, "kg")),
        {"masses.cart": 1.2, "masses.stage": 0.5},
        links={"parasitic.mass": "0.5*masses.stage", TUNED_MASS: "masses.cart + masses.stage"},
    ),
    ThesisStudy(
        "isolator-friction", "15B", "Friction forces, isolated", _FRICTION, _FRICTION_MARKER, zeros=_FRICTION_ZEROS
    ),
    ThesisStudy(
        "isolator-crossover",
        "16A",
        "Crossover and stroke, k_j = 2.4e3 N/m",
        _CROSSOVER,
        _CROSSOVER_MARKER,
        zeros=_STROKE_ZERO,
    ),
    ThesisStudy(
        "isolator-crossover-soft",
        "16B",
        "Crossover and stroke, k_j = 1e3 N/m",
        _CROSSOVER,
        _CROSSOVER_MARKER,
        SOFT,
        zeros=_STROKE_ZERO,
    ),
)

STUDIES: Mapping[str, ThesisStudy] = MappingProxyType({study.name: study for study in _ALL})
"""The studies of Table 3 by name, in the order of the figures. The last one, with the softer joint, belongs to Fig. 16
alone."""
