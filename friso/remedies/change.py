"""How large a change of a stage is: what has to be bought, how many keys change, and by how much."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friso.remedies.settings import RemedySettings
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER

PARTS = ("joint.", "flexure.")
"""Keys of what has to be bought."""


@dataclass(frozen=True, order=True)
class ChangeSize:
    """Changes are compared by whether a part is `bought`, then by the number of `keys` of the controller that change,
    come or go, then by the `factor` by which those change that had a value and have one, all factors multiplied;
    `scaled` is how many these are."""

    bought: bool
    keys: int
    factor: float
    scaled: int = field(default=0, compare=False)

    @property
    def mean(self) -> float:
        """The factor by which each of these changes, on average: the geometric mean."""
        return float(self.factor ** (1 / max(1, self.scaled)))


def change_size(before: Stage, after: Stage) -> ChangeSize:
    """How large the change from one stage to another is."""
    old, new = before.flat(), after.flat()
    bought = any(_differ(old.get(key), new.get(key)) for key in {*old, *new} if key.startswith(PARTS))
    keys = [key for key in {*old, *new} if key.startswith(f"{CONTROLLER}.") and _differ(old.get(key), new.get(key))]
    octaves = [octave for key in sorted(keys) if (octave := _octaves(old, new, key))]
    return ChangeSize(bought, len(keys), float(np.exp(sum(octaves))), len(octaves))


def _octaves(old: Mapping[str, Any], new: Mapping[str, Any], key: str) -> float:
    """The logarithm of the factor by which a number changes, upward or downward; 0 for what was none."""
    before, after = old.get(key), new.get(key)
    if isinstance(before, str) or isinstance(after, str) or not before or not after or before * after <= 0:
        return 0.0
    return abs(float(np.log(after / before)))


def _differ(before: Any, after: Any) -> bool:
    settings = RemedySettings.current()
    if before is None or after is None or isinstance(before, str) or isinstance(after, str):
        return bool(before != after)
    return abs(after - before) > settings.unchanged_share * max(abs(before), abs(after))
