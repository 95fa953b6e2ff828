"""The thesis's studies, claims and their reproduction."""

from friso.studies.thesis.claims import Claim, Evidence, Finding, Part, Response, claims, judges
from friso.studies.thesis.reading import CONVENTIONS
from friso.studies.thesis.reproduce import Reproduction, reproduce
from friso.studies.thesis.studies import STUDIES, ThesisStudy, thesis_rig
from friso.studies.thesis.verdicts import ClaimVerdict

__all__ = [
    "CONVENTIONS",
    "STUDIES",
    "Claim",
    "ClaimVerdict",
    "Evidence",
    "Finding",
    "Part",
    "Reproduction",
    "Response",
    "ThesisStudy",
    "claims",
    "judges",
    "reproduce",
    "thesis_rig",
]
