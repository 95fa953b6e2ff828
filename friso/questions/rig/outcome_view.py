"""How outcomes of the rig's experiments are shown: what an experiment may declare of it, and the registry of these."""

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
    """How an outcome is shown: sentences for the engineer who has to decide with it, figures in the arrangement of the
    thesis, numbers for the JSON document."""

    sentences: Callable[[Outcome], list[str]]
    figures: Callable[[Outcome], list[Figure]]
    numbers: Callable[[Outcome], dict[str, Any]]


OUTCOME_VIEWS = Registry[OutcomeView]("friso.questions.rig.experiments", "VIEW", "friso.rig_views", OutcomeView)
"""Every module of `friso/questions/rig/experiments/` declares one, and every module that an installed package names,
under the name of its experiment."""


def view_of(experiment: str) -> OutcomeView:
    """How outcomes of an experiment are shown: as its view declares, or else by its logs.

    A view of another package that cannot be used is told and left out: the experiment has been run by then.
    """
    try:
        if experiment in OUTCOME_VIEWS:
            return OUTCOME_VIEWS[experiment]
    except InputError as error:
        leave_out(error)
    return OutcomeView(_lengths, _records, lambda _: {})


def _lengths(outcome: Outcome) -> list[str]:
    logs = [f"{log.name}, {with_unit(len(log.log.time) * log.interval, 's')}" for log in outcome.logs]
    return [f"Logs of {outcome.experiment}: {'; '.join(logs)}."]


def _records(outcome: Outcome) -> list[Figure]:
    return [log_figure(log.log, [*log.logged], f"rig_{log.name}") for log in outcome.logs]
