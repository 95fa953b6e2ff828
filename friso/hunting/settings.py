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
    """With looser runs, rounding breaks stuck stages away; tighter ones take longer with equal results."""

    tight_survey_rtol: float = setting(1e-9, "")
    """Decides where simulations alone show an attractor; a looser one would be no second opinion."""

    landing_rtol: float = setting(1e-6, "")
    """Landings scatter by less than the gaps between points of a map; tighter runs take longer."""

    sketch_rtol: float = setting(1e-5, "")
    """A sketch separates hunting from settling, but does not locate the edge; tighter runs take longer."""

    long_run_rtol: float = setting(1e-6, "")
    """Only decides how a motion ends; times and widths come from finer runs."""

    slope_rtol_factor: float = setting(100.0, "of cycle_rtol")
    """The slope is taken over a wide range, so rougher runs suffice."""

    held_rtol_factor: float = setting(10.0, "of cycle_rtol")
    """Only the distances of returns matter; rougher runs would blur narrow ranges."""

    check_rtol_factor: float = setting(0.01, "")
    """The change at a hundredth of the tolerance estimates the error; a closer tolerance would hide it."""

    closed_gap: float = setting(1e-8, "of the states")
    """With a larger gap, runs count as closed that are no orbits; with a smaller one, real cycles stay open."""

    closed_gap_chattering: float = setting(1e-4, "of the states")
    """A limiter that chatters moves the end of a run by about this much."""

    finest_gap: float = setting(1e-11, "of the states")
    """Gaps below it are rounding: further steps do not help."""

    finest_gap_chattering: float = setting(1e-8, "of the states")
    """Where a limiter chatters, gaps below it are rounding."""

    gap_rtol_factor: float = setting(0.1, "of the tolerance of runs")
    """A gap far below the tolerance of its runs gets no better."""

    followed_gap: float = setting(1e-6, "of the states")
    """Along a branch, stiff stages close no better; with larger gaps a step leads to another branch."""


@dataclass(frozen=True)
class BasinSettings(Settings):
    """Kicks and moves that start hunting."""

    judged_periods: float = setting(1.5, "periods")
    """The end of a run that is judged: shorter ones miss a whole swing, longer ones include the transient."""

    caught_swing_share: float = setting(0.003, "")
    """A run whose swing is this close to that of an attractor need not be followed to the end."""

    resting_end_share: float = setting(0.5, "of the run")
    """A motion that stands still for a shorter time may only wait to break away again."""

    kick_range: tuple[float, float] = setting((1 / 30, 300.0), "least attracting motions")
    """Smaller kicks do not break away; larger ones meet the force limit."""

    kick_count: int = setting(128, "")
    """Windows of kicks narrower than a step are missed; more kicks take longer."""

    kick_edge_share: float = setting(0.01, "")
    """Edges of windows are shown with three digits; finer ones take more runs."""

    runaway_periods: float = setting(200.0, "typical periods")
    """A motion that has not run away by then does not."""

    kicks_between: int = setting(7, "")
    """So many runs take hardly longer than one, and narrow an edge down eightfold."""

    drawn_moves: int = setting(128, "")
    """The interval of the share narrows with the root of this number; more moves take longer."""


@dataclass(frozen=True)
class EdgeSettings(Settings):
    """The search for the edge of hunting in bandwidth, friction and a joint's design."""

    edge_pace: float = setting(3.0, "")
    """Branches that only lead to an edge need fewer points than those that are drawn."""

    first_edge_step: float = setting(0.03, "log of bandwidth")
    """A longer first step may lead to another branch."""

    shortest_edge_step: float = setting(5e-4, "log of bandwidth")
    """An orbit that needs shorter steps is given up, and simulations go on."""

    flip_search_step: float = setting(1e-4, "log of bandwidth")
    """The edge is shown with four digits."""

    fold_search_step: float = setting(1e-3, "along the branch")
    """At a fold the bandwidth changes with the square of this step, so a longer one suffices."""

    chattering_edge_step: float = setting(2e-3, "log of bandwidth")
    """A limiter that chatters makes multipliers rough: shorter steps follow the roughness."""

    beyond_edge_factor: float = setting(1.0095, "")
    """First factor beyond an edge at which nothing may attract: the edge is known to a hundredth, rounded to four
    digits."""

    most_orbits_followed: int = setting(8, "")
    """Beyond the end of one orbit another may attract; more than eight in a row were not met."""

    edge_bracket_share: float = setting(0.02, "of the bandwidth")
    """Widest bracket of an edge to which no orbit was followed; a narrower one takes more surveys."""

    bracket_steps: int = setting(5, "")
    """More steps per range take more surveys at once, fewer take more rounds."""

    reach_log: float = setting(0.06, "log of bandwidth")
    """First distance at which attractors are looked for ahead, doubled each time; a longer one wastes surveys."""

    simulated_work: float = setting(1e8, "")
    """Work for simulations at bandwidths without a map: the rest of a check needs work too."""

    bandwidths_at_once: int = setting(8, "")
    """As many stages as one register holds; more would be run although the work does not suffice."""

    proved_distances: tuple[float, float] = setting((0.02, 0.06), "log of factor")
    """Distances on the hunting side, and on the other, from the change: nearer, motions take too long to die out."""

    same_factor_log: float = setting(1e-6, "log of factor")
    """Values that differ by less are one."""

    widest_factor_step: float = setting(0.03, "log of factor")
    """A margin is shown with three digits at most, so that closer values do not matter."""

    most_proofs: int = setting(6, "")
    """A side stays open after a rough survey was wrong this often."""

    joint_margin_work: float = setting(2e8, "")
    """Margins of a joint are computed for --details alone, in a quarter of a check's time."""

    key_nudge_share: float = setting(1e-3, "")
    """Multipliers are derivatives themselves: smaller changes of keys drown in their error."""

    inside_edge_share: float = setting(1e-3, "of the bandwidth")
    """Distance inside the edge at which the cycle is analysed, because it exists there."""

    flip_multiplier: float = setting(0.8, "")
    """A larger multiplier next to an edge, in size, shows that the cycle flips there."""


