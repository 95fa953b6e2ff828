"""Settings of hunting: tolerances, a check's work, the edge of hunting, and kicks."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ToleranceSettings(Settings):
    """The tolerances of runs and orbits, in one table. A value without a unit is relative.

    Those that are defaults of parameters, `cycle_rtol` to `long_run_rtol`, are read once, when friso is imported.
    """

    cycle_rtol: float = setting(1e-9, "")
    """Multipliers are derivatives of runs: looser runs scatter them near -1, tighter ones take longer."""

    guess_rtol: float = setting(1e-6, "")
    """Enough for Newton's method to start from; looser runs miss narrow cycles."""

    survey_rtol: float = setting(1e-7, "")
    """Looser runs break stages away by rounding that are stuck; tighter ones take longer and end alike."""

    tight_survey_rtol: float = setting(1e-9, "")
    """Decides where runs at the usual tolerance alone tell; looser, it would not be a second opinion."""

    landing_rtol: float = setting(1e-6, "")
    """Landings scatter by less than the gaps between points of a map; tighter runs take longer."""

    sketch_rtol: float = setting(1e-5, "")
    """A sketch tells hunting from settling, not where the edge is; tighter runs take longer."""

    long_run_rtol: float = setting(1e-6, "")
    """Tells only what becomes of a motion; times and widths come from runs that are finer."""

    slope_rtol_factor: float = setting(100.0, "of cycle_rtol")
    """The slope is taken over a wide range, so that rougher runs do."""

    held_rtol_factor: float = setting(10.0, "of cycle_rtol")
    """Only the distances of returns are looked at; rougher runs would blur narrow ranges."""

    check_rtol_factor: float = setting(0.01, "")
    """What changes at a hundredth of the tolerance tells the error; closer ones do not show it."""

    closed_gap: float = setting(1e-8, "of the states")
    """A larger one closes orbits that are none; a smaller one leaves real cycles open."""

    closed_gap_chattering: float = setting(1e-4, "of the states")
    """A limiter that chatters moves the end of a run by about as much."""

    finest_gap: float = setting(1e-11, "of the states")
    """Gaps below it are rounding: further steps do not help."""

    finest_gap_chattering: float = setting(1e-8, "of the states")
    """Where a limiter chatters, gaps below it are rounding."""

    gap_rtol_factor: float = setting(0.1, "of the tolerance of runs")
    """A gap far below the tolerance of its runs gets no better."""

    followed_gap: float = setting(1e-6, "of the states")
    """Along a branch stiff stages close no better; larger gaps lead to others."""


@dataclass(frozen=True)
class BasinSettings(Settings):
    """Kicks and moves that start hunting."""

    judged_periods: float = setting(1.5, "periods")
    """Long enough to hold a whole swing; longer ends hold what is still a transient."""

    caught_swing_share: float = setting(0.003, "")
    """A run whose swing is so near what attracts it need not be followed to the end."""

    resting_end_share: float = setting(0.5, "of the run")
    """A motion that stands still for less may only wait to break away again."""

    kick_range: tuple[float, float] = setting((1 / 30, 300.0), "least attracting motions")
    """Smaller kicks do not break away; larger ones meet the force limit."""

    kick_count: int = setting(128, "")
    """Narrower windows of kicks than a step are missed; more kicks take longer."""

    kick_edge_share: float = setting(0.01, "")
    """Edges of windows are told in three digits; finer ones take more runs."""

    runaway_periods: float = setting(200.0, "typical periods")
    """A motion that has not run away by then does not."""

    kicks_between: int = setting(7, "")
    """As many runs take hardly longer than one, and narrow an edge down eightfold."""

    drawn_moves: int = setting(128, "")
    """The share of moves is told with its interval; more narrow that with the root of their number."""


