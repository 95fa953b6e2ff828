"""Judge what the thesis says about parallel leaf springs (Sec. 3.4.1).

It concerns shortening, width, length, and where to push.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from friso.leaf_springs.beams import beams
from friso.leaf_springs.evaluation import Evaluation
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.judges.leaf_springs import STROKE, mechanism
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.settings import settings

_YOUNG, _SPACING = 195e9, 0.06
"""Young's modulus [Pa] of tempered strip, and spacing of the leaves [m]."""


_STIFFNESSES = "drive", "support_x", "support_y"


@cache
def evaluated(dimension: str = "", factor: float = 1.0) -> Evaluation:
    """Evaluate the leaf springs of Sec. 3.5, with one of their dimensions larger by a factor."""
    own = mechanism(_YOUNG, _SPACING, 0.0)
    return beams(replace(own, **{dimension: factor * getattr(own, dimension)}) if dimension else own, STROKE)


@judges("S341S", figure="Sec. 3.4.1, shortening")
def shortening_is_negligible(evidence: Evidence) -> Finding:
    """Judge how nonlinear the leaves are, and how much they shorten, at full stroke."""
    return judged_shortening(evaluated())


def judged_shortening(leaves: Evaluation) -> Finding:
    """Judge how nonlinear leaf springs are, and how much they shorten, at full stroke."""
    share, least = leaves.shortening / leaves.stroke, settings.negligible_share
    return Finding(
        (
            Part(
                f"at full stroke the force is linear in the deflection (within {percent(least)})",
                leaves.nonlinearity <= least,
                f"off by {percent(leaves.nonlinearity, 2)} at {leaves.stroke * 1e3:g} mm",
                why="The leaves stretch.",
            ),
            Part(
                f"the motion in height is negligible: at most {percent(least)} of the stroke",
                share <= least,
                f"the leaves shorten by {leaves.shortening * 1e6:.2g} um, {percent(share, 2)} of the stroke",
                why="It rises with the square of the deflection.",
            ),
        )
    )


@judges("S341W", figure="Sec. 3.4.1, width and length")
def width_against_length(evidence: Evidence) -> Finding:
    """Judge what wider leaves, and longer leaves, change in the stiffness of drive and supports."""
    return judged_dimensions(*(_ratios(name) for name in ("width", "length")))


def _ratios(dimension: str) -> tuple[float, float, float]:
    """Return by which factors a larger `dimension` of the leaves changes three stiffnesses.

    The stiffnesses are those of the drive, along the leaves, and along their width.
    """
    own, other = evaluated(), evaluated(dimension, settings.leaf_change_factor)
    drive, along, across = (float(getattr(other, name)[0] / getattr(own, name)[0]) for name in _STIFFNESSES)
    return drive, along, across


def judged_dimensions(wider: tuple[float, float, float], longer: tuple[float, float, float]) -> Finding:
    """Judge by which factors wider leaves, and longer leaves, change three stiffnesses.

    The stiffnesses are that of the drive, along the leaves, and along their width.
    """
    words = reading()
    alike, larger = settings.negligible_share, settings.leaf_change_factor
    drive, along, across = wider
    return Finding(
        (
            Part(
                "wider leaves gain more stiffness in a supporting direction than in the direction of the drive, and "
                f"less in none (within {percent(alike)})",
                across > (1 + alike) * drive and along >= (1 - alike) * drive,
                f"{larger:g} times the width: {across:.3g} times the support along the width, {along:.3g} times that "
                f"along the leaves, {drive:.3g} times the drive stiffness",
                why="The supports gain no more than the drive.",
            ),
            Part(
                "longer leaves lose support along their width, in proportion significantly: by more than what is the "
                f"same ({percent(words.same)})",
                longer[2] < 1 - words.same,
                f"{larger:g} times the length: {longer[2]:.3g} times the support along the width, {longer[1]:.3g} "
                f"times that along the leaves, {longer[0]:.3g} times the drive stiffness",
                why="They lose less.",
            ),
        )
    )


@judges("S341A", figure="Sec. 3.4.1, where to push")
def pushed_at_the_centre(evidence: Evidence) -> Finding:
    """Judge where a force along the drive does not tilt the stage."""
    leaves = evaluated()
    return judged_place(leaves.stiffness[0], leaves.mechanism.length)


def judged_place(stiffness: np.ndarray, length: float) -> Finding:
    """Judge at which place a force does not tilt the stage, from its stiffness matrix (6, 6).

    The stiffness is taken at the ends of leaves of a length [m]. A force F along z that acts at a distance d from the
    leaf ends exerts the moment -d F about y.
    """
    words = reading()
    compliance = np.linalg.inv(stiffness)
    place = float(compliance[4, 2] / compliance[4, 4])
    beneath = abs(float(compliance[4, 2] + length * compliance[4, 4]))
    return Finding(
        (
            Part(
                "a force that acts in the middle of the leaves does not tilt the stage (the place at which it does not "
                f"is there within {percent(words.same)} of their length)",
                abs(place + length / 2) <= words.same * length,
                f"no tilt with the force {-place * 1e3:.3g} mm from the ends of {length * 1e3:g} mm long leaves; at "
                f"their clamps at the cart, where the rig has its actuator, {beneath * 1e6:.2g} urad/N",
                why="The place of no tilt lies elsewhere.",
            ),
        )
    )
