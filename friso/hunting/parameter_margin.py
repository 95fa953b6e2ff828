"""Find how far a parameter of a stage may change before hunting begins, or ends."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.rows import ArrayRows
from friso.hunting.settings import edge_settings
from friso.hunting.what_attracts import map_may_decide, surveyed_roughly, what_attracts


class Undecided(Exception):
    """Error: the search could not decide whether hunting begins or ends on a side."""


Scaled = Callable[[np.ndarray], Mapping[str, Any]]
"""Function that returns stages, as keys in SI, with a parameter times factors (count,)."""


@dataclass(frozen=True)
class MarginEnd:
    """End of a margin: two close factors of a parameter between which hunting changes.

    From 1 up to `same` the stage hunts, or not, as at its own value; at `other` it does the opposite. The end is
    `certain` if a closed orbit is stable at one of the factors, and a completed search finds no attractor at the other.
    """

    same: float
    other: float
    certain: bool


@dataclass(frozen=True)
class ParameterMargin:
    """Range of a parameter over which a stage keeps hunting, or keeps not hunting.

    `attracts` is true if it hunts. `below` and `above` are the nearest factors of the parameter at which that changes
    (None: at no factor tried up to the end of the `range`). On the `open_sides`, -1 or 1, this is not known. Nothing of
    it is certain unless the values of the stage are `sure`.
    """

    attracts: bool
    below: MarginEnd | None
    above: MarginEnd | None
    range: tuple[float, float]
    open_sides: tuple[int, ...] = ()
    sure: bool = True

    @property
    def certain(self) -> bool:
        """Tell whether no side is open, the stage is sure, and both ends, if there are any, are certain.

        Between the tried values, hunting may still begin and end unnoticed.
        """
        return self.sure and not self.open_sides and all(end.certain for end in (self.below, self.above) if end)

    def uncertain(self) -> ParameterMargin:
        """Return the margin with its ends marked as not certain, of a stage that is not sure."""
        below, above = (end and replace(end, certain=False) for end in (self.below, self.above))
        return replace(self, below=below, above=above, sure=False)

    def end(self, side: int) -> MarginEnd | None:
        """Return the end below (`side` -1) or above (1) the stage's own value; None without one."""
        return self.below if side < 0 else self.above


@dataclass(frozen=True)
class _Wanted:
    """Factors of a parameter, shape (count,), to be surveyed roughly, or searched thoroughly."""

    factors: np.ndarray
    thorough: bool


@dataclass(frozen=True)
class _Found(ArrayRows):
    """What surveys show of stages, arrays of shape (count,).

    A stage `attracts` or not, which is `decided` or not. `certain` results come from a closed orbit or a completed
    thorough search.
    """

    attracts: np.ndarray
    decided: np.ndarray
    certain: np.ndarray


_Search = Generator[_Wanted, _Found, MarginEnd | None]
"""Search for an end of a margin, which asks for surveys and is sent their results."""


def parameter_margin(scaled: Scaled, attracts: bool, lowest: float, highest: float) -> ParameterMargin:
    """Find over what range of a parameter a stage keeps hunting, or keeps not hunting.

    The search runs from the factor `lowest` to the `highest` one. `scaled` makes the stages, and `attracts` is true if
    the stage itself hunts. Each side is surveyed roughly, at values whose spacing grows outward, then more closely
    around a change. Both ends are searched thoroughly, side by side. Ranges narrower than these steps may be missed. A
    side is open if an allowance of work is used up, or the search does not decide.
    """
    step = edge_settings.widest_factor_step
    farthest = {side: at for side, at in ((-1, lowest), (1, highest)) if side * (at - 1) > step}
    searches = {side: _Side(attracts, at).end() for side, at in farthest.items()}
    ends, open_sides = _ends(scaled, searches)
    return ParameterMargin(
        attracts, ends.get(-1), ends.get(1), (farthest.get(-1, 1.0), farthest.get(1, 1.0)), open_sides
    )


def _ends(scaled: Scaled, searches: dict[int, _Search]) -> tuple[dict[int, MarginEnd | None], tuple[int, ...]]:
    """Run searches side by side, and return the ends they find, by side, and the sides that stay open.

    Where return maps decide, surveys of one kind that several searches wait for are made together; rough ones come
    first. Elsewhere runs from many starts fill the registers anyway, and one search follows the other: if the allowance
    of work runs out, fewer stay open.
    """
    ends: dict[int, MarginEnd | None] = {}
    wanted = dict.fromkeys(searches, _Wanted(np.empty(0), False))
    answers: dict[int, Any] = dict.fromkeys(searches)
    together = map_may_decide(Ensemble.held(scaled(np.ones(1)), 1))
    with suppress(Exhausted):
        while wanted:
            for side, answer in answers.items():
                try:
                    wanted[side] = searches[side].send(answer)
                except StopIteration as finished:
                    ends[side] = finished.value
                    del wanted[side]
                except Undecided:
                    del wanted[side]
            turn = [*wanted] if together else [*wanted][:1]
            thorough = all(wanted[side].thorough for side in turn)
            now = [side for side in turn if wanted[side].thorough == thorough]
            if now:
                survey = _surveyed(scaled, np.concatenate([wanted[side].factors for side in now]), thorough)
                places = np.cumsum([0, *(len(wanted[side].factors) for side in now)])
                answers = {side: survey.take(slice(*part)) for side, part in zip(now, pairwise(places), strict=True)}
    return ends, tuple(side for side in searches if side not in ends)


