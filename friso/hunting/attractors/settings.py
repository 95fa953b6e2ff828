"""Settings of the survey of what attracts stages, by simulations from many starts."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class SurveySettings(Settings):
    """Runs from many starts, followed in rounds until all that attracts a stage is told."""

    arrival_periods: tuple[float, float] = setting((60.0, 600.0), "periods")
    """Fewer, and slow transients pass for attracted; more cost work and change nothing."""

    arrival_time_constants: float = setting(8.0, "time constants")
    """Near a flip transients last: after eight time constants 0.03 % of a deviation is left."""

    early_arrival_share: float = setting(0.25, "")
    """Two time constants, or 15 periods: most motions have come by then, and the rest need not be run."""

    longest_counted_period: float = setting(3.0, "typical periods")
    """Slower cycles would make every motion be followed for as long."""

    closed_orbit_periods: float = setting(6.0, "periods")
    """How long at least a motion near a closed orbit is waited for, however slow the orbit."""

    observed_swing_periods: float = setting(24.0, "periods")
    """Of a swing that was only observed nobody knows how slowly motions leave what is beside it."""

    samples_per_repetition: int = setting(400, "")
    """Fewer miss where a stage stands still between swings; more take longer."""

    still_move_share: float = setting(1e-3, "of peak to peak")
    """A stage that moves farther from sample to sample does not stick there."""

    repeated_orbit_share: float = setting(1e-3, "")
    """Orbits that pass through a simpler one several times differ by less; others by more."""

    closed_swing_share: float = setting(0.2, "of peak to peak")
    """An orbit that differs more is another one than the run came to."""

    most_repeating_swings: int = setting(12, "swings")
    """Motions that repeat themselves after more swings look irregular, and cost more to tell."""

    repeated_swing_share: float = setting(0.03, "of the largest swing")
    """Small swings scatter by half of it; larger differences are no repetition."""

    compared_swings: int = setting(16, "swings")
    """With fewer a motion that approaches slowly looks as if it had arrived."""

    closer_repetition_share: float = setting(0.2, "")
    """A longer repetition has to be that much better, or the shorter one counts."""

    first_round_periods: float = setting(24.0, "typical periods")
    """Fewer show no swings of slow stages; more are wasted on those that rest."""

    next_round_factor: float = setting(3.0, "")
    """Slow transients take many rounds if it is smaller, and the last round wastes work if it is larger."""

    typical_distance: float = setting(0.3, "deflections at break-away")
    """The cycle from there tells the period in which all others are counted."""

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
    """Smaller legs are ringing of a stage that has landed, not swings."""

    least_turns: int = setting(3, "")
    """A stage that creeps home turns less often in the second half of a round."""

    least_swing: float = setting(0.0004, "deflections at break-away")
    """Smaller swings are below what runs resolve; larger ones would be missed."""

    creep_distances: tuple[float, float, int] = setting((0.001, 1.0, 16), "deflections at break-away")
    """First, last, number of starts tried for where a stage breaks away."""

    least_overshoot_share: float = setting(0.05, "of the distance")
    """A stage that breaks away and swings across by less creeps home."""

    rest_waits: float = setting(4.0, "waits")
    """The integrator has passed twice from limit to limit: a stage that stood still rests."""

    longest_waits: float = setting(24.0, "longest waits")
    """Swings nearly as slow repeat themselves within half of it; longer runs only take time."""

    wound_up_starts: tuple[tuple[float, float, int], tuple[float, ...]] = setting(
        ((0.1, 100.0, 24), (0.0, 1.0, 10.0)), ""
    )
    """Starts without anti-windup: first, last, number of distances [deflections by the force limit]; windups."""

    farthest_start: float = setting(1e5, "deflections at break-away")
    """A tenth of where a run counts as running away: from farther off it would at once."""

    outer_integral_windups: tuple[float, ...] = setting((-10.0, -1.0, 1.0, 10.0), "loop times")
    """Both signs, small and large; more multiply the starts of cascades."""

    bending_travels: tuple[float, float] = setting((1e-3, 10.0), "deflections at break-away")
    """From within presliding to far beyond it, by which bristles are bent."""

    least_bend_back_share: float = setting(1e-3, "of the travel")
    """Bending back by less leaves the bristles as they were."""

    start_strides: tuple[int, ...] = setting((64, 16, 4, 1), "")
    """Coarse starts first: most stages are decided by these, and the rest need not be run."""

    beside_cycle_shares: tuple[float, ...] = setting((-0.03, -0.003, 0.003, 0.03), "of the distance")
    """Motions on both sides of a cycle show what is beside it."""

    most_rounds: int = setting(5, "")
    """The last takes two thousand typical periods; more would use up the steps of a stage."""

    thorough_step_limit: int = setting(16_000_000, "steps")
    """What all runs of a stage may take in a survey that decides: slow transients need most."""

    quick_step_limit: int = setting(6_000_000, "steps")
    """What all runs of a stage may take in other surveys: a third decides most stages."""

    unproved_round_steps: int = setting(400_000, "steps")
    """Of many stages at once a single one that chatters would keep all others waiting."""

    same_motion_share: float = setting(0.05, "")
    """Times and widths of one motion differ by less from run to run; other motions by more."""

    same_irregular_share: float = setting(0.01, "of peak to peak")
    """Irregular runs of one kind differ by less over a long round."""

    same_orbit_share: float = setting(1e-3, "")
    """Closed orbits are exact: those that differ by more are two."""

    most_kinds: int = setting(32, "")
    """A stage with more kinds of runs is left undecided; following all would take too long."""

    next_round_cost: float = setting(30.0, "times the last round")
    """Kinds of runs are dropped if the next round would cost more than that."""

    runs_per_side: int = setting(4, "")
    """As many run together in one register; fewer would miss the side on which runs leave."""

    outer_share: float = setting(0.25, "")
    """The farthest runs leave an unstable cycle first, so that they are followed."""

    most_period_multiple: int = setting(2, "")
    """Motions beside an unstable cycle repeat themselves after its time or twice that."""

    enough_rounds: int = setting(3, "")
    """Where one attractor is certain, more are looked for only so long."""

    settled_swing_share: float = setting(0.005, "of peak to peak")
    """Swings that repeat so closely are near an orbit, and Newton's method closes it."""

    close_from_round: int = setting(3, "")
    """From this round on an orbit is tried to be closed from every run that is left."""

    regular_from_round: int = setting(2, "")
    """Two hundred typical periods: earlier, slow transients look regular."""

    unchanged_swing_share: float = setting(2e-3, "")
    """A motion whose mean swing changes by more over a round still comes or goes."""

    exact_repetition_share: float = setting(1e-7, "of peak to peak")
    """So near an unstable cycle no run comes by chance."""

    converged_swing_share: float = setting(1e-4, "of peak to peak")
    """Where nothing has to be proved, such a repetition counts as attracted."""

    approach_share: float = setting(0.7, "")
    """A repetition that has improved by less since some swings before does not approach an orbit."""

    orbits_per_round: int = setting(3, "")
    """More orbits per round rarely tell more, and Newton's method takes as long as a round."""

    leaving_time_constants: float = setting(15.0, "time constants")
    """After 15 a deviation of rounding size has grown to that of the swing."""

    longest_leaving_rounds: float = setting(20.0, "of the last round")
    """Cycles that repel more slowly are left undecided; waiting takes too long."""

    steady_swing_share: float = setting(0.8, "")
    """A decay that keeps more of its swing over the last round looks like a cycle."""
