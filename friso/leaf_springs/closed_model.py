"""Evaluate one mechanism at a stroke by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.leaf_springs import closed_forms
from friso.leaf_springs.closed_forms import CLAMPED
from friso.leaf_springs.curved import stage_stiffness_at
from friso.leaf_springs.evaluation import Evaluation, Mode, peak_of
from friso.leaf_springs.mechanism import Mechanism, along_motion
from friso.leaf_springs.naming import mode_name
from friso.leaf_springs.settings import settings


def closed_form_model(mechanism: Mechanism, stroke: float) -> Evaluation:
    """Evaluate the mechanism by closed forms over its stroke [m].

    The drive stiffness is equal at all deflections.
    """
    deflections = np.linspace(0.0, stroke, settings.closed_deflections)
    drive = closed_forms.drive_stiffness(mechanism) * np.ones(settings.closed_deflections)
    return Evaluation(
        model="closed forms",
        mechanism=mechanism,
        deflections=deflections,
        forces=drive * deflections,
        drive=drive,
        support_x=closed_forms.support_x(mechanism, deflections),
        support_y=closed_forms.support_y(mechanism, deflections),
        stiffness=np.array([stage_stiffness_at(mechanism, deflection) for deflection in (0.0, stroke)]),
        modes=_modes(mechanism),
        stress=float(closed_forms.max_stress(mechanism, stroke)),
        shortening=float(closed_forms.shortening(mechanism, stroke)),
        buckling=float(closed_forms.buckling_load(mechanism)),
    )


def _modes(mechanism: Mechanism) -> tuple[Mode, ...]:
    """Return the modes of stage and leaves by closed forms.

    In some modes the leaves bend in phase with the stage; in the others they move while the stage is at rest.
    """
    frequencies, shapes = closed_forms.modes(mechanism)
    drive = int(closed_forms.drive_mode(frequencies, shapes))
    first = replace(_mode(mechanism, frequencies[drive], shapes[:, drive]), name="drive")
    others = [_mode(mechanism, frequencies[k], shapes[:, k]) for k in range(7) if k != drive]
    return (first, *sorted([*others, *_unlike(mechanism), _torsion_mode(mechanism)], key=lambda mode: mode.frequency))


def _mode(mechanism: Mechanism, frequency: float, shape: np.ndarray) -> Mode:
    """Build a mode from its frequency [Hz] and its shape at unit modal mass, (7,).

    The shape has the stage's six coordinates, then the bending of the leaves.
    """
    stage, leaves = shape[:6], following(mechanism, shape[:6])
    leaves[:, :, 2] += shape[6] / np.sqrt(mechanism.leaves * mechanism.leaf_mass) * _clamped_shape()
    actuator, sensor = (
        float(along_motion(mechanism, point, stage[:, None])[0]) for point in (mechanism.actuation, mechanism.sensor)
    )
    arm = np.array(mechanism.body.centre) - np.array([mechanism.length, 0.0, 0.0])
    name = mode_name(stage, mechanism.body.mass, np.array(mechanism.body.inertia), arm, leaves, mechanism.leaf_mass)
    return Mode(name, float(frequency), actuator, sensor, peak_of(mechanism, actuator, sensor), stage, leaves)


def following(mechanism: Mechanism, stage: np.ndarray) -> np.ndarray:
    """Return how the leaves' middle lines follow a motion of the stage, (leaves, POINTS, 3).

    The motion has shape (6,), and the leaves follow statically.
    """
    s = np.linspace(0.0, 1.0, settings.mode_shape_points)
    by_place, by_slope = 3 * s**2 - 2 * s**3, mechanism.length * (s**3 - s**2)
    x, y, z, turn_x, turn_y, turn_z = stage
    return np.array(
        [
            np.stack(
                [
                    (x + turn_y * offset) * s,
                    (y - turn_x * offset) * by_place + turn_z * by_slope,
                    z * by_place - turn_y * by_slope,
                ],
                axis=1,
            )
            for offset in mechanism.offsets
        ]
    )


def _unlike(mechanism: Mechanism) -> list[Mode]:
    """Return the modes in which the leaves bend against each other, with the stage at rest."""
    count, leaf_mass = int(mechanism.leaves), float(mechanism.leaf_mass)
    modes = []
    for k in range(1, count):
        wave = np.cos(np.pi * k * (np.arange(count) + 0.5) / count)  # patterns of the leaves, orthogonal to each other
        leaves = np.zeros((count, settings.mode_shape_points, 3))
        leaves[:, :, 2] = wave[:, None] * _clamped_shape() / np.sqrt(leaf_mass * np.sum(wave**2))
        frequency = float(closed_forms.leaf_bending(mechanism))
        modes.append(Mode("leaf bending, out of phase", frequency, 0.0, 0.0, 0.0, np.zeros(6), leaves))
    return modes


def _clamped_shape() -> np.ndarray:
    """Return the first bending mode of a clamped beam at even places, with mean square 1."""
    x = CLAMPED * np.linspace(0.0, 1.0, settings.mode_shape_points)
    ratio = (np.cosh(CLAMPED) - np.cos(CLAMPED)) / (np.sinh(CLAMPED) - np.sin(CLAMPED))
    return np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))


def _torsion_mode(mechanism: Mechanism) -> Mode:
    """Return the first torsional mode of the leaves, whose middle lines stay at rest."""
    leaves = np.zeros((int(mechanism.leaves), settings.mode_shape_points, 3))
    return Mode("leaf torsion", float(closed_forms.leaf_torsion(mechanism)), 0.0, 0.0, 0.0, np.zeros(6), leaves)
