"""Say that a loop is unstable, which matters more than anything that friction does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friso.shown.drawing.prefixes import listed

if TYPE_CHECKING:
    from friso.hunting import LoopState
    from friso.stage import Stage

UNSTABLE_AS_BUILT = "it leaves out the samples and delays of the drive, with which the loop is unstable"
"""Reason given for an uncertain verdict on a loop that only the drive makes unstable."""


def lost_as_built(stage: Stage) -> tuple[LoopState, ...]:
    """Return the states in which samples and delays of the drive make the loop of a stage unstable."""
    if not any(key.startswith("drive.") for key in stage.flat()):
        return ()
    from friso.frequency.bode import unstable_as_built  # 0.3 s to import

    states: tuple[LoopState, LoopState] = ("sticks", "slides")
    return tuple(state for state, lost in zip(states, unstable_as_built(stage.flat()), strict=True) if lost)


def without_drive(stage: Stage) -> str:
    """Write as a condition that an answer leaves out the drive, which makes the loop unstable; "" if it does not."""
    lost = lost_as_built(stage)
    return "Without the samples and delays of its drive, with which the loop is unstable: " if lost else ""


def unstable_loop(states: tuple[LoopState, ...]) -> list[str]:
    """Say in which states the loop of the stage as given is unstable; [] for a stable loop."""
    return [f"The loop of the stage as its file gives it is {unstable_where(states)}."] if states else []


def unstable_where(states: tuple[LoopState, ...]) -> str:
    """Say in which states a loop is unstable, and what to do about it."""
    where = listed([f"while the stage {state}" for state in states], "and")
    return f"unstable {where}, whatever the friction: retune the controller (friso bode)"


def after_loop(does: str, unstable: tuple[LoopState, ...], as_built: tuple[LoopState, ...]) -> str:
    """Say in the fewest words that a loop is unstable, itself or with its drive, and what the stage `does` then.

    A state is named if the loop is stable in the other one.
    """
    states, drive, then = (unstable, "", "; ") if unstable else (as_built, " with its delay", "; without: ")
    if not states:
        return does
    where = "" if len(states) > 1 else f" while it {next(iter(states))}"
    return f"unstable{drive}{where}{then if does else ''}{does}"
