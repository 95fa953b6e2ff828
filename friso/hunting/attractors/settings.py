"""Settings of the search for limit cycles of stages by simulation from many starts."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class SurveySettings(Settings):
    """Settings of the survey, which follows runs from many starts to their attractors."""

    # [deflections at break-away]
    usual_starts: tuple[tuple[float, float, int], ...] = ((0.001, 0.007, 4), (0.01, 3.0, 48), (5.0, 300.0, 6))
    """Distances at which a stage sticks at first in surveys of many stages: half as many, which takes half as long."""

    beside_motion_shares: tuple[float, ...] = (0.9, 0.97, 0.99, 1.0, 1.01, 1.03, 1.1)  # [of the distance]
    """Starts beside an observed motion when it is observed again at a tighter tolerance. Its basin may be narrow."""

    quick_step_limit: int = 6_000_000  # [steps]
    """Most steps for all runs of a stage in other surveys; a third of it decides most stages."""

    most_kinds: int = 32
    """Most kinds of run followed for a stage. A stage with more is left undecided, because following all takes too
    long."""

    next_round_cost: float = 30.0  # [times the last round]
    """Largest cost of the next round of one kind of run. Kinds that cost more are dropped."""


settings = SurveySettings.live()
