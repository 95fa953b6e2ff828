"""Judge Eq. 1 and 2: joint and pre-sliding friction as springs in series.

The stiffness of such springs is derived and differentiated. Both formulas are compared with the results, and Eq. 1 with
the plant.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from friso.frequency.members import in_series
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.linear import PLANT, Springs
from friso_thesis.studies.thesis.settings import settings

K_F, K_J = sp.symbols("k_f k_j", positive=True)

PRINTED_STIFFNESS = in_series(K_F, K_J)
"""Eq. 1 as printed."""

PRINTED_SENSITIVITY = (K_J / K_F / (1 + K_J / K_F)) ** 2
"""Eq. 2 as printed, with eta = K_J/K_F. It gives the change of the series stiffness with the stiffness of the
friction."""


@judges("E1", figure="Eq. 1, 2", needs=(PLANT,))
def printed_formulas(evidence: Evidence) -> Finding:
    """Judge both printed formulas against the balance of forces, and Eq. 1 against the plant."""
    return Finding(
        (
            *judged_formulas(PRINTED_STIFFNESS, PRINTED_SENSITIVITY),
            in_the_plant(PRINTED_STIFFNESS, evidence.analysis.springs),
        )
    )


@cache
def judged_formulas(stiffness: sp.Expr, slope_printed: sp.Expr) -> tuple[Part, Part, Part]:
    """Judge the given formulas, in K_F and K_J, against two springs that carry one force."""
    force, middle, end = sp.symbols("F u x")
    balance = sp.solve([K_F * middle - force, K_J * (end - middle) - force], [middle, end], dict=True)[0]
    derived = sp.simplify(force / balance[end])
    slope = sp.diff(derived, K_F)
    limits = [sp.limit(slope_printed, *to) for to in ((K_J, 0), (K_F, sp.oo))]
    relative = sp.simplify(slope * K_F / derived)
    return (
        Part(
            "Eq. 1 equals force over displacement of two springs in series",
            sp.simplify(derived - stiffness) == 0,
            f"k_e = {_written(derived)}",
        ),
        Part(
            "Eq. 2 equals the derivative of that stiffness with respect to k_f, for all k_f and k_j",
            sp.simplify(slope - slope_printed) == 0,
            f"d k_e / d k_f = {_written(sp.factor(slope))}; minus Eq. 2 as printed: "
            f"{_written(sp.simplify(slope - slope_printed))}",
        ),
        Part(
            "Eq. 2 vanishes with eta = k_j/k_f, whether k_j goes to 0 or k_f to infinity",
            all(limit == 0 for limit in limits),
            f"limits {limits[0]} and {limits[1]}; the relative sensitivity, (k_f/k_e) d k_e / d k_f = "
            f"{_written(relative)}, "
            "vanishes too, but with eta instead of its square",
        ),
    )


def _written(expression: sp.Basic) -> str:
    """Write a SymPy expression in a readable form, as text."""
    return str(expression).replace("**", "^").replace("*", " ")


def in_the_plant(stiffness: sp.Expr, springs: Springs) -> Part:
    """Judge a stiffness formula in K_F and K_J against the plant of the declared equations."""
    eta = springs.joint / springs.bristles
    expected = float(stiffness.subs({K_F: springs.bristles, K_J: springs.joint}))
    return Part(
        "Eq. 1 with k_f = sigma_0 is the force over displacement at rest of the plant linearised with a stuck cart, "
        "its limiter free",
        abs(springs.both / expected - 1) <= settings.exact_share,
        f"plant {springs.both:.6g} N/m, Eq. 1 {expected:.6g} N/m; eta {eta:.3g}: an error of 1 % in k_f changes k_e by "
        f"{eta / (1 + eta):.2g} %",
    )