@dataclass(frozen=True)
class CheckSettings(Settings):
    """Settings of a check: its work, and the limits of its comparisons."""

    limit_force_share: float = setting(1e-9, "of the limit")
    """A force that differs from the limit by less is at the limit: it is exact but for rounding."""

    free_work_share: float = setting(0.58, "")
    """The case with a free joint takes more work, because its limiter chatters."""

    feeding_work_share: float = setting(0.3, "")
    """Least share of a case's work for the search of the cause that feeds a cycle."""

    friction_margin_work_share: float = setting(0.25, "")
    """Work for the margin in static friction, beside the work of a case."""

    advice_work_share: float = setting(0.1, "")
    """Work for two stages that are searched to see whether advice keeps a margin."""

    check_work: float = setting(8e8, "")
    """About 10 s on one core: a check has to be quick; stages that need more say what was given up."""

    survey_work_share: float = setting(0.4, "")
    """The search for attractors decides the verdict, and must leave room for the rest."""

    rest_work_share: float = setting(0.3, "")
    """Following a motion that has not come to rest must not use up the work for kicks."""

    kick_work_share: float = setting(0.3, "")
    """Work for kicks and moves; the search for the edge gets everything that is left."""

    small_swing_factor: float = setting(12.0, "")
    """A motion that swings by less than the attractor is followed for this many times longer: it may still grow."""

    runaway_swing_factor: float = setting(2.0, "")
    """Motions that swing farther than this multiple of the attractor, and do not come back, run away."""

    feeding_shares: tuple[float, ...] = setting((0.5, 0.1, 0.01, 0.001), "")
    """Shares to which a possible cause of hunting is reduced; the last stands for nothing."""

    derivative_step_share: float = setting(1e-6, "of the states")
    """A smaller step is rounding; a larger one suffers from the curvature of friction."""

    least_growth_rate: float = setting(1e-5, "natural frequencies")
    """Slower growth is rounding: a stage that sticks has poles at 0."""

    lag_angle: float = setting(1e-3, "rad")
    """A force further behind the error is a lag, with a static gain a few thousandths above that of a slip; less stops
    even on a Coulomb level of a hundredth of the static one. Rounding is far below."""

    lag_rates: tuple[float, float] = setting((1e-6, 30.0), "natural frequencies")
    """Rates at which lags are sought: a slower one rises too slowly to break a stage away, and no loop acts faster."""

    lag_points: int = setting(200, "")
    """Rates looked at: 27 a decade, finer than any lag."""

    viscous_speed: float = setting(1e3, "loop speeds")
    """By this speed, friction that falls with speed has become viscous."""

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


@dataclass(frozen=True)
class TrackingSettings(Settings):
    """Responses to references that keep moving."""

    samples_of_a_period: int = setting(4000, "")
    """Fewer samples miss the tip of an error behind a reversal; more take memory."""

    closing_rounds: int = setting(30, "")
    """Newton steps, or waits for as long, before a periodic response is given up."""

    periods_waited: int = setting(4, "periods")
    """Where a Newton step does not come closer, friction has kinks in between: the stage is run on for so long."""

    derivative_step: float = setting(1e-4, "of the scales of the states")
    """Smaller steps are lost in the tolerance of the runs; larger ones reach across kinks of friction."""

    closed_distance: float = setting(1e-4, "of the scales of the states")
    """How far the periodic response may be, and states from themselves a period later: three digits of it are told."""
