"""Recompute and judge the thesis behind friso, and its design guideline.

This package plugs into friso.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from friso_thesis.studies.describing.function import describing
    from friso_thesis.studies.describing.response import mass_line, plant_response
    from friso_thesis.studies.harmonic_balance import harmonic_balance

_PLACES = {
    "describing": "friso_thesis.studies.describing.function",
    "harmonic_balance": "friso_thesis.studies.harmonic_balance",
    "mass_line": "friso_thesis.studies.describing.response",
    "plant_response": "friso_thesis.studies.describing.response",
}

__all__ = ["describing", "harmonic_balance", "mass_line", "plant_response"]


def __getattr__(name: str) -> Any:
    """Import a function when it is first used."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_PLACES[name]), name)
