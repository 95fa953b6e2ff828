"""Settings of the boundary of hunting: how cycles, and the curves on which they change, are followed."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """Branches and curves of cycles, followed in one key or two."""

    first_branch_step: float = setting(0.002, "")
    """A first step that is longer may lead to another branch."""

    longest_branch_step: float = setting(0.1, "")
    """Longer steps draw corners; shorter ones take more orbits."""

    shortest_branch_step: float = setting(1e-6, "")
    """A branch that needs shorter steps is lost: its cycle cannot be closed any more."""

    most_branch_steps: int = setting(300, "")
    """Branches that wind for longer do not end; each step is an orbit."""

    vanished_amplitude: float = setting(1e-3, "deflections at break-away")
    """Smaller cycles cannot be told from rest."""

    steepest_multiplier: float = setting(30.0, "")
    """Nothing comes near a cycle that repels more, and its orbits are hard to close."""

    multiplier_change_per_step: float = setting(0.25, "")
    """Larger changes may step over two special points at once."""

    steep_multiplier: float = setting(3.0, "")
    """Beyond it changes of the multiplier do not matter, and steps need not be short."""

    branch_turn_per_step: float = setting(0.3, "rad")
    """A sharper turn is a jump to another branch."""

    cubic_values: int = setting(9, "")
    """A cubic through fewer values follows their scatter."""

    least_cubic_values: int = setting(6, "")
    """With fewer values that are known, the cubic tells no scatter."""

    first_curve_step: float = setting(0.01, "ranges")
    """A first step that is longer may lead to another curve."""

    longest_curve_step: float = setting(0.05, "ranges")
    """Longer steps draw corners; shorter ones take more orbits."""

    shortest_curve_step: float = setting(1e-3, "ranges")
    """A curve that needs shorter steps is lost."""

    second_point_distance: float = setting(1e-3, "ranges")
    """The second point of a curve gives its direction; farther off it may lie on another curve."""

    most_curve_steps: int = setting(400, "")
    """Curves that wind for longer do not end; each step is several orbits."""

    curve_turn_per_step: float = setting(0.4, "rad")
    """A sharper turn is a jump to another curve."""

    aside_of_prediction: float = setting(0.7, "steps")
    """A point farther aside of its prediction is of another curve."""

    grazing_sine: float = setting(0.2, "")
    """A line at a smaller angle to the curve tells nothing of how the multiplier changes across."""

    fold_search_depth: float = setting(0.5, "")
    """How far a fold may lie from its prediction in logarithms of distance and time."""

    range_stages: int = setting(33, "")
    """Branches that are narrower than a step are missed; more stages take longer."""

    other_branches: int = setting(6, "")
    """Where periods double again and again there is no end of branches."""

    same_point_hundredths: float = setting(0.1, "hundredths of the key")
    """Where a limiter chatters, overlapping branches meet a point within this."""

    special_point_step: float = setting(1e-7, "")
    """Ends the search for a special point: far below the digits told."""

    special_point_tries: int = setting(30, "")
    """A search that needs more steps does not converge."""

    slope_step: float = setting(1e-3, "")
    """Smaller, the slope is rounding; larger, it is that of the next bend."""

    met_multiplier_error: float = setting(1e-5, "")
    """A first guess whose multiplier is so near the one predicted need not be tried again."""

    chattering_fold_reach: float = setting(0.03, "")
    """Where a limiter chatters, the multiplier may be 1 as far as this from the fold."""

    same_cycle_log: float = setting(0.02, "")
    """Logarithms of distance and time of one cycle differ by less."""

    grid_stages: int = setting(13, "")
    """Curves between stages that do not differ are missed; more stages take longer by the square."""

    most_points_between: int = setting(60, "")
    """A branch that winds for longer between two stages hardly leads to a curve."""

    explained_distance: float = setting(0.2, "steps of the grid")
    """A curve so near explains why two neighbours differ; others are looked for."""


@dataclass(frozen=True)
class MeetingSettings(Settings):
    """Where curves of the edge of hunting meet. The range of either key is one unit."""

    crossing_refinements: int = setting(8, "")
    """A crossing that is not refined in so many steps is where straight lines between points cross."""

    crossing_precision: float = setting(1e-6, "ranges")
    """The last step of a refinement: far below the digits shown; a smaller one costs another step."""

    crossing_reach: float = setting(0.05, "ranges")
    """Farther than the longest step of a curve a refinement would find another crossing."""

    chord_along: float = setting(0.7, "")
    """A step to another point of a curve tells its direction if it is mostly along it, else where it lies."""

    end_distance: float = setting(0.02, "ranges")
    """A curve that is lost stops up to two first steps short of what it ends on; farther is another."""

    together_distance: float = setting(0.005, "ranges")
    """Straight lines between points stray so far from a curve; curves farther apart are two."""

    together_length: float = setting(0.05, "ranges")
    """Ten times the distance within which curves are one: curves that cross at more than six degrees part sooner."""

    same_cycle_log: float = setting(0.05, "")
    """Logarithms of amplitude and period between points are off by less; other cycles differ by more."""
