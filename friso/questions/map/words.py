"""What the axes, variables and cells of a map are called, and how many cells have which word."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import axis_shown
from friso.shown.drawing.figure import GREY, INK, ORANGE, PINK, VERMILLION, Category
from friso.stage.controllers import CONTROLLER, CONTROLLERS, FORCE_LIMIT
from friso.stage.tables import friction_laws
from friso.studies.cells import NOTHING, SKETCH, SWING, UNKNOWN, VERDICTS
from friso.studies.scalings import SCALINGS

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 1_000_000
"""Texts that are counted at a time."""

_QUANTITIES = {
    FORCE_LIMIT: "Force limit",
    "joint.limiter_damping": "Limiter damping",
    "joint.limiter_stiffness": "Limiter stiffness",
    "joint.locked": "Joint",
    "masses.cart": "Cart mass",
    "masses.stage": "Stage mass",
}
_VARIABLES = {
    "outcome": "What the run does at its end",
    "verdict": "Verdict on the stage",
    SKETCH: "Verdict on the stage, sketched",
    "peaks": "Counted peaks",
    "distinct_peaks": "Counted peaks, distinct ones",
    "status": "Status",
    "peak_to_peak": "Peak to peak, last quarter",
    "period": "Period",
    "settling_time": "Settling time into 1 µm",
    "settling_time_10um": "Settling time into 10 µm",
    "largest_force": "Largest actuator force",
    "attractor": "What attracts the stage",
    "multiplier": "Multiplier of the cycle that attracts",
    "amplitude": "Amplitude of what attracts",
    "cycle_period": "Period of what attracts",
    "steps": "Solver steps",
    "rejected": "Rejected solver steps",
}

QUIET = "#d3e6f3"  # rest: a pale blue, far from every colour of swings and from white and grey
INVALID = Category("invalid", "#b4b4b4")
FAILED = Category("failed", INK)
NOT_RUN = Category("not run", "#ffffff")
_NO_RESULT = {"failed": FAILED, "invalid": INVALID, "": NOT_RUN}
_VERDICTS = {
    "hunts": Category("hunts", VERMILLION),
    "bistable": Category("bistable", PINK),
    "transient": Category("transient", ORANGE),
    "settles": Category("settles", QUIET),
    **_NO_RESULT,
}
CATEGORIES = {
    "outcome": {
        "swings": Category("swings", VERMILLION),
        "creeps": Category("creeps", ORANGE),
        "rests": Category("rests", QUIET),
        **_NO_RESULT,
    },
    **dict.fromkeys(VERDICTS, _VERDICTS),
}
"""By variable the words that a cell can have, the worst first, in the colours of every map."""
# Cells without numbers of their own: paler than the word they are said to have, so that both can stand in a map.
INFERRED = {
    "swings": Category("swings (inferred)", "#f3c39e"),
    "creeps": Category("creeps (inferred)", "#f7dfa8"),
    "rests": Category("rests (inferred)", "#e4efe0"),
}
_NO_NUMBER = "#e8dcc6"
_OF_ATTRACTORS = {
    NOTHING: Category("nothing attracts", QUIET),
    UNKNOWN: Category("not certain what attracts", "#8c6d8f"),
    SWING: Category("attracts, but not closed as an orbit", PINK),
}
"""Why a cell has no measure of what attracts its stage, by the word for that."""


def quantity(key: Hashable) -> str:
    """An axis in words: "joint.stroke" is "Joint stroke", a free name is itself."""
    name = str(key)
    of_laws = {f"friction.{key}": word for law in friction_laws().values() for key, word in law.words.items()}
    scalings = {name: scaling.words for name, scaling in SCALINGS.items()}
    quantities = _QUANTITIES | of_laws | CONTROLLERS.words | scalings
    if name in quantities:
        return quantities[name]
    for table in (f"{CONTROLLER}.", "friction.", "motion."):
        name = name.removeprefix(table)
    words = name.replace("_", " ").replace(".", " ")
    return words[:1].upper() + words[1:]


def in_sentence(key: Hashable) -> str:
    """An axis within a sentence: "joint stroke"; names of people keep their capital."""
    name = quantity(key)
    return name if name.startswith(("Coulomb", "Stribeck")) else name[0].lower() + name[1:]


def variable(name: Hashable) -> str:
    """A variable in words: "period" is "Period"."""
    return axis_shown().text(_VARIABLES.get(str(name)) or quantity(name))


def word_category(name: str, word: str) -> Category:
    """Label and colour of a word of the variable `name`; one that is not known here is grey, under its own name."""
    return CATEGORIES[name].get(word) or Category(word, GREY)


def no_number(name: str, attractor: str | None = None) -> Category:
    """What it means that a run that was completed has no such number; `attractor`: the word for what attracts."""
    if name.startswith("settling_time"):
        band = variable(name).removeprefix("Settling time into ")
        return Category(f"does not stay within {band}", _NO_NUMBER)
    if attractor in _OF_ATTRACTORS:
        return _OF_ATTRACTORS[attractor]
    return Category("no period" if name == "period" else "no value", _NO_NUMBER)


def grouped(number: int) -> str:
    """A count in groups of three digits: 1 000 000."""
    return f"{number:,}".replace(",", " ")


def in_order(categories: Iterable[Category]) -> tuple[Category, ...]:
    """Each category once, in the order of every legend: words, the worst first, then what has none."""
    words = {category: None for categories in CATEGORIES.values() for category in categories.values()}
    order = [
        *(category for category in words if category not in _NO_RESULT.values()),
        *_NO_RESULT.values(),
        *INFERRED.values(),
    ]
    return tuple(
        sorted(
            dict.fromkeys(categories), key=lambda category: order.index(category) if category in order else len(order)
        )
    )


def unit_of(array: xr.DataArray) -> str:
    """SI unit of a variable or coordinate; none for counts and words."""
    unit = str(array.attrs.get("units", ""))
    return "" if unit == "1" else unit


def words_of(runs: xr.Dataset, name: str) -> tuple[np.ndarray, list[str]]:
    """The texts of a variable: their numbers, of its shape, and each text once (by its first place)."""
    import pandas as pd

    values = runs[name].values
    codes, words = pd.factorize(values.astype(object).ravel())
    return codes.reshape(values.shape), [str(word) for word in words]


def text_counts(runs: xr.Dataset, name: str) -> dict[str, int]:
    """How many cells have each text of a variable, the most frequent first; none where there is no such variable."""
    if name not in runs:
        return {}
    cells: Counter[str] = Counter()
    along, shape = str(runs[name].dims[0]), runs[name].shape
    rows = max(1, AT_ONCE // max(1, int(np.prod(shape[1:]))))
    for first in range(0, shape[0], rows):  # a large store is never read whole
        codes, words = words_of(runs.isel({along: slice(first, first + rows)}), name)
        cells.update(dict(zip(words, np.bincount(codes.ravel(), minlength=len(words)).tolist(), strict=True)))
    return dict(cells.most_common())


def failures(runs: xr.Dataset) -> dict[str, int]:
    """How many cells have no result, by the reason in their status."""
    return {
        reason: number
        for reason, number in text_counts(runs, "status").items()
        if reason != "done" and not reason.startswith("inferred")
    }


def word_counts(runs: xr.Dataset, name: str) -> dict[str, int]:
    """How many cells have each word of the variable `name`, in the order of the legend; none without that variable."""
    cells = {word_category(name, word): number for word, number in text_counts(runs, name).items()}
    return {category.label: cells[category] for category in in_order(cells)}


def tally(runs: xr.Dataset, name: str) -> str:
    """How many cells have each word, in a sentence: "1 swings, 3 creep"; empty without the variable `name`."""
    return ", ".join(f"{grouped(number)} {_verb(word, number)}" for word, number in word_counts(runs, name).items())


def _verb(word: str, number: int) -> str:
    """A word of a map as it agrees with a number of cells."""
    first, *rest = word.split(" ")
    return " ".join([first if number == 1 or first not in _VERBS else first.removesuffix("s"), *rest])


_VERBS = ("swings", "creeps", "rests", "hunts", "settles")
