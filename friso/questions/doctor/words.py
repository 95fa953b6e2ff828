"""Say what `friso doctor` found."""

from __future__ import annotations

from collections.abc import Sequence

from friso.shown.blocks import AnswerBlock
from friso.studies.doctor import DoctorCheck


def blocks(checks: Sequence[DoctorCheck]) -> list[AnswerBlock]:
    """Say whether friso works, with the table of checks, and remedies if something does not work."""
    broken = [check.subject for check in checks if not check.works]
    remedies = ["Remedy"] if broken else []
    says = f"friso does not work on this machine: see {', '.join(broken)}." if broken else _WORKS
    rows = [(check.subject, [check.text, *("" if check.works else check.remedy for _ in remedies)]) for check in checks]
    numbers = {"conclusion": says, "works": not broken, "findings": [vars(check) for check in checks]}
    return [AnswerBlock(sentences=[says], columns=["Result", *remedies], rows=rows, numbers=lambda: numbers)]


_WORKS = "friso works on this machine."
