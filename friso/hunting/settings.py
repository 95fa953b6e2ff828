"""Settings of hunting: tolerances, work of a check, search for the edge, and kicks."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class CheckSettings(Settings):
    """Settings of a check: its work, and the limits of its comparisons."""

    feeding_shares: tuple[float, ...] = (0.5, 0.1, 0.01, 0.001)
    """Fractions to which a possible cause of hunting is reduced; the last stands for zero."""

    compiled_from_points: int = 100
    """Turning points from which the compiled loops are faster than Python."""


check_settings = CheckSettings.live()
