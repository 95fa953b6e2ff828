"""Build the machines that a specification allows, and find the edge of hunting over them.

The machines are the corners of its ranges, and machines drawn at random. The edge is the highest crossover at which a
stage hunts. In the corner where it is highest it is located to 1 or 2 %; only this one decides, and a design simulates
all its moves afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import qmc

from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.errors import InputError
from friso.hunting import find_attractors
from friso.intervals import Interval
from friso.progress import Progress, silent


@dataclass(frozen=True)
class Population:
    """Machines as arrays of shape (count,) by key [SI], for keys that differ from the stage."""

    keys: Mapping[str, np.ndarray]
    count: int

    def over(self, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stage's keys, with each machine's values where machines differ from it.

        The controller stays unchanged.
        """
        return {**flat, **self.keys}

    def of(self, number: int) -> dict[str, float]:
        """Return the values [SI] of one machine, by its number, for keys that differ from the stage."""
        return {key: float(values[number]) for key, values in self.keys.items()}


def corners(spec: Spec, flat: Mapping[str, Any]) -> Population:
    """Return the corners of a specification: the ends of all ranges of friction and masses.

    For static friction and gap, the middles are included too. Static friction and gap are combined with each other, and
    with masses that are all light or all heavy. All other friction is at its ends together, but viscous friction at the
    opposite end, because it damps. Raises InputError if friction never falls.
    """
    friction, masses = _friction(spec, flat), _masses(spec)
    main = [name for name in ("static", "coulomb", "gap") if name in friction]
    rest = [name for name in friction if name not in main]
    groups = [dict.fromkeys(masses, share) for share in (0.0, 1.0)] if masses else [{}]
    turned = (
        [{name: 1 - share if name == "viscous" else share for name in rest} for share in (0.0, 1.0)] if rest else [{}]
    )
    ranges = friction | masses
    levels = product(*(settings.corner_levels if ranges[name].high > ranges[name].low else (0.0,) for name in main))
    rows = [
        {**dict(zip(main, level, strict=True)), **side, **mass} for level, side, mass in product(levels, turned, groups)
    ]
    shares = {name: np.array([row[name] for row in rows]) for name in ranges}
    population = _population(ranges, shares, flat, len(rows))
    _falls(population, flat)
    return population


def _falls(population: Population, flat: Mapping[str, Any]) -> None:
    """Raise InputError if sliding friction is nowhere below static friction.

    Nothing is checked for a law without both kinds of friction.
    """
    static, coulomb = (population.keys.get(f"friction.{name}") for name in ("static", "coulomb"))
    if static is not None and coulomb is not None and np.all(coulomb >= static):
        text = f"static friction up to {static.max():g} N with Coulomb friction from {coulomb.min():g} N on"
        expected = "static friction above Coulomb friction (that of the stage file where the specification gives none)"
        raise InputError("friction.static", text, expected, 'static = "1 N .. 3 N", gap = "0.3 .. 0.85"')


def random_machines(spec: Spec, flat: Mapping[str, Any], count: int, softening: float) -> Population:
    """Draw machines and moves at random (Sobol) from the ranges of the specification.

    Friction, masses and stiffness are uniform; travel and acceleration are uniform in the logarithm. Stiffness varies
    by its tolerance; its low end is also reduced by `softening`, the fraction that the load may take away.
    """
    ranges = _friction(spec, flat) | _masses(spec)
    names = [*ranges, "stiffness", "travel", "acceleration"]
    sequence = qmc.Sobol(len(names), rng=settings.population_seed).random_base2(int(np.ceil(np.log2(count))))[:count]
    shares = dict(zip(names, sequence.T, strict=True))
    population = _population(ranges, {name: shares[name] for name in ranges}, flat, count)
    moves = _moves(spec, shares["travel"], shares["acceleration"])
    tolerance = spec.safety.stiffness_tolerance
    factors = Interval((1 - tolerance) * (1 - softening), 1 + tolerance, "").at(shares["stiffness"])
    stiffness = {"joint.stiffness": flat["joint.stiffness"] * factors}
    return Population({**population.keys, **moves, **stiffness}, count)


def typical_move(spec: Spec) -> dict[str, Any]:
    """Return the keys of a move in the middle of the ranges of travel and acceleration."""
    keys = _moves(spec, np.array(0.5), np.array(0.5))
    return {"motion.kind": "there_and_back", **{key: float(value) for key, value in keys.items()}}


def _moves(spec: Spec, travel: np.ndarray, acceleration: np.ndarray) -> dict[str, np.ndarray]:
    """Return keys of moves there and back, at fractions from 0 to 1 of the ranges specified.

    `travel` and `acceleration` are these fractions, on a logarithmic scale.
    """
    distance, rate = (
        interval.low * (interval.high / interval.low) ** share
        for interval, share in ((spec.moves.travel, travel), (spec.moves.acceleration, acceleration))
    )
    time = np.sqrt(distance / rate)
    back = np.maximum(settings.return_after, 2 * time + settings.return_after / 2)
    return {"motion.acceleration": rate, "motion.acceleration_time": time, "motion.return_at": back}


