"""Compute every number and chart of the design guideline anew."""

from __future__ import annotations

from pathlib import Path

from friso.interface.answer import Answer, question
from friso.progress import Progress, silent
from friso_thesis.studies.guideline.compute import FIT_SAMPLES


class GuidelineAnswer(Answer):
    """The guideline: `result` is a `Guideline` with both laws and their errors."""

    @property
    def interrupted(self) -> bool:
        """Tell whether Ctrl-C ended the sweeps, so that it rests on fewer samples."""
        return bool(self.result.interrupted)


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
