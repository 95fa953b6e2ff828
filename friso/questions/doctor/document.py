"""Build the JSON document of `friso doctor`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.questions.doctor.words import sentences
from friso.studies.doctor import DoctorCheck


def doctor_document(checks: Sequence[DoctorCheck]) -> dict[str, Any]:
    """Return whether friso works, and the result of every check."""
    return {
        "conclusion": sentences(checks)[0],
        "works": all(check.works for check in checks),
        "findings": [vars(check) for check in checks],
    }