def _surveyed(scaled: Scaled, factors: np.ndarray, thorough: bool) -> _Found:
    """Survey the stages that `scaled` makes at factors of the parameter, roughly or thoroughly."""
    stages = Ensemble.held(scaled(factors), len(factors))
    if not thorough:
        roughly = surveyed_roughly(stages, close=False)
        return _Found(roughly.attracts, roughly.decided, np.zeros(len(factors), bool))
    survey = what_attracts(stages)
    closed = np.zeros(len(factors), bool)
    closed[[motion.stage for motion in survey.motions if motion.cycles is not None]] = True
    surely = surely_surveyed(stages, survey)
    return _Found(survey.attracts, surely, np.where(survey.attracts, closed, surely))


class _Side:
    """Factors of a parameter on one side of its own value, from 1 outward, with results.

    `changed`: hunting has begun or ended. `decided`: it is known whether it has. `searched`: the stage was searched
    thoroughly. `certain`: the thorough search was certain.
    """

    def __init__(self, attracts: bool, farthest: float) -> None:
        """Begin at the factor 1; `attracts` is true if the stage itself hunts, and `farthest` is the last factor."""
        self.attracts, self.farthest = attracts, farthest
        self.factors, self.changed = np.ones(1), np.zeros(1, bool)
        self.decided, self.searched, self.certain = (np.ones(1, bool) for _ in range(3))

    def end(self) -> _Search:
        """Find the first factor at which hunting begins or ends; None if there is none.

        Raises Undecided if surveys leave open whether hunting changes.
        """
        yield from self._try(self.farthest ** np.array(edge_settings.margin_steps))
        for _ in range(edge_settings.most_proofs):
            first = yield from self._bracketed()
            pair = np.array(edge_settings.thorough_margin_steps) if first is None else (yield from self._pair(first))
            yield from self._search(pair[~self.searched[pair]])
            if first is None and not self.changed.any():
                if not self.decided.all():
                    raise Undecided
                return None
            if first is None:
                continue
            certain = self.certain[pair].all() and self.decided[: pair[1]].all()
            if not self.changed[pair[0]] and self.changed[pair[1]]:
                return MarginEnd(*self.factors[pair].tolist(), certain=bool(certain))
            if not self.changed[pair[1]]:
                self.changed[: pair[1]] &= self.searched[: pair[1]]
        raise Undecided

    def _bracketed(self) -> Generator[_Wanted, _Found, int | None]:
        """Find the first factor at which hunting has changed; return its number, or None.

        Factors before it are tried until the last one without a change is close.
        """
        while (changed := np.flatnonzero(self.changed)).size:
            first = int(changed[0])
            if abs(self.factors[first] / self.factors[first - 1] - 1) <= edge_settings.widest_factor_step:
                return first
            between = np.geomspace(self.factors[first - 1], self.factors[first], edge_settings.bracket_steps + 1)[1:-1]
            yield from self._try(between)
        return None

    def _pair(self, first: int) -> Generator[_Wanted, _Found, np.ndarray]:
        """Choose two factors, by number, to search thoroughly around the first change.

        Their distances from the change are `proved_distances`: close to the end of hunting, motions take long to decay,
        and a rough survey may be wrong. Factors that were not surveyed yet are surveyed roughly.
        """
        inward, outward = edge_settings.proved_distances if self.attracts else edge_settings.proved_distances[::-1]
        places, farthest = np.abs(np.log(self.factors)), abs(np.log(self.farthest))
        wanted = np.clip([places[first - 1] - inward, places[first] + outward], 0.0, farthest)
        new = [place for place in wanted if np.abs(places - place).min() > edge_settings.same_factor_log]
        if new:
            yield from self._try(np.exp(np.sign(np.log(self.farthest)) * np.array(new)))
        places = np.abs(np.log(self.factors))
        return np.array([np.abs(places - place).argmin() for place in wanted])

    def _try(self, factors: np.ndarray) -> Generator[_Wanted, _Found, None]:
        """Survey more factors roughly."""
        survey = yield _Wanted(factors, thorough=False)
        order = np.argsort(np.abs(np.log(np.append(self.factors, factors))), kind="stable")
        self.factors = np.append(self.factors, factors)[order]
        self.changed = np.append(self.changed, survey.attracts != self.attracts)[order]
        self.decided = np.append(self.decided, survey.decided)[order]
        nothing = np.zeros(len(factors), bool)
        self.searched, self.certain = (np.append(flags, nothing)[order] for flags in (self.searched, self.certain))

    def _search(self, numbers: np.ndarray) -> Generator[_Wanted, _Found, None]:
        """Search factors thoroughly, by number."""
        if not numbers.size:
            return
        survey = yield _Wanted(self.factors[numbers], thorough=True)
        self.changed[numbers], self.searched[numbers] = survey.attracts != self.attracts, True
        self.decided[numbers], self.certain[numbers] = survey.decided, survey.certain
