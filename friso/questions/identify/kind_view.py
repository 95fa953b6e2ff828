"""Declare how results of each kind of experiment are shown, and register these views.

The module also has parts that the views' figures share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from friso.identification.kind import Source
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.questions.identify.numbers import name_of, with_interval
from friso.registry import Registry
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE, INK, ORANGE

Facts = tuple[tuple[str, str], ...]
"""Values in words, with their names."""

Result = TypeVar("Result")

AREA = "#cfdfee"
WAYS: Mapping[str, str] = MappingProxyType({"forward": BLUE, "backward": ORANGE})
TIME = Axis("Time", "s")


@dataclass(frozen=True)
class PredictionView(Generic[Result]):
    """How to show another log that the model from a kind of experiment predicts.

    All fields are functions of the prediction. `worst` returns the largest relative error, and `sentence` describes the
    errors. `numbers` go into the JSON document. `figures` also takes the log and its number, for the figures' names.
    """

    worst: Callable[[Result], float]
    sentence: Callable[[Result], str]
    numbers: Callable[[Result], dict[str, Any]]
    figures: Callable[[Log, Result, int], list[Figure]] = lambda log, result, number: []


@dataclass(frozen=True)
class KindView(Generic[Result]):
    """How to show the results of one kind of experiment.

    Terminal and page show the `title`, `facts`, `sentences` and `warnings`. `numbers` go into the JSON document, in SI
    with the unit in the key or beside it. `figures` also takes a name, with which the names of the figures begin.
    `headline` is a sentence at the head of the page, beside the estimates of keys; it may be empty.

    `longest` is true if only the longest stretch of a log without gaps is analysed. `opening` is the last part of the
    name of the figure that opens the page, or empty. `prediction` says how to show other logs that the model predicts,
    if it can.
    """

    title: str
    facts: Callable[[Result], Facts]
    numbers: Callable[[Result], dict[str, Any]]
    figures: Callable[[Result, Sequence[Source], str], list[Figure]] = lambda result, logs, name: []
    sentences: Callable[[Result], tuple[str, ...]] = lambda result: ()
    warnings: Callable[[Any], tuple[str, ...]] = lambda result: result.warnings
    headline: Callable[[Result], str] = lambda result: ""
    longest: bool = False
    opening: str = ""
    prediction: PredictionView[Any] | None = None


VIEWS: Registry[KindView[Any]] = Registry("friso.questions.identify.kinds", "VIEW")
"""Views by kind of experiment: one from every module of `friso/questions/identify/kinds/`."""


def view_of(kind: str) -> KindView[Any]:
    """Return how to show the results of a kind of experiment.

    A kind that declares nothing is shown by its estimates and its logs.
    """
    return VIEWS[kind] if kind in VIEWS else _by_estimates(kind)


def _by_estimates(kind: str) -> KindView[Any]:
    """Return how to show a kind that declares nothing: by its estimates and its logs."""

    def facts(result: Any) -> Facts:
        """List the estimates with their intervals."""
        return tuple(
            (name_of(estimate.name), with_interval(estimate)) for estimate in KINDS[kind].estimates(result, None)
        )

    def figures(result: Any, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw, for each log, the signals that this kind of experiment needs."""
        records = [log for log in logs if isinstance(log, Log)]
        return [log_figure(log, KINDS[kind].needed(log.signals), f"{name}_{i}") for i, log in enumerate(records, 1)]

    def warnings(result: Any) -> tuple[str, ...]:
        """Return the warnings of a result, if its class has any."""
        return getattr(result, "warnings", ())

    return KindView(kind.replace("-", " ").capitalize(), facts, lambda result: {}, figures, warnings=warnings)


def log_figure(log: Log, roles: Sequence[str], name: str) -> Figure:
    """Draw some signals of a log, by role, over time."""
    panels = tuple(
        Panel(
            "", TIME, Axis(role.replace("_", " ").capitalize(), log.unit(role)), (Series(log.time, log[role], "", INK),)
        )
        for role in roles
    )
    return Figure(name, log.name, "As logged.", panels)
