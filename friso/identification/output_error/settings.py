"""Settings of the fit of the whole model by its output error."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class OutputErrorSettings(Settings):
    """Settings of the fit of the whole model, and of the decision which parameters to report."""

    starts_of_a_fit: int = 1024
    """Number of starting points of a fit. A quarter of them misses optima of stick-slip records."""

    starts_refined_first: int = 20
    """Number of best starts that are refined briefly. For stick-slip records the very best often lead to worse
    optima."""

    starts_refined_further: int = 6
    """Number of briefly refined starts that are refined further. Only the best of them is iterated to convergence."""

    starts_near_a_fit: int = 127
    """Number of starts around an earlier fit, needed because the closed loop of a hunting stage has other optima."""

    points_of_a_profile: int = 5
    """Number of values at which a profiled parameter is fixed. Fewer make intervals coarser, not narrower."""

    iterations_of_a_profile: int = 5
    """Largest number of iterations of each fit of a profile. Fewer make intervals along a ridge too narrow."""


settings = OutputErrorSettings.live()
