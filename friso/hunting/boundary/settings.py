"""Settings of the boundary of hunting: how cycles and the curves of their changes are
followed."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """Branches and curves of cycles, followed in one key or two."""

    first_branch_step: float = setting(0.002, "")
    """A longer first step may lead to another branch."""

    longest_branch_step: float = setting(0.1, "")
    """Longer steps draw corners; shorter ones take more orbits."""

    shortest_branch_step: float = setting(1e-6, "")
    """A branch that needs shorter steps is lost: its cycle cannot be closed any more."""

    most_branch_steps: int = setting(300, "")
    """A branch with more steps winds without end; each step is an orbit."""

    vanished_amplitude: float = setting(1e-3, "deflections at break-away")
    """Smaller cycles cannot be told from rest."""

    steepest_multiplier: float = setting(30.0, "")
    """No motion comes near a more unstable cycle, and its orbits are hard to close."""

    multiplier_change_per_step: float = setting(0.25, "")
    """A larger change may step over two special points at once."""

    steep_multiplier: float = setting(3.0, "")
    """Beyond this multiplier its changes do not matter, so steps need not be short."""

    branch_turn_per_step: float = setting(0.3, "rad")
    """A sharper turn is a jump to another branch."""

    cubic_values: int = setting(9, "")
    """A cubic through fewer values follows their scatter."""

    least_cubic_values: int = setting(6, "")
    """With fewer values the scatter about the cubic cannot be estimated."""

    first_curve_step: float = setting(0.01, "ranges")
    """A longer first step may lead to another curve."""

    longest_curve_step: float = setting(0.05, "ranges")
    """Longer steps draw corners; shorter ones take more orbits."""

    shortest_curve_step: float = setting(1e-3, "ranges")
    """A curve that needs shorter steps is lost."""

    second_point_distance: float = setting(1e-3, "ranges")
    """The second point of a curve gives its direction; farther off it may lie on another curve."""

    most_curve_steps: int = setting(400, "")
    """A curve with more steps winds without end; each step is several orbits."""

    curve_turn_per_step: float = setting(0.4, "rad")
    """A sharper turn is a jump to another curve."""

    aside_of_prediction: float = setting(0.7, "steps")
    """A point farther to the side of its prediction belongs to another curve."""

    grazing_sine: float = setting(0.2, "")
    """Along a line at a smaller angle to the curve, the change of the multiplier across it is lost."""

    fold_search_depth: float = setting(0.5, "")
    """Largest distance of a fold from its prediction, in logarithms of distance and time."""

    range_stages: int = setting(33, "")
    """Branches that are narrower than a step are missed; more stages take longer."""

    other_branches: int = setting(6, "")
    """Where periods double again and again, branches would never end."""

    same_point_hundredths: float = setting(0.1, "hundredths of the key")
    """Where a limiter chatters, points of overlapping branches within this distance are one."""

    special_point_step: float = setting(1e-7, "")
    """The search for a special point ends at this step, far below the digits shown."""

    special_point_tries: int = setting(30, "")
    """A search that needs more steps does not converge."""

    slope_step: float = setting(1e-3, "")
    """With a smaller step the slope is rounding; with a larger one it belongs to the next bend."""

    met_multiplier_error: float = setting(1e-5, "")
    """A first guess with a multiplier this close to the wanted one needs no further step."""

    chattering_fold_reach: float = setting(0.03, "")
    """Where a limiter chatters, the multiplier may be 1 as far as this from the fold."""

    same_cycle_log: float = setting(0.02, "")
    """Logarithms of distance and time of one cycle differ by less."""

    grid_stages: int = setting(13, "")
    """Curves between stages that do not differ are missed; more stages take longer by the square."""

    most_points_between: int = setting(60, "")
    """A branch that winds for longer between two stages rarely leads to a curve."""

    explained_distance: float = setting(0.2, "steps of the grid")
    """A curve this close explains why two neighbours differ; otherwise another curve is looked for."""


@dataclass(frozen=True)
class MeetingSettings(Settings):
    """Settings of the search for meetings of curves of the edge of hunting.

    The range of either key is one unit.
    """

    crossing_refinements: int = setting(8, "")
    """A crossing that needs more steps stays where the straight lines between points cross."""

    crossing_precision: float = setting(1e-6, "ranges")
    """Last step of a refinement, far below the digits shown; a smaller one costs another step."""

    crossing_reach: float = setting(0.05, "ranges")
    """Farther than the longest step of a curve, a refinement would find another crossing."""

    chord_along: float = setting(0.7, "")
    """A step to another point of a curve shows its direction only if it is mostly along the curve."""

    end_distance: float = setting(0.02, "ranges")
    """A curve that is lost stops up to two first steps short of the curve it ends on."""

    together_distance: float = setting(0.005, "ranges")
    """Straight lines between points stray this far from a curve; curves farther apart are two."""

    together_length: float = setting(0.05, "ranges")
    """Ten times the distance within which curves are one: curves that cross at more than six degrees part sooner."""

    same_cycle_log: float = setting(0.05, "")
    """Interpolated log amplitude and log period of one cycle are off by less; other cycles differ by more."""
