"""Expressions by cases, taken as they are written.

SymPy's own class simplifies conditions in which other cases occur, whenever one is made or changed. In the equations of
a sampled controller with settings against friction, whose conditions depend on each other, that takes minutes and
leaves nothing shorter.
"""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair


class _Case(ExprCondPair):
    """An expression and its condition, which is kept as it is."""

    def __new__(cls, expression: Any, condition: Any) -> _Case:
        return sp.Tuple.__new__(cls, sp.sympify(expression), sp.sympify(condition))


class Piecewise(sp.Piecewise):
    """The first of some expressions whose condition holds: ``Piecewise((1, x > 0), (-1, x < 0), (0, True))``.

    Conditions that never hold, what follows one that always does, and cases before that with the same expression (such
    as a derivative has) are left out. Raises TypeError where no condition may hold.
    """

    def __new__(cls, *cases: Any, **options: Any) -> Any:
        kept: list[_Case] = []
        for case in cases:
            kept.append(_Case(*getattr(case, "args", case)))
            if kept[-1].cond == sp.false:
                kept.pop()
            elif kept[-1].cond == sp.true:
                while len(kept) > 1 and kept[-2].expr == kept[-1].expr:
                    del kept[-2]
                break
        if not kept:
            raise TypeError("cases given: none that may hold, expected: at least one")
        return kept[0].expr if kept[0].cond == sp.true else sp.Basic.__new__(cls, *kept)
