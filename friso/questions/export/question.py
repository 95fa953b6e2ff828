"""Take gains or the controller itself out of friso, to where they are used."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.axis import speak_of
from friso.drives.drive import FORMATS
from friso.drives.gains import gains_of
from friso.drives.target import TARGETS
from friso.errors import InputError
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, FormatName, StageLike
from friso.progress import Progress, silent
from friso.quantities import quoted

if TYPE_CHECKING:
    from friso.questions.export.parcel import ControllerAnswer
    from friso.shown.blocks import AnswerBlock, Files


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

    def blocks(self) -> list[AnswerBlock]:
        """Return the parts of the answer: what to type in, the loop, the gains, and a drive's parameters."""
        from friso.questions.export.words import gain_blocks

        return gain_blocks(self.result)

    def files(self) -> Files:
        """Return the page, and the parameter file if a kind of drive was named."""
        kind = self.result.kind
        return {"gains.html": self.page().html(), **({f"parameters{kind.suffix}": self.result.text} if kind else {})}


@question
def export(
    stage: StageLike,
    *,
    set: Changes = None,
    to: FormatName | None = None,
    name: str | None = None,
    machine: bool = False,
    progress: Progress = silent,
) -> ExportAnswer | ControllerAnswer:
    """What to take to the drive: gains in its units, its parameters, or the controller itself as code.

    travel_per_turn and motor_constant ("0.5 N*m/A") add the units of a motor. Code is that of the drive as built, with
    the verdict of friso check in its header and a test against friso's own run.

    Parameters
    ----------
    set : dict, optional
        Keys to override, or what no stage file says: travel_per_turn="10 mm", motor_constant="0.5 N*m/A".
    to : str, optional
        A kind of drive, whose parameters are wanted, or a language; friso export --help lists them.
    name : str, optional
        Name of the controller in code and of its files; default: the name of the stage file.
    machine : bool
        Add the machine with its friction as a plant of fixed steps (c, fmu).

    Returns
    -------
    ExportAnswer or ControllerAnswer
        The gains in several units; or the controller, ``answer.target_files``, and ``answer.system`` for
        python-control.

    Raises
    ------
    InputError
        For a stage or a target that is not usable, and for all that is still to be said, together.

    Examples
    --------
    >>> import friso
    >>> friso.export(friso.example("twincat_cascade"), set={"travel_per_turn": "10 mm"})  # doctest: +SKIP
    """
    pairs = inputs.changes_of(set)
    overrides = {key: value for key, value in pairs.items() if "." in key}
    user_values = {key: pairs[key] for key in pairs if key not in overrides}
    if to is not None and to not in FORMATS:
        inputs.choice(to, "to", (*FORMATS, *TARGETS), "to=c")
    if to is None or to in FORMATS:
        chosen = inputs.stage_of(stage, overrides)
        speak_of(chosen.axis_kind)
        for option, value in (("name", name), ("machine", machine)):
            if value:
                actual = quoted(to) if to else "nothing"
                raise InputError("to", actual, f"a language, which the option {option} is for", "to=c")
        return ExportAnswer(gains_of(chosen, user_values, to), stage_file=inputs.file_of(stage, overrides))
    if machine and not TARGETS[to].holds_machine:
        able = ", ".join(target for target in TARGETS if TARGETS[target].holds_machine)
        raise InputError("to", quoted(to), f"a language that can hold a machine ({able})", "to=c")
    from friso.questions.export.parcel import ControllerAnswer, parcel_of

    chosen = inputs.read_stage(stage, overrides, leaves_out=())
    speak_of(chosen.axis_kind)
    if "drive.sample_time" not in chosen.flat():
        inputs.mention_sampling(chosen)
    own_name = name or re.sub(r"[\W_]+", "_", inputs.stem_of(stage)).strip("_")
    correlations = inputs.correlations_of(stage, chosen)
    parcel, check = parcel_of(chosen, correlations, TARGETS[to], own_name, user_values, machine, progress)
    return ControllerAnswer(parcel, stage=chosen, check=check, to=to)