@dataclass(frozen=True)
class EdgeSettings(Settings):
    """The search for the edge of hunting in bandwidth, friction and a joint's design."""

    edge_pace: float = setting(3.0, "")
    """Branches that only lead to an edge need fewer points than those that are drawn."""

    first_edge_step: float = setting(0.03, "log of bandwidth")
    """A first step that is longer may lead to another branch."""

    shortest_edge_step: float = setting(5e-4, "log of bandwidth")
    """An orbit that needs shorter steps is given up, and simulations go on."""

    flip_search_step: float = setting(1e-4, "log of bandwidth")
    """The edge is told in four digits."""

    fold_search_step: float = setting(1e-3, "along the branch")
    """At a fold the bandwidth changes with the square of it, so that a longer one does."""

    chattering_edge_step: float = setting(2e-3, "log of bandwidth")
    """A limiter that chatters makes multipliers rough: shorter steps follow the roughness."""

    beyond_edge_factor: float = setting(1.0095, "")
    """Nothing may attract so far beyond an edge: it is known to a hundredth, rounded to four digits."""

    narrow_window_share: float = setting(1e-3, "of the bandwidth")
    """No machine holds its bandwidth as exactly: narrower ones are only in --details."""

    most_orbits_followed: int = setting(8, "")
    """Beyond the end of one orbit another may attract; more than eight in a row were not met."""

    edge_bracket_share: float = setting(0.02, "of the bandwidth")
    """Widest range of an edge that no orbit was followed to; narrower takes more surveys."""

    bracket_steps: int = setting(5, "")
    """More steps per range take more surveys at once, fewer take more rounds."""

    reach_log: float = setting(0.06, "log of bandwidth")
    """How far on attractors are looked for, doubled each time; longer wastes surveys."""

    window_pace: float = setting(8.0, "")
    """Branches of cycles that repel are only followed to where they attract again."""

    shortest_window_step: float = setting(1e-5, "log of bandwidth")
    """A branch that needs shorter steps is lost, and no window is told."""

    steepest_window_multiplier: float = setting(1000.0, "")
    """Next to a fold cycles repel so much before they attract again."""

    least_window_error: float = setting(1e-5, "of the bandwidth")
    """Ends of windows are not known better than multipliers are."""

    simulated_work: float = setting(1e8, "")
    """What simulations at bandwidths without a map may take: the rest of a check needs the work too."""

    bandwidths_at_once: int = setting(8, "")
    """As many stages as one register holds; more would be run although the work does not suffice."""

    proved_distances: tuple[float, float] = setting((0.02, 0.06), "log of factor")
    """On the hunting side, and on the other: nearer, motions take too long to die out."""

    same_factor_log: float = setting(1e-6, "log of factor")
    """Values that differ by less are one."""

    widest_factor_step: float = setting(0.03, "log of factor")
    """A margin is told in three digits at most, so that closer values do not matter."""

    most_proofs: int = setting(6, "")
    """A rough survey that was wrong this often leaves a side open."""

    joint_margin_work: float = setting(2e8, "")
    """Margins of a joint are computed for --details alone, in a quarter of a check's time."""

    key_nudge_share: float = setting(1e-3, "")
    """Multipliers are derivatives themselves: smaller changes of keys drown in their error."""

    inside_edge_share: float = setting(1e-3, "of the bandwidth")
    """The cycle is looked at so far inside the edge, where it exists."""

    flip_multiplier: float = setting(0.8, "")
    """A multiplier of that size next to an edge shows that the cycle flips there."""


@dataclass(frozen=True)
class CheckSettings(Settings):
    """What a check may take, and what it compares."""

    limit_force_share: float = setting(1e-9, "of the limit")
    """A force that differs by less from the limit stands there; it is exact but for rounding."""

    free_work_share: float = setting(0.58, "")
    """The case with a free joint takes the most: its limiter chatters."""

    feeding_work_share: float = setting(0.3, "")
    """The search for what feeds a cycle gets so much at least of the work of a case."""

    friction_margin_work_share: float = setting(0.25, "")
    """The margin in static friction may take so much beside the work of a case."""

    advice_work_share: float = setting(0.1, "")
    """Two stages are searched for whether advice keeps a margin."""

    check_work: float = setting(8e8, "")
    """About 10 s on one core: a check has to be quick; stages that need more say what was given up."""

    survey_work_share: float = setting(0.4, "")
    """The search for what attracts decides the verdict, and leaves room for the rest."""

    rest_work_share: float = setting(0.3, "")
    """Following a motion that has not come to rest must not use up what kicks need."""

    kick_work_share: float = setting(0.3, "")
    """What kicks and moves may use; the search for the edge gets all that is left."""

    beyond_edge_work: float = setting(1.5e8, "")
    """Work beside that of a check in which cycles are followed beyond the edge."""

    small_swing_factor: float = setting(12.0, "")
    """A motion that swings by less than what attracts is followed for longer, as it may still grow."""

    runaway_swing_factor: float = setting(2.0, "")
    """Motions that swing farther than that and do not come back run away."""

    feeding_shares: tuple[float, ...] = setting((0.5, 0.1, 0.01, 0.001), "")
    """What feeds is taken away by these shares; the last stands for nothing."""

    derivative_step_share: float = setting(1e-6, "of the states")
    """Smaller steps are rounding; larger ones feel the curvature of friction."""

    least_growth_rate: float = setting(1e-5, "natural frequencies")
    """Slower growth is rounding: a stage that sticks has poles at 0."""

    viscous_speed: float = setting(1e3, "loop speeds")
    """Friction that falls with speed is viscous by then."""

    lower_gain_shares: tuple[float, float, int] = setting((1e-06, 1.0, 37), "")
    """First, last and number of gains at which stability is looked at: twelve per decade."""

    loops_at_once: int = setting(256, "")
    """Loops of a map looked at together take 0.1 MB each."""

    least_followed_time: float = setting(1000.0, "s")
    """Motions that have not settled at their end are followed that long at least."""

    least_followed_waits: float = setting(120.0, "longest waits")
    """Slow stages need more than the time above for as many swings."""

    steady_motion_share: float = setting(0.01, "")
    """A swing that changes by more over a quarter of the run still grows or decays."""

    compiled_from_points: int = setting(100, "")
    """Loading the compiled loops takes as long as so many turning points in Python."""
