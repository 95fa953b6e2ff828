"""Remedies for a stage that hunts: settings and isolators optimised one remedy at a time, verified by cycles."""

from typing import Literal

Changeable = Literal["controller", "joint"]
"""What of a stage may be changed."""
