"""Compute and judge the thesis's figures and claims again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.interface.answer import Answer, question
from friso.interface.inputs import ClaimName, StudyName, Tolerance, tolerance_of
from friso.platform.installed import need
from friso.progress import Progress, silent
from friso_thesis.studies.thesis.plausible import DRAW_COUNT
from friso_thesis.studies.thesis.reproduce import MAP_POINTS

if TYPE_CHECKING:
    from friso.shown.blocks import AnswerBlock, Files
    from friso_thesis.studies.thesis.laws import ConclusionsByLaw


class ReproduceAnswer(Answer):
    """The thesis recomputed.

    `result` is a `Reproduction` with maps, responses and a verdict on each claim. `laws` are judgements of the
    conclusions under each friction law, or None.
    """

    laws: ConclusionsByLaw | None

    @cached_property
    def _document(self) -> dict[str, Any]:
        from friso_thesis.questions.reproduce.document import reproduce_document

        return reproduce_document(self.result, self.laws)

    def blocks(self) -> Sequence[AnswerBlock]:
        """Return the claims, and the conclusions under each friction law if they were asked for."""
        from friso.shown.blocks import AnswerBlock
        from friso_thesis.questions.reproduce.figures import reproduction_figures
        from friso_thesis.questions.reproduce.words import TITLE, fit_sentence, laws_rows, laws_sentences

        fit, laws = fit_sentence(self.result.plausible), self.laws
        claims = [
            f"{claim['id']:5} {claim['judgement']:18} {_drawn(claim['space'])}{claim['number']}"
            for claim in self._document["claims"]
            if claim["judgement"] != "not yet covered"
        ]
        cycles = [
            f"{name}: in {cells['counted_only']} of {cells['cells']} cells peaks are counted although no cycle "
            f"attracts; in {cells['attracted_only']} none are counted although one does"
            for name, cells in self._document["cycles"].items()
        ]
        reproduced = AnswerBlock(
            sentences=[self._document["conclusion"], *([fit] if fit else [])],
            details=[*claims, *cycles],
            draw=lambda: [*reproduction_figures(self.result).values()],
            numbers=lambda: self._document,
        )
        if not laws:
            return [reproduced]
        by_law = AnswerBlock(title=TITLE, sentences=laws_sentences(laws), columns=laws.laws, rows=laws_rows(laws))
        return [reproduced, by_law]

    def files(self) -> Files:
        """Return the page, the claims, the figures."""
        from friso_thesis.questions.reproduce.page import reproduce_files

        return reproduce_files(self.result, self.laws)


def _drawn(space: dict[str, Any] | None) -> str:
    """Say for how many random choices of the open values a claim holds; "" without any."""
    return f"[{space['holds']} of {space['decided']} draws that decide] " if space else ""


@question
def reproduce(
    names: Iterable[StudyName] | None = None,
    points: int = MAP_POINTS,
    rtol: Tolerance = 1e-6,
    *,
    only: Iterable[ClaimName] | None = None,
    draws: int = DRAW_COUNT,
    laws: bool = False,
    folder: Path | None = None,
    progress: Progress = silent,
) -> ReproduceAnswer:
    """Every figure and claim of the thesis that computation can decide, judged: reproduction.html, claims.json.

    Writes into the folder reproduction; single claims go into one such as reproduction-F15B.
    An interrupted run keeps what it has finished; the same command resumes it.

    Parameters
    ----------
    names : list of str, optional
        Studies of Table 3; default: all of them.
    points : int
        Values per axis of every map.
    only : list of str, optional
        Claims, such as "F15B", that alone are judged, with what they need; default: all of them.
    draws : int
        Most joint draws of the values that the thesis does not state. A claim is judged in as many as decide on it.
    laws : bool
        Judge the conclusions of the thesis under every friction law too.
    folder : Path, optional
        Where finished pieces are kept, from which an interrupted run resumes.

    Returns
    -------
    ReproduceAnswer
        Maps and responses by name, and ``answer.verdicts`` on the claims.

    Raises
    ------
    InputError
        For an unknown study or claim, too few points, or too many.

    Examples
    --------
    >>> import friso
    >>> friso.reproduce(["isolator-crossover"], points=21)  # doctest: +SKIP
    """
    need("design", "friso reproduce")
    from friso_thesis.studies.thesis.kept import Kept
    from friso_thesis.studies.thesis.laws import conclusions_by_law
    from friso_thesis.studies.thesis.reproduce import reproduce as reproduced

    result = reproduced(names, points, tolerance_of(rtol), progress, draws=draws, only=only, kept=Kept(folder))
    return ReproduceAnswer(result, laws=conclusions_by_law(result, progress) if laws else None)
