"""Evaluate the reference within a piece: a polynomial and sinusoids ("tones").

They are symbols in the equations, and numbers elsewhere. A row of numbers describes a piece. It holds the start [s] and
the derivatives of the polynomial at the start. With tones it also holds the direction in which the reference moves (1,
-1), and the parameters of each tone: amplitude [m], phase [turns], frequency [Hz] and sweep [Hz/s]. Phases and
frequencies are given at the start of the piece, so that they stay small.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import factorial, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.stage.rig import QUADRATIC, ReferenceForm

if TYPE_CHECKING:
    import sympy as sp

DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap")
"""Names of the derivatives of the polynomial, from order 0."""

TONE = ("amplitude", "turns", "frequency", "sweep")
"""Names of the parameters of a sinusoid."""


@dataclass(frozen=True)
class Reference:
    """A reference as symbols: inputs of each piece, and derivatives made of them and `TIME`.

    `direction` is 1 ahead, -1 back and 0 at rest, throughout a piece. `acceleration_size` is the absolute value of the
    acceleration.
    """

    inputs: tuple[sp.Symbol, ...]
    position: sp.Expr
    velocity: sp.Expr
    acceleration: sp.Expr
    jerk: sp.Expr
    direction: sp.Expr
    acceleration_size: sp.Expr


def declared(form: ReferenceForm = QUADRATIC) -> Reference:
    """Return a reference in symbols, of polynomials and sinusoids as `form` says."""
    import sympy as sp

    from friso.equations.blocks import sign_of_motion
    from friso.equations.cases import Piecewise
    from friso.equations.component import TIME, key, sine

    names = [f"reference.{name}" for name in DERIVATIVES[: form.degree + 1]]
    names += ["reference.direction"] if form.tones else []
    names += [f"reference.{name}_{number + 1}" for number in range(form.tones) for name in TONE]
    inputs = tuple(map(key, names))
    derivatives, tones = inputs[: form.degree + 1], inputs[form.degree + 2 :]
    position = sum((d * TIME**k / sp.factorial(k) for k, d in enumerate(derivatives)), start=sp.S.Zero)
    for first in range(0, len(tones), len(TONE)):
        amplitude, turns, frequency, sweep = tones[first : first + len(TONE)]
        position += amplitude * sine(turns + frequency * TIME + sweep * TIME**2 / 2)
    velocity = sp.diff(position, TIME)
    acceleration = sp.diff(velocity, TIME)
    smooth = form != QUADRATIC
    size = Piecewise((acceleration, acceleration > 0), (-acceleration, True)) if smooth else sp.Abs(acceleration)
    direction = inputs[form.degree + 1] if form.tones else sign_of_motion(*derivatives[1:])
    return Reference(inputs, position, velocity, acceleration, sp.diff(acceleration, TIME), direction, size)


def value(form: ReferenceForm, rows: np.ndarray, elapsed: Any, order: int = 0) -> np.ndarray:
    """Return the reference, or its first or second derivative, at a time [s] within each piece.

    `elapsed` counts from the start of the piece, and `order` is that of the derivative. The result has the shape of the
    pieces, `rows` without their last axis.
    """
    total = rows[..., 1 + order] + 0.0 * elapsed
    for power in range(1, form.degree - order + 1):
        total = total + rows[..., 1 + order + power] * elapsed**power / factorial(power)
    for amplitude, turns, frequency, sweep in _tones(form, rows):
        phase = 2 * pi * np.mod(turns + (frequency + sweep * elapsed / 2) * elapsed, 1.0)
        rate = 2 * pi * (frequency + sweep * elapsed)
        parts = np.sin(phase), rate * np.cos(phase), 2 * pi * sweep * np.cos(phase) - rate**2 * np.sin(phase)
        total = total + amplitude * parts[order]
    return total


def moved_on(form: ReferenceForm, rows: np.ndarray, elapsed: Any) -> np.ndarray:
    """Return pieces of the reference that start a time `elapsed` [s] later and go on as before.

    Pieces and result have the shape of `rows`. Polynomials are expanded about the new start, and sinusoids get the
    phase and frequency that they have there.
    """
    later = rows.copy()
    later[..., 0] += elapsed
    bare = ReferenceForm(form.degree)
    for k in range(form.degree + 1):
        later[..., 1 + k] = value(bare, rows, elapsed, k)
    for tone in _tones(form, later):
        _, turns, frequency, sweep = tone
        turns += (frequency + sweep * elapsed / 2) * elapsed
        frequency += sweep * elapsed
    return later


def at_rest(form: ReferenceForm, rows: np.ndarray, derivative: int = 1) -> np.ndarray:
    """Return which pieces stand still, in the shape of `rows` without its last axis.

    With `derivative` 2, return which pieces have a constant velocity.
    """
    rests = np.all(rows[..., 1 + derivative : form.degree + 2] == 0, axis=-1)
    for amplitude, *_ in _tones(form, rows):
        rests &= amplitude == 0
    return rests


def _tones(form: ReferenceForm, rows: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield the parameters of each sinusoid, as views of the pieces `rows`."""
    first = form.degree + 3
    for number in range(form.tones):
        yield tuple(rows[..., first + len(TONE) * number + i] for i in range(len(TONE)))
