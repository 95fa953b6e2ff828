"""Settings of hunting: tolerances, work of a check, search for the edge, and kicks."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ToleranceSettings(Settings):
    """Tolerances of runs and orbits; a value without a unit is relative.

    The defaults of parameters, `cycle_rtol` to `long_run_rtol`, are read once, when friso is imported.
    """

    cycle_rtol: float = setting(1e-9, "")
    """Tolerance of cycles. Looser runs scatter multipliers near -1; tighter ones take longer."""

    guess_rtol: float = setting(1e-6, "")
    """Tolerance of runs that start Newton's method. Looser ones miss narrow cycles."""

    survey_rtol: float = setting(1e-7, "")
    """Tolerance of surveys. In looser runs rounding errors break stuck stages away; tighter ones take longer and give
    equal results."""

    tight_survey_rtol: float = setting(1e-9, "")
    """Tolerance of repeated runs where only simulations show an attractor. A looser one would be no second opinion."""

    landing_rtol: float = setting(1e-6, "")
    """Tolerance of runs that find where stages stick. They scatter by less than the gaps between points of a map."""

    sketch_rtol: float = setting(1e-5, "")
    """Tolerance of sketches, which separate hunting from settling but do not locate the edge."""

    long_run_rtol: float = setting(1e-6, "")
    """Tolerance of runs that only show how a motion ends. Times and widths come from finer runs."""

    chattering_rtol: float = setting(1e-7, "")
    """Tolerance of cycles that may chatter, where many are followed or searched for, and widest one for the slope of a
    return map. Finer runs change their multipliers by less than the scatter from one stage to the next."""

    slope_rtol_factor: float = setting(100.0, "of cycle_rtol")
    """Tolerance of runs for the slope of a return map, relative to that of cycles. The slope is taken over a wide
    range."""

    check_rtol_factor: float = setting(0.01, "")
    """Factor of the tighter tolerance at which results are repeated to estimate their error."""

    closed_gap: float = setting(1e-8, "of the states")
    """Gap at which an orbit counts as closed. With a larger one runs that are no orbits pass; with a smaller one real
    cycles fail."""

    closed_gap_chattering: float = setting(1e-4, "of the states")
    """Gap at which an orbit with a chattering limiter counts as closed. The chatter moves the end of a run by about
    this much."""

    finest_gap: float = setting(1e-11, "of the states")
    """Gap below which everything is rounding, so that further steps do not help."""

    finest_gap_chattering: float = setting(1e-8, "of the states")
    """Gap below which everything is rounding where a limiter chatters."""

    gap_rtol_factor: float = setting(0.1, "of the tolerance of runs")
    """Smallest useful gap, relative to the tolerance of the runs."""

    followed_gap: float = setting(1e-6, "of the states")
    """Gap at which orbits along a branch count as closed. Stiff stages close no better; with a larger one a step leads
    to another branch."""


@dataclass(frozen=True)
class BasinSettings(Settings):
    """Settings of kicks and moves that start hunting."""

    judged_periods: float = setting(1.5, "periods")
    """Length of the end of a run that is judged. Shorter ones miss a whole swing; longer ones include the transient."""

    caught_swing_share: float = setting(0.003, "")
    """Largest difference in swing between a run and the attractor at which the run need not be continued."""

    resting_end_share: float = setting(0.5, "of the run")
    """Shortest standstill at the end of a run at rest. A shorter one may only be the wait for the next break-away."""

    kick_range: tuple[float, float] = setting((1 / 30, 300.0), "least attracting motions")
    """Smallest and largest kick. Smaller ones do not break away; larger ones meet the force limit."""

    kick_count: int = setting(128, "")
    """Kicks tried. Windows narrower than a step are missed; more kicks take longer."""

    kick_edge_share: float = setting(0.01, "")
    """Precision of the edges of windows, which are shown with three digits."""

    runaway_periods: float = setting(200.0, "typical periods")
    """Time after which a motion that has not diverged does not diverge."""

    kicks_between: int = setting(7, "")
    """Kicks tried at once between the edges of a window, which take hardly longer than one."""

    drawn_moves: int = setting(128, "")
    """Moves drawn. The interval of the fraction narrows with the root of this number."""


