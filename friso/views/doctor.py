"""What `friso doctor` says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.studies.doctor import Finding


def conclusion(findings: Sequence[Finding]) -> str:
    """Whether friso works, in one sentence."""
    broken = [finding.subject for finding in findings if not finding.works]
    if not broken:
        return "friso works on this machine."
    return f"friso does not work on this machine: see {', '.join(broken)}."


def doctor_document(findings: Sequence[Finding]) -> dict[str, Any]:
    """The conclusion and all that was looked at, for JSON."""
    return {
        "conclusion": conclusion(findings),
        "works": all(finding.works for finding in findings),
        "findings": [vars(finding) for finding in findings],
    }
