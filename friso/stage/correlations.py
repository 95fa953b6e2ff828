"""Read and write correlations of a stage's uncertain keys, and sample stages from them.

`identified.correlations.toml` stands beside `identified.toml` and holds `keys` and their correlation `matrix`: that of
the normal distributions behind the keys (a normal copula, Nelsen 2006, An Introduction to Copulas, Sec. 2.8). For two
keys "VALUE +/- HALF-WIDTH" it is their own correlation. Keys that it does not name are independent.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from friso.errors import InputError, StageError
from friso.intervals import NORMAL_COVERAGE
from friso.quantities import LARGEST_INTEGER, as_toml, percent, quoted
from friso.stage.contacts import guessed_ratios
from friso.stage.controllers import as_tuned
from friso.stage.section import unknown_key
from friso.stage.stage import Stage, violations
from friso.stage.tables_of_files import parsed, text_of

_EXPECTED = "a file with keys and the matrix of their correlations"
_EXAMPLE = 'keys = ["friction.coulomb", "friction.viscous"] and matrix = [[1.0, -0.8], [-0.8, 1.0]]'

MATRIX_ROUNDING = 1e-9
"""Tolerance for rounded numbers of a matrix: it bounds asymmetry, deviation of the diagonal from 1, and negative
eigenvalues."""

MOST_SAMPLES = 100
"""Largest number of samples tried per stage before the ranges count as hardly ever allowed."""


@dataclass(frozen=True)
class Correlations:
    """Keys of a stage file and their correlation matrix, shape (keys, keys).

    An empty object stands for independent keys. Raises StageError if the matrix is no correlation matrix of the keys,
    or if a key is there twice.
    """

    keys: tuple[str, ...] = ()
    matrix: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        twice = [key for key, times in Counter(self.keys).items() if times > 1]
        if twice:
            raise StageError("keys", f"{twice[0]} twice", "each key once", _EXAMPLE)
        if problem := _problem(self.matrix, len(self.keys)):
            raise StageError("matrix", problem, "a correlation matrix, one row and one column per key", _EXAMPLE)

    def among(self, keys: Collection[str]) -> Correlations:
        """Select the correlations among some of the keys."""
        places = [k for k, key in enumerate(self.keys) if key in keys]
        return Correlations(tuple(self.keys[k] for k in places), self.matrix[np.ix_(places, places)])

    def over(self, keys: list[str]) -> np.ndarray:
        """Return the correlation matrix of `keys`, shape (keys, keys), in their order.

        The keys must include those of this object; all others are independent.
        """
        matrix = np.eye(len(keys))
        places = [keys.index(key) for key in self.keys]
        matrix[np.ix_(places, places)] = self.matrix
        return matrix


def _problem(matrix: np.ndarray, size: int) -> str:
    """Return why a matrix is not a correlation matrix of `size` keys; "" if it is one."""
    if matrix.shape != (size, size):
        return f"{' x '.join(map(str, matrix.shape))} numbers for {size} keys"
    if not np.isfinite(matrix).all():
        return "a number that is not finite"
    if size and np.abs(np.diag(matrix) - 1).max() > MATRIX_ROUNDING:
        return "a diagonal that is not 1"
    if size and np.abs(matrix - matrix.T).max() > MATRIX_ROUNDING:
        return "not symmetric"
    if size and np.linalg.eigvalsh(matrix).min() < -MATRIX_ROUNDING * size:
        return "not positive semidefinite: no quantities can be correlated like this"
    return ""


def correlations_file(path: str | os.PathLike[str]) -> Path:
    """Return the path of a stage file's correlations: stage.correlations.toml for stage.toml."""
    return Path(path).with_suffix(".correlations.toml")


def read_correlations(path: str | os.PathLike[str], stage: Stage) -> Correlations:
    """Return the correlations of a file, which must be of uncertain keys of the stage.

    Raises InputError if they are of other keys, and for a file that has no correlation matrix.
    """
    try:
        correlations = _from(parsed(text_of(Path(path), _EXPECTED, _EXAMPLE), _EXPECTED, _EXAMPLE))
        _belongs(correlations, stage)
    except InputError as error:
        raise error.found_in(str(path)) from None
    return correlations


def correlations_text(correlations: Correlations, stage: Stage) -> str:
    """Return the text of a file of correlations of uncertain keys of the stage.

    Raises InputError if they are of other keys.
    """
    _belongs(correlations, stage)
    rows = [f"  [{', '.join(repr(float(value)) for value in row)}]," for row in correlations.matrix]
    names = [f"  {as_toml(key)}," for key in correlations.keys]
    return "\n".join(["keys = [", *names, "]", "matrix = [", *rows, "]", ""])


def _is_number(value: Any) -> bool:
    return type(value) is float or (type(value) is int and abs(value) < LARGEST_INTEGER)


def _from(document: dict[str, Any]) -> Correlations:
    for key in document:
        if key not in ("keys", "matrix"):
            raise unknown_key(key, ("keys", "matrix"), _EXAMPLE)
    keys, rows = document.get("keys"), document.get("matrix")
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise StageError("keys", quoted(keys), "a list of keys of the stage file", _EXAMPLE)
    if not isinstance(rows, list) or not all(isinstance(row, list) and all(map(_is_number, row)) for row in rows):
        raise StageError("matrix", quoted(rows), "a list of rows of numbers", _EXAMPLE)
    if len({len(row) for row in rows}) > 1:
        raise StageError("matrix", "rows of different lengths", "one row and one column per key", _EXAMPLE)
    return Correlations(tuple(keys), np.array(rows, dtype=float).reshape(len(rows), len(rows[0]) if rows else 0))


