"""Judge the leaf springs of the rig (Sec. 3.5)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np

from friso.leaf_springs.beams import beams
from friso.leaf_springs.evaluation import Evaluation
from friso.leaf_springs.mechanism import Mechanism, MovingBody, cube_inertia
from friso.materials import materials
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.studies import thesis_rig

STROKE, _STIFFNESS, _FIRST, _PARASITIC, _STRESS = 1e-3, 2.4e3, 11.0, 360.0, 50e6
"""Stroke, stiffness, first and parasitic frequency, and stress that the thesis finds with SPACAR [m, N/m, Hz, Hz, Pa]
(Sec. 3.5)."""

_CLOSE = 0.05
"""Relative difference within which stiffness and first frequency should agree. For both, the thesis leaves only the
steel open."""

_YOUNG = (185e9, 195e9, 210e9)
"""Young's moduli [Pa] of stainless spring steel: as rolled, tempered, and of steel in general."""

_SPACINGS, _HEIGHTS = (0.03, 0.06, 0.09), (0.0, 0.03, 0.06)
"""Spacings of the leaves, and heights of the stage's centre of mass above their ends [m]: the thesis gives neither."""


@cache
def _evaluated() -> tuple[Evaluation, ...]:
    """Evaluate the thesis's leaf springs for all combinations of values that it leaves open."""
    return tuple(beams(mechanism(*variant), STROKE) for variant in product(_YOUNG, _SPACINGS, _HEIGHTS))


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
        body=MovingBody(mass, cube_inertia(mass), centre),
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
    over = f"over Young's moduli from {_YOUNG[0] / 1e9:g} to {_YOUNG[-1] / 1e9:g} GPa"
    return Finding(
        (
            Part(
                f"the drive stiffness is {_STIFFNESS:g} N/m within {percent(_CLOSE)} for some stainless spring steel",
                _met(stiffness / _STIFFNESS),
                f"{_range(stiffness)} N/m {over}; with {_YOUNG[-1] / 1e9:g} GPa as plain beams, without "
                f"anticlastic stiffening: {_as_beams(_YOUNG[-1]):.4g} N/m",
            ),
            Part(
                f"with the cart held the first mode is {_FIRST:g} Hz within {percent(_CLOSE)} for some of them",
                _met(first / _FIRST),
                f"{_range(first)} Hz",
            ),
            _parasitic(evaluations),
            Part(
                f"the stress at 1 mm is at most {_STRESS / 1e6:g} MPa with the modulus of tempered strip, 195 GPa, or "
                "less",
                bool(np.all(stress[[evaluation.mechanism.young <= 195e9 for evaluation in evaluations]] <= _STRESS)),
                f"{_range(stress / 1e6)} MPa {over}, at the largest over the width of the clamp",
            ),
        )
    )


def _parasitic(evaluations: tuple[Evaluation, ...]) -> Part:
    """Judge the frequency of the first mode other than the drive mode, for all values left open."""
    words = reading()
    modes = [min(evaluation.modes[1:], key=lambda mode: mode.frequency) for evaluation in evaluations]
    visible = np.array(
        [evaluation.interfering.frequency if evaluation.interfering else np.nan for evaluation in evaluations]
    )
    frequencies = np.array([mode.frequency for mode in modes])
    names = sorted({mode.name for mode in modes})
    return Part(
        f"the first parasitic mode is about {_PARASITIC:g} Hz (within a factor of {words.about:g}), whatever "
        "spacing of "
        f"{_millimetres(_SPACINGS)} and height of the centre of mass of {_millimetres(_HEIGHTS)} above the leaf ends",
        bool(np.all((frequencies >= _PARASITIC / words.about) & (frequencies <= _PARASITIC * words.about))),
        f"{_range(frequencies)} Hz: {' or '.join(names)}; the first that actuator and sensor, underneath the leaves, "
        f"see: {_range(visible)} Hz",
        why="The sideways mode of the stage falls with its height, which the thesis leaves open.",
    )


def _as_beams(young: float) -> float:
    """Return the drive stiffness [N/m] of leaves that may curl across their width: n 12 E I/L^3."""
    own = mechanism(young, _SPACINGS[0], _HEIGHTS[0])
    return own.leaves * 12 * own.young * own.bending / own.length**3


def _met(ratio: np.ndarray) -> bool:
    return bool(np.any(np.abs(ratio - 1) <= _CLOSE))


def _range(values: np.ndarray) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"


def _millimetres(lengths: Sequence[float]) -> str:
    """Return the range of lengths [m] in millimetres, as text."""
    return f"{1e3 * min(lengths):g} to {1e3 * max(lengths):g} mm"
