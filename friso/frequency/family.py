"""Analyse a family of states of a stage: stuck under any bias force, sliding at any speed.

Friction is an impedance between cart and ground, and the masses are computed once. The masses without friction respond
to forces on stage and cart by g (2 x 2), and by h with the cart held. With the dynamic stiffness k = s Z of friction on
the cart, the stage responds by (g_ss + k g_cc h)/(1 + k g_cc). No large numbers are subtracted, and each member (state)
and frequency takes a few operations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.equations.structure import shared_structure
from friso.frequency.loops import Poles, controller_over_period, poles, samples_controller
from friso.frequency.margins import frequencies, margins
from friso.frequency.members import Members, law_of, limit_cases
from friso.frequency.parts import (
    FORCE,
    RATED,
    STAGE,
    VELOCITY,
    cart_states,
    compensator,
    mechanics,
    operating_point,
    plant,
)
from friso.frequency.settings import settings
from friso.frequency.system import Complex, DriveTiming, System

_T = TypeVar("_T")


BESIDE_RESONANCE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Frequencies about a closed-loop resonance at which it is evaluated, in half widths."""


@dataclass(frozen=True)
class Scan:
    """Stability of a stage in many states, its members, as arrays of shape (members,).

    `flat` has the stage's keys in SI. Modulus margins are computed on first use.
    """

    flat: Mapping[str, Any]
    members: Members
    by_poles: PoleStability

    @property
    def abscissa(self) -> np.ndarray:
        """Return the real part [1/s] of the rightmost closed-loop pole in each state, (members,)."""
        return self.by_poles.abscissa

    @property
    def stable(self) -> np.ndarray:
        """Return in which states the stage is stable, shape (members,)."""
        return self.abscissa < 0

    @cached_property
    def distance(self) -> np.ndarray:
        """Return the least distance of the loop from -1 in each state, shape (members,).

        It is computed at common frequencies and near each state's closed-loop resonances. For the states that come
        closest to -1 it is exact.
        """
        omega = frequency_grid(self.flat, settings.family_density)

        def shared(which: np.ndarray) -> np.ndarray:
            return distance_to_lines(loops(self.flat, self.members[which], omega))

        parts = _split(np.arange(len(self.members)))
        distance = np.concatenate(side_by_side([partial(shared, part) for part in parts]))
        distance = np.minimum(distance, self.by_poles.resonant)
        for k in np.argsort(np.where(self.stable, distance, np.inf))[: settings.closest_members]:
            exact = margins(self.flat, self.members[k]).modulus_margin
            distance[k] = distance[k] if np.isnan(exact) else exact
        return distance

    def worst(self, among: np.ndarray | None = None) -> int:
        """Return the index of the worst state: the least stable, or the one closest to -1.

        `among` marks the states to consider; None stands for all.
        """
        among = np.ones(len(self.members), bool) if among is None else among
        if not self.stable[among].all():
            return int(np.where(among, self.abscissa, -np.inf).argmax())
        return int(np.where(among, self.distance, np.inf).argmin())


def scan_stability(flat: Mapping[str, Any], members: Members) -> Scan:
    """Return the stability of a stage in every state of `members`, with modulus margins."""
    return Scan(flat, members, stability_by_poles(flat, members))


class PoleStability(NamedTuple):
    """Stability of a stage in many states by its closed-loop poles, both of shape (members,).

    `abscissa` is the real part of the rightmost pole [1/s], 0 on the edge of stability; `resonant` is the least abs(1 +
    L) about closed-loop resonances.
    """

    abscissa: np.ndarray
    resonant: np.ndarray


def stability_by_poles(flat: Mapping[str, Any], members: Members) -> PoleStability:
    """Return the stability of a stage in every state of `members`, by its closed-loop poles.

    `flat` has its keys in SI, which may be arrays of shape (members,), except the drive's.
    """
    by_poles = PoleStability(np.empty(len(members)), np.empty(len(members)))

    def look(part: Poles) -> PoleStability:
        distance = part.distance(np.nan_to_num(omega := about_resonances(part), nan=1.0))
        return PoleStability(part.abscissa, np.where(np.isnan(omega), np.inf, distance).min(axis=1))

    for which, looked in for_poles(flat, members, look):
        by_poles.abscissa[which], by_poles.resonant[which] = looked
    return by_poles


