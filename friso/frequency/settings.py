"""Settings of `friso.frequency`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class FrequencySettings(Settings):
    """Settings of linear loops and margins."""

    crossover_steps: int = 161
    """Crossovers of the search. Fewer step over a narrow stable range; each costs the margins of all limit cases."""

    search_biases: int = 9
    """Bias forces for each state of the limiter. Fewer miss the softest bristle."""


settings = FrequencySettings.live()