@dataclass(frozen=True)
class EdgeSettings(Settings):
    """Settings of the search for the edge of hunting in bandwidth, friction and joint."""

    longest_edge_step: float = setting(0.12, "log of the parameter")
    """Longest step between orbits that are closed on the way to an edge. Over more, Newton's method mostly fails."""

    met_multiplier_share: float = setting(0.01, "")
    """Largest difference of a multiplier from its limit at an orbit that is taken for the end. A multiplier that jumps
    past its limit does not come so near."""

    flip_search_step: float = setting(1e-4, "log of the parameter")
    """Precision of a flip; the edge is shown with four digits."""

    chattering_edge_step: float = setting(2e-3, "log of the parameter")
    """Step with a chattering limiter. Shorter steps follow the roughness of multipliers."""

    beyond_bandwidths: tuple[float, ...] = setting((1.0095, 1.03, 1.06), "")
    """Factors beyond the end of an orbit in bandwidth at which other attractors are looked for. The first makes the
    edge accurate to one per cent. Most windows to which no orbit leads lie at the others, and they are narrower than
    the steps of a search through all bandwidths."""

    beyond_factors: tuple[float, ...] = setting((1.03, 1.06), "")
    """Factors beyond the end of an orbit in another parameter, which is shown with fewer digits. Nearer, motions take
    long to decay."""

    followed_starts: tuple[float, ...] = setting(
        (0.92, 0.96, 0.98, 0.99, 0.995, 0.9975, 1.0, 1.0025, 1.005, 1.01, 1.02, 1.04, 1.08), "of the sticking distance"
    )
    """Starts from which a motion is followed to the next bandwidth. A motion moves by less than a tenth, and its basin
    may be narrow."""

    most_orbits_followed: int = setting(8, "")
    """Most orbits followed one after the other. More than eight in a row were not met."""

    edge_bracket_share: float = setting(0.02, "of the bandwidth")
    """Widest bracket of an edge to which no orbit was followed. A narrower one takes more surveys."""

    bracket_steps: int = setting(5, "")
    """Steps in which a bracket is divided. More take more surveys at once, fewer take more rounds."""

    reach_log: float = setting(0.06, "log of bandwidth")
    """First distance ahead at which attractors are looked for. It doubles each time."""

    simulated_work_share: float = setting(0.33, "of the work left")
    """Work for simulations of the few stages whose maps do not decide. Beside an end of attraction these take long, and
    following an orbit past them decides."""

    bandwidths_at_once: int = setting(8, "")
    """Bandwidths surveyed at once, as many as stages in one register."""

    margin_steps: tuple[float, ...] = setting(
        (0.04, 0.08, 0.13, 0.19, 0.28, 0.42, 0.65, 1.0), "of the log of the farthest factor"
    )
    """Values tried first on either side of the stage's own. They lie closest together near it, and are as many as most
    processors run at once."""

    thorough_margin_steps: tuple[int, ...] = setting((1, 3, -1), "")
    """Numbers of the values, counted outward, that are searched thoroughly if a rough survey finds no change: 9 and
    23 % off for a farthest factor of three, and the farthest, at which a rough survey once saw hunting that was not."""

    inside_end_log: float = setting(0.02, "log of factor")
    """Distance from an end on the hunting side at which hunting is told. Nearer, a cycle attracts from hardly anywhere,
    and motions take too long to decay."""

    most_proofs: int = setting(6, "")
    """Rounds of searches after which a side stays open because rough surveys were wrong."""

    joint_margin_work: float = setting(2e8, "")
    """Work for the margins of a joint, which only --details needs: a quarter of a check's time."""


