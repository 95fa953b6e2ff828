"""Declare how outcomes of the rig's experiments are shown, and register these views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from friso.errors import InputError
from friso.platform.installed import leave_out
from friso.questions.identify.kind_view import log_figure
from friso.registry import Registry
from friso.shown.drawing.figure import Figure
from friso.shown.drawing.prefixes import with_unit
from friso.studies.rig.outcome import Outcome


@dataclass(frozen=True)
class OutcomeView:
    """How to show the outcome of one of the rig's experiments.

    Each field is a function of the outcome: sentences, figures arranged as in the thesis, and numbers of the JSON
    document.
    """

    sentences: Callable[[Outcome], list[str]]
    figures: Callable[[Outcome], list[Figure]]
    numbers: Callable[[Outcome], dict[str, Any]]


OUTCOME_VIEWS = Registry[OutcomeView]("friso.questions.rig.experiments", "VIEW", "friso.rig_views", OutcomeView)
"""Views by experiment.

Every module of `friso/questions/rig/experiments/` declares one, and so does every module of an installed package."""


def view_of(experiment: str) -> OutcomeView:
    """Return how to show an experiment's outcome; without a declaration, by its logs alone.

    A declaration that cannot be used, such as that of another package, is reported and left out. An error would lose
    the experiment, which has already been run.
    """
    try:
        if experiment in OUTCOME_VIEWS:
            return OUTCOME_VIEWS[experiment]
    except InputError as error:
        leave_out(error)
    return OutcomeView(_lengths, _records, lambda _: {})


def _lengths(outcome: Outcome) -> list[str]:
    """Name the logs of an experiment with their durations."""
    logs = [f"{log.name}, {with_unit(len(log.log.time) * log.interval, 's')}" for log in outcome.logs]
    return [f"Logs of {outcome.experiment}: {'; '.join(logs)}."]


def _records(outcome: Outcome) -> list[Figure]:
    """Draw the signals of each log over time, one figure per log."""
    return [log_figure(log.log, [*log.logged], f"rig_{log.name}") for log in outcome.logs]
