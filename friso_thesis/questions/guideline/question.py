"""Compute every number and chart of the design guideline anew."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from friso.interface.answer import Answer, question
from friso.progress import Progress, silent
from friso_thesis.studies.guideline.compute import FIT_SAMPLES

if TYPE_CHECKING:
    from friso.shown.blocks import AnswerBlock, Files


class GuidelineAnswer(Answer):
    """The guideline: `result` is a `Guideline` with both laws and their errors."""

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the sweeps, so that it rests on fewer samples."""
        return bool(self.result.interrupted)

    def blocks(self) -> Sequence[AnswerBlock]:
        """Return how accurately both laws predict the edge of hunting, with all charts."""
        from friso.shown.blocks import AnswerBlock
        from friso_thesis.questions.guideline.document import guideline_document
        from friso_thesis.questions.guideline.figures import guideline_figures
        from friso_thesis.questions.guideline.words import sentences

        draw, numbers = partial(guideline_figures, self.result), partial(guideline_document, self.result)
        return [AnswerBlock(sentences=sentences(self.result), draw=draw, numbers=numbers)]

    def files(self) -> Files:
        """Return the page in Markdown, the table of edges, and the charts."""
        from friso_thesis.questions.guideline.page import guideline_files

        return guideline_files(self.result)


@question
def guideline(
    samples: int = FIT_SAMPLES, *, folder: Path | None = None, progress: Progress = silent
) -> GuidelineAnswer:
    """Two formulas for the crossover at which hunting ends: guideline.md, its charts, guideline_edges.csv.

    Parameters
    ----------
    samples : int
        Number of samples for the locked law, 64 or more; the other sweeps scale with it.
    folder : Path, optional
        Where finished parts of the sweeps are kept, from which an interrupted run resumes.

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
    from friso_thesis.studies.guideline.compute import guideline as computed

    return GuidelineAnswer(computed(samples, folder, progress))
