"""Doubt: mass or friction differs between the halves of a record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, ValueCase
from friso.identification.inverse_model import InverseModel, least_squares
from friso.identification.settings import doubt_settings
from friso.identification.spread import spread_of
from friso.intervals import NORMAL_COVERAGE

WORDS = {"mass": "the mass", "viscous": "viscous friction", "coulomb": "Coulomb friction"}
"""Quantities of the inverse model, as named in sentences."""


@dataclass(frozen=True)
class Half:
    """Mass or friction in either half of a record, by least squares, and a range over both.

    `first` and `second` are the values; the range from `low` to `high` holds both intervals.
    """

    name: str
    first: float
    second: float
    low: float
    high: float


def find(case: ValueCase) -> Iterator[RaisedDoubt]:
    """Compare mass and friction between the halves of a record, each by least squares.

    Nothing is compared if the whole model explains the record nearly to its noise.
    """
    for one in halves(case.inverse) if case.lacks else ():
        unit = case.inverse.estimate(one.name).unit
        values = f"{one.first:.4g} and {one.second:.4g} {unit}"
        words = f"The halves of the record differ in {WORDS[one.name]}: {values}; its interval holds both"
        reaches = {one.name: (one.low, one.high)}
        yield RaisedDoubt(
            words="" if case.poor else words, size=abs(one.first - one.second), unit=unit, reaches=reaches
        )


def halves(inverse: InverseModel) -> list[Half]:
    """List the mass and frictions of an inverse model that differ between the record's halves.

    They differ by more than chance, given the deviations of both. Friction is not compared between halves that move at
    very different speeds, which show different parts of its curve, nor mass at very different accelerations.
    """
    fits = []
    parts = np.array_split(np.arange(len(inverse.measured)), 2)
    sizes = np.array([np.linalg.norm(inverse.columns[part, :2], axis=0) / np.sqrt(len(part)) for part in parts])
    unlike = (sizes.max(axis=0) > doubt_settings.ratio_of_comparable_halves * sizes.min(axis=0))[[0, 1, 1]]
    for part in parts:
        columns, force = inverse.columns[part], inverse.measured[part]
        solution, left = least_squares(columns, force)
        fits.append((solution, np.sqrt(np.diag(spread_of(columns, left)))))
    values, off = (np.array(rows) for rows in zip(*fits, strict=True))
    apart = np.abs(values[0] - values[1]) > doubt_settings.deviations_of_differing_halves * np.hypot(*off)
    low, high = (values - NORMAL_COVERAGE * off).min(axis=0), (values + NORMAL_COVERAGE * off).max(axis=0)
    return [
        Half(name, *(float(number) for number in (*values[:, i], low[i], high[i])))
        for i, name in enumerate(WORDS)
        if apart[i] and not unlike[i] and np.isfinite(off[:, i]).all()
    ]


DOUBT = Doubt(
    "value",
    find,
    "mass and friction of either half of the record",
    "intervals hold both",
    "the same moves again, after the machine has warmed up",
    after=("little-friction",),
)
