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
def doctor(full_paths: bool = False, *, progress: Progress = silent) -> DoctorAnswer:
    """Does friso work on this machine? Text to paste into a bug report.

    Parameters
    ----------
    full_paths : bool
        Name folders in full, with the user's name in them.

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
