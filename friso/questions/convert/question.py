"""Put a stage under another friction law, and say what could not be kept."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, LawName, StageLike, Whole, read_stage, stem_of, whole_number
from friso.progress import Progress, silent

if TYPE_CHECKING:
    from friso.shown.files import Files

MOST_ELEMENTS = 12
"""Largest number of elements of a law with several elements."""


class ConvertAnswer(Answer):
    """A stage under another friction law.

    `result` is the `LawConversion`, and ``answer.stage`` is the converted stage.
    """

    name: str

    def files(self) -> Files:
        """Return the stage file and the figure."""
        from friso.questions.convert.page import convert_files

        return convert_files(self.result, self.name)


@question
def convert(
    stage: StageLike,
    friction: LawName,
    *,
    elements: Whole = 6,
    virgin: str | os.PathLike[str] | None = None,
    set: Changes = None,
    progress: Progress = silent,
) -> ConvertAnswer:
    """Convert friction to another law that keeps what was measured, and say what could not be kept.

    Parameters
    ----------
    friction : str
        The friction law to convert to; friso convert --help lists them.
    elements : int
        Elements of a law that has several, side by side, 1 to 12.
    virgin : path, optional
        A file of any log format with measured force over displacement from rest up to break-away, one channel of each,
        with its unit; in place of what the stage's own law says of it.

    Returns
    -------
    ConvertAnswer
        The converted stage, ``answer.stage``, and what is kept.

    Raises
    ------
    InputError
        For a stage, a law, a number or a file that is not usable.

    Examples
    --------
    >>> import friso
    >>> friso.convert(friso.example("thesis_rig"), "gms")  # doctest: +SKIP
    """
    chosen = read_stage(stage, set)
    whole_number(elements, "elements", 1, MOST_ELEMENTS, "6")
    from friso.studies.laws.conversion import convert as converted

    return ConvertAnswer(converted(chosen, friction, elements, virgin), name=f"{stem_of(stage)}_{friction}")
