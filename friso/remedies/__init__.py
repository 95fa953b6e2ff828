"""Find what stops a stage from hunting.

Controller settings and isolators are each optimised, then verified by limit cycles.
"""

from typing import Literal

Changeable = Literal["controller", "joint"]
"""Parts of a stage that may be changed."""
