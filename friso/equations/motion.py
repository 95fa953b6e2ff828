"""Describe a stage's motion: pieces of its reference, standstill, size and start.

Within a piece the reference is a polynomial and sinusoids ("tones"). They are symbols in the equations, and numbers
elsewhere.

A row of numbers describes a piece. It holds the start [s] and the derivatives of the polynomial at the start. With
tones it also holds the direction in which the reference moves (1, -1), and the parameters of each tone: amplitude [m],
phase [turns], frequency [Hz] and sweep [Hz/s]. Phases and frequencies are given at the start of the piece, so that they
stay small.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import factorial, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.stage.rig import DURATION, QUADRATIC, ReferenceForm, Stand, Tone, motion_of

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
    from friso.equations.component import TIME, Piecewise, key, sine

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


def form_of(flat: Mapping[str, Any]) -> ReferenceForm:
    """Return what a stage's reference consists of: polynomials of a degree, and sinusoids."""
    return motion_of(flat).form(flat)


def varies(flat: Mapping[str, Any]) -> bool:
    """Tell whether the motions of the stages in `flat`, keys with SI values, differ."""
    return any(np.ndim(value) for key, value in flat.items() if key.startswith("motion."))


def pieces(flat: Mapping[str, Any], runs: int) -> np.ndarray:
    """Return the pieces of the reference of each run, shape (runs, pieces, 1 + inputs).

    A piece is a row of its start [s] and of the inputs of the equations (see `friso.equations.motion`).
    """
    kind = motion_of(flat)
    form, rows, tones = kind.form(flat), kind.pieces(flat), kind.tones(flat)
    full = np.zeros((runs, len(rows), 1 + form.inputs))
    for i, row in enumerate(rows):
        for j, number in enumerate(row):
            full[:, i, j] = number
    return _with_tones(form, full, tones, flat[DURATION]) if tones else full


def _with_tones(form: ReferenceForm, rows: np.ndarray, tones: Sequence[Tone], duration: Any) -> np.ndarray:
    """Return pieces of the reference with sinusoids added, cut also where it reverses.

    `rows` are the pieces without sinusoids, shape (runs, pieces, 1 + inputs); `tones` are the sinusoids, and `duration`
    [s] is that of the runs.
    """
    ends = np.broadcast_to(np.asarray(duration, dtype=float), (len(rows),))
    for number, tone in enumerate(tones):
        for i, part in enumerate(tone):
            rows[..., form.degree + 3 + 4 * number + i] = np.reshape(part, (-1, 1))
    parts = [_turning(form, run, end) for run, end in zip(rows, ends, strict=True)]
    most = max(map(len, parts))
    return np.array([np.concatenate([part, np.repeat(part[-1:], most - len(part), axis=0)]) for part in parts])


SAMPLES_PER_PERIOD = 32.0
"""Samples in a period of the fastest sinusoid, among which reversals are sought. With fewer, two reversals close
together are missed, and between them feedforward by direction has the wrong sign. More take longer."""


def _turning(form: ReferenceForm, rows: np.ndarray, end: float) -> np.ndarray:
    """Return the pieces of one run's reference with sinusoids, cut also where it reverses.

    `rows`, shape (pieces, 1 + inputs), are pieces up to the time `end` [s], whose sinusoids have their phases at time
    0. The result has as many columns.
    """
    starts, first, per_period = rows[:, 0], form.degree + 3, SAMPLES_PER_PERIOD
    tones = rows[0, first:].reshape(-1, 4)
    fastest = np.max(np.maximum(np.abs(tones[:, 2]), np.abs(tones[:, 2] + tones[:, 3] * end)))
    bare = rows.copy()
    bare[:, first:] = 0.0

    def rate(time: np.ndarray) -> np.ndarray:
        """Return the velocity of the reference [m/s] at times of the run [s], both of shape (n,)."""
        piece = bare[np.searchsorted(starts, time, side="right") - 1]
        of_tones = np.concatenate([np.zeros((1, first)), rows[:1, first:]], axis=1)
        return value(form, piece, time - piece[:, 0], 1) + value(form, of_tones, time, 1)

    grid = np.linspace(0.0, end, max(2, int(np.ceil(per_period * fastest * end)) + 1))
    rates = rate(grid)
    changes = np.flatnonzero(rates[1:] * rates[:-1] < 0)
    low, high, before = grid[changes], grid[changes + 1], rates[changes]
    while np.any(high - low > 4 * np.finfo(float).eps * high):
        middle = (low + high) / 2
        same = rate(middle) * before > 0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    corners = np.unique(np.concatenate([starts, (low + high) / 2, grid[1:-1][rates[1:-1] == 0]]))
    cut = bare[np.searchsorted(starts, corners, side="right") - 1]
    cut = moved_on(form, cut, corners - cut[:, 0])
    tones_only = np.repeat(np.concatenate([np.zeros((1, first)), rows[:1, first:]], axis=1), len(corners), axis=0)
    cut[:, first:] = moved_on(form, tones_only, corners)[:, first:]
    cut[:, first + 1 :: 4] %= 1.0
    cut[:, form.degree + 2] = np.sign(rate((corners + np.append(corners[1:], end)) / 2))
    return cut