def _belongs(correlations: Correlations, stage: Stage) -> None:
    """Check that all correlated keys are uncertain keys of the stage.

    Raises InputError for an unknown key, and StageError for one that is not uncertain.
    """
    keys, uncertain = stage.numeric_keys(), stage.uncertain()
    for key in correlations.keys:
        if key not in keys:
            raise unknown_key(key, keys, _EXAMPLE)
        if key not in uncertain:
            text = f"{key}, which is not uncertain in the stage file"
            raise StageError(
                "keys", text, f"some of {', '.join(uncertain) or 'nothing: no key is uncertain'}", _EXAMPLE
            )


@dataclass(frozen=True)
class Sample:
    """Stages sampled at random: keys to their SI values, arrays of shape (count,).

    Invalid samples were replaced. `beyond` counts those in which a key exceeded its bound. `broken` counts those that
    broke a rule between keys, by the rule.
    """

    keys: Mapping[str, np.ndarray]
    count: int
    beyond: int
    broken: Mapping[str, int]

    @property
    def left_out(self) -> int:
        """Return the number of samples that were replaced."""
        return self.beyond + sum(self.broken.values())


def draw(stage: Stage, correlations: Correlations, count: int, seed: int) -> Sample:
    """Sample stages from a stage with uncertain keys; the same seed gives the same stages.

    `count` valid stages are returned. Keys are correlated as `correlations` say, and follow a scrambled Sobol sequence
    (Owen 1998). Raises StageError if no key is uncertain, or if hardly any sample is a valid stage.
    """
    from scipy.stats import qmc

    intervals = stage.uncertain()
    if not intervals:
        example = 'coulomb = "1 N +/- 0.1 N", or coulomb = "0.8 N .. 1.2 N"'
        raise StageError("", "a stage file without uncertain keys", "at least one uncertain key to draw from", example)
    sampler = qmc.Sobol(len(intervals), rng=seed)
    matrix, size = correlations.over([*intervals]), 1 << max(0, count - 1).bit_length()
    parts, accepted, beyond, broken = [], 0, 0, Counter[str]()
    for _ in range(MOST_SAMPLES):
        keys = _values(stage, matrix, sampler.random(size))
        within, why = allowed_draws(stage, keys, size)
        enough = np.flatnonzero(np.cumsum(within) == count - accepted)[:1]
        leading = slice(0, int(enough[0]) + 1 if enough.size else size)
        reasons = why[leading][~within[leading]]
        beyond += int(np.count_nonzero(reasons == ""))
        broken.update(reasons[reasons != ""].tolist())
        parts.append({key: values[leading][within[leading]] for key, values in keys.items()})
        accepted += int(within[leading].sum())
        if accepted == count:
            joined = {key: np.concatenate([part[key] for part in parts]) for key in intervals}
            return Sample(joined, count, beyond, broken)
    most = broken.most_common(1)
    text = f"ranges of which {percent(accepted / (MOST_SAMPLES * size))} are allowed"
    raise StageError("", text, most[0][0] if most else "ranges within the bounds of their keys")


def _values(stage: Stage, matrix: np.ndarray, shares: np.ndarray) -> dict[str, np.ndarray]:
    """Return values of the uncertain keys [SI], each of shape (count,), at given quantiles.

    `shares` are independent uniform numbers, shape (count, keys), which `matrix` correlates. Of two keys that grow
    together over machines, and that nobody knows, the second is drawn by its ratio to the first.
    """
    from scipy.special import ndtr, ndtri

    sizes, directions = np.linalg.eigh(matrix)
    root = directions * np.sqrt(np.maximum(sizes, 0.0))
    edge = 2.0**-31  # half the step of the sequence: a 0 would be infinitely far out
    normals = ndtri(np.clip(shares, edge, 1 - edge)) @ root.T
    flat, uncertain = stage.flat(), stage.uncertain()
    values, levels = {}, dict(zip(uncertain, ndtr(normals).T, strict=True))
    for (key, interval), column in zip(uncertain.items(), normals.T, strict=True):
        half = (interval.high - interval.low) / 2
        drawn = interval.form == "range"
        values[key] = interval.evenly(levels[key]) if drawn else flat[key] + half / NORMAL_COVERAGE * column
    for key, (lead, ratio) in guessed_ratios(stage).items():
        values[key] = values[lead] * ratio.evenly(levels[key])
        if key in BOUNDED_GUESSES:
            values[key] = np.clip(values[key], uncertain[key].low, uncertain[key].high)
    return values


BOUNDED_GUESSES = ("friction.bristle_damping",)
"""Keys drawn by a ratio whose own range is kept, as a log may have shown it."""


def allowed_draws(stage: Stage, keys: Mapping[str, np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples are valid stages, and which rule between keys the others break.

    Both have the shape (count,). The rule is "" for a valid stage, and where a key exceeds its bound. `keys` has the
    values [SI].
    """
    fields = stage.numeric_keys()
    within = np.all([fields[key].bound.holds(values) for key, values in keys.items()], axis=0)
    why = np.full(count, "", dtype=object)
    chosen = np.flatnonzero(within)
    for wrong, reason in violations(laid_over(stage, {key: values[chosen] for key, values in keys.items()})):
        which = chosen[np.broadcast_to(wrong, chosen.shape)]
        why[which[why[which] == ""]] = reason
    return within & (why == ""), why


def laid_over(stage: Stage, keys: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return the keys of sampled stages in SI: those of the stage, with sampled `keys` in place.

    The controller stays tuned for the original stage: it does not know the sampled mass.
    """
    flat = stage.flat()
    return stage.flat(as_tuned(flat) | dict(keys))
