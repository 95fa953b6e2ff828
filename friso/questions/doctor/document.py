"""What `friso doctor` says, in a sentence and in JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.studies.doctor import DoctorCheck


def conclusion(checks: Sequence[DoctorCheck]) -> str:
    """Whether friso works, in one sentence."""
    broken = [check.subject for check in checks if not check.works]
    if not broken:
        return "friso works on this machine."
    return f"friso does not work on this machine: see {', '.join(broken)}."


def doctor_document(checks: Sequence[DoctorCheck]) -> dict[str, Any]:
    """The conclusion and all that was looked at, for JSON."""
    return {
        "conclusion": conclusion(checks),
        "works": all(check.works for check in checks),
        "findings": [vars(check) for check in checks],
    }
