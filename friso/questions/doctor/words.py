"""Say what `friso doctor` found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.interface.answer import AnswerTable
from friso.studies.doctor import DoctorCheck


def sentences(checks: Sequence[DoctorCheck]) -> list[str]:
    """Say in one sentence whether friso works."""
    broken = [check.subject for check in checks if not check.works]
    if not broken:
        return ["friso works on this machine."]
    return [f"friso does not work on this machine: see {', '.join(broken)}."]


def tables(checks: Sequence[DoctorCheck]) -> list[AnswerTable]:
    """Return the table of checks, with remedies if something does not work."""
    if all(check.works for check in checks):
        return [AnswerTable("", ["Result"], [(check.subject, [check.text]) for check in checks])]
    rows = [(check.subject, [check.text, "" if check.works else check.remedy]) for check in checks]
    return [AnswerTable("", ["Result", "Remedy"], rows)]


def doctor_document(checks: Sequence[DoctorCheck]) -> dict[str, Any]:
    """Return whether friso works, and the result of every check."""
    return {
        "conclusion": sentences(checks)[0],
        "works": all(check.works for check in checks),
        "findings": [vars(check) for check in checks],
    }
