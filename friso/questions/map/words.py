"""Name the axes, variables and cells of a map, and count the cells with each word."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Hashable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import axis_shown
from friso.shown.drawing.figure import GREY, INK, MAUVE, ORANGE, PINK, QUIET, VERMILLION, Category
from friso.shown.text import key_in_words
from friso.studies.axes import SCALINGS
from friso.studies.metric import metrics, worded

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 1_000_000
"""Number of texts counted in one batch."""

INVALID = Category("invalid", "#b4b4b4")
FAILED = Category("failed", INK)
NOT_RUN = Category("not run", "#ffffff")
_NO_RESULT = {"failed": FAILED, "invalid": INVALID, "": NOT_RUN}
_NO_NUMBER = "#e8dcc6"
PALETTE = {"vermillion": VERMILLION, "orange": ORANGE, "pink": PINK, "mauve": MAUVE, "quiet": QUIET}
"""Colours by the words that metrics use; metrics may also give "#rrggbb"."""


def quantity(key: Hashable) -> str:
    """Return a key or a scaling in words: "joint.stroke" is "Joint stroke"; a free name stays as it is."""
    name = str(key)
    return SCALINGS[name].words if name in SCALINGS else key_in_words(name)


STATIC, COULOMB = "friction.static", "friction.coulomb"


def friction_held(key: str, varied: Collection[Hashable]) -> str:
    """Say in brackets which friction stays as it is when one key of friction varies; empty for other keys."""
    held = {STATIC: (COULOMB, "Coulomb"), COULOMB: (STATIC, "static")}
    other, name = held.get(key, ("", ""))
    return f" ({name} friction {'varies, too' if other in varied else 'held'})" if other else ""


def in_sentence(key: Hashable) -> str:
    """Return a key in words for within a sentence: "joint stroke"; proper names keep capitals."""
    name = quantity(key)
    return name if name.startswith(("Coulomb", "Stribeck")) else name[0].lower() + name[1:]


def variable(name: Hashable) -> str:
    """Return a variable in words: "period" is "Period"."""
    metric = metrics().get(str(name))
    return axis_shown().text(metric.title if metric else quantity(name))


def categories_of(name: str) -> dict[str, Category]:
    """Return label and colour of each word of a metric, the worst first."""
    words = (metrics()[name] if name in metrics() else metrics()["outcome"]).words
    labels = {word.text: axis_shown().text(word.label or word.text) for word in words}
    return {word.text: Category(labels[word.text], PALETTE.get(word.colour, word.colour)) for word in words}


def word_category(name: str, word: str) -> Category:
    """Return label and colour of a word of a metric.

    A word that the metric does not declare is grey.
    """
    return (categories_of(name) | _NO_RESULT).get(word) or Category(word, GREY)


def no_number(name: str, reason: str | None = None) -> Category:
    """Return the category of a cell that was run but has no number for the metric `name`.

    `reason` is the cell's word of another metric (`Metric.reasons`), which says why.
    """
    metric = metrics().get(name)
    reasons = categories_of(metric.reasons) if metric and metric.reasons else {}
    return reasons.get(reason or "") or Category(
        axis_shown().text(metric.missing) if metric else "no value", _NO_NUMBER
    )


def grouped(number: int) -> str:
    """Write a count in groups of three digits: 1 000 000."""
    return f"{number:,}".replace(",", " ")


def in_order(categories: Iterable[Category]) -> tuple[Category, ...]:
    """Return each category once, in the order of every legend.

    Words come first, the worst at the beginning, then cells without a word.
    """
    words = [category for name in worded() for category in categories_of(name).values()]
    order = [*words, *_NO_RESULT.values()]
    places = {category: place for place, category in reversed([*enumerate(order)])}
    return tuple(sorted(dict.fromkeys(categories), key=lambda category: places.get(category, len(order))))


def unit_of(array: xr.DataArray) -> str:
    """Return the SI unit of a variable or coordinate; empty for counts and words."""
    unit = str(array.attrs.get("units", ""))
    return "" if unit == "1" else unit


def words_of(runs: xr.Dataset, name: str) -> tuple[np.ndarray, list[str]]:
    """Return a variable of texts as indices, and the texts to which these refer.

    The indices have the shape of the variable. Texts come in the order in which they occur.
    """
    import pandas as pd

    values = runs[name].values
    codes, words = pd.factorize(values.astype(object).ravel())
    return codes.reshape(values.shape), [str(word) for word in words]


def text_counts(runs: xr.Dataset, name: str) -> dict[str, int]:
    """Count the cells with each text of a variable, the most frequent first.

    A missing variable gives no counts.
    """
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
    """Count the cells without a result by the reason in their status."""
    return {reason: number for reason, number in text_counts(runs, "status").items() if reason != "done"}


def word_counts(runs: xr.Dataset, name: str) -> dict[str, int]:
    """Count the cells with each word of a metric, in the order of the legend.

    A missing metric gives no counts.
    """
    cells = {word_category(name, word): number for word, number in text_counts(runs, name).items()}
    return {category.label: cells[category] for category in in_order(cells)}


def tally(runs: xr.Dataset, name: str) -> str:
    """Count the cells with each word of a metric in a sentence: "1 swings, 3 creep".

    The sentence is empty without the metric.
    """
    return ", ".join(f"{grouped(number)} {_verb(word, number)}" for word, number in word_counts(runs, name).items())


def tallied() -> list[str]:
    """List the metrics whose words sentences and tables count."""
    return [name for name in worded() if metrics()[name].tallied]


def _verb(word: str, number: int) -> str:
    """Return a word of a map as it agrees with a number of cells: "3 creep", "3 bistable"."""
    first, *rest = word.split(" ")
    return " ".join([first if number == 1 or first.endswith("ss") else first.removesuffix("s"), *rest])
