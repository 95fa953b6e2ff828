"""Find what stops a stage from hunting: settings and isolators, each optimised and verified by cycles."""

from typing import Literal

Changeable = Literal["controller", "joint"]
"""Parts of a stage that may be changed."""