def for_poles(
    flat: Mapping[str, Any], members: Members, function: Callable[[Poles], _T]
) -> list[tuple[np.ndarray, _T]]:
    """Apply a function to the poles of a stage in many states, a few states at a time.

    Returns pairs of the states' numbers and the function's result. `flat` has the keys in SI, which may be arrays of
    shape (members,), except the drive's.
    """
    drive = DriveTiming.of(flat)

    def of_part(which: np.ndarray) -> tuple[np.ndarray, _T]:
        keys = {key: value[which] if np.ndim(value) else value for key, value in flat.items()}
        return which, function(poles(keys, members[which], drive))

    numbers = (np.flatnonzero(mask) for mask in (members.stuck, ~members.stuck))
    return side_by_side([partial(of_part, part) for numbers_of_kind in numbers for part in _split(numbers_of_kind)])


def spectral_abscissa(flat: Mapping[str, Any], members: Members) -> np.ndarray:
    """Return the real part [1/s] of the rightmost closed-loop pole, shape (members,).

    It is 0 on the edge of stability.
    """
    return stability_by_poles(flat, members).abscissa


def about_resonances(system: Poles) -> np.ndarray:
    """Return angular frequencies [rad/s] about each state's lightly damped closed-loop poles.

    The shape is (members, k), with NaN for states that have fewer. With loops at several rates all are NaN, because the
    poles do not show which alias resonates.
    """
    if system.drive.period > 1:  # its poles do not show which alias resonates
        return np.full((len(system.closed), 1), np.nan)
    closed = system.in_s
    light = (closed.imag > 0) & (np.abs(closed.real) < settings.light_damping * closed.imag)
    omega = (
        np.where(light, closed.imag, np.nan)[:, :, None]
        + BESIDE_RESONANCE * np.where(light, closed.real, np.nan)[:, :, None]
    )
    return np.clip(omega, 0, system.drive.highest).reshape(len(closed), -1)


def distance_to_lines(loop: Complex) -> np.ndarray:
    """Return the least distance of loops from -1, shape (...).

    Loops are given over ascending frequencies, shape (..., k), and joined by straight lines.
    """
    start, step = 1 + loop[..., :-1], np.diff(loop, axis=-1)
    length = np.maximum(np.abs(step) ** 2, np.finfo(float).tiny)
    along = np.clip(-(start * step.conj()).real / length, 0, 1)
    return np.abs(start + along * step).min(axis=-1)


def frequency_grid(flat: Mapping[str, Any], density: float) -> np.ndarray:
    """Return angular frequencies [rad/s] that resolve the loops in all limit cases, (k,).

    There are `density` per decade, and more about the resonances of plant and closed loop.
    """
    cases = Members.joined(limit_cases(flat).values())
    return frequencies(
        flat, cases, DriveTiming.of(flat), density, [plant_poles(flat, cases), closed_loop_poles(flat, cases)]
    )


def closed_loop_poles(flat: Mapping[str, Any], members: Members) -> Complex:
    """Return the finite closed-loop poles [rad/s] of a stage in all states of `members`, (n,)."""
    drive = DriveTiming.of(flat)
    roots = np.concatenate([poles(flat, kind, drive).in_s.ravel() for kind in members.kinds])
    return roots[np.isfinite(roots)]


def plant_poles(flat: Mapping[str, Any], members: Members) -> Complex:
    """Return the poles [rad/s] of the plant in all states of `members`, shape (n,)."""
    return np.concatenate([np.linalg.eigvals(plant(flat, kind).a).ravel() for kind in members.kinds]).astype(complex)


