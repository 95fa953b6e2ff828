"""What an experiment of the rig declares of how its outcome is shown, and the registry of these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from friso.registry import Registry
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import Figure


@dataclass(frozen=True)
class OutcomeView:
    """How an outcome is shown: sentences for the engineer who has to decide with it, figures in the arrangement of the
    thesis, numbers for the JSON document."""

    sentences: Callable[[Outcome], list[str]]
    figures: Callable[[Outcome], list[Figure]]
    numbers: Callable[[Outcome], dict[str, Any]]


OUTCOME_VIEWS: Registry[OutcomeView] = Registry("friso.views.rig.experiments", "VIEW")
"""Every module of `friso/views/rig/experiments/` declares one, under the name of its experiment."""
