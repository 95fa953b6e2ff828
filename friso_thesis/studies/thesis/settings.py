"""Settings of the judges of the thesis's sentences."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class JudgeSettings(Settings):
    """What judges take for far, for equal, and how many stages they draw."""

    influence_draws: int = setting(1024, "stages")
    """A rank correlation over so many is known to 0.06, two standard errors."""

    influence_rtol: float = setting(1e-5, "")
    """Ten times tighter than the thesis's tolerance; tighter runs count the same peaks."""

    far_crossover_factor: float = setting(3.0, "")
    """“Significantly larger” or “smaller” than an eigenfrequency: half a decade, as “far” in all claims."""

    tuned_masses: int = setting(9, "")
    """Masses for which the controller is tuned, from that of the stage to the whole: more show the same maximum."""

    leaf_change_factor: float = setting(1.1, "")
    """Factor by which a dimension of the leaves grows: small enough that stiffnesses change in proportion."""

    negligible_share: float = setting(0.01, "")
    """Share up to which a spring is linear and a motion of no account; one reads no less off a figure."""

    exact_share: float = setting(1e-9, "")
    """Numbers that follow from one equation differ by rounding alone, which is far less."""
