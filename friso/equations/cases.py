"""Define piecewise expressions that keep their conditions as written.

SymPy's own class simplifies conditions in which other piecewise expressions occur, whenever one is made or changed.
Conditions of a sampled controller with settings against friction depend on each other. For such conditions SymPy takes
minutes and finds nothing shorter.
"""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair


class _Case(ExprCondPair):
    """An expression and its condition, kept as written."""

    def __new__(cls, expression: Any, condition: Any) -> _Case:
        return sp.Tuple.__new__(cls, sp.sympify(expression), sp.sympify(condition))


class Piecewise(sp.Piecewise):
    """The first of some expressions whose condition holds.

    An example is ``Piecewise((1, x > 0), (-1, x < 0), (0, True))``. Cases whose condition is never true are left out,
    and so is everything after a condition that is always true. If the cases just before that last one have its
    expression, as in a derivative, they are left out too. Raises TypeError where no condition can be true.
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
