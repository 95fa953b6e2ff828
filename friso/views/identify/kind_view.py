"""What a kind of experiment declares of how it is shown, the registry of these, and what their figures share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from friso.identify.kind import Source
from friso.identify.logs.log import Log
from friso.registry import Registry
from friso.views.drawing.figure import BLUE, ORANGE, Axis, Figure

Facts = tuple[tuple[str, str], ...]
"""Numbers in words, by name."""

Result = TypeVar("Result")

AREA = "#cfdfee"
WAYS: Mapping[str, str] = MappingProxyType({"forward": BLUE, "backward": ORANGE})
TIME = Axis("Time", "s")


@dataclass(frozen=True)
class PredictionView(Generic[Result]):
    """How another log that a kind of experiment predicts is shown: the `worst` of its relative errors, a sentence of
    them, its numbers as in the JSON document, and its figures, of which the number is that of the log."""

    worst: Callable[[Result], float]
    sentence: Callable[[Result], str]
    numbers: Callable[[Result], dict[str, Any]]
    figures: Callable[[Log, Result, int], list[Figure]] = lambda log, result, number: []


@dataclass(frozen=True)
class KindView(Generic[Result]):
    """How results of a kind of experiment are shown.

    Its `title`; `facts` and `sentences` for terminal and page, with `warnings`; `numbers` for the JSON document, SI,
    the unit in the key's suffix or beside; `figures`, whose names begin with the text given. `headline` is a sentence
    for the head of the page beside the estimates of keys, "" for none. `longest`: of a log with gaps, the longest
    stretch without any is all that is used.
    """

    title: str
    facts: Callable[[Result], Facts]
    numbers: Callable[[Result], dict[str, Any]]
    figures: Callable[[Result, Sequence[Source], str], list[Figure]] = lambda result, logs, name: []
    sentences: Callable[[Result], tuple[str, ...]] = lambda result: ()
    warnings: Callable[[Any], tuple[str, ...]] = lambda result: result.warnings
    headline: Callable[[Result], str] = lambda result: ""
    longest: bool = False
    prediction: PredictionView[Any] | None = None


VIEWS: Registry[KindView[Any]] = Registry("friso.views.identify.kinds", "VIEW")
"""Every module of `friso/views/identify/kinds/` declares one, under the name of its kind of experiment."""