def _friction(spec: Spec, flat: Mapping[str, Any]) -> dict[str, Interval]:
    """Return the ranges of friction by key.

    Raises InputError for a key that the friction law lacks.
    """
    values = {name: getattr(spec.friction, name) for name in type(spec.friction).model_fields}
    ranges = {name: interval for name, interval in values.items() if interval is not None}
    for name in ranges:
        key = f"friction.{'coulomb' if name == 'gap' else name}"
        if key not in flat:
            law = flat["friction.model"]
            expected = "a range of a key that the friction law of the stage has"
            raise InputError(f"friction.{name}", f"a range, but the stage has {law} friction", expected)
    return ranges


def _masses(spec: Spec) -> dict[str, Interval]:
    masses = {name: getattr(spec.masses, name) for name in ("cart", "stage")}
    return {name: interval for name, interval in masses.items() if interval is not None}


def _population(
    ranges: Mapping[str, Interval], shares: Mapping[str, np.ndarray], flat: Mapping[str, Any], count: int
) -> Population:
    """Return machines whose keys lie at fractions `shares`, from 0 to 1, of their ranges.

    Sliding friction is limited to the static friction. Machines with both equal are included, although they cannot
    hunt.
    """
    values = {name: interval.at(shares[name]) for name, interval in ranges.items()}
    keys = {f"masses.{name}": values.pop(name) for name in ("cart", "stage") if name in values}
    if "friction.static" not in flat:
        return Population(keys | {f"friction.{name}": value for name, value in values.items()}, count)
    static = np.broadcast_to(values.get("static", flat["friction.static"]), (count,)).astype(float)
    if "gap" in values:
        values["coulomb"] = static * (1 - values.pop("gap"))
    else:
        values["coulomb"] = np.minimum(values.get("coulomb", flat["friction.coulomb"]), static)
    values["static"] = static
    return Population(keys | {f"friction.{name}": value for name, value in values.items()}, count)


@dataclass(frozen=True)
class Corners:
    """Extremes of friction and masses (corners), and the edge of hunting at each.

    `edges` [Hz], shape (n,), is the highest crossover at which the stage hunts: to 1 or 2 % in the worst corner, in the
    others to half a step of the search. It is 0 if the stage does not hunt from `searched[0]` on, and infinite if it
    still hunts at `searched[1]`. `unknown` counts the corners whose edge is not certain. Either simulations below it
    failed or did not settle, which counts as hunting. Or something above it may attract that no simulation reached.
    """

    population: Population
    edges: np.ndarray
    searched: tuple[float, float]
    unknown: int = 0

    @property
    def worst(self) -> int:
        """Return the index of the corner that hunts up to the highest crossover."""
        return int(self.edges.argmax())

    @property
    def highest(self) -> float:
        """Return the highest crossover [Hz] at which any corner hunts.

        If none hunts, the result is the lowest crossover searched.
        """
        return float(max(self.searched[0], self.edges.max()))

    @property
    def hunts(self) -> bool:
        """Tell whether any corner hunts in the range searched."""
        return bool(np.any(self.edges > 0))


def edges_over(
    flat: Mapping[str, Any],
    population: Population,
    low: float,
    high: float,
    steps: int,
    progress: Progress = silent,
    label: str = "",
) -> Corners:
    """Find the edge of hunting of a stage by van Dijk's rules, for each machine of a population.

    The search goes down from `high` to `low` [Hz] on a grid of `steps`, until the stage hunts. It then halves the step
    above that point, for the machines that may have the highest edge of all. `label` names the search to the progress.
    """
    corners = population.over({**flat, CROSSOVER: np.nan, "motion.kind": "release"})  # whatever the stage's motion
    grid, count = np.log(np.geomspace(low, high, steps)), population.count
    inside, outside, unsure = np.full(count, -np.inf), np.full(count, np.inf), np.zeros((2, count), bool)

    def survey(which: np.ndarray, crossover: np.ndarray) -> None:
        attract, certain = _attract(corners, which, crossover)
        outside[which[~attract]], inside[which[attract]] = crossover[~attract], crossover[attract]
        unsure[attract.astype(int), which] = ~certain

    for k, point in enumerate(grid[::-1]):
        progress(k, steps + settings.edge_bisections, label)
        if (left := np.flatnonzero(np.isneginf(inside))).size:
            survey(left, np.full(left.size, point))
    for k in range(settings.edge_bisections):
        progress(steps + k, steps + settings.edge_bisections, label)
        highest = np.flatnonzero(np.isfinite(inside) & np.isfinite(outside) & (outside > inside.max()))
        if highest.size:
            survey(highest, (inside[highest] + outside[highest]) / 2)
    edges = np.where(np.isneginf(inside), 0.0, np.exp((inside + outside) / 2))
    return Corners(population, edges, (low, high), int(unsure.any(axis=0).sum()))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _attract(corners: Mapping[str, Any], which: np.ndarray, crossover: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell which corners hunt or may hunt at certain crossovers, and whether that is certain.

    `which` are indices of corners, and `crossover` the logarithm of a crossover for each.
    """
    some = {key: value[which] if np.ndim(value) else value for key, value in corners.items()}
    attracted = find_attractors({**some, CROSSOVER: np.exp(crossover)}, len(which), settings.orbit_rtol)
    return attracted.attracts | ~attracted.decided, attracted.certain


def rigid(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the stage without isolator: cart and stage become one mass, as if locked."""
    return {key: value for key, value in flat.items() if not key.startswith(("joint.", "flexure.", "parasitic."))}
