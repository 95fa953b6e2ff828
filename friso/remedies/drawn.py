"""Draw random machines around a stage file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from friso.errors import InputError
from friso.stage import Stage, numeric_keys
from friso.stage.arguments import MOST_SEED
from friso.stage.controllers import CONTROLLER
from friso.stage.correlations import Correlations, Sample, draw
from friso.stage.lists import element_keys
from friso.stage.tables import BACKLASH, INERTIA, LEAD, MOTOR_FRICTION, MOTOR_MASS, RATIO, TRANSMISSION, motor_mass

FEWEST_MACHINES, MOST_MACHINES = 20, 100_000
"""Fewest machines, because fewer give no useful interval, and most, because more take hours."""


FRICTIONS = ("friction", MOTOR_FRICTION)
"""Tables of a friction law, whose keys have the same spreads."""


def _of_both(keys: Mapping[str, float]) -> dict[str, float]:
    """Return spreads of keys of a friction law for the friction of the guide and of the motor."""
    return {f"{table}.{key}": spread for table in FRICTIONS for key, spread in keys.items()}


SPREADS: Mapping[str, float] = MappingProxyType(
    {
        "masses.cart": 3.0,
        "masses.stage": 3.0,
        **_of_both(
            {
                "static": 30.0,
                "coulomb": 30.0,
                "viscous": 30.0,
                "stribeck_velocity": 50.0,
                "bristle_stiffness": 50.0,
                "bristle_damping": 50.0,
                "breakaway_deflection": 50.0,
                "attraction": 50.0,
            }
        ),
        MOTOR_MASS: 3.0,
        INERTIA: 3.0,
        f"{TRANSMISSION}.stiffness": 20.0,
        f"{TRANSMISSION}.damping": 50.0,
        BACKLASH: 50.0,
        "joint.stiffness": 5.0,
        "joint.damping": 50.0,
        "parasitic.frequency": 5.0,
        "parasitic.damping_ratio": 50.0,
        "rail.static_deviation": 30.0,
        "rail.coulomb_deviation": 30.0,
    }
)
"""Half-widths of the 95 % intervals [%] of keys for which the stage file has none.

friso chose them: friction as it differs between bearings of one type and preload, masses as weighed, bristles and
Stribeck velocity as uncertain as identification leaves them, a screw's stiffness as catalogues state it.
"""

ELEMENTS: Mapping[str, float] = MappingProxyType(_of_both({"element_stiffness": 50.0, "element_damping": 50.0}))
"""Half-widths of the 95 % intervals [%] of arrays for which the stage file has none. All elements of an array vary by
one common factor."""

SLIPS = tuple(f"{table}.breakaway_deflection" for table in FRICTIONS)
"""Keys of the deflection at which elasto-plastic bristles begin to slip. It is drawn as a fraction f of the deflection
of sliding, F_c/sigma_0, which it must not reach: the spread applies to f/(1 - f)."""

TINY_DEFLECTION = 1e-6
"""Factor on the slip deflection while the other keys are drawn, so that it excludes none of their values."""

TOGETHER, TOGETHER_BY = tuple((f"{table}.static", f"{table}.coulomb") for table in FRICTIONS), 0.8
"""Pairs of keys that both follow the preload, and their correlation if neither is uncertain in the file (friso's
choice)."""

HELD = (
    *(f"{CONTROLLER}.", "motion.", "drive.sample_time", "drive.velocity_sample_time", "drive.position_sample_time"),
    *("drive.delay", "drive.velocity_samples"),
)
"""Prefixes of keys that an engineer sets.

