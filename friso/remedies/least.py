"""The least change of a controller's keys that still meets the goal, from settings that do."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from friso.errors import InputError
from friso.remedies.catalogue import Remedy
from friso.remedies.search import Search
from friso.remedies.settings import RemedySettings
from friso.remedies.variables import Variable, of_key
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER

LEAST = ": the least change"
"""What is added to the name of a remedy."""


STEPS = np.append(np.linspace(1.0, 1.5, 26), np.geomspace(1.6, 8.0, 14))
"""Powers of the factors of the least change that are looked at, one after the other: the least of all is the one that
just works on the machines of the search, which is not to say on others."""


def least_remedy(before: Stage, tuned: Stage, remedy: Remedy) -> Remedy | None:
    """The remedy that varies each key of the controller by itself between its value `before` and the one in settings
    that work, and somewhat further, all else being as `tuned`; None where there are no such keys."""
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
    """A key between two values, beyond the one that works, and a little the other way, as far as a stage may have
    that."""
    settings = RemedySettings.current()
    towards, away = (
        (new * settings.factor_beyond, old / settings.factor_away)
        if new > old
        else (new / settings.factor_beyond, old * settings.factor_away)
    )
    ends = _possible(tuned, key, towards, new), _possible(tuned, key, away, old)
    return of_key(key, min(ends), max(ends), old)


def _possible(tuned: Stage, key: str, value: float, otherwise: float) -> float:
    """A value of a key, or another one where a stage may not have that."""
    try:
        tuned.with_numbers({key: value})
    except InputError:
        return otherwise
    return value


def least_changes(search: Search) -> Iterator[np.ndarray]:
    """The least changes of a remedy of `least_remedy`, (variables,): fewer keys first, then smaller factors. Each key
    is changed alone at first, as any such change is less than all those of more keys."""
    yield from _of_one_key(search)
    search.optimise(partial(change_costs, search.remedy), _beginnings(search.remedy))
    yield from candidates(search)


def _of_one_key(search: Search) -> Iterator[np.ndarray]:
    """Changes of one key, the least first, as far as it goes either way: those that break nothing, with which enough of
    the fresh machines meet the goal by their moves and margins, and nothing attracts the machines."""
    settings = RemedySettings.current()
    wanted = partial(change_costs, search.remedy)
    home, _ = _ends(search.remedy).T
    ways = np.concatenate([np.diag(end - home) for end in (1.0, 0.0)]) / settings.values_alone

    def changed(points: np.ndarray) -> np.ndarray:
        points = points[wanted(points) >= 1]
        return points[np.argsort(wanted(points), kind="stable")]

    alone = changed(np.concatenate([home + step * ways for step in range(1, settings.values_alone + 1)]))
    for few in search.tries(alone):
        for one in _robust(search, few):
            way = ways[(ways @ (one - home)).argmax()]
            finer = changed(one - way * np.linspace(0, 1, settings.finer_values + 1)[1:-1, None])
            for some in search.tries(finer) if len(finer) else ():
                yield from _robust(search, some)
            yield one


def _robust(search: Search, points: np.ndarray) -> Iterator[np.ndarray]:
    """Those of points (points, variables) with which enough of the fresh machines meet the goal by their moves and
    margins, and nothing attracts the machines."""
    settings = RemedySettings.current()
    robust = points[search.share(points) >= search.goal.surely(search.fresh.count)] if len(points) else points
    for few in np.array_split(robust, -(-len(robust) // settings.survey_batch)) if len(robust) else ():
        yield from few[search.clear(few)]


def change_costs(remedy: Remedy, shares: np.ndarray) -> np.ndarray:
    """How many keys points change, and below 1 by what factor, shape (points,)."""
    logarithms = np.stack(
        [
            np.abs(np.log(variable.at(share) / variable.present))
            for variable, share in zip(remedy.variables, shares.T, strict=True)
        ]
    )
    total = logarithms.sum(axis=0)
    return np.asarray(np.count_nonzero(logarithms, axis=0) + total / (1 + total))


def _beginnings(remedy: Remedy) -> np.ndarray:
    """The settings that work, and then with some keys as they were, the fewest changed ones first, wholly and half as
    far (in the logarithm), shape (points, variables)."""
    home, works = _ends(remedy).T
    _, *some, every = sorted(product((0.0, 1.0), repeat=len(home)), key=sum)
    masks = [every, *some]
    return np.array([home + part * np.array(mask) * (works - home) for mask in masks for part in (1.0, 0.5)])


def _ends(remedy: Remedy) -> np.ndarray:
    """Shares at which the numbers are the present ones, and those of the settings that work, (variables, 2)."""
    flat = remedy.stage.flat()
    return np.array([[v.share(v.present), v.share(flat[v.name])] for v in remedy.variables])


def candidates(search: Search) -> Iterator[np.ndarray]:
    """The least change of those of several keys tried that break nothing, (variables,), the same change taken further,
    points on the way from it to the settings that work, and others that were tried, all of them the least change first:
    those with which enough of the fresh machines meet the goal by their moves and margins, and nothing attracts the
    machines; last all that were tried."""
    settings = RemedySettings.current()
    wanted, points = partial(change_costs, search.remedy), search.points
    free = points.shares[points.meets(search.goal)]
    free = free[wanted(free) >= min(2, len(search.remedy.variables))]
    if not len(free):
        return
    others = free[np.argsort(wanted(free), kind="stable")][: settings.other_settings]
    least, (home, works) = others[0], _ends(search.remedy).T
    further = [home + step * (least - home) for step in STEPS]
    towards = [least + part * (works - least) for part in settings.change_parts]
    tried = np.unique(np.clip([*further, *towards, *others], 0, 1), axis=0)
    kept = tried[search.measured(tried).meets(search.goal)]
    kept = kept[np.argsort(wanted(kept), kind="stable")]
    for few in np.array_split(kept, -(-len(kept) // settings.points_looked_at)) if len(kept) else ():
        yield from _robust(search, few)
    yield from search.surveyed(wanted)
