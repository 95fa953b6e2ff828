"""Offer what stops the hunting of a machine as keys to set, for buttons of the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.equations.bandwidth import bandwidth, sped_up
from friso.hunting import Case
from friso.hunting.criteria import ATTRACTED
from friso.questions.check.words import freeing_helps
from friso.shown.motion_words import shown_cases
from friso.shown.text import rounded_down, rounded_up, with_unit
from friso.stage import Stage

FREE = {"label": "Free the joint", "values": {"joint.locked": False}}


def cures_of(cases: Mapping[str, Case], name: str) -> list[dict[str, Any]]:
    """Return what stops the hunting of a case, by its name: a label, and values by key (SI numbers).

    It is what the conclusion of `friso check` advises. The list is empty for a case that does not hunt.
    """
    case = cases[name]
    if case.verdict not in ATTRACTED:
        return []
    (item,) = [item for item in shown_cases(cases) if item.key in (name, _twin(case.stage))]
    flat, cures = case.stage.flat(), []
    for advice, verb, away in ((case.faster, "Raise", rounded_up), (case.slower, "Lower", rounded_down)):
        if advice is None:
            continue
        own = bandwidth(flat)
        factor = away(advice.factor * own) / own if own else away(advice.factor)
        label = (
            f"{verb} to {with_unit(factor * own, 'Hz')}" if own else f"{verb} the speed of the controller × {factor:g}"
        )
        cures.append({"label": label, "values": sped_up(flat, factor)})
    return [*cures, *([FREE] if freeing_helps(item, cases) else [])]


def _twin(stage: Stage) -> str:
    return "" if stage.joint is None else "locked" if stage.joint.locked else "free"
