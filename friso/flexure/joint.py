"""What the leaf springs of a stage are to its equations of motion: stiffness of the joint and parasitic mode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.flexure import closed_forms
from friso.flexure.evaluation import VISIBLE
from friso.flexure.mechanism import Mechanism, along_motion
from friso.quantities import StageError
from friso.stage.flexure import register_derivation


@register_derivation("flexure")
def joint_keys(flat: Mapping[str, Any]) -> dict[str, Any]:
    """`joint.stiffness` and the keys of [parasitic] of a stage whose leaves are given, by closed forms. Raises
    StageError where a single mechanism buckles under its load."""
    with np.errstate(all="ignore"):  # numbers that make no mechanism are found out by the rules of the stage file
        it = Mechanism.of(flat)
        frequency, share = first_interfering(it)
        stiffness, buckling = closed_forms.loaded_drive_stiffness(it), closed_forms.buckling_load(it)
    if np.ndim(stiffness) == 0 and it.load >= buckling > 0:
        expected = f"less than the buckling load of the leaves, {float(buckling):.4g} N"
        raise StageError("flexure.load", f"{float(it.load):.4g} N", expected, f'load = "{float(buckling) / 3:.2g} N"')
    found = {
        "joint.stiffness": stiffness,
        "parasitic.frequency": frequency,
        "parasitic.mass": share / (1 + share) * it.body.mass,
        "parasitic.damping_ratio": it.damping_ratio,
    }
    return {key: value if np.ndim(value) else float(value) for key, value in found.items()}


def first_interfering(it: Mechanism) -> tuple[Any, Any]:
    """Frequency [Hz] of the lowest mode, but for the drive mode, that actuator and sensor see, and its residue times
    the stage's mass: how much more of a mass it is than the stage is.

    The model of the equations, a part m_p of the stage's mass m on a spring, has the residue m_p/(m (m - m_p)).
    """
    leaf = closed_forms.leaf_participation(it)
    inner = closed_forms.leaf_bending(it) * np.sqrt(1 + leaf)
    inner = np.where(leaf > VISIBLE * 2 * it.damping_ratio, inner, np.inf)
    frequencies, shapes = closed_forms.stage_modes(it)
    seen = np.abs(along_motion(it, it.actuation, shapes) * along_motion(it, it.sensor, shapes))
    residues = seen * np.asarray(it.body.mass)[..., None]
    heights = residues / (2 * np.asarray(it.damping_ratio)[..., None])
    drive = np.arange(6) == closed_forms.drive_mode(shapes)[..., None]
    rigid = np.where((heights > VISIBLE) & ~drive, frequencies, np.inf)
    first = np.argmin(rigid, axis=-1)[..., None]
    lowest, residue = (np.take_along_axis(each, first, axis=-1)[..., 0] for each in (rigid, residues))
    leaves_first = inner <= lowest
    return np.where(leaves_first, inner, lowest)[()], np.where(leaves_first, leaf, residue)[()]
