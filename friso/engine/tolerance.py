"""The relative tolerance and its limits."""

from __future__ import annotations

TIGHTEST, LOOSEST = 1e-12, 1e-2


def checked_rtol(rtol: float) -> float:
    """`rtol` if the solver can hold it. Raises ValueError otherwise."""
    if not TIGHTEST <= rtol <= LOOSEST:
        raise ValueError(f"rtol: given {rtol:g}, expected a number from 1e-12 to 1e-2, such as 1e-6")
    return rtol
