"""Draw machines around a stage, each with a move of its own.

Any change of the stage can be applied to all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.remedies.settings import RemedySettings
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.stage.correlations import Correlations
from friso.stage.motion import motion_of
from friso.studies.compare.machines import LEAST, SPREADS, draw_machines

ADDED = int.from_bytes(b"joint")
"""Which of a seed's random numbers decide on a joint that the stage file does not have: they are the second half of
Philox's key."""

HALF_WIDTHS = 1.959963984540054
"""Standard deviations in the half-width of a 95 % interval."""

ADDED_KEYS = ("joint.stiffness", "joint.damping")


@dataclass(frozen=True)
class Fleet:
    """Machines drawn around a stage, as changes of its keys, all of shape (count,).

    `ratios` multiply a key on each machine, and `shifts` are added to keys that are 0. `travel` is each machine's share
    of the travel. `from_file` lists the keys that the file calls uncertain, and `spreads` [%] the default spreads of
    others. `left_out` counts invalid draws, which were replaced.
    """

    ratios: Mapping[str, np.ndarray]
    shifts: Mapping[str, np.ndarray]
    travel: np.ndarray
    from_file: tuple[str, ...]
    spreads: Mapping[str, float]
    left_out: int = 0

    @property
    def count(self) -> int:
        """Return the number of machines."""
        return len(self.travel)

    def take(self, numbers: np.ndarray) -> Fleet:
        """Return the machines with these numbers."""
        ratios, shifts = (
            {key: value[numbers] for key, value in column.items()} for column in (self.ratios, self.shifts)
        )
        return replace(self, ratios=ratios, shifts=shifts, travel=self.travel[numbers])

    def laid_over(self, stage: Stage, changes: Mapping[str, Any], points: int) -> dict[str, Any]:
        """Return flat keys of all machines at all `points`, whose arrays have shape (points,).

        All machines at the first point come first. The controller is tuned for the stage and does not know the drawn
        values.
        """
        flat = stage.flat()
        tuned = as_tuned(flat)
        for key, value in {**tuned, **changes}.items():
            flat[key] = np.repeat(np.broadcast_to(value, (points,)), self.count)
        for key, ratio in self._of(flat).items():
            flat[key] = flat[key] * np.tile(ratio, points)
        for key, shift in self.shifts.items():
            flat[key] = flat.get(key, 0.0) + np.tile(shift, points)
        return {**flat, **motion_of(flat).stretched(flat, np.tile(self.travel, points))}

    def _of(self, flat: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the ratios of the keys that the stage has.

        Both parts of a mass that was split vary with the whole mass.
        """
        ratios = {key: ratio for key, ratio in self.ratios.items() if key in flat}
        masses = [key for key in self.ratios if key.startswith("masses.")]
        for key in ("masses.cart", "masses.stage"):
            if key in flat and key not in ratios and masses:
                ratios[key] = self.ratios[masses[0]]
        return ratios


def draw_fleet(stage: Stage, correlations: Correlations, count: int, seed: int) -> Fleet:
    """Draw machines around a stage as `friso compare` does.

    The first is the stage file's own, with its own move. Joints that the file does not have vary by the default
    spreads. Raises InputError.
    """
    settings = RemedySettings.current()
    sample, flat = draw_machines(stage, correlations, max(count, LEAST), seed), stage.flat()
    keys = {key: values[:count] for key, values in sample.keys.items() if key in flat and not key.startswith("rail.")}
    ratios = {key: values / flat[key] for key, values in keys.items() if flat[key]}
    shifts = {key: values.copy() for key, values in keys.items() if not flat[key]}
    random = np.random.Generator(np.random.Philox(key=[seed, ADDED]))
    for key in ADDED_KEYS:
        spread = SPREADS[key] / 100 / HALF_WIDTHS * random.standard_normal(count)
        ratios.setdefault(key, np.maximum(1 + spread, 1 - SPREADS[key] / 100))
    travel = settings.shortest_travel ** random.random(count)
    for values in (*ratios.values(), travel):
        values[0] = 1.0
    for values in shifts.values():
        values[0] = 0.0
    return Fleet(ratios, shifts, travel, sample.from_file, dict(sample.spreads), sample.sample.left_out)
