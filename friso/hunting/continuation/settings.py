"""Settings of the continuation of limit cycles, and of the grid over two keys."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """Settings of the continuation of branches of cycles."""

    first_branch_step: float = setting(0.002, "")
    """First step along a branch. A longer one may lead to another branch."""

    longest_branch_step: float = setting(0.1, "")
    """Longest step along a branch. Longer steps draw corners; shorter ones take more orbits."""

    shortest_branch_step: float = setting(1e-6, "")
    """Shortest step along a branch, below which its cycle cannot be closed and the branch ends."""

    farthest_move: float = setting(3.0, "steps")
    """Distance from a cycle beyond which the search for its neighbour is given up: it leads to another branch."""

    most_branch_steps: int = setting(300, "")
    """Most steps along a branch, each of which is an orbit. A branch with more winds without end."""

    vanished_amplitude: float = setting(1e-3, "deflections at break-away")
    """Amplitude below which a cycle cannot be told from rest, and its branch ends."""

    steepest_multiplier: float = setting(30.0, "")
    """Multiplier beyond which a branch is left: no motion comes near so unstable a cycle, and its orbits are hard to
    close."""

    multiplier_change_per_step: float = setting(0.25, "")
    """Largest change of the multiplier per step. A larger one may step over two special points at once."""

    steep_multiplier: float = setting(3.0, "")
    """Multiplier beyond which its changes do not limit the steps."""

    branch_turn_per_step: float = setting(0.3, "rad")
    """Largest turn of a branch per step. A sharper turn is a jump to another branch."""

    cubic_values: int = setting(9, "")
    """Values through which a cubic is fitted. With fewer it follows their scatter."""

    least_cubic_values: int = setting(6, "")
    """Fewest values of a cubic whose scatter can be estimated."""

    range_stages: int = setting(33, "")
    """Number of stages over the range from which branches start. Branches narrower than a step are missed; more stages
    take longer."""

    other_branches: int = setting(6, "")
    """Most further branches followed. Where periods double again and again, branches would never end."""

    same_point_hundredths: float = setting(0.1, "hundredths of the key")
    """Distance within which points of overlapping branches are one, where a limiter chatters."""

    special_point_step: float = setting(1e-7, "")
    """Last step of the search for a special point, far below the decimals shown."""

    special_point_tries: int = setting(30, "")
    """Most steps of the search for a special point. A search with more does not converge."""

    slope_step: float = setting(1e-3, "")
    """Step of the difference that gives the slope. If smaller it is rounding; if larger it includes the next bend."""

    chattering_fold_reach: float = setting(0.03, "")
    """Largest distance from a fold at which the multiplier may be 1, where a limiter chatters."""

    chattering_step_share: float = setting(0.25, "distances of the orbits of a cubic")
    """Last step of the search for a special point where a limiter chatters. Nearer, the scatter of multipliers leads
    nowhere; farther off, the cubic's orbits may lie on one side."""

    same_cycle_log: float = setting(0.02, "")
    """Largest difference in log distance and log time between two computations of one cycle."""

    grid_stages: int = setting(13, "")
    """Stages along each side of the grid of two keys. Curves between equal neighbours are missed; cost grows with the
    square."""


continuation_settings = ContinuationSettings.live()
