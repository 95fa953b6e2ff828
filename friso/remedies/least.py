"""Find a controller's smallest change that meets the goal, from settings that do.

The size of a change counts parts bought, keys changed, and the factor of change.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, product
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.remedies.catalogue import Remedy, Variable, of_key
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


LEAST = ": the least change"
"""Suffix of the name of a remedy with the smallest change."""


TRIED_POWERS = np.append(np.linspace(1.0, 1.5, 26), np.geomspace(1.6, 8.0, 14))
"""Powers of the factors of the smallest change that are tried in turn. The smallest change just works on the machines
of the search, so other machines may need more."""


def least_remedy(before: Stage, tuned: Stage, remedy: Remedy) -> Remedy | None:
    """Return a remedy that varies each changed key of the controller separately.

    The range of a key is from its value `before` to its `tuned` value, and slightly beyond. Everything else is as
    `tuned`. Returns None if no key of the controller changed.
    """
    old, new = before.flat(), tuned.flat()
    variables = [
        _between(tuned, key, old[key], new[key])
        for key in tuned.numeric_keys()
        if key.startswith(f"{CONTROLLER}.") and old.get(key) and new.get(key) and old[key] != new[key]
    ]
    if not variables:
        return None
    name = f"{remedy.name.removesuffix(LEAST)}{LEAST}"
    return Remedy(name, tuned, tuple(variables), remedy.buys_joint)


def _between(tuned: Stage, key: str, old: float, new: float) -> Variable:
    """Return a key as a variable between two values, and slightly beyond if a stage allows it."""
    towards, away = (
        (new * settings.factor_beyond, old / settings.factor_away)
        if new > old
        else (new / settings.factor_beyond, old * settings.factor_away)
    )
    ends = _possible(tuned, key, towards, new), _possible(tuned, key, away, old)
    return of_key(key, min(ends), max(ends), old)


def _possible(tuned: Stage, key: str, value: float, otherwise: float) -> float:
    """Return `value` for a key, or `otherwise` if the stage does not allow it."""
    try:
        tuned.with_numbers({key: value})
    except InputError:
        return otherwise
    return value


def least_changes(search: Search, most: float = np.inf) -> Iterator[np.ndarray]:
    """Yield the smallest changes of the controller that may work, each of shape (variables,).

    The remedy searched varies each changed key separately (see `least_remedy`). Fewer keys come first, then smaller
    factors. Single keys are tried first, because any change of one key counts as smaller than a change of several. Only
    changes whose `size_cost` is less than `most` are returned.
    """
    yield from of_one_key(search, most)
    if most >= min(2, len(search.remedy.variables)):
        wanted = partial(change_costs, search.remedy)
        search.optimise(wanted, _beginnings(search.remedy))
        yield from (point for point in candidates(search) if wanted(point[None])[0] < most)


def of_one_key(search: Search, most: float = np.inf, enough: float | None = None) -> Iterator[np.ndarray]:
    """Yield changes of a single variable that work, the smallest first, all smaller than `most`.

    They break no constraint, and enough surveyed machines do not hunt (`Search.clear`). The fraction `enough` of the
    fresh machines meets the goal; by default, one standard error more than the goal requires. By default, smaller
    changes between grid points are tried, too. With `enough` they are not, so the first answer has a reserve.
    """
    wanted = partial(change_costs, search.remedy)
    home = np.array([variable.share(variable.present) for variable in search.remedy.variables])
    ways = np.concatenate([np.diag(end - home) for end in (1.0, 0.0)]) / settings.values_alone

    def changed(points: np.ndarray) -> np.ndarray:
        points = points[(wanted(points) >= 1) & (wanted(points) < most)]
        return points[np.argsort(wanted(points), kind="stable")]

    alone = changed(np.concatenate([home + step * ways for step in range(1, settings.values_alone + 1)]))
    closest = settings.finer_values + 1 if enough is None else 1
    for few in search.tries(alone):
        for one in _robust(search, few, enough):
            way = ways[(ways @ (one - home)).argmax()]
            finer = changed(one - way * np.linspace(0, 1, closest)[1:-1, None])
            closest = 2  # after a change that fails on other machines, take larger steps
            for some in search.tries(finer):
                yield from islice(_robust(search, some, enough), 1)
            yield one


def _robust(search: Search, points: np.ndarray, enough: float | None = None) -> Iterator[np.ndarray]:
    """Yield the points (points, variables) that work on fresh machines, without hunting.

    Enough surveyed machines must not hunt (`Search.clear`). At least the fraction `enough` of the fresh machines must
    meet the goal by moves and margins. By default, this fraction lies one standard error above the one required of all
    machines.
    """
    least = search.goal.surely(search.fresh.count) if enough is None else enough
    robust = points[search.share(points) >= least] if len(points) else points
    for few in np.array_split(robust, -(-len(robust) // settings.survey_batch)) if len(robust) else ():
        yield from few[search.clear(few)]


def change_costs(remedy: Remedy, shares: np.ndarray) -> np.ndarray:
    """Return the sizes of the changes at points with coordinates `shares`, shape (points,).

    The integer part counts the keys that change; the fraction grows with the factors of change.
    """
    logarithms = np.stack(
        [
            np.abs(np.log(variable.at(share) / variable.present))
            for variable, share in zip(remedy.variables, shares.T, strict=True)
        ]
    )
    return size_cost(np.count_nonzero(logarithms, axis=0), logarithms.sum(axis=0))


def size_cost(keys: Any, logarithm: Any) -> np.ndarray:
    """Return the size of a change as a number, to compare changes.

    The integer part of the result is the number of `keys`. Its fraction grows with the `logarithm` of the product of
    all factors.
    """
    return np.asarray(keys + logarithm / (1 + logarithm))


def _beginnings(remedy: Remedy) -> np.ndarray:
    """Return settings from which a search starts, as coordinates of shape (points, variables).

    First come those that are already known to work. Then follow settings in which only some keys change, the fewest
    first. Changes are taken wholly, and half-way in the logarithm.
    """
    home, works = _ends(remedy).T
    _, *some, every = sorted(product((0.0, 1.0), repeat=len(home)), key=sum)
    masks = [every, *some]
    return np.array([home + part * np.array(mask) * (works - home) for mask in masks for part in (1.0, 0.5)])


def _ends(remedy: Remedy) -> np.ndarray:
    """Return each variable's present value, and one that works, as coordinates, (variables, 2)."""
    flat = remedy.stage.flat()
    return np.array([[v.share(v.present), v.share(flat[v.name])] for v in remedy.variables])


def candidates(search: Search) -> Iterator[np.ndarray]:
    """Yield settings to verify, as points of shape (variables,), the smallest change first.

    First come settings that work on fresh machines: the smallest change tried that breaks no constraint, this change
    taken further, points between it and the working settings, and other small changes tried. The best of all points
    tried follow (`Search.surveyed`).
    """
    wanted, points = partial(change_costs, search.remedy), search.points
    free = points.shares[points.meets(search.goal)]
    free = free[wanted(free) >= min(2, len(search.remedy.variables))]
    if not len(free):
        return
    others = free[np.argsort(wanted(free), kind="stable")][: settings.other_settings]
    least, (home, works) = others[0], _ends(search.remedy).T
    further = [home + step * (least - home) for step in TRIED_POWERS]
    towards = [least + part * (works - least) for part in settings.change_parts]
    tried = np.unique(np.clip([*further, *towards, *others], 0, 1), axis=0)
    kept = tried[search.measured(tried, settings.worst_time).meets(search.goal)]
    kept = kept[np.argsort(wanted(kept), kind="stable")]
    for few in np.array_split(kept, -(-len(kept) // settings.points_looked_at)) if len(kept) else ():
        yield from _robust(search, few)
    yield from search.surveyed(wanted)
