"""Judge the leaf springs of the rig (Sec. 3.5), and of parallel leaf springs (Sec. 3.4.1).

The thesis speaks of shortening, width, length, and where to push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np

from friso.leaf_springs.beams import beams
from friso.leaf_springs.mechanism import Evaluation, Mechanism, MovingBody, block_inertia
from friso.materials import materials
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.reading import words
from friso_thesis.studies.thesis.studies import thesis_rig

JOINT_STROKE, JOINT_STIFFNESS, FIRST_FREQUENCY, PARASITIC_FREQUENCY, LARGEST_STRESS = 1e-3, 2.4e3, 11.0, 360.0, 50e6
"""Stroke, stiffness, first and parasitic frequency, and stress that the thesis finds with SPACAR [m, N/m, Hz, Hz, Pa]
(Sec. 3.5)."""

CLOSE_ENOUGH = 0.05
"""Relative difference within which stiffness and first frequency should agree. For both, the thesis leaves only the
steel open."""

YOUNGS_MODULI = (185e9, 195e9, 210e9)
"""Young's moduli [Pa] of stainless spring steel: as rolled, tempered, and of steel in general."""

LEAF_SPACINGS, CENTRE_HEIGHTS = (0.03, 0.06, 0.09), (0.0, 0.03, 0.06)
"""Spacings of the leaves, and heights of the stage's centre of mass above their ends [m]: the thesis gives neither."""


@cache
def _evaluated() -> tuple[Evaluation, ...]:
    """Evaluate the thesis's leaf springs for all combinations of values that it leaves open."""
    return tuple(
        beams(mechanism(*variant), JOINT_STROKE) for variant in product(YOUNGS_MODULI, LEAF_SPACINGS, CENTRE_HEIGHTS)
    )


def mechanism(young: float, spacing: float, height: float) -> Mechanism:
    """Return the rig's leaf springs for values that the thesis leaves open.

    The open values are a Young's modulus [Pa] and a spacing of the leaves [m]. The third is a height [m] of the stage's
    centre of mass above the leaf ends.
    """
    steel, mass, length = materials()["stainless 1.4310"], thesis_rig().flat()["masses.stage"], 70e-3
    centre = (length + height, 0.0, 0.0)
    return Mechanism(
        leaves=2,
        length=length,
        width=45e-3,
        thickness=0.35e-3,
        spacing=spacing,
        young=young,
        poisson=steel.poisson,
        density=float(steel.density),
        yield_strength=float(steel.yield_strength),
        fatigue=float(steel.fatigue),
        body=MovingBody(mass, block_inertia(mass), centre),
        actuation=(0.0, 0.0, 0.0),  # "underneath the flexure mechanism" (Sec. 3.4.1)
        sensor=(0.0, 0.0, 0.0),
    )


@judges("S35", figure="Sec. 3.5, leaf springs")
def the_leaf_springs(evidence: Evidence) -> Finding:
    """Judge stiffness, frequencies and stress of the leaf springs, by geometrically exact beams."""
    evaluations = _evaluated()
    stiffness = np.array([evaluation.drive[0] for evaluation in evaluations])
    first = np.array([evaluation.modes[0].frequency for evaluation in evaluations])
    stress = np.array([evaluation.stress for evaluation in evaluations])
    over = f"over Young's moduli from {YOUNGS_MODULI[0] / 1e9:g} to {YOUNGS_MODULI[-1] / 1e9:g} GPa"
    return Finding.of(
        Part(
            f"the drive stiffness is {JOINT_STIFFNESS:g} N/m within {percent(CLOSE_ENOUGH)} for some stainless spring "
            "steel",
            _met(stiffness / JOINT_STIFFNESS),
            f"{_range(stiffness)} N/m {over}; with {YOUNGS_MODULI[-1] / 1e9:g} GPa as plain beams, without "
            f"anticlastic stiffening: {_as_beams(YOUNGS_MODULI[-1]):.4g} N/m",
        ),
        Part(
            f"with the cart held the first mode is {FIRST_FREQUENCY:g} Hz within {percent(CLOSE_ENOUGH)} for some of "
            "them",
            _met(first / FIRST_FREQUENCY),
            f"{_range(first)} Hz",
        ),
        _parasitic(evaluations),
        Part(
            f"the stress at 1 mm is at most {LARGEST_STRESS / 1e6:g} MPa with the modulus of tempered strip, 195 GPa, "
            "or less",
            bool(np.all(stress[[evaluation.mechanism.young <= 195e9 for evaluation in evaluations]] <= LARGEST_STRESS)),
            f"{_range(stress / 1e6)} MPa {over}, at the largest over the width of the clamp",
        ),
    )


