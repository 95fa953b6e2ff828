"""Settings of the search for limit cycles of stages by simulation from many starts."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class SurveySettings(Settings):
    """Settings of the survey, which follows runs from many starts to their attractors."""

    arrival_periods: tuple[float, float] = setting((60.0, 600.0), "periods")
    """Shortest and longest time until a motion counts as arrived. If shorter, slow transients pass for attracted; if
    longer, runs cost more and change nothing."""

    arrival_time_constants: float = setting(8.0, "time constants")
    """Waiting time near a stable cycle, in time constants of the cycle. After eight of them 0.03 % of a deviation is
    left."""

    early_arrival_share: float = setting(0.25, "")
    """Time of an early check, as a fraction of the arrival time. Most motions have arrived by then, and their runs can
    end."""

    longest_counted_period: float = setting(3.0, "typical periods")
    """Longest period used for arrival times. With a slower cycle, every motion would have to be followed for as
    long."""

    closed_orbit_periods: float = setting(6.0, "periods")
    """Shortest wait for a motion near a closed orbit, however fast the orbit attracts."""

    observed_swing_periods: float = setting(24.0, "periods")
    """Shortest wait for a swing that was only observed, whose time constant is unknown."""

    samples_per_repetition: int = setting(400, "")
    """Samples of one repetition when a sticking instant is looked for. Fewer miss short standstills; more take longer.
    """

    still_move_share: float = setting(1e-3, "of peak to peak")
    """Largest move between samples of a stage that sticks. If larger, slow sliding passes for sticking."""

    repeated_orbit_share: float = setting(1e-3, "")
    """Largest relative difference between an orbit and a simpler one that it passes through several times."""

    closed_swing_share: float = setting(0.2, "of peak to peak")
    """Largest relative difference in size between a closed orbit and the run from which it was started."""

    most_repeating_swings: int = setting(12, "swings")
    """Longest repetition looked for. Motions that repeat after more swings count as irregular; detecting them costs
    more."""

    repeated_swing_share: float = setting(0.03, "of the largest swing")
    """Largest difference between swings that repeat. If larger, irregular motion passes for periodic."""

    compared_swings: int = setting(16, "swings")
    """Number of swings compared to detect a repetition. With fewer, a slow approach to a cycle looks periodic."""

    closer_repetition_share: float = setting(0.2, "")
    """Factor by which a longer repetition must reduce the error to replace a shorter one."""

    first_round_periods: float = setting(24.0, "typical periods")
    """Length of the first round. If shorter, slow stages show no swing yet; if longer, stages at rest waste work."""

    next_round_factor: float = setting(3.0, "")
    """Length of a round over that of the previous one. If smaller, slow transients take many rounds; if larger, the
    last one wastes work."""

    typical_distance: float = setting(0.3, "deflections at break-away")
    """Start distance of the swing whose period is the typical period, the unit of all durations."""

    quiet_round_factor: float = setting(10.0, "")
    """Length of the next round over the last one, for a run that has not swung yet."""

    kept_swings: int = setting(32, "swings")
    """Last swings that are stored of each run. Fewer hide repetitions after several swings; more take memory."""

    turning_point_room: int = setting(1 << 20, "")
    """Turning points stored for all runs of a round together, limited by memory."""

    run_turning_points: int = setting(1 << 14, "")
    """Turning points stored for a run at first. Runs that need more are repeated; a larger store slows down every run.
    """

    round_step_limit: int = setting(4_000_000, "steps")
    """Steps after which a run of a round is stopped. A run that chatters would hold up all others."""

    swing_leg_share: float = setting(0.25, "of peak to peak")
    """Smallest leg of the zigzag that counts as a swing. Smaller legs are ringing of a stage that sticks."""

    least_turns: int = setting(3, "")
    """Fewest turning points in the second half of a round of a stage that swings. With fewer it creeps."""

    least_swing: float = setting(0.0004, "deflections at break-away")
    """Smallest swing that counts. Smaller ones are below the resolution of runs; a larger limit would miss small
    cycles."""

    creep_distances: tuple[float, float, int] = setting((0.001, 1.0, 16), "deflections at break-away")
    """First and last distance, and number of starts, of the test for where a stage breaks away."""

    least_overshoot_share: float = setting(0.05, "of the distance")
    """Smallest overshoot of a stage that breaks away. A stage with less creeps to its reference."""

    rest_waits: float = setting(4.0, "waits")
    """Standstill after which a stage certainly rests, because the integrator has passed twice from limit to limit."""

    longest_waits: float = setting(24.0, "longest waits")
    """Longest round, in the longest sticking time. A slower swing repeats within half of it; longer runs only cost
    time."""

    thorough_starts: tuple[tuple[float, float, int], ...] = setting(
        ((0.001, 0.009, 12), (0.01, 3.0, 96), (4.0, 300.0, 16)), "deflections at break-away"
    )
    """Distances at which a stage sticks at first: first, last and number of each range. From the nearest ones most runs
    creep home; from the farthest ones they do not stick. Attractors are missed between two of them."""

    usual_starts: tuple[tuple[float, float, int], ...] = setting(
        ((0.001, 0.007, 4), (0.01, 3.0, 48), (5.0, 300.0, 6)), "deflections at break-away"
    )
    """Distances at which a stage sticks at first in surveys of many stages: half as many, which takes half as long."""

    limited_starts: tuple[float, float, int] = setting((500.0, 30000.0, 8), "deflections at break-away")
    """Farther starts with a force limit. A cycle driven by the limit is as large as the limit moves the masses while
    the integrator unwinds."""

    pushed_starts: tuple[float, float, int] = setting((0.03, 300.0, 12), "speeds that deflect the loop to break-away")
    """Speeds of stages that start at their reference. They lead where starts at rest do not."""

    remembering_starts: tuple[tuple[float, float, int], tuple[float, float, int]] = setting(
        ((0.01, 10.0, 32), (0.01, 30.0, 128)), "deflections at break-away"
    )
    """Starts of stages with several bristles bent in many ways, for other surveys and for a thorough one. Each counts
    seven times, once for each past."""

    beside_motion_shares: tuple[float, ...] = setting((0.9, 0.97, 0.99, 1.0, 1.01, 1.03, 1.1), "of the distance")
    """Starts beside an observed motion when it is observed again at a tighter tolerance. Its basin may be narrow."""

    wound_up_starts: tuple[tuple[float, float, int], tuple[float, ...]] = setting(
        ((0.1, 100.0, 24), (0.0, 1.0, 10.0)), ""
    )
    """Starts without anti-windup: first, last and number of distances, and windups of the integrator."""

    farthest_start: float = setting(1e5, "deflections at break-away")
    """Farthest start. It is a tenth of the deviation at which a run counts as diverged."""

    outer_integral_windups: tuple[float, ...] = setting((-10.0, -1.0, 1.0, 10.0), "loop times")
    """Initial windups of the outer integral of a cascade, of both signs. More multiply the starts."""

    bending_travels: tuple[float, float] = setting((1e-3, 10.0), "deflections at break-away")
    """Shortest and longest travel by which bristles are bent before a start, from presliding to far beyond it."""

    least_bend_back_share: float = setting(1e-3, "of the travel")
    """Smallest reversal after bending the bristles. A smaller one leaves them as they were."""

    start_strides: tuple[int, ...] = setting((64, 16, 4, 1), "")
    """Strides through the starts of many stages. Every 64th start runs first, because a few starts decide most stages.
    """

    beside_cycle_shares: tuple[float, ...] = setting((-0.03, -0.003, 0.003, 0.03), "of the distance")
    """Offsets of starts from an unstable cycle, on both sides, that lead to the attractors next to it."""

    most_rounds: int = setting(5, "")
    """Most rounds of a run. The last one takes two thousand typical periods."""

    thorough_step_limit: int = setting(16_000_000, "steps")
    """Most steps for all runs of a stage in a survey that decides; slow transients need most of them."""

    quick_step_limit: int = setting(6_000_000, "steps")
    """Most steps for all runs of a stage in other surveys; a third of it decides most stages."""

    unproved_round_steps: int = setting(400_000, "steps")
    """Most steps of a round of one of many stages, which would keep all others waiting if it chatters."""

    same_motion_share: float = setting(0.05, "")
    """Largest relative difference in time and size between runs on the same motion."""

    left_repetitions: int = setting(8, "")
    """Repetitions over which the growth of a deviation tells that a run leaves a cycle. Over fewer, noise hides it."""

    same_irregular_share: float = setting(0.01, "of peak to peak")
    """Largest difference between irregular runs of the same kind over a long round."""

    same_orbit_share: float = setting(1e-3, "")
    """Largest relative difference between two computations of the same closed orbit."""

    most_kinds: int = setting(32, "")
    """Most kinds of run followed for a stage. A stage with more is left undecided, because following all takes too
    long."""

    next_round_cost: float = setting(30.0, "times the last round")
    """Largest cost of the next round of one kind of run. Kinds that cost more are dropped."""

    runs_per_side: int = setting(4, "")
    """Runs followed on either side of an unstable cycle. Fewer would miss the side on which runs leave."""

    outer_share: float = setting(0.25, "")
    """Outer fraction of the runs beside an unstable cycle that is followed, because these leave it first."""

    most_period_multiple: int = setting(2, "")
    """Longest repetition beside an unstable cycle, as a multiple of the cycle's time."""

    enough_rounds: int = setting(3, "")
    """Rounds in which a thorough survey looks for further attractors once one is certain."""

    settled_swing_share: float = setting(0.005, "of peak to peak")
    """Largest error of a repetition from which Newton's method is started to close an orbit."""

    close_from_round: int = setting(3, "")
    """Round from which an orbit is closed from every remaining run, if possible."""

    regular_from_round: int = setting(2, "")
    """Round from which regular motion is trusted. Before two hundred typical periods slow transients look regular."""

    unchanged_swing_share: float = setting(2e-3, "")
    """Largest change of the mean swing over a round. A motion that changes more still grows or decays."""

    exact_repetition_share: float = setting(1e-7, "of peak to peak")
    """Largest error of a repetition that proves an attractor: no run stays so close to an unstable cycle by chance."""

    converged_swing_share: float = setting(1e-5, "of peak to peak")
    """Largest error of a repetition that counts as converged where attraction need not be proved. Runs come closer than
    a larger one to unstable cycles by chance."""

    approach_share: float = setting(0.7, "")
    """Factor by which the error of a repetition must shrink over some swings for the run to approach an orbit."""

    orbits_per_round: int = setting(3, "")
    """Orbits closed per round and stage. Further ones rarely show anything, and each costs as much as a round."""

    leaving_time_constants: float = setting(15.0, "time constants")
    """Time for which runs are followed near an unstable cycle. Afterwards rounding errors have grown to the size of the
    swing."""

    longest_leaving_rounds: float = setting(20.0, "of the last round")
    """Longest wait for runs to leave an unstable cycle. A cycle that needs longer leaves its stage undecided."""

    steady_swing_share: float = setting(0.8, "")
    """Fraction of the swing that a motion must keep over the last round to count as a cycle."""


settings = SurveySettings.live()
