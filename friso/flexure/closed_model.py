"""The closed forms as a model of one mechanism at a stroke."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.flexure import closed_forms
from friso.flexure.closed_forms import CLAMPED
from friso.flexure.curved import stage_stiffness_at
from friso.flexure.evaluation import Evaluation, Mode, peak_of
from friso.flexure.mechanism import Mechanism, along_motion
from friso.flexure.naming import mode_name

POINTS = 17
"""Places along a leaf at which its modes are told."""

STEPS = 5
"""Deflections from 0 to the stroke."""


def closed(mechanism: Mechanism, stroke: float) -> Evaluation:
    """The mechanism by closed forms: its drive stiffness is the same at any deflection."""
    deflections = np.linspace(0.0, stroke, STEPS)
    drive = closed_forms.drive_stiffness(mechanism) * np.ones(STEPS)
    return Evaluation(
        model="closed forms",
        mechanism=mechanism,
        deflections=deflections,
        forces=drive * deflections,
        drive=drive,
        support_x=closed_forms.support_x(mechanism, deflections),
        support_y=closed_forms.support_y(mechanism, deflections),
        stiffness=np.array([stage_stiffness_at(mechanism, each) for each in (0.0, stroke)]),
        modes=_modes(mechanism),
        stress=float(closed_forms.max_stress(mechanism, stroke)),
        shortening=float(closed_forms.shortening(mechanism, stroke)),
        buckling=float(closed_forms.buckling_load(mechanism)),
    )


def _modes(it: Mechanism) -> tuple[Mode, ...]:
    """Those of the stage on leaves that follow it, and the first bending modes and torsion of the leaves."""
    frequencies, shapes = closed_forms.stage_modes(it)
    drive = int(closed_forms.drive_mode(shapes))
    first = replace(_stage_mode(it, frequencies[drive], shapes[:, drive]), name="drive")
    others = [_stage_mode(it, frequencies[k], shapes[:, k]) for k in range(6) if k != drive]
    return (first, *sorted([*others, *_bending_modes(it), _torsion_mode(it)], key=lambda mode: mode.frequency))


def _stage_mode(it: Mechanism, frequency: float, shape: np.ndarray) -> Mode:
    leaves = following(it, shape)
    actuator, sensor = (float(along_motion(it, point, shape[:, None])[0]) for point in (it.actuation, it.sensor))
    arm = np.array(it.body.centre) - np.array([it.length, 0.0, 0.0])
    name = mode_name(shape, it.body.mass, np.array(it.body.inertia), arm, leaves, it.leaf_mass)
    return Mode(name, float(frequency), actuator, sensor, peak_of(it, actuator, sensor), shape, leaves)


def following(it: Mechanism, stage: np.ndarray) -> np.ndarray:
    """How the middle lines of the leaves move with the stage (6,), statically, shape (leaves, POINTS, 3)."""
    s = np.linspace(0.0, 1.0, POINTS)
    by_place, by_slope = 3 * s**2 - 2 * s**3, it.length * (s**3 - s**2)
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
            for offset in it.offsets
        ]
    )


def _bending_modes(it: Mechanism) -> list[Mode]:
    """The first bending mode of the leaves: all alike, against the stage, and as often again with the stage at rest."""
    count, own = int(it.leaves), float(it.leaf_mass)
    shape = _clamped_shape(np.linspace(0.0, 1.0, POINTS))
    frequency, share = float(closed_forms.leaf_bending(it)), float(closed_forms.leaf_participation(it))
    modes = []
    for k in range(count):
        wave = np.cos(np.pi * k * (np.arange(count) + 0.5) / count)  # orthogonal patterns, the first all alike
        leaves = np.zeros((count, POINTS, 3))
        leaves[:, :, 2] = wave[:, None] * shape / np.sqrt(own * np.sum(wave**2))
        stage = np.zeros(6)
        stage[2] = -np.sqrt(share / it.body.mass) if k == 0 else 0.0
        at = float(stage[2])
        own_frequency = frequency * np.sqrt(1 + share) if k == 0 else frequency
        name = "leaf bending, in phase" if k == 0 else "leaf bending, out of phase"
        modes.append(Mode(name, own_frequency, at, at, peak_of(it, at, at), stage, leaves + following(it, stage)))
    return modes


def _clamped_shape(s: np.ndarray) -> np.ndarray:
    """First bending mode of a beam between clamps, its mean square 1."""
    x = CLAMPED * s
    ratio = (np.cosh(CLAMPED) - np.cos(CLAMPED)) / (np.sinh(CLAMPED) - np.sin(CLAMPED))
    return np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))


def _torsion_mode(it: Mechanism) -> Mode:
    """The first torsion of the leaves, whose middle lines stay at rest."""
    leaves = np.zeros((int(it.leaves), POINTS, 3))
    return Mode("leaf torsion", float(closed_forms.leaf_torsion(it)), 0.0, 0.0, 0.0, np.zeros(6), leaves)
