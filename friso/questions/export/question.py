"""What to type into the drive: the gains of a stage file in the units of drives, and as a drive's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from friso.axis import speak_of
from friso.drives.gains import Gains, gains_of
from friso.interface.answer import Answer, AnswerTable, question
from friso.interface.inputs import Changes, StageLike, changes_of, choice, stage_of
from friso.progress import Progress, silent

if TYPE_CHECKING:
    from friso.shown.files import Files


class ExportAnswer(Answer):
    """Gains in the terms of drives: `result` is a `Gains`."""

    command = "export"

    def __init__(self, result: Gains) -> None:
        self.result, self.axis_kind = result, result.stage.axis_kind

    def sentences(self) -> Sequence[str]:
        """The gains in units of drives, and what to know of them."""
        from friso.questions.export.words import sentences

        return sentences(self.result)

    def blocks(self) -> Sequence[str]:
        """The loop drawn, and the parameters of a drive."""
        return [text for text in (self.result.diagram, self.result.text) if text]

    def tables(self) -> Sequence[AnswerTable]:
        """Each gain with its symbol and its values."""
        from friso.questions.export.words import COLUMNS, rows, title

        return [AnswerTable(title(self.result), COLUMNS, rows(self.result))]

    def document(self) -> dict[str, Any]:
        """The gains, and the parameters."""
        from friso.questions.export.document import export_document

        return export_document(self.result)

    def files(self) -> Files:
        """The page, and the parameters as a drive's file."""
        from friso.questions.export.page import export_files

        return export_files(self.result)


@question
def export(
    what: str,
    stage: StageLike,
    *,
    set: Changes = None,
    to: str | None = None,
    progress: Progress = silent,
) -> ExportAnswer:
    """The gains in the units that drives use, a drawing of the loop they belong to, and a drive's parameters.

    Parameters
    ----------
    what : str
        "gains".
    stage : Stage, path or dict
        The stage, its file, or the tables of one.
    set : dict, optional
        Keys to override, and what no stage file says: ``{"travel_per_turn": "10 mm", "motor_constant": "0.5 N*m/A"}``.
    to : str, optional
        A kind of drive, whose parameters are wanted; a wrong one is answered with all of them.
    progress : Progress
        Not called: this is quick.

    Returns
    -------
    ExportAnswer
        The gains in several units, ``answer.conversions``, and the parameters, ``answer.parameters``.

    Raises
    ------
    InputError
        For a stage or a drive that is not usable, and for all that is still to be said, together.

    Examples
    --------
    >>> import friso
    >>> friso.export("gains", friso.example("twincat_cascade"), set={"travel_per_turn": "10 mm"})  # doctest: +SKIP
    """
    choice(what, "WHAT", ("gains",), "friso export gains stage.toml")
    pairs = changes_of(set)
    overrides = {key: value for key, value in pairs.items() if "." in key}
    chosen = stage_of(stage, overrides)
    speak_of(chosen.axis_kind)
    return ExportAnswer(gains_of(chosen, {key: pairs[key] for key in pairs if key not in overrides}, to))
