"""Find what stops hunting: the least change of controller or joint that settles such machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np

from friso.errors import InputError
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import (
    LOGGER,
    Changes,
    ForceLike,
    FrequencyLike,
    LengthLike,
    LengthRange,
    RatioLike,
    Seed,
    StageLike,
    TimeLike,
)
from friso.platform.installed import install, missing
from friso.platform.system import shell_word
from friso.progress import Progress, silent
from friso.quantities import Bound, Quantity, positive, quoted
from friso.remedies import Changeable
from friso.remedies.machines import Goal, MoveRange
from friso.stage import Stage

if TYPE_CHECKING:
    from friso.remedies.verified import RemedyOutcome


class TuneAnswer(Answer):
    """The remedies, the least change first; `result` is the `Advice`."""

    status = 2

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys over which machines are drawn."""
        return [*self.result.stage.uncertain()]

    @property
    def failure(self) -> str:
        """Say that a change is needed and none surely works; empty otherwise."""
        if not self.result.needed or self.result.working:
            return ""
        so_far = "before it was interrupted, " if self.result.interrupted else ""
        return f"{so_far}no change that was tried works for certain"

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the search, so that the answer is the best so far."""
        return self.result.interrupted

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that writes the gains for the drive, and those for the leaf springs of isolators.

        There are none of the latter if `friso design` does not know the controller.
        """
        from friso.design_method.prepare import check_designable
        from friso.questions.tune.blocks import NOT_SURE, OF_LEAVES, TUNED

        gains = [f"friso export {shell_word(str(file))}" for file in files if file.name == TUNED]
        try:
            check_designable(self.result.stage)
        except InputError:
            return gains
        isolators = [
            file
            for file in files
            if file.name.startswith("tuned-isolator") and file.suffixes == [".toml"] and NOT_SURE not in file.name
        ]
        return gains + [
            f"friso {'flexure' if file.stem.endswith(OF_LEAVES) else 'design'} {shell_word(str(file))}"
            for file in isolators
        ]


@question
def tune(
    stage: StageLike,
    *,
    within: LengthLike | None = None,
    settle: TimeLike | None = None,
    moves: LengthRange | None = None,
    force_limit: ForceLike | None = None,
    bandwidth_limit: FrequencyLike | None = None,
    margin: RatioLike | None = None,
    only: Changeable | None = None,
    keep: Changeable | None = None,
    seed: Seed = 1,
    set: Changes = None,
    progress: Progress = silent,
) -> TuneAnswer:
    """What stops the hunting: the least change of controller or joint that settles 95 % of machines like this one.

    Parameters
    ----------
    settle : str or float, optional
        Time after the move in which 95 % of the machines are in position, "0.3 s" or a number [s].
    moves : str, optional
        Smallest and largest move, "10 um..32 mm"; default: [moves] of the file, or from ten times the tolerance to the
        file's own move.
    force_limit : str or float, optional
        Largest force of the actuator during the moves, "50 N" or a number [N].
    bandwidth_limit : str or float, optional
        Highest bandwidth that modes missing from the stage file allow, "25 Hz" or a number [Hz].
    margin : float or str, optional
        Least modulus margin of 95 % of the machines, between 0 and 1; 0.5 if not given.
    only : str, optional
        The part to change alone: "controller" or "joint".
    keep : str, optional
        The part to leave unchanged: "controller" or "joint".

    Returns
    -------
    TuneAnswer
        The remedies, ``answer.result.working``, each with its `stage`.

    Raises
    ------
    InputError
        For a stage or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> friso.tune(friso.example("thesis_rig"), only="controller", within="2 um")  # doctest: +SKIP
    """
    chosen = inputs.read_stage(stage, set, leaves_out=(), uncertain_too=True)
    goal = _goal(chosen, within, settle, moves, force_limit, bandwidth_limit, margin, only, keep)
    correlations = inputs.correlations_of(stage, chosen)
    if missing("design"):
        inputs.note(f"no leaf springs are sized for a joint: that takes {install('design')}")
    from friso.remedies.method import tune as tuned

    begins, answered = partial(inputs.mention_unstable_loop, chosen), partial(_mention, chosen, goal)
    advice = tuned(chosen, goal, seed, correlations, progress=progress, begins=begins, answered=answered)
    return TuneAnswer(advice)


