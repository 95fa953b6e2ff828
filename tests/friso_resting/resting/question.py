"""How far from its target friction may hold a stage whose integrator has not wound up yet."""

from __future__ import annotations

from friso.equations.bandwidth import breakaway, proportional_stiffness
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, StageLike, read_stage
from friso.progress import Progress, silent
from friso.stage import Stage


class RestingAnswer(Answer):
    """The distance: `result` is a number [m]."""

    stage: Stage
    templates = "friso_resting"

    @property
    def subject(self) -> RestingAnswer:
        """The answer itself, for the page shows the stage too."""
        return self


@question
def resting(stage: StageLike, *, set: Changes = None, progress: Progress = silent) -> RestingAnswer:
    """How far from its target may friction hold the stage: break-away over proportional stiffness.

    Returns
    -------
    RestingAnswer
        The distance [m], ``answer.result``.

    Examples
    --------
    >>> import friso
    >>> friso.resting(friso.example("thesis_rig"))  # doctest: +SKIP
    """
    chosen = read_stage(stage, set)
    flat = chosen.flat()
    return RestingAnswer(float(breakaway(flat)) / proportional_stiffness(flat), stage=chosen)
