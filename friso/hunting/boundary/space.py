"""Represent the keys that are varied as a box whose every side runs from 0 to 1."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from friso.equations.structure import Structure, shared_structure
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.shooting import Family
from friso.stage import Stage, violations

GENERIC_POSITION = 0.4721359549995794
"""Irrational position in a key's range, from 0 to 1, at which no key has a special value."""

FlatAt = Callable[[Mapping[str, np.ndarray]], Mapping[str, Any]]
"""Function that turns arrays of values, by name, into the keys of stages with SI values."""


@dataclass(frozen=True)
class KeyRange:
    """Range of a key, or of a variable that keys depend on, from `low` to `high` [SI `unit`].

    A place in the range runs from 0 to 1, evenly in the value, or in its logarithm if `log`.
    """

    key: str
    low: float
    high: float
    log: bool = False
    unit: str = ""

    def at(self, place: np.ndarray) -> np.ndarray:
        """Return the values [SI] at places, in their shape: `low` at place 0 and `high` at 1."""
        if self.log:
            return self.low * (self.high / self.low) ** place
        return self.low + (self.high - self.low) * place

    def place(self, value: np.ndarray) -> np.ndarray:
        """Return the places of values [SI], in their shape, from 0 at `low` to 1 at `high`."""
        if self.log:
            return np.log(value / self.low) / np.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def hundredth(self, place: float) -> float:
        """Return by how much the place changes where the value changes by one per cent.

        The value is the one at `place`. If the range contains 0, one per cent of the larger end is used instead.
        """
        if self.log:
            return float(np.log(1.01) / abs(np.log(self.high / self.low)))
        ends = [abs(self.low), abs(self.high)]
        size = abs(float(self.at(np.array(place)))) if self.low * self.high > 0 else max(ends)
        return 0.01 * size / abs(self.high - self.low)


@dataclass(frozen=True)
class Space:
    """Stages with one key varied, or several, over their ranges.

    `flat` makes the keys [SI] of stages from values of the varied keys.
    """

    ranges: tuple[KeyRange, ...]
    flat: FlatAt

    @classmethod
    def of(cls, stage: Stage, ranges: Sequence[KeyRange]) -> Space:
        """Make the space around one stage, over ranges of its keys."""
        return cls(tuple(ranges), stage.flat)

    def values(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """Return the values [SI] of the keys at points of the box, shape (count, keys)."""
        return {swept.key: swept.at(points[:, i]) for i, swept in enumerate(self.ranges)}

    def stages(self, points: np.ndarray) -> Ensemble:
        """Return the stages at points of the box, shape (count, keys)."""
        return Ensemble.held(self.flat(self.values(points)), len(points), form=self.form)

    @cached_property
    def form(self) -> Structure:
        """Return the structure shared by all stages in the box.

        The structure is that of a stage at which no key is zero or a whole number. Simpler stages, with a stroke of
        zero or a whole exponent, use it too.
        """
        return shared_structure(self.flat(self.values(np.full((1, len(self.ranges)), GENERIC_POSITION))))

    def grid(self, nodes: int) -> np.ndarray:
        """Return points spaced evenly over the box, `nodes` along every side, (points, keys).

        The first key varies slowest.
        """
        sides = np.meshgrid(*[np.linspace(0, 1, nodes)] * len(self.ranges), indexing="ij")
        return np.stack([side.ravel() for side in sides], axis=1)

    def allowed(self, points: np.ndarray) -> np.ndarray:
        """Return which points of the box, shape (count, keys), are valid stages, shape (count,)."""
        broken = [np.broadcast_to(where, len(points)) for where, _ in violations(self.flat(self.values(points)))]
        return ~np.any([np.zeros(len(points), bool), *broken], axis=0)

    def lines(self, origins: np.ndarray, directions: np.ndarray) -> Family:
        """Return a function that makes the stages at places along lines through the box.

        Lines have origins (count, keys) and directions (count, keys).
        """

        def family(which: np.ndarray, places: np.ndarray) -> Ensemble:
            """Return the stages on the lines numbered `which`, at `places` along them."""
            return self.stages(origins[which] + places[:, None] * directions[which])

        return family

    def hundredth(self, origin: np.ndarray, direction: np.ndarray) -> Callable[[float], float]:
        """Return a function that tells, at a place on a line, over what length a key changes by 1 %.

        The key that changes fastest counts. The line runs through the box from an origin (keys,) along a direction
        (keys,).
        """

        def length(place: float) -> float:
            """Return the distance from `place` along the line that changes the fastest key by 1 %."""
            steps = zip(self.ranges, origin + place * direction, direction, strict=True)
            return min(swept.hundredth(float(at)) / abs(float(way)) for swept, at, way in steps if way)

        return length
