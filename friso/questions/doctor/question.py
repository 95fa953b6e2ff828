"""Check whether friso works on this machine."""

from __future__ import annotations

from friso.interface.answer import Answer, question
from friso.progress import Progress, silent


class DoctorAnswer(Answer):
    """Checks of whether friso works; `result` holds one `DoctorCheck` each."""

    @property
    def failure(self) -> str:
        """Say that something does not work; empty if everything does."""
        return "" if all(check.works for check in self.result) else "friso does not work on this machine"


@question
def doctor(*, progress: Progress = silent) -> DoctorAnswer:
    """Does friso work on this machine? Text to paste into a bug report.

    Returns
    -------
    DoctorAnswer
        What was looked at.

    Raises
    ------
    InputError
        For a `progress` that cannot be called.

    Examples
    --------
    >>> import friso
    >>> friso.doctor()  # doctest: +SKIP
    """
    from friso.studies.doctor import checks

    return DoctorAnswer([*checks()])
