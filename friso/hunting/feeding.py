"""What feeds the hunting of a stage with a backlash: whether it lasts while the dry friction, or the backlash, is taken
to nothing, step by step.

Each of both is scaled down on its own, the stage being surveyed anew at every share, so that it does not matter
whether the cycle changes its form on the way. Viscous friction stays: it only damps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.structure import structure
from friso.hunting.loop import unstable
from friso.hunting.many_stages import find_attractors
from friso.hunting.settings import CheckSettings
from friso.stage import Stage
from friso.stage.stage import declared_keys
from friso.stage.transmission import BACKLASH, MOTOR_FRICTION


@dataclass(frozen=True)
class Decline:
    """What becomes of hunting as one cause is scaled down: the least share at which something `lasts` that attracts,
    and the greatest below it at which nothing does, `gone` (None: something attracts down to the last share; 0: it
    shrinks in proportion to its cause, and is gone without that alone); and whether all of this is `certain`."""

    lasts: float
    gone: float | None
    certain: bool

    @property
    def needed(self) -> bool:
        """Whether hunting ends without it."""
        return self.gone is not None


@dataclass(frozen=True)
class Feeding:
    """What becomes of the hunting of a stage without its dry friction (None: it has none), and without its backlash."""

    friction: Decline | None
    backlash: Decline


def feeding(stage: Stage) -> Feeding | None:
    """What feeds the cycle that attracts a stage with a backlash; None for a stage without."""
    flat = stage.flat()
    if not structure(flat).plays:
        return None
    dry = dry_friction(flat)
    if not dry:
        return Feeding(None, _without_friction(stage))
    return Feeding(_decline(flat, dry), _decline(flat, (BACKLASH,)))


def _without_friction(stage: Stage) -> Decline:
    """What becomes of a stage without dry friction as its backlash goes: all motions are as much smaller as that is, so
    that nothing changes until it is gone, and with it all that is not linear."""
    settings = CheckSettings.current()
    rests = not unstable(stage.replace({BACKLASH: None}))
    return Decline(lasts=float(np.array(settings.feeding_shares)[-1]), gone=0.0 if rests else None, certain=True)


def dry_friction(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys in proportion to all of which the dry friction of guide and motor goes: forces, and what makes the
    bristles as much softer."""
    units = {key: field.unit for key, field in declared_keys(flat).items() if key in flat}
    tables = ("friction.", f"{MOTOR_FRICTION}.")
    return tuple(
        key
        for key, unit in units.items()
        if key.startswith(tables) and unit.startswith("N") and not key.endswith(".viscous")
    )


def _decline(flat: Mapping[str, Any], keys: tuple[str, ...]) -> Decline:
    """What becomes of hunting with some keys at all shares."""
    settings = CheckSettings.current()
    scaled = {**flat, **{key: flat[key] * np.array(settings.feeding_shares) for key in keys}}
    attracted = find_attractors(scaled, len(np.array(settings.feeding_shares)))
    gone = np.flatnonzero(~attracted.attracts)
    first = int(gone[0]) if gone.size else len(np.array(settings.feeding_shares))
    return Decline(
        lasts=float(np.array(settings.feeding_shares)[first - 1]) if first else 1.0,
        gone=float(np.array(settings.feeding_shares)[first]) if gone.size else None,
        certain=bool(attracted.certain[: first + 1].all()),
    )
