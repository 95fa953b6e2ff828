"""Doubt: a force that varies along the way, such as cogging, a cable or a slope, passes for friction and mass."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.settings import doubt_settings


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name a force that varies along the way, with its pitch, if it explains most of the residual."""
    effect = case.led_by("cogging")
    if effect is None:
        return
    parts = zip(effect.explained.sizes, effect.tried.forces, strict=True)
    size = float(np.ptp(sum(share * force for share, force in parts)))
    pitch = effect.tried.label
    every = f", every {pitch * 1e3:.3g} mm, as cogging does" if np.isfinite(pitch) else ""
    words = (
        f"A force along the way differs from place to place by {size:.2g} {case.unit}{every}: no stage file has one, "
        "and the intervals allow for it; slow passes to and fro over the same way would show it"
    )
    yield case.named_along(effect, words, size)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield forces at several places along the way, then one sine with the best-fitting pitch."""
    problem = case.fit.problem
    position, counted = case.log["position"][case.log.longest], problem.counted > 0
    travel = float(np.ptp(position))
    unit = doubt_settings.friction_share_of_a_tried_force * float(np.std(case.log["force"][case.log.longest]))
    along = places_along(position)
    yield TriedForces(along, [unit] * len(along))
    rest = case.fit.residual[counted]
    low, high = doubt_settings.travels_of_a_pitch
    pitches = travel / np.linspace(low, high, 1 + round(doubt_settings.pitches_for_each_travel * (high - low)))
    explained = [_explained_by(position[counted], pitch, rest) for pitch in pitches]
    pitch = float(pitches[int(np.argmax(explained))])
    yield TriedForces(_waves(position, pitch), [unit] * 2, pitch, len(pitches))


def places_along(position: np.ndarray) -> list[np.ndarray]:
    """Return a triangular function of position for each of several places, (n,), minus its mean.

    `position` [m] has the shape (n,). A function is 1 at its place, and 0 from the neighbouring places on. The first
    place has none.
    """
    nodes = np.linspace(position.min(), position.max(), doubt_settings.places_of_a_force_along)
    near = np.maximum(1 - np.abs(position - nodes[:, None]) / (nodes[1] - nodes[0]), 0.0)
    return [column - column.mean() for column in near[1:]]


def _waves(position: np.ndarray, pitch: float) -> list[np.ndarray]:
    """Return sine and cosine of a position [m] with a pitch [m], each of shape (n,)."""
    angle = 2 * np.pi * position / pitch
    return [np.sin(angle), np.cos(angle)]


def _explained_by(position: np.ndarray, pitch: float, rest: np.ndarray) -> float:
    """Return the power [N^2] of a residual force that a sine with a pitch [m] explains.

    `position` [m] and the residual `rest` [N] have the shape (n,). The constant part of the force does not count.
    """
    columns = np.stack([*_waves(position, pitch), np.ones(len(rest))], axis=1)
    solution = np.linalg.lstsq(columns, rest, rcond=None)[0]
    return float(np.var(columns @ solution))


DOUBT = Doubt(
    "fit",
    find,
    "a force at places along the way, and one that repeats along it",
    "intervals widen; bristles are refused",
    "slow passes to and fro over the same way",
    after=("friction-by-direction",),
    forces=forces,
    places=True,
)
