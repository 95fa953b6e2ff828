"""Compute how static and Coulomb friction of the bearing vary along its rail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import ndtri

from friso.errors import InputError

PHASES, FIELD = int.from_bytes(b"phases"), int.from_bytes(b"field")
"""Second halves of the Philox key, one for the random phases and one for the random field of a seed."""

HARMONICS = ("first", "second", "third")

CELLS_PER_LENGTH, KERNEL_REACH = 2, 5
"""Cells of white noise per correlation length, and length of the smoothing kernel to each side in correlation lengths.
They make the sum over cells differ from the integral by a fraction 2 exp(-(pi CELLS_PER_LENGTH)^2 / 2) = 5e-9
(Poisson's summation) and by exp(-KERNEL_REACH^2)."""

MOST_CELLS = 10**7
"""Largest number of cells of a rail, for which arrays of some 100 MB are needed."""

WORDS_PER_COUNT = 4
"""Number of words that Philox gives per count."""


def friction_factors(flat: Mapping[str, Any], places: np.ndarray, seed: int | None = None) -> np.ndarray:
    """Return factors of static and Coulomb friction at places [m] on a rail, shape (2, n).

    `places` has the shape (n,). The factors are (1 + offset) (1 + sum of A_n cos(2 pi n x / pitch + phase_n)) exp(s g
    - s^2 / 2), with s^2 = log(1 + deviation^2): lognormal with mean 1 and the standard deviation given, hence
    positive. One Gaussian field g serves both, since both follow the same preload. Flat keys "rail.*" describe the
    rail; without them all factors are 1. `seed` replaces that of the rail. The factors at a place do not depend on the
    other places. Raises InputError for a correlation length that is tiny against the range of places.
    """
    rail = {key.removeprefix("rail."): value for key, value in flat.items() if key.startswith("rail.")}
    if not rail:
        return np.ones((2, len(places)))
    number = int(rail["seed"] if seed is None else seed)
    deviations = np.array([[rail["static_deviation"]], [rail["coulomb_deviation"]]])
    common = (1 + rail["offset"]) * _rolling(rail, places, number)
    if not deviations.any():
        return np.broadcast_to(common, (2, len(places))).copy()
    widths = np.sqrt(np.log1p(deviations**2))
    return common * np.exp(widths * gaussian_field(places, rail["correlation_length"], number) - widths**2 / 2)


def gaussian_field(places: np.ndarray, length: float, seed: int) -> np.ndarray:
    """Return a Gaussian field at places [m], shape (n,), with mean 0 and variance 1.

    Its correlation is exp(-(d / length)^2 / 2). It is white noise in cells counted from place 0, smoothed by exp(-(d /
    length)^2). A random Fourier series would need many more terms than the 21 cells here until it is Gaussian. Its few
    longest waves would also repeat along a rail. Raises InputError for a length that is tiny against the range of
    places.
    """
    at = places * (CELLS_PER_LENGTH / length)
    cell = np.rint(at)
    reach = CELLS_PER_LENGTH * KERNEL_REACH
    first = int(cell.min()) - reach
    noise = _white(first, int(cell.max()) + reach + 1 - first, seed, length)
    index, beside = (cell - first).astype(np.intp), (at - cell) / CELLS_PER_LENGTH
    # exp(-(u - k/C)^2) = exp(-u^2) q^k exp(-(k/C)^2) with q = exp(2 u/C): a polynomial of q, by Horner's rule
    q, field = np.exp(2 * beside / CELLS_PER_LENGTH), np.zeros(len(places))
    for k in range(reach, -reach - 1, -1):
        field *= q
        field += (noise * np.exp(-((k / CELLS_PER_LENGTH) ** 2)))[index + k]
    return field * q**-reach * np.exp(-(beside**2)) * (2 / np.pi) ** 0.25 / CELLS_PER_LENGTH**0.5


def _white(first: int, count: int, seed: int, length: float) -> np.ndarray:
    """Return standard normal numbers for `count` cells of the rail, from number `first` on.

    The numbers are independent, and each is a function of the cell's number and the seed alone. The shape is (count,).
    Raises InputError for too many cells; the message names a sufficient correlation `length` [m].
    """
    if count > MOST_CELLS:
        least = length * count / MOST_CELLS
        actual, expected = f"{length:.3g} m", f"at least {least:.3g} m for places that far apart"
        raise InputError("rail.correlation_length", actual, expected, 'correlation_length = "5 mm"')
    block, skipped = divmod(first, WORDS_PER_COUNT)
    words = np.random.Philox(key=[seed, FIELD], counter=block % 2**256).random_raw(skipped + count)[skipped:]
    return ndtri(((words >> np.uint64(11)) + 0.5) * 2.0**-53)


def _rolling(rail: Mapping[str, Any], places: np.ndarray, seed: int) -> np.ndarray | float:
    """Return the factor on friction at places [m] that is due to the rolling elements, (n,).

    `rail` has the keys of the rail; without a pitch of rolling elements, the result is the number 1.
    """
    if "rolling_pitch" not in rail:
        return 1.0
    phases = np.random.Generator(np.random.Philox(key=[seed, PHASES])).uniform(0, 2 * np.pi, len(HARMONICS))
    turn = 2 * np.pi / rail["rolling_pitch"] * places
    waves = [
        rail[f"{name}_harmonic"] * np.cos(order * turn + phase)
        for order, (name, phase) in enumerate(zip(HARMONICS, phases, strict=True), 1)
    ]
    return 1 + np.sum(waves, axis=0)
