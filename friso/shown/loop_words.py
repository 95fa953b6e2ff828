"""Say that a loop is unstable, which matters more than anything that friction does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friso.shown.drawing.prefixes import listed

if TYPE_CHECKING:
    from friso.hunting import LoopState


def unstable_loop(states: tuple[LoopState, ...]) -> list[str]:
    """Say in which states the loop of the stage as given is unstable; [] for a stable loop."""
    return [f"The loop of the stage as its file gives it is {unstable_where(states)}."] if states else []


def unstable_where(states: tuple[LoopState, ...]) -> str:
    """Say in which states a loop is unstable, and what to do about it."""
    where = listed([f"while the stage {state}" for state in states], "and")
    return f"unstable {where}, whatever the friction: retune the controller (friso bode)"
