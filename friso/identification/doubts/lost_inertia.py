"""Doubt: the force that accelerates a mass is smaller than what the fit leaves unexplained."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Compare the force that accelerates the masses with the residual beyond noise.

    Any part of the residual may pass for inertia. A mass is withheld if its inertia force is smaller than the residual.
    Otherwise the relative uncertainty of the mass is at least the squared ratio of residual to inertia (friso's
    choice).
    """
    masses = {key: one for key, one in case.determined.items() if key in ("masses.cart", "masses.stage")}
    inertia = sum(mass.value for mass in masses.values()) * float(np.sqrt(np.mean(case.acceleration**2)))
    if inertia < case.unexplained:
        left = f"{case.unexplained:.2g} {case.unit}"
        why = f"its inertia, {inertia:.2g} {case.unit}, is less than what the model leaves unexplained, {left}"
        yield RaisedDoubt(size=inertia, unit=case.unit, refuses=dict.fromkeys(masses, why))
    elif masses and inertia > 0:
        share = (case.unexplained / inertia) ** 2
        answers = {key: one.reaching((1 - share) * one.value, (1 + share) * one.value) for key, one in masses.items()}
        yield RaisedDoubt(size=inertia, unit=case.unit, answers=answers)


DOUBT = Doubt(
    "key",
    find,
    "the inertia beside what the model leaves unexplained",
    "masses widen, or are refused",
    "faster moves, or a frequency response",
    after=("slow-motion",),
)
