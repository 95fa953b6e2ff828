"""Find the cause that feeds a stage's hunting: dry friction or the backlash.

Each cause is scaled down separately, step by step. The stage is surveyed at every step, because the cycle may change
its form on the way. Viscous friction stays, because it only damps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.structure import structure
from friso.hunting.loop import unstable
from friso.hunting.many_stages import find_attractors
from friso.hunting.settings import check_settings
from friso.stage import Stage
from friso.stage.stage import declared_keys
from friso.stage.tables import BACKLASH, MOTOR_FRICTION


@dataclass(frozen=True)
class Decline:
    """How hunting declines as one cause is scaled down.

    `lasts` is the smallest scale at which the stage still hunts. `gone` is the largest scale below `lasts` at which it
    does not hunt. It is None if the stage hunts down to the last scale, and 0 if the cycle shrinks in proportion to its
    cause. `certain` is true if all surveys down to `gone`, or to the last scale, were certain.
    """

    lasts: float
    gone: float | None
    certain: bool

    @property
    def needed(self) -> bool:
        """Tell whether hunting ends when the cause is removed."""
        return self.gone is not None


@dataclass(frozen=True)
class Feeding:
    """How hunting declines when dry friction (None: no friction) or backlash is scaled down."""

    friction: Decline | None
    backlash: Decline


def feeding(stage: Stage) -> Feeding | None:
    """Find the cause that feeds the hunting of a stage with a backlash; None without backlash."""
    flat = stage.flat()
    if not structure(flat).plays:
        return None
    dry = dry_friction(flat)
    if not dry:
        return Feeding(None, _without_friction(stage))
    return Feeding(_decline(flat, dry), _decline(flat, (BACKLASH,)))


def _without_friction(stage: Stage) -> Decline:
    """Return the decline of a stage without dry friction as its backlash vanishes.

    All motions scale with the backlash, so nothing changes until it is zero, when the loop is linear.
    """
    rests = not unstable(stage.replace({BACKLASH: None}))
    return Decline(lasts=float(check_settings.feeding_shares[-1]), gone=0.0 if rests else None, certain=True)


def dry_friction(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the keys that scale the dry friction of guide and motor, such as "friction.static".

    They are the friction forces and the bristle stiffnesses, so that bristles become softer in proportion.
    """
    units = {key: field.unit for key, field in declared_keys(flat).items() if key in flat}
    tables = ("friction.", f"{MOTOR_FRICTION}.")
    return tuple(
        key
        for key, unit in units.items()
        if key.startswith(tables) and unit.startswith("N") and not key.endswith(".viscous")
    )


def _decline(flat: Mapping[str, Any], keys: tuple[str, ...]) -> Decline:
    """Survey a stage with `keys` scaled down in steps, and return how hunting declines."""
    scaled = {**flat, **{key: flat[key] * np.array(check_settings.feeding_shares) for key in keys}}
    attracted = find_attractors(scaled, len(check_settings.feeding_shares))
    gone = np.flatnonzero(~attracted.attracts)
    first = int(gone[0]) if gone.size else len(check_settings.feeding_shares)
    return Decline(
        lasts=float(check_settings.feeding_shares[first - 1]) if first else 1.0,
        gone=float(check_settings.feeding_shares[first]) if gone.size else None,
        certain=bool(attracted.certain[: first + 1].all()),
    )
