"""Define the states of a stage: the thesis's limit cases (Table 1), and those between.

Compute springs in series: joint and bearing (Eq. 1), and the touched limiter (Table 1).

The numbers are those of the thesis. The bearing acts as a spring before it slides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.equations.structure import structure
from friso.errors import InputError
from friso.frequency.friction import level, speeds
from friso.frequency.settings import settings
from friso.stage.arguments import check_arguments
from friso.stage.transmission import leading_friction


def in_series(first: Any, second: Any) -> Any:
    """Return the stiffness [N/m] of two springs, or damping [N s/m] of two dampers, in series.

    See Eq. 1 of the thesis.
    """
    return first * second / (first + second)


def limiter_in_series(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with joint and limiter in series as its joint, as Table 1 prints.

    Stiffness and damping are k1 k2 / (k1 + k2), and the limiter never touches.
    """
    pairs = {"stiffness": "limiter_stiffness", "damping": "limiter_damping"}
    free = {"joint.stroke": 1.0}  # so long that the limiter does not touch
    return {**flat, **free, **{f"joint.{a}": _printed(flat, a, b) for a, b in pairs.items() if f"joint.{a}" in flat}}


def _printed(flat: Mapping[str, Any], joint: str, limiter: str) -> Any:
    joint_value, limiter_value = flat[f"joint.{joint}"], flat[f"joint.{limiter}"]
    return in_series(joint_value, limiter_value) if joint_value + limiter_value else joint_value


BIASES, SPEEDS = 65, 257
"""Bias forces and speeds in a family, for each state of the limiter."""


@dataclass(frozen=True)
class Members:
    """States of a stage, one per row, each array of shape (members,).

    `speed` [m/s] is that of the cart, 0 where it is stuck. `bias` [N] is the friction force of a stuck cart, positive
    where it opposes the motion. `touched` is true if the limiter is touched, and `forward` for motion ahead.

    Examples
    --------
    >>> import friso
    >>> sliding = friso.member(speed=1e-3)
    >>> len(sliding), sliding.stuck.item(), sliding.touched.item()
    (1, False, False)
    """

    speed: np.ndarray
    bias: np.ndarray
    touched: np.ndarray
    forward: np.ndarray

    def __len__(self) -> int:
        return len(self.speed)

    def __getitem__(self, which: Any) -> Members:
        """Select states by numbers or by a boolean array."""
        return Members(*(np.atleast_1d(getattr(self, field.name)[which]) for field in fields(self)))

    @property
    def kinds(self) -> list[Members]:
        """Return the stuck states and the sliding ones as two groups; empty groups are left out.

        The equations of both have different states.
        """
        return [self[mask] for mask in (self.stuck, ~self.stuck) if mask.any()]

    @property
    def stuck(self) -> np.ndarray:
        """Return in which states the cart is stuck, shape (members,)."""
        return self.speed == 0

    @property
    def settled(self) -> np.ndarray:
        """Return which states of a family are stuck, or slide the fastest, shape (members,)."""
        return self.stuck | (self.speed == self.speed.max())

    def with_limiter(self, touched: bool) -> Members:
        """Return the states with the limiter touched or not."""
        return replace(self, touched=np.full(len(self), touched))

    def repeated(self, times: int) -> Members:
        """Return all states in order, and this list `times` times."""
        return Members(*(np.tile(getattr(self, field.name), times) for field in fields(self)))


@check_arguments
def member(speed: float = 0.0, bias: float = 0.0, touched: bool = False, forward: bool = True) -> Members:
    """Return one state of a stage: sliding at a speed [m/s], or stuck under a bias force [N].

    It slides `forward` or back; a speed of 0 means stuck. The limiter may be `touched`. Raises InputError for a
    negative speed and for a bias of a cart that slides.

    Examples
    --------
    >>> import friso
    >>> friso.member(speed=1e-3).stuck
    array([False])
    """
    if not 0 <= speed < np.inf:
        raise InputError("speed", f"{speed} m/s", "0 or greater; forward=False for the other direction", "speed=1e-3")
    if bias and speed:
        raise InputError("bias", f"{bias} N at {speed} m/s", "a bias of a cart that is stuck", "member(bias=1.0)")
    return Members(np.array([speed]), np.array([bias]), np.array([touched]), np.array([forward]))


def concatenate_families(parts: list[Members]) -> Members:
    """Return the states of several `Members` as one, in the order of the list."""
    return Members(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Members)))


def limit_cases(flat: Mapping[str, Any]) -> dict[str, Members]:
    """Return the limit cases of a stage by name: "stuck" and "sliding" (fast).

    Both have "-touched" appended where the limiter is touched (Table 1). A stage with just one case calls it "given".
    `flat` has the stage's keys in SI.
    """
    flat = leading_friction(flat)
    moves = ["sliding"] if flat["friction.model"] == "none" else ["stuck", "sliding"]
    limits = limiter_states(flat)
    if len(moves) == len(limits) == 1:
        return {"given": member(_fast(flat), touched=limits[0])}
    named = structure(flat).joint in ("free", "touching")
    return {
        f"{move}-touched" if touched and named else move: member(0.0 if move == "stuck" else _fast(flat), 0.0, touched)
        for touched in limits
        for move in moves
    }


def family(flat: Mapping[str, Any], biases: int = BIASES, speeds_: int = SPEEDS) -> Members:
    """Return states near and between all limit cases of a stage, stuck and sliding.

    Stuck ones bear `biases` different bias forces up to nearly break-away, for and against the motion. Sliding ones
    cover all speeds by `speeds_` of them, in both directions if friction differs between them. Without friction they
    are the limit cases alone.
    """
    flat = leading_friction(flat)
    if flat["friction.model"] == "none":
        return concatenate_families([*limit_cases(flat).values()])
    parts = []
    differs = any(flat.get(f"friction.{name}", 0.0) != 0 for name in ("asymmetry", "viscous_asymmetry"))
    for touched in limiter_states(flat):
        for forward in (True, False) if differs else (True,):
            least, most = (
                -settings.greatest_bias_share * level(flat, not forward),
                settings.greatest_bias_share * level(flat, forward),
            )
            bias = np.unique(np.linspace(least, most, biases))  # a law that creeps instead of sticking bears no bias
            speed = np.concatenate([np.zeros(len(bias)), speeds(flat, speeds_)])
            bias = np.concatenate([bias, np.zeros(speeds_)])
            parts.append(Members(speed, bias, np.full(len(speed), touched), np.full(len(speed), forward)))
    return concatenate_families(parts)


def _fast(flat: Mapping[str, Any]) -> float:
    return 0.0 if flat["friction.model"] == "none" else float(speeds(flat, 2)[-1])


def limiter_states(flat: Mapping[str, Any]) -> tuple[bool, ...]:
    """Return whether the limiter of a stage may be free (False), touched (True), or both."""
    return {"free": (False, True), "touching": (True,)}.get(structure(flat).joint, (False,))
