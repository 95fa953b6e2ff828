"""The design guideline, every number and chart of it computed anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.interface.answer import Answer, question
from friso.progress import Progress, silent
from friso_thesis.studies.guideline.compute import SAMPLES, Guideline

if TYPE_CHECKING:
    from friso.shown.drawing.figure import Figure
    from friso.shown.files import Files


class GuidelineAnswer(Answer):
    """The guideline: `result` is a `Guideline` with both laws and their errors."""

    command = "guideline"

    def __init__(self, result: Guideline) -> None:
        self.result = result

    def sentences(self) -> Sequence[str]:
        """How accurate the laws are."""
        from friso_thesis.questions.guideline.words import accuracy

        return accuracy(self.result)

    def figures(self) -> Sequence[Figure]:
        """The charts."""
        from friso_thesis.questions.guideline.figures import guideline_figures

        return guideline_figures(self.result)

    def document(self) -> dict[str, Any]:
        """Laws, errors, checks and the worked steps."""
        from friso_thesis.questions.guideline.document import guideline_document

        return guideline_document(self.result)

    def files(self) -> Files:
        """guideline.md, its charts and the table of edges."""
        from friso_thesis.questions.guideline.page import guideline_files

        return guideline_files(self.result)


@question
def guideline(samples: int = SAMPLES, *, folder: Path | None = None, progress: Progress = silent) -> GuidelineAnswer:
    """The design guideline: two formulas for the crossover at which hunting ends, with their errors.

    Parameters
    ----------
    samples : int
        Number of samples for the locked law, 64 or more; the other sweeps scale with it.
    folder : Path, optional
        Where finished parts of the sweeps are kept, from which an interrupted run resumes.
    progress : Progress
        Called as sweeps are done.

    Returns
    -------
    GuidelineAnswer
        The fitted laws, ``answer.locked`` and ``answer.free``, with their tests.

    Raises
    ------
    InputError
        For too few or too many samples.

    Examples
    --------
    >>> import friso
    >>> friso.guideline(samples=64)  # doctest: +SKIP
    """
    from friso_thesis.studies.guideline import guideline as computed

    return GuidelineAnswer(computed(samples, folder, progress))