These keys are equal on all machines, even if the file calls them uncertain.
"""

FROM_LEAVES = ("joint.stiffness", "parasitic.")
"""Prefixes of keys that follow from leaf springs, if the stage has any."""


@dataclass(frozen=True)
class Machines:
    """Random machines drawn around a stage.

    `keys` that differ between machines are SI arrays of shape (count,). They come from a `sample` of the keys
    `from_file`, which the file calls uncertain, and of keys with default `spreads` [%].
    """

    keys: Mapping[str, np.ndarray]
    sample: Sample
    from_file: tuple[str, ...]
    spreads: Mapping[str, float]


def draw_machines(stage: Stage, correlations: Correlations, count: int, seed: int) -> Machines:
    """Draw `count` machines from a stage's uncertain keys, and from default spreads of others.

    Raises InputError for an invalid seed, and for ranges of which hardly any machine is valid.
    """
    if not 0 <= seed <= MOST_SEED:
        raise InputError("--seed", str(seed), f"a whole number from 0 to {MOST_SEED}", "--seed 1")
    flat, spreads = stage.flat(), _spreads(stage)
    sample = draw(_spread(stage, spreads), _with_default_correlations(correlations, spreads), count, seed)
    keys = {key: values for key, values in sample.keys.items() if not key.startswith(HELD)}
    if keys.keys() & {INERTIA, LEAD, RATIO}:
        keys[MOTOR_MASS] = np.asarray(motor_mass({**flat, **keys}))
    keys |= {slip: _slipping(flat, keys, slip) for slip in SLIPS if slip in spreads}
    return Machines(keys, sample, tuple(key for key in stage.uncertain() if key in keys), spreads)


def _spreads(stage: Stage) -> dict[str, float]:
    """Return the default spreads [%] of a stage's keys that are not 0 and not uncertain."""
    flat, uncertain = stage.flat(), stage.uncertain()
    follow = FROM_LEAVES if stage.flexure else ()
    single = {key: spread for key, spread in SPREADS.items() if key not in uncertain and not key.startswith(follow)}
    several = {
        key: spread
        for array, spread in ELEMENTS.items()
        for key in element_keys(flat, array)
        if not uncertain.keys() & {*element_keys(flat, array)}
    }
    if INERTIA in flat:  # the motor's mass follows from it
        single.pop(MOTOR_MASS, None)
    return {key: spread for key, spread in (single | several).items() if flat.get(key)}


def _slipping(flat: Mapping[str, Any], keys: Mapping[str, np.ndarray], slip: str) -> np.ndarray:
    """Return the deflections [m] at which the bristles of drawn machines begin to slip, the key `slip`.

    `flat` has the keys of the file's stage, and `keys` the drawn ones, arrays (count,).
    """
    table = slip.partition(".")[0]

    def most(values: Mapping[str, Any]) -> Any:
        weaker = 1 - np.abs(values.get(f"{table}.asymmetry", 0.0))
        return values[f"{table}.coulomb"] * weaker / values[f"{table}.bristle_stiffness"]

    share = flat[slip] / most(flat)
    odds = share / (1 - share) * keys[slip] / (TINY_DEFLECTION * flat[slip])
    return np.asarray(most({**flat, **keys}) * odds / (1 + odds))


def _spread(stage: Stage, spreads: Mapping[str, float]) -> Stage:
    """Return the stage with the `spreads` [%] written into its keys, as uncertainties."""
    flat = stage.flat()
    for slip in spreads.keys() & {*SLIPS}:
        flat[slip] *= TINY_DEFLECTION
    fields_of_keys = numeric_keys(flat)
    return stage.replace(
        {key: f"{flat[key]!r} {fields_of_keys[key].unit} +/- {part} %" for key, part in spreads.items()}
    )


def _with_default_correlations(correlations: Correlations, spreads: Mapping[str, float]) -> Correlations:
    """Return the user's correlations, joined by default ones for keys with default `spreads`.

    Static and Coulomb friction are correlated, and the elements of an array vary together.
    """
    arrays = [tuple(key for key in spreads if key.startswith(f"{array}.")) for array in ELEMENTS]
    levels = [pair for pair in TOGETHER if all(key in spreads for key in pair)]
    groups = [*((pair, TOGETHER_BY) for pair in levels), *((array, 1.0) for array in arrays if array)]
    if not groups:
        return correlations
    blocks = [np.where(np.eye(len(keys), dtype=bool), 1.0, by) for keys, by in groups]
    matrices = [correlations.matrix] if correlations.keys else []
    names = tuple(key for keys, _ in groups for key in keys)
    return Correlations((*correlations.keys, *names), np.asarray(block_diag(*matrices, *blocks)))
