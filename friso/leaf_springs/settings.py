"""Settings of `friso.leaf_springs`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LeafSpringSettings(Settings):
    """Settings of the models of leaf springs."""

    reported_modes: int = setting(12, "")
    """Modes that are reported. Higher ones lie beyond any crossover."""

    stage_energy_share: float = setting(0.1, "")
    """Fraction of the kinetic energy in the stage below which a mode is one of the leaves."""

    beam_deflections: int = setting(5, "")
    """Deflections at which beams are evaluated. Fewer miss the curvature of the stiffness over the stroke."""

    step_newton_iterations: int = setting(8, "")
    """Newton iterations of a step. A step that needs more converges sooner when halved."""

    most_step_halvings: int = setting(5, "")
    """Halvings of a step. Leaves that still do not converge are buckled or folded."""

    newton_energy_share: float = setting(1e-7, "")
    """Newton's error in energy, relative to the total. It leaves an error of 4e-4 of the buckling load in the axial
    force."""

    folding_angle: float = setting(1.3, "rad")
    """Angle beyond which the mechanism is folded rather than deflected."""

    mode_shape_points: int = setting(17, "")
    """Points of a mode shape, enough to draw the third bending mode smoothly."""

    closed_deflections: int = setting(5, "")
    """Deflections of the closed forms, as many as of beams, for one table."""

    gauss_points: int = setting(48, "")
    """Points of integration along a curved leaf, which are exact to rounding."""

    visible_peak: float = setting(0.01, "")
    """Peak over the mass line from which a mode interferes. Lower ones do not reach 0 dB below a margin of 40 dB."""

    least_residue: float = setting(1e-9, "")
    """Least residue of a parasitic mode, because the equations need a mass above 0."""

    shape_ripple: float = setting(0.05, "")
    """Displacement over the largest one below which rounding decides the sign of a shape."""

    tilt_iterations: int = setting(8, "")
    """Iterations of the tilt. Four reach rounding."""


settings = LeafSpringSettings.live()
