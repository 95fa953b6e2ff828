"""Say whether a log contradicts the verdict on a stage, and which single change would explain it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.quantities import plain_factor
from friso.shown.text import listed, swing_with_unit, with_unit
from friso.stage import Stage
from friso.studies.contradiction import CHANGES, Contradiction, ExplainingChange, Standing
from friso.studies.settings import settings


def against_sentences(name: str, stage: Stage, result: Contradiction) -> list[str]:
    """Say what the log called `name` shows, whether the stage does so, and which change would explain a difference."""
    standing = result.standing
    machine = (
        f"hunts, {_swing(standing)}"
        if standing.hunts
        else f"rests for {with_unit(standing.time, 's')} while its reference stands"
    )
    does = f"hunts, {_swing(result)}" if result.attracts else "does not hunt"
    doubt = "" if result.certain else " (not certain: its values, or what attracts it, are not)"
    if not standing.hunts and not standing.rests:
        return [f"{name} does not tell: the machine neither rests nor swings evenly; the stage {does}{doubt}."]
    if result.open and result.attracts and result.may_rest:
        return [f"{name} does not tell: the machine {machine}; the stage may rest, too, and {does} after other moves."]
    if result.open:
        return [f"{name} does not tell: the machine {machine}, too briefly for that; the stage {does}{doubt}."]
    if result.agrees:
        return [f"{name} agrees with the stage: the machine {machine}; the stage {does}{doubt}."]
    says = f"{name} contradicts the stage: the machine {machine}; the stage {does}{doubt}."
    nearest = result.explanations[: settings.most_explanations]
    if not nearest:
        return [says, "No single change of friction, masses or the controller's speed explains that."]
    changes = listed([_change(stage, one) for one in nearest], "or")
    return [says, f"One change would explain that, the smallest first: {changes}."]


def _swing(result: Standing | Contradiction) -> str:
    """Write the size and period of the swing that a log shows, or of that in which a stage hunts."""
    size = swing_with_unit(result.swing or 0.0, result.middle, "m")
    return f"{size} every {with_unit(result.period or 0.0, 's')}"


def _change(stage: Stage, change: ExplainingChange) -> str:
    """Write a change by its factor, and by the value of its key if it has a single one."""
    times = f"{change.name} {plain_factor(change.factor)} times"
    keys, flat = CHANGES[change.name], stage.flat()
    if len(keys) != 1:
        return times
    return f"{times} ({with_unit(change.factor * flat[keys[0]], stage.numeric_keys()[keys[0]].unit)})"


def _numbers(result: Standing | Contradiction) -> dict[str, Any]:
    """Return size, middle and period of the swing that a log shows, or of that in which a stage hunts."""
    return {"swing_m": result.swing, "offset_m": result.middle, "period_s": result.period}


def against_document(name: str, result: Contradiction) -> dict[str, Any]:
    """Return what a log shows, what the stage does, and the changes that explain a difference."""
    changes: Sequence[dict[str, Any]] = [
        {"change": one.name, "factor": one.factor, "swing_m": one.swing, "period_s": one.period}
        for one in result.explanations
    ]
    standing = result.standing
    return {
        "log": name,
        "machine": {"hunts": standing.hunts, **_numbers(standing)},
        "stands_s": standing.time,
        "stage": {"hunts": result.attracts, "certain": result.certain, **_numbers(result)},
        "agrees": result.agrees,
        "explanations": changes,
    }
