"""Measure how large a change is, and find the smallest change of the bandwidth that meets the goal.

The size of a change counts parts bought, keys changed, and the factor of change.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friso.remedies.search import Search
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


def least_factors(search: Search) -> Iterator[np.ndarray]:
    """Yield factors on the bandwidth that work, the smallest change first, each of shape (1,).

    The remedy searched varies the bandwidth alone. With these factors no constraint is broken, all fresh machines meet
    the goal by moves and margins, and enough surveyed machines do not hunt (`Search.clear`).
    """
    (variable,) = search.remedy.variables
    home, steps = variable.share(variable.present), np.arange(1, settings.factors_tried + 1)
    shares = np.concatenate([home + steps * ((end - home) / settings.factors_tried) for end in (1.0, 0.0)])
    sizes = np.abs(np.log(variable.at(shares) / variable.present))
    order = np.argsort(sizes, kind="stable")
    for few in search.tries(shares[order[sizes[order] > 0], None]):
        robust = few[search.share(few) == 1] if len(few) else few
        for some in np.array_split(robust, -(-len(robust) // settings.survey_batch)) if len(robust) else ():
            yield from some[search.clear(some)]
