"""Tuning numbers of `friso.leaf_springs`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LeafSpringSettings(Settings):
    """Settings of the models of leaf springs."""

    reported_modes: int = setting(12, "")
    """Higher modes lie beyond any crossover; each costs a row of the table."""

    stage_energy_share: float = setting(0.1, "")
    """Below it a mode is one of the leaves; larger would miss modes of the stage that move its corners."""

    beam_deflections: int = setting(5, "")
    """Fewer miss the bend of the stiffness over the stroke; each costs a nonlinear solution."""

    step_newton_iterations: int = setting(8, "")
    """A step that needs more is too long and converges sooner when halved."""

    most_step_halvings: int = setting(5, "")
    """Leaves that still do not converge are buckled or folded."""

    newton_energy_share: float = setting(1e-7, "")
    """Leaves an axial force in error by 4e-4 of the buckling load; larger shows in the support stiffness."""

    folding_angle: float = setting(1.3, "rad")
    """Beyond it the mechanism is folded rather than deflected and no joint."""

    mode_shape_points: int = setting(17, "")
    """Enough to draw the third bending mode smoothly."""

    closed_deflections: int = setting(5, "")
    """As many as the beam model has, so that both stand in one table."""

    gauss_points: int = setting(48, "")
    """The integrals of curved leaves then hold to rounding; more cost time alone."""

    visible_peak: float = setting(0.01, "")
    """Lower resonances do not reach 0 dB below a margin of 40 dB; a lower limit warns of harmless ones."""

    least_residue: float = setting(1e-9, "")
    """Smaller residues change nothing, and the equations need a parasitic mass above 0."""

    shape_ripple: float = setting(0.05, "")
    """Below this share of the largest displacement rounding and mesh decide on the sign of a shape."""

    tilt_iterations: int = setting(8, "")
    """Four are enough for rounding; the rest is reserve."""
