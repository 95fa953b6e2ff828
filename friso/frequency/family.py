"""A whole family of states at once: friction as an impedance between cart and ground, the masses computed once.

The mechanics without friction answer forces on stage and cart by g (2 x 2); a cart that feels the friction force
Z v turns them into g - g_c Z s g_c^T / (1 + Z s g_cc), a few operations for each member and frequency.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.frequency.friction import law_of, operating_point
from friso.frequency.loops import Drive, closed_poles
from friso.frequency.margins import frequencies, margins
from friso.frequency.members import Members, family, limit_cases
from friso.frequency.parts import REFERENCE, STAGE, VELOCITY, compensator, mechanics, plant
from friso.frequency.system import Complex

CHUNK = 256
"""Members that are computed together: their arrays then stay in the cache."""

POINTS, FEW = 250, 7
"""Frequencies at which all members are looked at, besides those about resonances, and the bias forces and speeds that
tell where these are."""

CLOSEST = 8
"""Members whose margin is computed exactly."""


@dataclass(frozen=True)
class Scan:
    """Members with the real part of their rightmost closed-loop pole `abscissa` [1/s] and the least distance of their
    loop from -1, `distance`, over frequencies, both of shape (members,)."""

    members: Members
    abscissa: np.ndarray
    distance: np.ndarray

    @property
    def stable(self) -> np.ndarray:
        return self.abscissa < 0

    def worst(self, among: np.ndarray | None = None) -> int:
        """The number of the worst (of those that `among` marks): the least stable if any is unstable, else the one
        whose loop comes closest to -1."""
        among = np.ones(len(self.members), bool) if among is None else among
        if not self.stable[among].all():
            return int(np.where(among, self.abscissa, -np.inf).argmax())
        return int(np.where(among, self.distance, np.inf).argmin())


def scan(flat: Mapping[str, Any], members: Members) -> Scan:
    """Stability of every member, and its modulus margin: on a grid of frequencies, and exactly for those that come
    closest to -1 there."""
    omega = grid(flat)
    abscissa = spectral_abscissa(flat, members)
    parts = (members[part] for part in _split(np.arange(len(members))))
    distance = np.concatenate(_side_by_side(lambda part: nearest(loops(flat, part, omega)), parts))
    for k in np.argsort(np.where(abscissa < 0, distance, np.inf))[:CLOSEST]:
        exact = margins(flat, members[k]).modulus_margin
        distance[k] = distance[k] if np.isnan(exact) else exact
    return Scan(members, abscissa, distance)


def nearest(loop: Complex) -> np.ndarray:
    """Least distance from -1 of loops over ascending frequencies, shape (..., k), joined by straight lines: (...)."""
    start, way = 1 + loop[..., :-1], np.diff(loop, axis=-1)
    length = np.maximum(np.abs(way) ** 2, np.finfo(float).tiny)
    along = np.clip(-(start * way.conj()).real / length, 0, 1)
    return np.abs(start + along * way).min(axis=-1)


def spectral_abscissa(flat: Mapping[str, Any], members: Members) -> np.ndarray:
    """Real part [1/s] of the rightmost closed-loop pole, shape (members,); `flat` may hold arrays of that shape."""
    drive, found = Drive.of(flat), np.empty(len(members))

    def rightmost(which: np.ndarray) -> None:
        own = {key: value[which] if np.ndim(value) else value for key, value in flat.items()}
        found[which] = closed_poles(own, members[which], drive).real.max(axis=1)

    numbers = (np.flatnonzero(mask) for mask in (members.stuck, ~members.stuck))
    _side_by_side(rightmost, [part for each in numbers for part in _split(each)])
    return found


def grid(flat: Mapping[str, Any]) -> np.ndarray:
    """Angular frequencies [rad/s] that show the limit cases of a stage."""
    return frequencies(closed_in_cases(flat), modes(flat, family(flat, FEW, FEW)), Drive.of(flat).highest, POINTS)


def closed_in_cases(flat: Mapping[str, Any]) -> Complex:
    """Finite poles [rad/s] of the closed loop in all limit cases."""
    drive = Drive.of(flat)
    poles = np.concatenate([closed_poles(flat, one, drive).ravel() for one in limit_cases(flat).values()])
    return poles[np.isfinite(poles)]


def modes(flat: Mapping[str, Any], members: Members) -> Complex:
    """Poles [rad/s] of the plant in all these states."""
    groups = [members[mask] for mask in (members.stuck, ~members.stuck) if mask.any()]
    return np.concatenate([np.linalg.eigvals(plant(flat, each).a).ravel() for each in groups]).astype(complex)


def plants(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """Stage position over actuator force [m/N], complex, shape (members, k), at angular frequencies (k,) [rad/s]."""
    s = 1j * omega
    sides = np.unique(members.touched)
    free = mechanics(flat, sides).at(s)  # (sides, k, 2, 2)
    g = free[np.searchsorted(sides, members.touched)]
    drag = s * impedance(flat, members, s)
    return g[..., 0, 0] - g[..., 0, 1] * drag * g[..., 1, 0] / (1 + drag * g[..., 1, 1])


def loops(flat: Mapping[str, Any], members: Members, omega: np.ndarray) -> Complex:
    """L, shape (members, k); of a sampled loop but for the aliases of the plant."""
    drive = Drive.of(flat)
    return plants(flat, members, omega) * controller(flat, omega) * drive.answer(omega)


def controller(flat: Mapping[str, Any], omega: np.ndarray) -> Complex:
    """Force over a deviation of the stage from its reference [N/m], its sign reversed, shape (k,)."""
    s = Drive.of(flat).laplace(omega)
    answers = compensator(flat, 1).take((STAGE, VELOCITY, REFERENCE), ("force",)).at(s)[0, :, 0]
    return -(answers[:, 0] + 1j * omega * answers[:, 1])


def impedance(flat: Mapping[str, Any], members: Members, s: np.ndarray) -> Complex:
    """Friction force over velocity of the cart [N s/m], shape (members, k), at the complex frequencies s (k,)."""
    law = law_of(flat)
    if law is None:
        return np.zeros((len(members), len(s)), complex)
    velocity = np.where(members.forward, members.speed, -members.speed)
    own = law.declared.at({**flat, **operating_point(flat, members), "velocity": velocity}, len(members))
    total = np.broadcast_to(own.d[:, 0], (len(members), len(s))).astype(complex)
    if law.states:
        values, vectors = np.linalg.eig(own.a)
        residues = (own.c @ vectors)[:, 0] * np.linalg.solve(vectors, own.b.astype(complex))[..., 0]
        for k in range(len(law.states)):
            total += residues[:, k, None] / (s - values[:, k, None])
    return total


def _split(numbers: np.ndarray) -> list[np.ndarray]:
    return np.array_split(numbers, -(-len(numbers) // CHUNK)) if len(numbers) else []


def _side_by_side(work: Callable[[Any], Any], parts: Any) -> list[Any]:
    """The work on every part, in threads: NumPy lets go of the interpreter's lock in its loops."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return list(pool.map(work, parts))
