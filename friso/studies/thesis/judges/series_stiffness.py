"""Eq. 1 and 2: joint and pre-sliding friction as springs in series, differentiated."""

from __future__ import annotations

import sympy as sp

from friso.studies.thesis.claims import Evidence, Finding, Part, judges

K_F, K_J = sp.symbols("k_f k_j", positive=True)
_ETA = K_J / K_F

PRINTED_STIFFNESS = K_F * K_J / (K_F + K_J)
"""Eq. 1 as printed."""

PRINTED_SENSITIVITY = (_ETA / (1 + _ETA)) ** 2
"""Eq. 2 as printed, with its eta."""


@judges("E1", figure="Eq. 1, 2")
def printed_formulas(evidence: Evidence) -> Finding:
    """Both printed formulas against what follows from the balance of forces."""
    return compare(PRINTED_STIFFNESS, PRINTED_SENSITIVITY)


def compare(stiffness: sp.Expr, sensitivity: sp.Expr) -> Finding:
    """The given formulas, in K_F and K_J, against two springs that carry one force."""
    force, middle, end = sp.symbols("F u x")
    balance = sp.solve([K_F * middle - force, K_J * (end - middle) - force], [middle, end], dict=True)[0]
    derived = sp.simplify(force / balance[end])
    slope = sp.diff(derived, K_F)
    return Finding(
        (
            Part(
                "Eq. 1 equals force over displacement of two springs in series",
                sp.simplify(derived - stiffness) == 0,
                f"k_e = {derived}",
            ),
            Part(
                "Eq. 2 equals the derivative of that stiffness with respect to k_f, for all k_f and k_j",
                sp.simplify(slope - sensitivity) == 0,
                f"d k_e / d k_f = {sp.factor(slope)}; minus Eq. 2 as printed: {sp.simplify(slope - sensitivity)}; "
                f"Eq. 2 goes to {sp.limit(sensitivity, K_J, 0)} with k_j",
            ),
        )
    )
