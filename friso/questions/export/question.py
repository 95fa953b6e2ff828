"""Give the gains of a stage file as they are typed into a drive.

They come in the units of drives, and as the parameters of a kind of drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.axis import speak_of
from friso.drives.gains import gains_of
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, FormatName, StageLike, changes_of, choice, file_of, stage_of
from friso.progress import Progress, silent

if TYPE_CHECKING:
    from friso.shown.files import Files


class ExportAnswer(Answer):
    """Gains in the terms of drives; `result` is a `Gains`."""

    stage_file: str = ""

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that compares a log of the drive with these gains with the stage."""
        return [f"friso identify NEW_LOG.csv --against {self.stage_file}"] if self.stage_file else []

    @property
    def condition(self) -> str:
        """Return "": gains are told as they stand."""
        return ""

    def files(self) -> Files:
        """Return the page, and the parameter file if a kind of drive was named."""
        kind = self.result.kind
        return {"gains.html": self.page().html(), **({f"parameters{kind.suffix}": self.result.text} if kind else {})}


@question
def export(
    what: str,
    stage: StageLike,
    *,
    set: Changes = None,
    to: FormatName | None = None,
    progress: Progress = silent,
) -> ExportAnswer:
    """The gains in the units that drives use, a drawing of the loop they belong to, and a drive's parameters.

    travel_per_turn and motor_constant ("0.5 N*m/A") add the units of a motor.

    Parameters
    ----------
    what : str
        "gains": the gains of the controller.
    set : dict, optional
        Keys to override, or what no stage file says: travel_per_turn="10 mm", motor_constant="0.5 N*m/A".
    to : str, optional
        A kind of drive, whose parameters are wanted; friso export --help lists them.

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
    gains = gains_of(chosen, {key: pairs[key] for key in pairs if key not in overrides}, to)
    return ExportAnswer(gains, stage_file=file_of(stage, overrides))
