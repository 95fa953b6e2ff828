"""Derive the variational equations: how a small deviation from a motion evolves.

Between kinks the deviation obeys the linearised equations. At a kink the right-hand side, its derivative or the state
itself may jump. The deviation then jumps too, because the neighbouring motion crosses a little earlier or later. The
jump is the saltation matrix (Leine, Nijmeijer 2004, doi:10.1007/978-3-540-44398-8, chapter 7).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import sympy as sp
from mpmath import mp
from sympy import prime

from friso.equations.component import TIME, Kink, Role, State, Switch, state
from friso.equations.model import Model

PREFIX = "small_"
"""Prefix of the names of deviations."""


def variational(model: Model) -> Model:
    """Return the model extended by a small deviation of each state, after the states.

    Deviations do not influence the step size. They are those of a neighbouring motion with other initial states.
    """
    small = {part.symbol: state(f"{PREFIX}{part.symbol}") for part in model.states}
    deviations = tuple(
        State(
            small[part.symbol],
            _directional_derivative(part.derivative, small),
            part.unit,
            part.scale,
            Role.DEVIATION,
            controlled=False,
        )
        for part in model.states
    )
    jumps = {kink: {**model.jumps.get(kink, {}), **_saltation(model, kink, small)} for kink in model.kinks}
    return replace(
        model, states=(*model.states, *deviations), jumps={kink: jump for kink, jump in jumps.items() if jump}
    )


Small = Mapping[sp.Symbol, sp.Symbol]


def _directional_derivative(expression: sp.Expr, small: Small) -> sp.Expr:
    """Return how much an expression changes with a small deviation.

    `small` maps each symbol to the symbol of its deviation.
    """
    terms = (sp.diff(expression, x) * deviation for x, deviation in small.items())
    return sum(terms, start=sp.S.Zero)


def _saltation(model: Model, kink: Kink, small: Small) -> dict[sp.Symbol, sp.Expr]:
    """Return the jump of deviations at a kink, where derivatives jump, by symbol of deviation.

    It is (f+ - f-) times the component of the deviation across the kink, divided by the speed of crossing. f- and f+
    are the right-hand sides just before and just after the crossing. `small` maps symbols to those of their deviations.
    """
    speed = sp.diff(kink.surface, TIME)
    speed += sum((sp.diff(kink.surface, part.symbol) * part.derivative for part in model.states), start=sp.S.Zero)
    share = _directional_derivative(kink.surface, small) / speed
    if isinstance(kink, Switch):
        return _saltation_with_reset(model, kink, small, share)
    across = {
        part.symbol: gap * (1 - 2 * kink.beyond)
        for part in model.states
        if not _vanishes(gap := part.derivative.subs(kink.beyond, 1) - part.derivative.subs(kink.beyond, 0), kink)
    }
    return {small[x]: gap * share for x, gap in across.items()}


def _saltation_with_reset(model: Model, switch: Switch, small: Small, share: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Return the jump of deviations where a `switch` changes and states x become R(x).

    The result is by symbol of deviation. Derivatives jump as well there. The jump is DR small + (f+ - DR f-) share -
    small. f- and f+ are the right-hand sides just before and just after the crossing, f+ at R(x). `share` is the time
    by which the neighbouring motion crosses earlier or later.
    """
    becomes = switch.becomes
    behind = {**becomes, switch.beyond: 1 - switch.beyond}
    before = {part.symbol: part.derivative for part in model.states}
    jumps: dict[sp.Symbol, sp.Expr] = {}
    for x, rate in before.items():
        if x not in becomes and not rate.free_symbols & {switch.beyond, *becomes}:
            continue
        new = becomes.get(x, x)
        carried = _directional_derivative(new, small)
        moved = sum((sp.diff(new, y) * before[y] for y in before), start=sp.S.Zero)
        jumps[small[x]] = carried - small[x] + (cast(sp.Expr, rate.xreplace(behind)) - moved) * share
    return jumps


def _vanishes(gap: sp.Expr, kink: Kink) -> bool:
    """Tell whether a difference is zero everywhere on a kink's surface, where derivatives jump.

    `gap` is the difference, an expression, tested at some points. The result is false if the surface is linear in no
    symbol, as at the end of a window. It is also false if the surface has no slope at one of the points.
    """
    if gap == 0:
        return True
    linear = (s for s in sorted(kink.surface.free_symbols, key=str) if sp.diff(kink.surface, s, 2) == 0)
    if (symbol := next(linear, None)) is None:
        return False
    others = sorted((kink.surface.free_symbols | gap.free_symbols) - {symbol}, key=str)
    rest, slope, difference = (
        sp.lambdify([symbol, *others], part, [{"sine": lambda turn: mp.sin(2 * mp.pi * turn)}, "mpmath"])
        for part in (kink.surface.subs(symbol, 0), sp.diff(kink.surface, symbol), gap)
    )
    with mp.workdps(TESTED_DECIMALS):
        for n in range(1, TRIED_POINTS + 1):
            point = [mp.mpf(int(prime(n + k)) % 97) / (50 + n) + 1 for k in range(1, len(others) + 1)]
            if not (steep := slope(0, *point)):
                return False
            at = -rest(0, *point) / steep
            if abs(difference(at, *point)) > ZERO_BOUND:
                return False
    return True


TRIED_POINTS, TESTED_DECIMALS, ZERO_BOUND = 3, 50, 1e-25
"""Number of points at which a difference is tested, decimals of its value, and the bound below which it counts as 0."""
