"""How far a parameter of a stage may be from its value before hunting begins, or ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.what_attracts import surveyed_roughly, what_attracts

STEPS = 8
"""Values that are tried first on either side of the stage's own: as many stages as are run at once on most
processors."""

FINER = 6
"""Steps into which the one in which what attracts changes is divided next."""

CLOSE = 0.03
"""Widest share between two neighbouring values where what attracts changes."""

PROOFS = 6
"""How often both ends are searched thoroughly at most, once for every end at which a rough survey was wrong."""

NEAREST = np.array([1, 2])
"""Numbers of the values, from the stage's own outward, that are searched thoroughly where a rough survey finds no
change: the nearest two."""


class Undecided(Exception):
    """It is not known whether what attracts changes on a side."""


Scaled = Callable[[np.ndarray], Mapping[str, Any]]
"""Stages, given as flat keys, whose parameter is multiplied by factors, shape (count,)."""


@dataclass(frozen=True)
class MarginEnd:
    """Two factors of a parameter, close together: up to `same`, from 1 on, what holds at the stage itself does, hunting
    or none, and it does not at `other`. It is `certain` where something attracts at one of both, closed as an orbit,
    and nothing does at the other, by a search that was completed.
    """

    same: float
    other: float
    certain: bool


@dataclass(frozen=True)
class ParameterMargin:
    """Where hunting begins, of a stage that nothing attracts, or ends, of one that something `attracts`: the nearest
    values of a parameter `below` and `above` its own, in units of that (None: none between it and the end of the
    `range` that was searched). Of a side in `open_sides`, -1 or 1, it is not known."""

    attracts: bool
    below: MarginEnd | None
    above: MarginEnd | None
    range: tuple[float, float]
    open_sides: tuple[int, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether both ends, where there are any, are certain, and both sides were searched."""
        return not self.open_sides and all(end.certain for end in (self.below, self.above) if end)

    def end(self, side: int) -> MarginEnd | None:
        """The end on a side, -1 or 1."""
        return self.below if side < 0 else self.above


def parameter_margin(scaled: Scaled, attracts: bool, lowest: float, highest: float) -> ParameterMargin:
    """The margin of a stage in a parameter, searched from the factor `lowest` to the `highest` one.

    What holds at the stage itself is known: whether something `attracts`. Both sides are surveyed roughly, at values a
    few per cent to a quarter apart, then more closely where that changes; both ends are searched thoroughly. So ranges
    narrower than these steps may be missed. Where an allowance is used up, or that does not decide, a side is open.
    """
    ends: dict[int, MarginEnd | None] = {-1: None, 1: None}
    open_sides = []
    for side, farthest in ((-1, lowest), (1, highest)):
        if side * (farthest - 1) <= CLOSE:
            continue
        try:
            ends[side] = _Side(scaled, attracts, farthest).end()
        except (Exhausted, Undecided):
            open_sides.append(side)
    return ParameterMargin(attracts, ends[-1], ends[1], (min(lowest, 1.0), max(highest, 1.0)), tuple(open_sides))


class _Side:
    """Factors of a parameter on one side of the stage's own, from 1 outward: at which of them what attracts has
    `changed`, of which that is `decided`, which were `searched` thoroughly, and of which of these it is `certain`."""

    def __init__(self, scaled: Scaled, attracts: bool, farthest: float) -> None:
        """Survey some factors roughly. Raises Exhausted."""
        self.scaled, self.attracts = scaled, attracts
        self.factors, self.changed = np.ones(1), np.zeros(1, bool)
        self.decided, self.searched, self.certain = (np.ones(1, bool) for _ in range(3))
        self._try(farthest ** (np.arange(1, STEPS + 1) / STEPS))

    def end(self) -> MarginEnd | None:
        """Where what attracts changes first; None if it does nowhere. Raises Exhausted, and Undecided."""
        end = None
        for _ in range(PROOFS):
            first = self._bracketed()
            pair = NEAREST if first is None else self._pair(first)
            self._search(pair[~self.searched[pair]])
            if first is None and not self.changed.any():
                if not self.decided.all():
                    raise Undecided
                return None
            if first is None:
                continue
            certain = self.certain[pair].all() and self.decided[: pair[1]].all()
            end = MarginEnd(*self.factors[pair].tolist(), certain=bool(certain))
            if not self.changed[pair[0]] and self.changed[pair[1]]:
                return end
            if not self.changed[pair[1]]:
                self.changed[: pair[1]] = False
        if end is None:
            raise Undecided
        return replace(end, certain=False)

    def _bracketed(self) -> int | None:
        """The number of the first factor at which it has changed, once others close to it were tried; None if it has
        nowhere."""
        while (changed := np.flatnonzero(self.changed)).size:
            first = int(changed[0])
            if abs(self.factors[first] / self.factors[first - 1] - 1) <= CLOSE:
                return first
            self._try(self._finer(first))
        return None

    def _finer(self, first: int) -> np.ndarray:
        """Factors between the first at which it has changed and the one before it, and two as close beyond
        it."""
        low, high = self.factors[first - 1 : first + 1]
        places = np.arange(1, FINER + 3)
        factors = low * (high / low) ** (places[places != FINER] / FINER)
        return factors[np.abs(np.log(factors)) < abs(np.log(self.factors[-1]))]

    def _pair(self, first: int) -> np.ndarray:
        """The numbers of two factors about the first at which it has changed, by a survey that is rough next to where
        hunting ends: a step off where something attracts, and two where nothing does, as motions take long to die out
        next to that."""
        inward, outward = (2, 2) if self.attracts else (3, 1)
        further = self.changed[first : first + outward + 1]
        return np.array([max(first - inward, 0), first + (len(further) if further.all() else further.argmin()) - 1])

    def _try(self, factors: np.ndarray) -> None:
        """Survey more factors roughly."""
        survey = surveyed_roughly(self._stages(factors), close=False)
        order = np.argsort(np.abs(np.log(np.append(self.factors, factors))), kind="stable")
        self.factors = np.append(self.factors, factors)[order]
        self.changed = np.append(self.changed, survey.attracts != self.attracts)[order]
        self.decided = np.append(self.decided, survey.decided)[order]
        nothing = np.zeros(len(factors), bool)
        self.searched, self.certain = (np.append(flags, nothing)[order] for flags in (self.searched, self.certain))

    def _search(self, numbers: np.ndarray) -> None:
        """Search factors thoroughly, by number."""
        survey = what_attracts(self._stages(self.factors[numbers]))
        closed = np.zeros(len(numbers), bool)
        closed[[motion.stage for motion in survey.motions if motion.cycles is not None]] = True
        self.changed[numbers], self.searched[numbers] = survey.attracts != self.attracts, True
        self.decided[numbers] = survey.decided
        self.certain[numbers] = np.where(survey.attracts, closed, survey.decided)

    def _stages(self, factors: np.ndarray) -> Ensemble:
        return Ensemble.held(self.scaled(factors), len(factors))
