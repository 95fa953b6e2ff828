"""Check the relative tolerance that a user gives."""

from __future__ import annotations

from friso.errors import InputError

TIGHTEST_RTOL, LOOSEST_RTOL = 1e-12, 1e-2


def checked_rtol(rtol: float) -> float:
    """Return `rtol` if the solver can meet it. Raises InputError otherwise."""
    if not TIGHTEST_RTOL <= rtol <= LOOSEST_RTOL:
        raise InputError("rtol", f"{rtol:g}", "a number from 1e-12 to 1e-2", "rtol=1e-6")
    return rtol
