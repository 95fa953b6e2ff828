"""Reproduce the thesis: its studies and its claims."""

from friso_thesis.studies.thesis.claims import Claim, Evidence, Finding, Part, Response, claims, judges
from friso_thesis.studies.thesis.reading import CONVENTIONS
from friso_thesis.studies.thesis.reproduce import Reproduction, reproduce
from friso_thesis.studies.thesis.studies import STUDIES, ThesisStudy, thesis_rig
from friso_thesis.studies.thesis.verdicts import ClaimVerdict

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
