"""Check whether friso works on this machine.

Say what `friso doctor` found.
"""

from __future__ import annotations

from collections.abc import Sequence

from friso.interface.answer import Answer, question
from friso.progress import Progress, silent
from friso.shown.blocks import AnswerBlock
from friso.studies.doctor import DoctorCheck


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


def blocks(checks: Sequence[DoctorCheck]) -> list[AnswerBlock]:
    """Say whether friso works, with the table of checks, and remedies if something does not work."""
    broken = [check.subject for check in checks if not check.works]
    remedies = ["Remedy"] if broken else []
    says = f"friso does not work on this machine: see {', '.join(broken)}." if broken else _WORKS
    rows = [(check.subject, [check.text, *("" if check.works else check.remedy for _ in remedies)]) for check in checks]
    numbers = {"conclusion": says, "works": not broken, "findings": [vars(check) for check in checks]}
    return [AnswerBlock(sentences=[says], columns=["Result", *remedies], rows=rows, numbers=lambda: numbers)]


_WORKS = "friso works on this machine."
