"""Settings of `friso.studies`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class StudySettings(Settings):
    """Settings of sweeps, stores, draws and conversions of friction laws."""

    most_axis_points: int = setting(1_000_000_000, "")
    """Most points of an axis. Longer ones take more than 8 GB before a cell is run."""

    loosest_rtol: float = setting(1e-6, "")
    """Loosest tolerance of orbits. Looser ones lose the branch at a fold."""

    tried_values: int = setting(9, "")
    """Values tried over a range. Fewer miss a range with cycles in its middle only."""

    edge_precision: float = setting(5e-4, "ranges")
    """Precision of edges of a map at which a closed orbit ceases to attract. Three digits of them are sure."""

    seen_edge_precision: float = setting(5e-3, "ranges")
    """Precision of edges of a map by verdicts alone, which take longer. It is a fifth of a cell of a usual map."""

    scheduler_timeout: float = setting(10.0, "s")
    """Time within which a scheduler on a busy network answers."""

    timed_runs: int = setting(64, "")
    """Runs that `friso doctor` times. Fewer measure the start of the threads, not the solver."""

    expected_swing: float = setting(1.03e-3, "m")
    """Hunting amplitude of the template's stage with its joint locked (docs/hunting.md)."""

    swing_error: float = setting(0.02, "")
    """Largest relative error of the expected amplitude. Processors agree to a thousandth; a broken kernel is off by far
    more."""

    stages_together: int = setting(256, "")
    """Stages computed between progress reports. Fewer do not fill the processor's registers."""

    trial_draws: int = setting(16, "")
    """Draws that are timed first. Fewer are misled by a single slow one."""

    usual_draws: int = setting(256, "")
    """Default draws. They give a fraction to five percent; more make a check wait."""

    usual_work: float = setting(3e8, "")
    """Work of a check without a requested number of draws (see `friso.engine.allowance`). It takes about 4 s on one
    core."""

    draws_of_bandwidths: int = setting(64, "")
    """Most draws tried at other bandwidths. If none of 59 hunts, 95 % of all do not, with 95 % confidence."""

    work_of_bandwidths: float = setting(3e8, "")
    """Work of trying draws at other bandwidths, about as much as the verdicts on them."""

    usual_bandwidths: int = setting(10, "")
    """Bandwidths that are usually tried, among which the work is divided."""

    step_of_bandwidths: float = setting(1.26, "")
    """Ratio of bandwidths that are tried, about three an octave. Windows of hunting narrower than a step are missed."""

    halvings_of_bandwidths: int = setting(2, "")
    """Halvings of the step in which hunting ends. Fewer advise more bandwidth than is needed."""

    reach_of_bandwidths: float = setting(8.0, "")
    """Largest factor up and down to which bandwidths are tried. Few machines can be made faster by more."""

    most_unstable_draws: float = setting(0.5, "")
    """Largest share of draws whose loop may be unstable at a bandwidth before no faster ones are tried."""

    most_open_draws: float = setting(0.05, "")
    """Largest share of draws that hunt or have no certain verdict where the others decide: advice holds for 95 %."""

    accelerations_of_friction: tuple[float, float] = setting((0.01, 10.0), "m/s^2")
    """Range of Coulomb friction over mass that bearings have, from air-like to a preloaded screw on a light stage."""

    levels_of_friction: int = setting(10, "")
    """Levels of Coulomb friction tried over that range, a factor of two apart."""

    machines_of_a_level: int = setting(32, "")
    """Machines drawn at each level of Coulomb friction."""

    periods_of_a_standing_log: float = setting(2.0, "")
    """Periods of the predicted cycle for which a reference must stand before rest in a log contradicts it."""

    shortest_standing: float = setting(0.3, "s")
    """Shortest time for which a reference stands that shows whether a machine rests: half of the quickest cycles."""

    noises_at_rest: float = setting(10.0, "")
    """Largest motion of a machine at rest, peak to peak, in standard deviations of the position's noise."""

    ratio_of_alike_swings: float = setting(1.25, "")
    """Largest ratio of swings, and of periods, that count as alike: friction of one machine differs by as much."""

    noises_of_a_swing: float = setting(4.0, "")
    """Smallest amplitude of a swing, in standard deviations of the position's noise."""

    counts_of_a_dither: int = setting(3, "")
    """Most levels of a position that jumps between counts of its encoder instead of swinging."""

    unevenness_of_a_swing: float = setting(0.4, "")
    """Largest standard deviation of the amplitude of a swing, relative to its mean. Noise is less even."""

    samples_of_a_swing: float = setting(10.0, "")
    """Shortest period of a swing in samples."""

    share_of_a_lasting_swing: float = setting(0.5, "")
    """Smallest share of the time at which a reference stands that a lasting swing takes."""

    reach_of_a_change: float = setting(8.0, "")
    """Largest factor tried on keys of a stage to explain a log."""

    changes_tried: int = setting(37, "")
    """Factors tried on a key, 12 % apart, less than the difference that swings may have to be alike."""

    finest_step: float = setting(1e-6, "")
    """Relative difference below which two bandwidths are one."""

    rtol_of_own_moves: float = setting(1e-6, "")
    """Relative tolerance of the run of a stage's own move that is compared with a log."""

    most_explanations: int = setting(3, "")
    """Most changes that an answer names as explanations of a log."""

    shares_of_levels: tuple[float, float] = setting((0.05, 0.5), "")
    """Shares of machines that hunt from the levels of friction on that an answer states: some, and half."""

    most_draws: int = setting(100_000, "")
    """Most draws. At the edge of hunting a draw takes 50 ms, so more take hours."""

    largest_memory_block: int = setting(2048, "")
    """Largest block in memory [cells]. It fills the processor's registers nearly to its end."""

    largest_survey_block: int = setting(256, "")
    """Largest block of a survey [cells], which needs a hundred runs for each cell. Larger ones report progress too
    rarely."""

    most_motions: int = setting(100_000, "")
    """Most cells whose motions are looked at before a study begins. More take seconds; larger maps over a motion have
    their extremes among fewer."""

    look_interval: float = setting(0.05, "s")
    """Interval between checks for cancellation. Longer ones are felt after Ctrl-C."""

    block_timeout: float = setting(10.0, "s")
    """Time within which cancelled blocks end."""

    curve_error: float = setting(0.02, "")
    """Largest difference of virgin curves that a measurement cannot resolve."""

    least_blocks: int = setting(8, "")
    """Fewest blocks of a store, so that an interruption loses an eighth of a study at most."""

    usual_blocks: int = setting(250, "")
    """Usual most blocks of a store. With more, writing delays the workers."""

    largest_stored_block: int = setting(16384, "")
    """Largest block of a store [cells]. A larger one is read whole for a single cell."""

    stored_block: int = setting(1024, "")
    """Cells of a block in a study with at most the usual number of blocks."""

    surveyed_block: int = setting(32, "")
    """Cells of a block with surveys of a hundred runs each, so that an interruption costs seconds."""

    points_of_a_loop: int = setting(1000, "")
    """Samples of a period of a hysteresis loop. Fewer cut its corners."""

    loop_periods: int = setting(3, "")
    """Periods of a hysteresis loop, of which the last counts. Fewer still drift."""

    loop_speed: float = setting(1e-3, "")
    """Speed of a loop in Stribeck velocities. Faster loops lose energy in the damping of bristles, which is reported
    separately."""

    loop_tolerance: float = setting(1e-6, "")
    """Relative tolerance of the solver along a loop, below the last digit of the table."""

    loop_amplitudes: tuple[float, float] = setting((0.1, 0.5), "")
    """Amplitudes of loops, in units of static friction over initial stiffness: one with hardly any slip, one with
    slip."""

    loop_error: float = setting(0.05, "")
    """Relative difference of loop areas or stiffnesses that a log hardly shows."""


settings = StudySettings.live()
