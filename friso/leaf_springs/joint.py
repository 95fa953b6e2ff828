"""Derive joint stiffness and parasitic mode of the equations of motion from leaf springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.leaf_springs import closed_forms
from friso.leaf_springs.mechanism import Mechanism, along_motion
from friso.leaf_springs.settings import settings
from friso.stage.flexure import register_derivation


@register_derivation("flexure")
def joint_keys(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return `joint.stiffness` and the keys of [parasitic] for leaf springs in closed form.

    Raises InputError if a single mechanism buckles under its load.
    """
    with np.errstate(all="ignore"):  # the rules of the stage file find numbers that make no mechanism
        mechanism = Mechanism.of(flat)
        frequency, share = parasitic_mode(mechanism)
        stiffness, buckling = closed_forms.loaded_drive_stiffness(mechanism), closed_forms.buckling_load(mechanism)
    if np.ndim(stiffness) == 0 and mechanism.load >= buckling > 0:
        expected = f"less than the buckling load of the leaves, {float(buckling):.4g} N"
        example = f'load = "{float(buckling) / 3:.2g} N"'
        raise InputError("flexure.load", f"{float(mechanism.load):.4g} N", expected, example)
    keys = {
        "joint.stiffness": stiffness,
        "parasitic.frequency": frequency,
        "parasitic.mass": share / (1 + share) * mechanism.body.mass,
        "parasitic.damping_ratio": mechanism.damping_ratio,
    }
    return {key: value if np.ndim(value) else float(value) for key, value in keys.items()}


@dataclass(frozen=True)
class VisibleModes:
    """All modes of mechanisms except their drive mode, as arrays of shape (..., 7).

    `frequency` is in Hz; `residue` is the residue times the mass of the stage, positive where actuator and sensor move
    in phase. Residues are 0 at the drive mode. `visible` marks the modes that actuator and sensor both see.
    """

    frequency: np.ndarray
    residue: np.ndarray
    visible: np.ndarray

    @classmethod
    def of(cls, mechanism: Mechanism) -> VisibleModes:
        """Compute the modes by closed forms, and decide which of them are visible."""
        frequency, shapes = closed_forms.modes(mechanism)
        pushed, measured = (along_motion(mechanism, at, shapes) for at in (mechanism.actuation, mechanism.sensor))
        internal = np.arange(7) != closed_forms.drive_mode(frequency, shapes)[..., None]
        residue = np.where(internal, pushed * measured * np.asarray(mechanism.body.mass)[..., None], 0.0)
        least = settings.visible_peak * 2 * np.asarray(mechanism.damping_ratio)[..., None]
        return cls(frequency, residue, np.abs(residue) > least)

    def at(self, mode: np.ndarray) -> tuple[Any, Any]:
        """Return frequency [Hz] and residue of the mode with number `mode`, all of shape (...).

        For a mechanism without any visible mode the frequency is infinite and the residue 0.
        """
        both = ((self.frequency, np.inf), (self.residue, 0.0))
        visible, at = self.visible.any(axis=-1), mode[..., None]
        frequency, residue = (
            np.where(visible, np.take_along_axis(quantity, at, axis=-1)[..., 0], none)[()] for quantity, none in both
        )
        return frequency, residue


def first_interfering(mechanism: Mechanism) -> Any:
    """Return the frequency [Hz] of the lowest mode that disturbs control; infinite without one.

    Actuator and sensor both see the mode, and it is not the drive mode.
    """
    visible = VisibleModes.of(mechanism)
    return visible.at(np.argmin(np.where(visible.visible, visible.frequency, np.inf), axis=-1))[0]


def parasitic_mode(mechanism: Mechanism) -> tuple[Any, Any]:
    """Return frequency [Hz] and residue of the mode whose resonance stands highest in the plant.

    Residues are multiplied by the stage's mass. The mode has the largest residue over the square of its frequency. If
    no mode is visible, the leaves' own mode is returned with the least residue that the equations allow.

    In the equations, a part m_p of the stage's mass m moves on a spring, which gives the residue m_p/(m (m - m_p)). It
    is never negative. If actuator and sensor move against each other, only the size of the residue counts.
    """
    visible = VisibleModes.of(mechanism)
    height = np.where(visible.visible, np.abs(visible.residue), 0.0) / np.maximum(visible.frequency, 1e-9) ** 2
    frequency, residue = visible.at(np.argmax(height, axis=-1))
    leaves = closed_forms.leaf_bending(mechanism)
    size = np.maximum(np.abs(residue), settings.least_residue)
    return np.where(np.isfinite(frequency), frequency, leaves)[()], size[()]
