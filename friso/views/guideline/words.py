"""The laws of the guideline as formulas, and its numbers as text."""

from __future__ import annotations

import math

from friso.studies.guideline import Guideline
from friso.studies.guideline.groups import GROUPS
from friso.studies.guideline.laws import REFERENCE, Fitted

BASES = {
    "slip": "sigma_0 v_s/F_s",
    "drop": "(F_s - F_c)/(m v_s)",
    "joint": "sqrt(k_j/m)",
    "stroke": "sqrt(F_s/(m S_j))",
}
"""What each rate is but for its factor and powers [rad/s]."""


def formulas(found: Guideline) -> str:
    """Both laws as lines of a formula, to be used by hand."""
    locked, free = found.locked.law, found.free.law
    lines = [
        *_rates(locked),
        "omega_locked = 1/(1/omega_slip + 1/omega_drop)",
        "",
        *_rates(free),
        "omega_free   = 1/sqrt(1/omega_locked^2 + 1/max(omega_joint, omega_stroke)^2)",
    ]
    return "\n".join(lines)


def _rates(law: Fitted) -> list[str]:
    return [
        f"{f'omega_{rate.name}':<12} = {number(law.factors[place])} {BASES[rate.name]}"
        + "".join(f"  {_power(group, value)}" for group, value in sorted(law.of(place).items(), key=_order))
        for place, rate in enumerate(law.law.rates)
    ]


def _order(item: tuple[str, float]) -> int:
    return list(GROUPS).index(item[0])


def _power(group: str, exponent: float) -> str:
    """A group over its reference to a power."""
    written, reference = GROUPS[group].written, REFERENCE[group]
    base = f"({written})" if reference == 1 else f"({written}/{reference:g})"
    if group == "gap":
        base = "gap"
    return f"{base}^{exponent:.2f}"


def number(value: float | None, digits: int = 3) -> str:
    """A number to so many digits; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"


def percent(off: float) -> str:
    """An error of a logarithm as a share: 0.1 is 11 %."""
    return f"{100 * math.expm1(off):.0f} %"
