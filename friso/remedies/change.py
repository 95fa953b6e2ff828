"""Measure the size of a change: parts bought, keys changed, and the factor of change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friso.remedies.settings import settings
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER

PARTS = ("joint.", "flexure.")
"""Prefixes of keys that describe parts to be bought."""


@dataclass(frozen=True, order=True)
class ChangeSize:
    """The size of a change, which orders changes from small to large.

    Changes are compared first by whether a part is `bought`, then by the number of `keys` of the controller that
    change. Last comes the `factor`, the product of the factors by which numbers change. `scaled` is how many numbers
    change by a factor; it is not compared.
    """

    bought: bool
    keys: int
    factor: float
    scaled: int = field(default=0, compare=False)

    @property
    def mean(self) -> float:
        """Return the geometric mean of the factors by which numbers change."""
        return float(self.factor ** (1 / max(1, self.scaled)))


def change_size(before: Stage, after: Stage) -> ChangeSize:
    """Measure how large the change from one stage to another is: parts bought, keys, factors."""
    old, new = before.flat(), after.flat()
    bought = any(_differ(old.get(key), new.get(key)) for key in {*old, *new} if key.startswith(PARTS))
    keys = [key for key in {*old, *new} if key.startswith(f"{CONTROLLER}.") and _differ(old.get(key), new.get(key))]
    octaves = [octave for key in sorted(keys) if (octave := _octaves(old, new, key))]
    return ChangeSize(bought, len(keys), float(np.exp(sum(octaves))), len(octaves))


def _octaves(old: Mapping[str, Any], new: Mapping[str, Any], key: str) -> float:
    """Return the size of a number's change, as the natural logarithm of its factor.

    Upward and downward changes count alike. The result is 0 for words, and for a number that was or becomes 0 or
    changes its sign.
    """
    before, after = old.get(key), new.get(key)
    if isinstance(before, str) or isinstance(after, str) or not before or not after or before * after <= 0:
        return 0.0
    return abs(float(np.log(after / before)))


def _differ(before: Any, after: Any) -> bool:
    """Tell whether two values of a key differ by more than rounding."""
    if before is None or after is None or isinstance(before, str) or isinstance(after, str):
        return bool(before != after)
    return abs(after - before) > settings.unchanged_share * max(abs(before), abs(after))
