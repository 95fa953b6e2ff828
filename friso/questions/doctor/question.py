"""Does friso work on this machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from friso.interface.answer import Answer, AnswerTable, question
from friso.progress import Progress, silent
from friso.studies.doctor import DoctorCheck

if TYPE_CHECKING:
    from friso.shown.files import Files


class DoctorAnswer(Answer):
    """What was looked at: `result` has a check each."""

    command = "doctor"

    def __init__(self, result: Sequence[DoctorCheck]) -> None:
        self.result = tuple(result)

    @property
    def failure(self) -> str:
        """Whether something does not work."""
        return "" if all(check.works for check in self.result) else "friso does not work on this machine"

    def sentences(self) -> Sequence[str]:
        """Whether friso works."""
        from friso.questions.doctor.document import conclusion

        return [conclusion(self.result)]

    def tables(self) -> Sequence[AnswerTable]:
        """What was looked at."""
        if all(check.works for check in self.result):
            return [AnswerTable("", ["Result"], [(check.subject, [check.text]) for check in self.result])]
        rows = [(check.subject, [check.text, "" if check.works else check.remedy]) for check in self.result]
        return [AnswerTable("", ["Result", "Remedy"], rows)]

    def document(self) -> dict[str, Any]:
        """All that was looked at."""
        from friso.questions.doctor.document import doctor_document

        return doctor_document(self.result)

    def files(self) -> Files:
        """Nothing is written."""
        return {}


@question
def doctor(full_paths: bool = False, *, progress: Progress = silent) -> DoctorAnswer:
    """Does friso work on this machine, and what does it run on: for a bug report.

    Parameters
    ----------
    full_paths : bool
        Whether folders are named in full, with the user's name in them.
    progress : Progress
        Not called.

    Returns
    -------
    DoctorAnswer
        What was looked at.

    Raises
    ------
    InputError
        For a `full_paths` that is neither true nor false.

    Examples
    --------
    >>> import friso
    >>> friso.doctor()  # doctest: +SKIP
    """
    from friso.studies.doctor import checks

    return DoctorAnswer([*checks(full_paths)])
