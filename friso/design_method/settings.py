"""Settings of `friso.design_method`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class DesignSettings(Settings):
    """Settings of the design of leaf springs, joint and controller."""

    confirmed_candidates: int = 24
    """Candidates of the front confirmed by the beam model, which takes a second for each."""

    edge_bisections: int = 3
    """Bisections that locate an edge to 1 or 2 %. Each takes a search for orbits."""

    front_population: int = 160
    """Population of the search for the front. A smaller one leaves gaps."""

    front_generations: int = 120
    """Generations of the search for the front. Fewer have not converged with many requirements."""

    map_crossovers: int = 24
    """Crossovers of the map. Fewer show steps in the edge; each is a search of a cell."""

    map_strokes: int = 16
    """Strokes of the map. Fewer show steps in the edge; each is a search of a cell."""

    edge_steps: int = 24
    """Crossovers of the search for an edge. Fewer step over a narrow range of hunting."""

    corner_levels: tuple[float, ...] = (0.0, 0.5, 1.0)
    """Places in the ranges of static friction and gap. The middle counts too, because hunting is not monotonous in
    both."""

    relaxed_generations: int = 80
    """Generations of the search for relaxations. Fewer have not converged."""

    verified_moves: int = 10_000
    """Number of verified moves, which shows 95 % to half a percent."""


settings = DesignSettings.live()
