"""A virgin curve that was measured: points of force over displacement from rest, in place of what a law says."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression

from friso.axis import AxisKind
from friso.equations.friction.measured import MeasuredFriction, virgin_displacements
from friso.errors import InputError
from friso.identification.logs.read import read_table
from friso.identification.logs.units import unit_factor

EXAMPLE = "displacement [um],force [N]"
"""Heading of a file with such a curve."""

LEAST, MOST, REACHES = 3, 2000, 0.9
"""Points at least and at most, and the share of static friction up to which they have to go at least."""

NEAR = 1e-6
"""Share of the last displacement within which there are no two points, so that slopes can be told."""


def read_virgin_curve(path: str | os.PathLike[str], kind: AxisKind) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] from rest and force [N], both of shape (n,), of a file of any log format with one channel of
    each, by their units on such an axis. Raises InputError, LogError for a file that holds none."""
    channels = read_table(Path(path)).channels
    displacement, force = (
        _channel(path, [(c.values, unit_factor(c.unit, unit)) for c in channels if c.unit], unit)
        for unit in (kind.length, kind.force)
    )
    if displacement.shape != force.shape or len(force) < LEAST:
        raise _refused(path, f"{len(displacement)} displacements and {len(force)} forces", f"{LEAST} points or more")
    if not (np.isfinite(displacement).all() and np.isfinite(force).all()):
        raise _refused(path, "a point that is no number", "numbers in every row")
    if displacement[0] < 0 or np.any(np.diff(displacement) <= 0):
        raise _refused(path, "displacements that do not increase", "displacements from rest (0) on, each larger")
    if len(force) > MOST:
        raise _refused(path, f"{len(force)} points", f"at most {MOST}: thin them out")
    if force[-1] <= max(force[0], 0.0) or force.min() < 0:
        raise _refused(path, "a force that does not rise", "the force that opposes the displacement, positive")
    return displacement, force


def _channel(path: str | os.PathLike[str], candidates: list[tuple[np.ndarray, float | None]], unit: str) -> np.ndarray:
    """The one channel that can be turned into this unit, in it."""
    in_unit = [values * factor for values, factor in candidates if factor is not None]
    if len(in_unit) != 1:
        raise _refused(
            path, f"{len(in_unit)} channels in {unit} or a part of it", f"one channel in {unit}, with its unit"
        )
    return in_unit[0]


def _refused(path: str | os.PathLike[str], actual: str, expected: str) -> InputError:
    return InputError("--virgin", f"{path}: {actual}", expected, f"a file that begins with: {EXAMPLE}")


def with_virgin_curve(measured: MeasuredFriction, displacement: np.ndarray, force: np.ndarray) -> MeasuredFriction:
    """The same with the points [m, N], both of shape (n,), as its virgin curve: straight between them, concave as
    springs that slip one after the other are (the nearest such curve, by least squares of the slopes), and level where
    it has reached static friction. Raises InputError for points that contradict static friction."""
    static = measured.levels.static
    if not REACHES * static <= force.max() <= static / REACHES:
        actual = f"points up to {force.max():.4g}, where friction.static is {static:.4g} (SI)"
        raise InputError("--virgin", actual, "points up to break-away", '--set friction.static="3 N"')
    if displacement[0] > 0:
        displacement, force = np.append(0.0, displacement), np.append(0.0, force)
    way = np.diff(displacement)
    slopes = np.maximum(isotonic_regression(np.diff(force) / way, weights=way, increasing=False).x, 0.0)
    risen = np.append(0.0, np.cumsum(slopes * way))
    stiffness, last = float(slopes[0]), float(slopes[slopes > 0][-1])
    reach = displacement[-1] + max(static - risen[-1], 0.0) / last  # goes on as it ends
    points, risen = np.append(displacement, reach), np.append(risen, max(static, risen[-1]))
    between = virgin_displacements(static, stiffness)
    near = np.abs(between[:, None] - points).min(axis=1) < NEAR * points[-1]
    dense = np.union1d(between[~near], points)
    curve = np.minimum(np.interp(dense, points, risen), static)
    return replace(measured, stiffness=stiffness, displacement=dense, force=curve)
