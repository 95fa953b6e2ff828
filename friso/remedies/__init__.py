"""Find what stops a stage from hunting: settings and isolators, each optimised and verified by cycles."""

from typing import Literal

Changeable = Literal["controller", "joint"]
"""What of a stage may be changed."""
