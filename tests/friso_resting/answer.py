"""How far from its target friction may hold a stage whose integrator has not wound up yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.equations.bandwidth import proportional_stiffness
from friso.equations.breakaway import breakaway
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, StageLike, read_stage
from friso.progress import Progress, silent
from friso.shown.drawing.prefixes import with_unit
from friso.shown.files import Files
from friso.shown.pages import Report
from friso.stage import Stage


class RestingAnswer(Answer):
    """The distance: `result` is a number [m]."""

    command = "resting"

    def __init__(self, stage: Stage) -> None:
        self.stage, self.axis_kind = stage, stage.axis_kind
        flat = stage.flat()
        self.result = float(breakaway(flat)) / proportional_stiffness(flat)

    def sentences(self) -> Sequence[str]:
        """The distance in words."""
        return [f"Friction may hold the stage up to {with_unit(self.result, 'm')} from its target."]

    def document(self) -> dict[str, Any]:
        """The distance."""
        return {"distance_m": self.result}

    def files(self) -> Files:
        """The page."""
        page = Report.of_stage(self.command, self.stage, (), templates="friso_resting", sentences=self.sentences())
        return {"resting.html": page.html()}


@question
def resting(stage: StageLike, *, set: Changes = None, progress: Progress = silent) -> RestingAnswer:
    """How far from its target friction may hold a stage: break-away over proportional stiffness.

    Parameters
    ----------
    stage : Stage, path or dict
        The stage, its file, or the tables of one.
    set : dict, optional
        Keys to override.
    progress : Progress
        Not called.

    Returns
    -------
    RestingAnswer
        The distance [m], ``answer.result``.

    Examples
    --------
    >>> import friso
    >>> friso.resting(friso.example("thesis_rig"))  # doctest: +SKIP
    """
    return RestingAnswer(read_stage(stage, set))
