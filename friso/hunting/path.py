"""Define paths through stages: one parameter of a stage moves, and hunting begins and ends on the way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.equations.bandwidth import faster, least_static_factor, with_static_friction
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.search_limits import SEARCH_LIMITS
from friso.hunting.settings import edge_settings

LossKind = Literal["flip", "fold", "torus", "lost", "seen"]
"""How attraction ends: the orbit flips, folds back or becomes a torus there, was lost, or surveys enclose the end."""


@dataclass(frozen=True)
class AttractionEnd:
    """Where attraction ends, between two factors of a parameter.

    The stage has an attractor at `inside` and none at `outside`. The end is `certain` under four conditions: an orbit
    was followed to its end or its loss at `inside`, or an attractor was seen there; no attractor exists at `outside`;
    all runs decided; and both factors are close together. `reserve` is the relative error, and `kind` says how
    attraction ends.
    """

    inside: float
    outside: float
    certain: bool
    kind: LossKind = "seen"

    @property
    def reserve(self) -> float:
        """Return the relative error of the end: by what fraction both factors differ."""
        return abs(self.outside / self.inside - 1)


@dataclass(frozen=True)
class BandwidthWindow:
    """A window of bandwidths in which a stage hunts, or its loop is unstable, by its ends `low` and `high`.

    The ends are in factors of the stage's own bandwidth (None: the window reaches the end of the search).
    """

    low: AttractionEnd | None
    high: AttractionEnd | None

    def holds(self, factor: float) -> bool:
        """Tell whether a factor of the stage's own bandwidth lies in this window."""
        low, high = self.low.inside if self.low else 0.0, self.high.inside if self.high else np.inf
        return low <= factor <= high

    def lies(self, side: int, factor: float) -> bool:
        """Tell whether this window lies above (`side` 1) or below (-1) a factor of the stage's own bandwidth."""
        near = self.low if side > 0 else self.high
        return near is not None and side * (near.inside - factor) > 0

    def without(self, other: BandwidthWindow) -> tuple[BandwidthWindow, ...]:
        """Return the parts of this window below and above another one; where both overlap, the other counts.

        A part that is narrower than the error of an end is left out.
        """
        if (other.high and not self._reaches(other.high, -1)) or (other.low and not self._reaches(other.low, 1)):
            return (self,)
        parts = []
        if other.low and self._reaches(other.low, -1):
            parts.append(
                BandwidthWindow(self.low, replace(other.low, inside=other.low.outside, outside=other.low.inside))
            )
        if other.high and self._reaches(other.high, 1):
            parts.append(
                BandwidthWindow(replace(other.high, inside=other.high.outside, outside=other.high.inside), self.high)
            )
        return tuple(parts)

    def _reaches(self, place: AttractionEnd, side: int) -> bool:
        """Tell whether part of this window surely lies above (`side` 1) or below (-1) the end of another one."""
        end = self.high if side > 0 else self.low
        return end is None or side * (end.inside / place.inside - 1) > end.reserve + place.reserve


@dataclass(frozen=True)
class ParameterPath:
    """Stages along which one parameter moves.

    `stages` makes them, with the parameter times factors (count,). `factors`, ascending, are those surveyed at first;
    the one numbered `own` is 1, the stage itself. `beyond` are the factors past an orbit's end at which other
    attractors are looked for.
    """

    stages: Callable[[np.ndarray], Ensemble]
    factors: np.ndarray
    own: int
    beyond: tuple[float, ...]

    @classmethod
    def of(
        cls,
        scaled: Callable[[np.ndarray], Mapping[str, Any]],
        below: np.ndarray,
        above: np.ndarray,
        beyond: tuple[float, ...],
    ) -> ParameterPath:
        """Make a path from ascending factors below and above 1, either of which may be empty.

        `scaled` gives the stages' keys in SI, with the parameter times factors (count,).
        """

        def stages(factors: np.ndarray) -> Ensemble:
            return Ensemble.held(scaled(factors), len(factors))

        return cls(stages, np.concatenate([below, [1.0], above]), len(below), beyond)

    def numbers(self, side: int) -> np.ndarray:
        """Return the numbers of the factors above (`side` 1) or below (-1) the stage's own, outward."""
        return np.arange(self.own + 1, len(self.factors)) if side > 0 else np.arange(self.own - 1, -1, -1)


def bandwidth_path(flat: Mapping[str, Any], attracting: bool) -> ParameterPath:
    """Return the path along which the whole controller of a stage becomes faster.

    `flat` has the stage's keys in SI. Factors lie closer on the side where an edge is expected: above for an
    `attracting` stage, else below.
    """
    fine, coarse = SEARCH_LIMITS.steps_to_edge, SEARCH_LIMITS.steps_beyond
    to_lower, to_higher = (coarse, fine) if attracting else (fine, coarse)
    lowest, highest = SEARCH_LIMITS.lowest_bandwidth, SEARCH_LIMITS.highest_bandwidth
    below = np.geomspace(lowest, 1.0, round(-to_lower * np.log10(lowest)), endpoint=False)
    above = np.geomspace(1.0, highest, round(to_higher * np.log10(highest)) + 1)[1:]
    return ParameterPath.of(lambda factors: faster(flat, factors), below, above, edge_settings.beyond_bandwidths)


def static_friction_path(flat: Mapping[str, Any]) -> ParameterPath:
    """Return the path along which static friction changes and Coulomb friction is held.

    It begins where both are equal, or at a fraction given by `SEARCH_LIMITS`. `flat` has the stage's keys in SI.
    """
    lowest = max(least_static_factor(flat), 1 / SEARCH_LIMITS.most_friction)
    return _path_of_factors(lambda factors: with_static_friction(flat, factors), lowest)


def key_path(flat: Mapping[str, Any], key: str) -> ParameterPath:
    """Return the path along which one key of a stage changes; `flat` has the stage's keys in SI."""
    return _path_of_factors(lambda factors: {**flat, key: flat[key] * factors}, 1 / SEARCH_LIMITS.most_friction)


def _path_of_factors(scaled: Callable[[np.ndarray], Mapping[str, Any]], lowest: float) -> ParameterPath:
    """Return a path from the factor `lowest`, at most 1, to the highest one; its steps grow outward."""
    steps = np.array(edge_settings.margin_steps)
    below = lowest ** steps[::-1] if lowest < 1 else np.empty(0)
    return ParameterPath.of(scaled, below, SEARCH_LIMITS.most_friction**steps, edge_settings.beyond_factors)