def plants(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return stage position over actuator force [m/N], complex, shape (members, k).

    `omega` (k,) are angular frequencies [rad/s].
    """
    s = 1j * omega
    sides = np.unique(members.touched)
    side = np.searchsorted(sides, members.touched)
    masses = mechanics(flat, sides)
    g, held = masses.at(s)[side], _cart_held(flat, masses, s)[side]
    pushed = s * impedance(flat, members, s) * g[..., 1, 1]
    return (g[..., 0, 0] + pushed * held) / (1 + pushed)


def _cart_held(flat: Mapping[str, Any], masses: System, s: np.ndarray) -> Complex:
    """Return stage position over force [m/N] while the cart is held, shape (members, k).

    `masses` are the masses without friction, and `s`, shape (k,), complex frequencies [rad/s]. The result is 0 if cart
    and stage are one.
    """
    if shared_structure(flat).joint == "rigid":
        return np.zeros((len(masses.a), len(s)), complex)
    cart = cart_states(flat)
    held = [i for i, name in enumerate(masses.states) if name not in cart]
    return masses.keep(held).at(s)[..., 0, 0]


def loops(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return the loops L in each state at angular frequencies [rad/s], shape (members, k).

    A sampled loop is taken without the aliases of the plant.
    """
    return bare_loops(flat, members, omega)(flat) * DriveTiming.of(flat).transfer(omega)


def bare_loops(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Callable[[Mapping[str, Any]], Complex]:
    """Return a function from a stage's keys to its loops L without hold, delay, current loop.

    The keys may have any controller. L has the shape (members, k) over angular frequencies (k,) [rad/s]. Parts that do
    not depend on the controller are computed once.
    """
    if shared_structure(flat).transmission is None:
        bare = plants(flat, members, omega)
        return lambda keys: bare * controller_response(keys, omega)
    seen = _measured_compliance(flat, members, omega)
    return lambda keys: (seen * _channels(keys, omega)).sum(axis=-1)


def _measured_compliance(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Return the measured signals over the force, shape (members, k, 2), from the whole plant.

    They are position [m/N] and velocity [m/(N s)]; for a sampled drive, the second is the position that it
    differentiates [m/N]. Encoders may be on different sides of a transmission. `members` are states of the stage.
    """
    second = RATED if DriveTiming.of(flat).sample_time else VELOCITY
    answers = np.empty((len(members), len(omega), 2), complex)
    for mask in (members.stuck, ~members.stuck):
        for part in np.array_split(np.flatnonzero(mask), -(-int(mask.sum()) // settings.members_solved_whole) or 1):
            machine = plant(flat, members[part]).take((FORCE,), (STAGE, second)) if len(part) else None
            if machine is not None:
                answers[part] = machine.at(1j * omega)[..., 0]
    return answers


def controller_response(flat: Mapping[str, Any], omega: np.ndarray) -> Complex:
    """Return the controller's force over a deviation of the stage [N/m], sign reversed, (k,).

    `omega` (k,) are angular frequencies [rad/s].
    """
    position, second = _channels(flat, omega).T
    return position + (second if DriveTiming.of(flat).sample_time else 1j * omega * second)


def _channels(flat: Mapping[str, Any], omega: np.ndarray) -> Complex:
    """Return the controller's force over each measured signal, sign reversed, shape (k, 2).

    The signals are position [N/m] and velocity [N s/m], or two positions for a sampled drive. With loops at several
    rates, the part at the frequency of the input counts.
    """
    drive = DriveTiming.of(flat)
    if drive.sample_time:
        controls, turn = samples_controller(flat, 1, drive.period), omega * drive.sample_time
        if drive.period == 1:
            return -controls[0].at(np.exp(1j * turn))[0, :, 0]
        lifted = (controller_over_period(controls, measured) for measured in (STAGE, RATED))
        return -np.stack([channel.fundamental(turn)[0] for channel in lifted], axis=1)
    return -compensator(flat, 1).take((STAGE, VELOCITY), (FORCE,)).at(1j * omega)[0, :, 0]


def impedance(flat: Mapping[str, Any], members: Members, s: np.ndarray) -> Complex:
    """Return the friction force over the cart's velocity [N s/m], shape (members, k).

    `members` are states of the stage, and `s` complex frequencies [rad/s], shape (k,).
    """
    law = law_of(flat)
    if law is None:
        return np.zeros((len(members), len(s)), complex)
    velocity = np.where(members.forward, members.speed, -members.speed)
    system = law.declared.at({**flat, **operating_point(flat, members), "velocity": velocity}, len(members))
    total = np.broadcast_to(system.d[:, 0], (len(members), len(s))).astype(complex)
    if law.states:
        values, vectors = np.linalg.eig(system.a)
        residues = (system.c @ vectors)[:, 0] * np.linalg.solve(vectors, system.b.astype(complex))[..., 0]
        for k in range(len(law.states)):
            total += residues[:, k, None] / (s - values[:, k, None])
    return total


def _split(numbers: np.ndarray) -> list[np.ndarray]:
    return np.array_split(numbers, -(-len(numbers) // settings.members_together)) if len(numbers) else []