def _parasitic(evaluations: tuple[Evaluation, ...]) -> Part:
    """Judge the frequency of the first mode other than the drive mode, for all values left open."""
    modes = [min(evaluation.modes[1:], key=lambda mode: mode.frequency) for evaluation in evaluations]
    visible = np.array(
        [evaluation.interfering.frequency if evaluation.interfering else np.nan for evaluation in evaluations]
    )
    frequencies = np.array([mode.frequency for mode in modes])
    names = sorted({mode.name for mode in modes})
    return Part(
        f"the first parasitic mode is about {PARASITIC_FREQUENCY:g} Hz (within a factor of {words.about:g}), whatever "
        "spacing of "
        f"{_millimetres(LEAF_SPACINGS)} and height of the centre of mass of {_millimetres(CENTRE_HEIGHTS)} above the "
        "leaf ends",
        bool(
            np.all(
                (frequencies >= PARASITIC_FREQUENCY / words.about) & (frequencies <= PARASITIC_FREQUENCY * words.about)
            )
        ),
        f"{_range(frequencies)} Hz: {' or '.join(names)}; the first that actuator and sensor, underneath the leaves, "
        f"see: {_range(visible)} Hz",
        why="The sideways mode of the stage falls with its height, which the thesis leaves open.",
    )


def _as_beams(young: float) -> float:
    """Return the drive stiffness [N/m] of leaves that may curl across their width: n 12 E I/L^3."""
    own = mechanism(young, LEAF_SPACINGS[0], CENTRE_HEIGHTS[0])
    return own.leaves * 12 * own.young * own.bending / own.length**3


def _met(ratio: np.ndarray) -> bool:
    return bool(np.any(np.abs(ratio - 1) <= CLOSE_ENOUGH))


def _range(values: np.ndarray) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"


def _millimetres(lengths: Sequence[float]) -> str:
    """Return the range of lengths [m] in millimetres, as text."""
    return f"{1e3 * min(lengths):g} to {1e3 * max(lengths):g} mm"


STRIP_MODULUS, STRIP_SPACING = 195e9, 0.06
"""Young's modulus [Pa] of tempered strip, and spacing of the leaves [m]."""


_STIFFNESSES = "drive", "support_x", "support_y"


@cache
def evaluated(dimension: str = "", factor: float = 1.0) -> Evaluation:
    """Evaluate the leaf springs of Sec. 3.5, with one of their dimensions larger by a factor."""
    own = mechanism(STRIP_MODULUS, STRIP_SPACING, 0.0)
    return beams(replace(own, **{dimension: factor * getattr(own, dimension)}) if dimension else own, JOINT_STROKE)


@judges("S341S", figure="Sec. 3.4.1, shortening")
def shortening_is_negligible(evidence: Evidence) -> Finding:
    """Judge how nonlinear the leaves are, and how much they shorten, at full stroke."""
    return judged_shortening(evaluated())


NEGLIGIBLE_SHARE = 0.01
"""Largest share that is negligible, for a nonlinearity or a motion. Smaller ones cannot be read off a figure."""


def judged_shortening(leaves: Evaluation) -> Finding:
    """Judge how nonlinear leaf springs are, and how much they shorten, at full stroke."""
    share, least = leaves.shortening / leaves.stroke, NEGLIGIBLE_SHARE
    return Finding.of(
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


@judges("S341W", figure="Sec. 3.4.1, width and length")
def width_against_length(evidence: Evidence) -> Finding:
    """Judge what wider leaves, and longer leaves, change in the stiffness of drive and supports."""
    return judged_dimensions(*(_ratios(name) for name in ("width", "length")))


LEAF_CHANGE_FACTOR = 1.1
"""Factor by which a dimension of the leaves grows, small enough for stiffnesses to change in proportion."""


def _ratios(dimension: str) -> tuple[float, float, float]:
    """Return by which factors a larger `dimension` of the leaves changes three stiffnesses.

    The stiffnesses are those of the drive, along the leaves, and along their width.
    """
    own, other = evaluated(), evaluated(dimension, LEAF_CHANGE_FACTOR)
    drive, along, across = (float(getattr(other, name)[0] / getattr(own, name)[0]) for name in _STIFFNESSES)
    return drive, along, across


def judged_dimensions(wider: tuple[float, float, float], longer: tuple[float, float, float]) -> Finding:
    """Judge by which factors wider leaves, and longer leaves, change three stiffnesses.

    The stiffnesses are that of the drive, along the leaves, and along their width.
    """
    alike, larger = NEGLIGIBLE_SHARE, LEAF_CHANGE_FACTOR
    drive, along, across = wider
    return Finding.of(
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
    compliance = np.linalg.inv(stiffness)
    place = float(compliance[4, 2] / compliance[4, 4])
    beneath = abs(float(compliance[4, 2] + length * compliance[4, 4]))
    return Finding.of(
        Part(
            "a force that acts in the middle of the leaves does not tilt the stage (the place at which it does not "
            f"is there within {percent(words.same)} of their length)",
            abs(place + length / 2) <= words.same * length,
            f"no tilt with the force {-place * 1e3:.3g} mm from the ends of {length * 1e3:g} mm long leaves; at "
            f"their clamps at the cart, where the rig has its actuator, {beneath * 1e6:.2g} urad/N",
            why="The place of no tilt lies elsewhere.",
        )
    )
