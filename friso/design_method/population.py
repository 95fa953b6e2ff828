"""Build the machines that a specification allows: its corners, and machines drawn at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import qmc

from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.errors import InputError
from friso.intervals import Interval


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
    return {
        "motion.acceleration": rate,
        "motion.acceleration_time": time,
        "motion.return_at": back,
    }


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