OTHERS_TIME = 36.0  # [s]
"""Time for which other remedies are tried once one works, as is said then: twice `TUNING_WORK`, on one core."""


def _mention(stage: Stage, goal: Goal, outcome: RemedyOutcome) -> None:
    """Log the first remedy that works, and how long others are still tried."""
    from friso.questions.tune.words import changes, slowest_time
    from friso.shown.text import listed, unknown_condition, with_unit

    if outcome.stage is None or outcome.measured is None:
        return
    changed = listed(changes(stage, outcome.stage), "and")
    when, condition = slowest_time(outcome.measured, goal), unknown_condition(stage, [*stage.uncertain()])
    LOGGER.info(
        f"{condition}this works: {changed}, in position after {when}; others are tried for up to "
        f"{with_unit(OTHERS_TIME, 's', 2)} of computing (Ctrl-C ends with this)",
        extra={"meanwhile": True},
    )


def _goal(
    stage: Stage,
    within: float | str | None,
    settle: float | str | None,
    moves: str | None,
    force_limit: float | str | None,
    bandwidth_limit: float | str | None,
    margin: float | str | None,
    only: Changeable | None,
    keep: Changeable | None,
) -> Goal:
    """Build the goal from the options, in SI.

    Raises InputError for a value that cannot be used, and if nothing is left to change.
    """
    for name, part in (("only", only), ("keep", keep)):
        if part is not None:
            inputs.choice(part, name, get_args(Changeable), f"{name}=controller")
    if only is not None and only == keep:
        raise InputError("keep", str(keep), f"something else than --only {only}, or nothing is left to change", "")

    def read(name: str, value: float | str | None, unit: str, example: str, bound: Bound = positive) -> float | None:
        """Read an option as a number in SI; None if it is not given."""
        quantity = Quantity(unit, bound, example).on(stage.axis_kind)
        return None if value is None else inputs.quantity_of(value, name, quantity)

    return Goal(
        within=inputs.in_position(stage, within),
        settle=read("settle", settle, "s", "0.3 s"),
        force_limit=read("force_limit", force_limit, "N", "50 N"),
        bandwidth_limit=read("bandwidth_limit", bandwidth_limit, "Hz", "25 Hz"),
        margin=Goal.margin if margin is None else _margin(margin),
        controller=only != "joint" and keep != "controller",
        joint=only != "controller" and keep != "joint",
        moves=None if moves is None else _moves(moves, stage),
    )


def _moves(text: str, stage: Stage) -> MoveRange:
    """Read the range of moves FIRST..LAST, with the accelerations of [moves].

    Raises InputError for a text without two lengths, or whose first length is the larger one.
    """
    length, stated = Quantity("m", positive, "10 um").on(stage.axis_kind), MoveRange.of_stage(stage, 0.0)
    first, _, last = text.partition("..")
    largest = Quantity("m", positive, "32 mm").on(stage.axis_kind).example
    example = f'"{length.example}..{largest}"'
    try:
        low, high = (float(length.read(part.strip())) for part in (first, last))
    except InputError:
        raise inputs.wrong(
            "moves", quoted(text), "smallest and largest move, FIRST..LAST, with units", example
        ) from None
    if low > high:
        raise inputs.wrong("moves", quoted(text), "the smallest move first", example)
    return replace(stated, smallest=low, largest=high)


def _margin(number: float | str) -> float:
    """Read a modulus margin. Raises InputError unless it lies between 0 and 1."""
    try:
        margin = float(number)
    except ValueError:
        margin = np.nan
    if not 0 < margin < 1:
        raise inputs.wrong("margin", quoted(number), "a modulus margin between 0 and 1", "0.5")
    return margin
