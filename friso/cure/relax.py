"""What to relax where no way meets the goal: the settings that break one constraint alone, or two."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.cure.answers import Cure
from friso.cure.goal import Goal
from friso.cure.machines import Fleet
from friso.cure.search import SettingsTried
from friso.cure.trials import LOOSER, attraction
from friso.cure.ways import WayOut
from friso.stage import Stage

TRIED, SURVEYED = 3, 4
"""Settings whose machines are surveyed, at most, for one relaxation, and how many machines."""


@dataclass(frozen=True)
class Relaxed:
    """Parts of the goal (`within`, `settle`, `force_limit`, `margin`) to the values with which a way meets it: its
    stage, and the factor by which they are relaxed, all together."""

    way: WayOut
    stage: Stage
    values: Mapping[str, float]
    factor: float


def relaxations(answers: Sequence[Cure], goal: Goal, machines: Fleet) -> tuple[Relaxed, ...]:
    """The cheapest relaxation of each kind, the one that relaxes least first. Nothing is relaxed of the distance from
    hunting: machines that are surveyed with the settings named have nothing that attracts."""
    best: dict[tuple[str, ...], Relaxed] = {}
    for answer in answers:
        if answer.settings is None:
            continue
        for relaxed in _of_way(answer.way, answer.settings, goal, machines):
            keys = tuple(sorted(relaxed.values))
            if keys not in best or relaxed.factor < best[keys].factor:
                best[keys] = relaxed
    single = [relaxed for keys, relaxed in best.items() if len(keys) == 1]
    listed = single or [*best.values()]
    return tuple(sorted(listed, key=lambda relaxed: relaxed.factor))


def _of_way(way: WayOut, settings: SettingsTried, goal: Goal, machines: Fleet) -> Iterator[Relaxed]:
    """The cheapest relaxations of a way: those of one part each, or else of two."""
    needed = _needed(settings, goal)
    count = np.sum([values > 1 for values in needed.values()], axis=0)
    factor = np.prod([np.maximum(values, 1.0) for values in needed.values()], axis=0)
    possible = np.isfinite(factor) & np.isfinite(settings.slower)
    few = machines.take(np.arange(min(SURVEYED, machines.count)))
    for parts in (1, 2):
        kinds: dict[tuple[str, ...], int] = {}
        which = np.flatnonzero(possible & (count == parts))
        for number in which[np.argsort(factor[which], kind="stable")]:
            names = tuple(name for name, values in needed.items() if values[number] > 1)
            kinds[names] = kinds.get(names, 0) + 1
            if kinds[names] > TRIED:
                continue
            if attraction(way, settings.shares[[number]], few, goal).clear.all():
                kinds[names] = TRIED
                values = {name: _value(name, settings, int(number)) for name in names}
                if "within" in values:
                    values["within"] = LOOSER * goal.within
                yield Relaxed(way, way.tuned(settings.shares[number]), values, float(factor[number]))
        if kinds:
            return


def _needed(settings: SettingsTried, goal: Goal) -> dict[str, np.ndarray]:
    """The factors by which parts of the goal would have to be relaxed for each setting."""
    time = np.where(np.isfinite(settings.settling), settings.settling, settings.looser)
    none = np.zeros(len(time))
    return {
        "margin": goal.margin / np.maximum(settings.margin, 1e-9) * np.where(settings.margin > 0, 1, np.inf),
        "within": np.where(np.isfinite(settings.settling), 1.0, np.where(np.isfinite(settings.looser), LOOSER, np.inf)),
        "settle": none if goal.settle is None else time / goal.settle,
        "force_limit": none if goal.force_limit is None else settings.force / goal.force_limit,
    }


def _value(name: str, settings: SettingsTried, number: int) -> float:
    """What a part of the goal would have to be for a setting."""
    time = settings.settling[number] if np.isfinite(settings.settling[number]) else settings.looser[number]
    values: dict[str, Any] = {
        "margin": settings.margin[number],
        "settle": time,
        "force_limit": settings.force[number],
        "within": np.nan,
    }
    return float(values[name])