def reference(flat: Mapping[str, Any], time: np.ndarray) -> np.ndarray:
    """Return the reference position [m] of one run at times [s], both of shape (n,)."""
    rows = pieces(flat, 1)[0]
    row = rows[np.searchsorted(rows[:, 0], time, side="right") - 1]
    return value(form_of(flat), row, time - row[:, 0])


def size(flat: Mapping[str, Any]) -> Any:
    """Return the length of the motion [m]; 0 where the reference never moves."""
    return motion_of(flat).motion_size(flat)


def initial_displacement(flat: Mapping[str, Any]) -> Any:
    """Return the position of all masses at the start [m]."""
    return motion_of(flat).initial_displacement(flat)


def stands(flat: Mapping[str, Any]) -> Sequence[Stand]:
    """Return the places where the reference stands still, in order of time.

    A reference that never stands has one, from its last corner on.
    """
    return motion_of(flat).stands(flat)


def rests(flat: Mapping[str, Any]) -> bool:
    """Tell whether the reference stands still in the end, so that a stage can hunt.

    `flat` has the keys of one stage or several; the result is true if that holds for all of them.
    """
    return motion_of(flat).rests or _ends_without(1, flat)


def ends_evenly(flat: Mapping[str, Any]) -> bool:
    """Tell whether the reference ends at rest or at constant velocity."""
    return _ends_without(2, flat)


def _ends_without(derivative: int, flat: Mapping[str, Any]) -> bool:
    """Tell whether this derivative of the reference and all higher ones are zero at the end.

    The result is true if that holds for all stages.
    """
    rows = pieces(flat, int(np.max([np.size(value) for value in flat.values()])))
    return bool(np.all(at_rest(form_of(flat), rows[:, -1], derivative)))


def returns(flat: Mapping[str, Any]) -> bool:
    """Tell whether the references of all stages stop where they began."""
    return motion_of(flat).rests and not np.any(motion_of(flat).pieces(flat)[-1][1])


def last_corner(flat: Mapping[str, Any]) -> Any:
    """Return the time [s] of the reference's last corner; after it one formula holds."""
    return motion_of(flat).pieces(flat)[-1][0]


def last_part(share: float, ended: np.ndarray, corner: np.ndarray | float) -> np.ndarray:
    """Return the time [s], shape (runs,), at which the last part of each run begins.

    Runs end at `ended` [s], shape (runs,). The last part begins after the fraction `share` of a run, such as 0.75. If
    the last `corner` [s] of the reference is late, it begins after the fraction share - 0.25 of the time since then. A
    stage then has at least a quarter of that time to settle where the share is 0.5 or more.
    """
    late = np.where(corner < ended, corner, 0.0)
    return np.maximum(share * ended, late + (share - 0.25) * (ended - late))


def without_motion(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys without those of the motion."""
    return {key: value for key, value in flat.items() if not key.startswith("motion.")}


def standing(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a stage whose reference stands still from the start.

    It stands where the reference of the stage's own motion ends. The new motion is a step to that place. If the place
    is 0, it is a release over the length of the old motion, which sets the scales of the equations. A motion whose
    reference has a single piece is returned unchanged, even if that piece moves.
    """
    rows = motion_of(flat).pieces(flat)
    if len(rows) == 1:
        return dict(flat)
    end = rows[-1][1]
    if np.any(end):
        return {**without_motion(flat), "motion.kind": "step", "motion.size": end}
    return {**without_motion(flat), "motion.kind": "release", "motion.displacement": size(flat)}