@dataclass(frozen=True)
class CheckSettings(Settings):
    """Settings of a check: its work, and the limits of its comparisons."""

    limit_force_share: float = setting(1e-9, "of the limit")
    """Largest difference between a force and its limit that is only rounding."""

    mass_changes: tuple[float, ...] = setting((0.0, -1e-5, -1e-6, -1e-7, 1e-7, 1e-6, 1e-5), "of the mass")
    """Changes of the masses with which a stage's own motion is run, because no mass is known that exactly. The
    first is 0, the motion itself."""

    free_work_share: float = setting(0.58, "")
    """Fraction of the work for the case with a free joint, whose limiter chatters."""

    feeding_work_share: float = setting(0.3, "")
    """Least fraction of a case's work for the search of the cause that feeds a cycle."""

    friction_margin_work_share: float = setting(0.4, "")
    """Work for the margin in static friction, as a fraction of that of a case."""

    advice_work_share: float = setting(0.1, "")
    """Work for two stages that show whether a bandwidth advised keeps a margin, as a fraction of that of a case."""

    advised_steps: int = setting(4, "")
    """Bandwidths tried for advice, each farther from the edge by the distance that advice keeps: up to twice."""

    check_work: float = setting(8e8, "")
    """Work of a check, about 10 s on one core. Stages that need more say what was left out."""

    survey_work_share: float = setting(0.4, "")
    """Fraction of the work for the search for attractors, which decides the verdict."""

    rest_work_share: float = setting(0.3, "")
    """Fraction of the work for continuing a motion that has not come to rest."""

    kick_work_share: float = setting(0.3, "")
    """Fraction of the work for kicks and moves; the search for the edge gets all that is left."""

    small_swing_factor: float = setting(12.0, "")
    """Factor by which a motion that swings by less than the attractor is continued, because it may still grow."""

    runaway_swing_factor: float = setting(2.0, "")
    """Swing beyond which a motion that does not come back diverges, as a multiple of the attractor's."""

    feeding_shares: tuple[float, ...] = setting((0.5, 0.1, 0.01, 0.001), "")
    """Fractions to which a possible cause of hunting is reduced; the last stands for zero."""

    derivative_step_share: float = setting(1e-6, "of the states")
    """Step of numerical derivatives. A smaller one is rounding; a larger one includes the curvature of friction."""

    least_growth_rate: float = setting(1e-5, "natural frequencies")
    """Slowest growth rate that is not rounding. A stage that sticks has poles at 0."""

    lag_angle: float = setting(1e-3, "rad")
    """Phase lag of the force behind the error from which a controller counts as a lag. With a smaller one, the force at
    standstill exceeds that of a slip by only a few thousandths. So the slip stops even if Coulomb friction is a
    hundredth of static friction."""

    lag_rates: tuple[float, float] = setting((1e-6, 30.0), "natural frequencies")
    """Lowest and highest rate at which lags are looked for. A slower lag rises too slowly to break a stage away."""

    lag_points: int = setting(200, "")
    """Rates at which the phase is computed: 27 per decade, finer than any lag."""

    viscous_speed: float = setting(1e3, "loop speeds")
    """Speed, in units of the loop's, at which friction that falls with speed has become viscous."""

    lower_gain_shares: tuple[float, float, int] = setting((1e-06, 1.0, 37), "")
    """First and last gain, and number of gains, at which stability is computed: twelve per decade."""

    loops_at_once: int = setting(256, "")
    """Loops of a map that are analysed together, at 0.1 MB each."""

    loop_bandwidths: int = setting(200, "")
    """Bandwidths at which the loop's stability is computed, 2 % apart, and again between two of these, 0.01 % apart."""

    least_followed_time: float = setting(1000.0, "s")
    """Shortest time for which motions that have not settled are continued."""

    least_followed_waits: float = setting(120.0, "longest waits")
    """Shortest continuation in waits, which slow stages need for as many swings."""

    steady_motion_share: float = setting(0.01, "")
    """Largest change of a steady swing over a quarter of the run. With more it grows or decays."""

    compiled_from_points: int = setting(100, "")
    """Turning points from which the compiled loops are faster than Python."""


@dataclass(frozen=True)
class TrackingSettings(Settings):
    """Settings of responses to references that keep moving."""

    samples_of_a_period: int = setting(4000, "")
    """Samples of a period. Fewer miss the peak of an error behind a reversal; more take memory."""

    closing_rounds: int = setting(30, "")
    """Newton steps, or equal waits, after which a periodic response is abandoned."""

    periods_waited: int = setting(4, "periods")
    """Periods of a plain run where jumps of friction's derivatives keep a Newton step from coming closer."""

    derivative_step: float = setting(1e-4, "of the scales of the states")
    """Step of numerical derivatives. Smaller ones are lost in the tolerance; larger ones cross jumps of derivatives."""

    closed_distance: float = setting(1e-4, "of the scales of the states")
    """Largest distance between states one period apart on a closed response, of which three digits are shown."""

    speeds_tried: tuple[float, float] = setting((3e-3, 300.0), "of the speed of the reference")
    """Lowest and highest constant speed at which stick-slip is looked for."""

    speed_count: int = setting(41, "")
    """Speeds tried at first, a third apart. Ranges of stick-slip narrower than a step are missed."""

    speeds_between: int = setting(8, "")
    """Speeds tried between two with different results. They bracket the change to three per cent."""

    swings_followed: float = setting(20.0, "")
    """Length of a run at constant speed, in times of sticking, slipping and swinging of the loop."""

    longer_run: float = setting(3.0, "")
    """Length of the next run, which shows whether a swing lasts, in lengths of the last one."""

    longer_runs: int = setting(2, "")
    """Most runs that follow the first at a speed. A swing that changes slowly is not decided then."""

    most_sliding_steps: int = setting(2_000_000, "")
    """Most steps of a run at constant speed. A speed that needs more is not decided."""

    no_swing_share: float = setting(1e-4, "of the deflection at break-away")
    """Swing below which a stage slides smoothly."""

    lasting_share: float = setting(0.8, "of the swing of the last run")
    """Least swing of the next run that lasts."""

    dying_share: float = setting(0.3, "of the swing of the last run")
    """Largest swing of the next run that dies out."""

    samples_of_a_course: int = setting(20_000, "")
    """Samples of the run at the speed of the reference, some hundred in each swing."""

    standing_speed_share: float = setting(0.02, "of the speed of the reference")
    """Speed below which a stage stands."""


tolerance_settings = ToleranceSettings.live()
basin_settings = BasinSettings.live()
edge_settings = EdgeSettings.live()
check_settings = CheckSettings.live()
tracking_settings = TrackingSettings.live()
