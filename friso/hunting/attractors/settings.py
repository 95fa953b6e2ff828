"""Settings of the survey of what attracts stages, by simulations from many starts."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class SurveySettings(Settings):
    """Settings of the survey: runs from many starts, followed in rounds to their attractors."""

    arrival_periods: tuple[float, float] = setting((60.0, 600.0), "periods")
    """Shortest and longest time until a motion counts as arrived. If shorter, slow transients pass for attracted; if
    longer, runs cost more and change nothing."""

    arrival_time_constants: float = setting(8.0, "time constants")
    """Near a flip transients last: after eight time constants 0.03 % of a deviation is left."""

    early_arrival_share: float = setting(0.25, "")
    """Two time constants, or 15 periods: most motions have come by then, and the rest need not be run."""

    longest_counted_period: float = setting(3.0, "typical periods")
    """Arrival times count in periods of at most this; slower cycles would make every motion be followed for as long."""

    closed_orbit_periods: float = setting(6.0, "periods")
    """Shortest wait for a motion near a closed orbit, however slow the orbit."""

    observed_swing_periods: float = setting(24.0, "periods")
    """Longer wait for a swing that was only observed: its time constant is unknown."""

    samples_per_repetition: int = setting(400, "")
    """Fewer miss where a stage stands still between swings; more take longer."""

    still_move_share: float = setting(1e-3, "of peak to peak")
    """A stage that moves farther from sample to sample does not stick there."""

    repeated_orbit_share: float = setting(1e-3, "")
    """Orbits that pass through a simpler one several times differ by less; others by more."""

    closed_swing_share: float = setting(0.2, "of peak to peak")
    """An orbit whose size differs by more is not the one that the run came to."""

    most_repeating_swings: int = setting(12, "swings")
    """Motions that repeat after more swings look irregular, and cost more to detect."""

    repeated_swing_share: float = setting(0.03, "of the largest swing")
    """Small swings scatter by half of it; larger differences are no repetition."""

    compared_swings: int = setting(16, "swings")
    """With fewer, a motion that approaches a cycle slowly looks as if it had arrived."""

    closer_repetition_share: float = setting(0.2, "")
    """A repetition after more swings replaces the shorter one only if its error is smaller by this factor."""

    first_round_periods: float = setting(24.0, "typical periods")
    """If shorter, slow stages show no swing yet; if longer, work is wasted on stages that rest."""

    next_round_factor: float = setting(3.0, "")
    """Slow transients take many rounds if it is smaller, and the last round wastes work if it is larger."""

    typical_distance: float = setting(0.3, "deflections at break-away")
    """The swing from this distance sets the typical period, the unit of all durations."""

    quiet_round_factor: float = setting(10.0, "")
    """A run that has not swung may wait long for its first swing; longer rounds waste work."""

    kept_swings: int = setting(32, "swings")
    """Enough to see repetitions of several swings; more take memory in every run."""

    turning_point_room: int = setting(1 << 20, "")
    """All runs of a round together: more would take too much memory."""

    run_turning_points: int = setting(1 << 14, "")
    """Runs that need more are run again with more room; larger arrays slow down every run."""

    round_step_limit: int = setting(4_000_000, "steps")
    """A run that chatters would hold up all others; normal rounds take far fewer."""

    swing_leg_share: float = setting(0.25, "of peak to peak")
    """Smaller legs are ringing after landing, not swings."""

    least_turns: int = setting(3, "")
    """With fewer turns in the second half of a round, a stage creeps home."""

    least_swing: float = setting(0.0004, "deflections at break-away")
    """Smaller swings are below the resolution of runs; a larger limit would miss small cycles."""

    creep_distances: tuple[float, float, int] = setting((0.001, 1.0, 16), "deflections at break-away")
    """First, last, number of starts tried for where a stage breaks away."""

    least_overshoot_share: float = setting(0.05, "of the distance")
    """A stage that breaks away and swings across by less creeps home."""

    rest_waits: float = setting(4.0, "waits")
    """By then the integrator has passed twice from limit to limit: a stage that stood still rests."""

    longest_waits: float = setting(24.0, "longest waits")
    """A swing nearly as slow as this repeats within half of it; longer runs only cost time."""

    wound_up_starts: tuple[tuple[float, float, int], tuple[float, ...]] = setting(
        ((0.1, 100.0, 24), (0.0, 1.0, 10.0)), ""
    )
    """Starts without anti-windup: first, last, number of distances [deflections by the force limit]; windups."""

    farthest_start: float = setting(1e5, "deflections at break-away")
    """A tenth of the deviation at which a run counts as diverged; farther off it would count at once."""

    outer_integral_windups: tuple[float, ...] = setting((-10.0, -1.0, 1.0, 10.0), "loop times")
    """Both signs, small and large; more multiply the starts of cascades."""

    bending_travels: tuple[float, float] = setting((1e-3, 10.0), "deflections at break-away")
    """From within presliding to far beyond it, by which bristles are bent."""

    least_bend_back_share: float = setting(1e-3, "of the travel")
    """Bending back by less leaves the bristles as they were."""

    start_strides: tuple[int, ...] = setting((64, 16, 4, 1), "")
    """Every 64th start runs first: most stages are decided by a few starts, so that the rest need not run."""

    beside_cycle_shares: tuple[float, ...] = setting((-0.03, -0.003, 0.003, 0.03), "of the distance")
    """Starts on both sides of an unstable cycle show the attractors next to it."""

    most_rounds: int = setting(5, "")
    """The last round takes two thousand typical periods; a further one would use up a stage's steps."""

    thorough_step_limit: int = setting(16_000_000, "steps")
    """Steps for all runs of a stage in a survey that decides: slow transients need most of them."""

    quick_step_limit: int = setting(6_000_000, "steps")
    """Steps for all runs of a stage in other surveys: a third of it decides most stages."""

    unproved_round_steps: int = setting(400_000, "steps")
    """One of many stages that chatters would keep all others waiting."""

    same_motion_share: float = setting(0.05, "")
    """Times and widths of one motion differ by less from run to run; other motions by more."""

    same_irregular_share: float = setting(0.01, "of peak to peak")
    """Irregular runs of one kind differ by less over a long round."""

    same_orbit_share: float = setting(1e-3, "")
    """Closed orbits are exact, so two that differ by more are different orbits."""

    most_kinds: int = setting(32, "")
    """A stage with more kinds of runs is left undecided; following all would take too long."""

    next_round_cost: float = setting(30.0, "times the last round")
    """Kinds of runs are dropped if the next round would cost more than that."""

    runs_per_side: int = setting(4, "")
    """As many run together in one register; fewer would miss the side on which runs leave."""

    outer_share: float = setting(0.25, "")
    """Runs farther from an unstable cycle than this share of the farthest leave it first, so these are followed."""

    most_period_multiple: int = setting(2, "")
    """Motions beside an unstable cycle repeat after its time, or after twice that."""

    enough_rounds: int = setting(3, "")
    """Once one attractor is certain, a thorough survey looks for others for this many rounds only."""

    settled_swing_share: float = setting(0.005, "of peak to peak")
    """Swings that repeat this closely are near enough to an orbit for Newton's method to close it."""

    close_from_round: int = setting(3, "")
    """From this round on, an orbit is closed from every run that is left, if possible."""

    regular_from_round: int = setting(2, "")
    """By this round two hundred typical periods have passed; earlier, slow transients look regular."""

    unchanged_swing_share: float = setting(2e-3, "")
    """A motion whose mean swing changes by more over a round still grows or decays."""

    exact_repetition_share: float = setting(1e-7, "of peak to peak")
    """A run that repeats this exactly is on an attractor: no run comes so near an unstable cycle by chance."""

    converged_swing_share: float = setting(1e-4, "of peak to peak")
    """Where attraction need not be proved, a repetition this close counts as attracted."""

    approach_share: float = setting(0.7, "")
    """The error of a repetition must shrink by this factor over some swings, or it does not approach an orbit."""

    orbits_per_round: int = setting(3, "")
    """More orbits per round rarely show more, and Newton's method takes as long as a round."""

    leaving_time_constants: float = setting(15.0, "time constants")
    """After 15 a deviation of rounding size has grown to that of the swing."""

    longest_leaving_rounds: float = setting(20.0, "of the last round")
    """Near cycles that are more weakly unstable a stage is left undecided; waiting takes too long."""

    steady_swing_share: float = setting(0.8, "")
    """A decay that keeps more of its swing over the last round looks like a cycle."""
