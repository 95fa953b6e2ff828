"""Tuning numbers of `friso.studies`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class StudySettings(Settings):
    """Settings of sweeps, stores, draws and conversions of friction laws."""

    most_axis_points: int = setting(1_000_000_000, "")
    """Longer axes take more than 8 GB before a cell is run."""

    loosest_rtol: float = setting(1e-6, "")
    """Looser orbits lose the branch at a fold."""

    tried_values: int = setting(9, "")
    """Fewer miss a range that holds stages with a cycle at its middle only."""

    scheduler_timeout: float = setting(10.0, "s")
    """A scheduler on a busy network answers within it; one that is not there does not."""

    timed_runs: int = setting(64, "")
    """Fewer runs measure the start of the threads rather than the solver."""

    expected_swing: float = setting(1.03e-3, "m")
    """Hunting of the template's stage with its joint locked (docs/hunting.md)."""

    swing_error: float = setting(0.02, "")
    """Processors agree to a thousandth; a broken kernel is off by far more."""

    stages_together: int = setting(256, "")
    """Between chunks progress is reported; fewer leave lanes idle."""

    trial_draws: int = setting(16, "")
    """Tell what a draw takes; fewer are misled by a single slow one."""

    usual_draws: int = setting(256, "")
    """Show a share to five percent; more make a check wait."""

    usual_work: float = setting(3e8, "")
    """About 4 s on one core, for a check for which no number of draws was asked."""

    draws_of_a_swing: int = setting(64, "")
    """Draws of which amplitude and period are told: a range of fewer leaves a tenth of the machines out."""

    draws_of_an_edge: int = setting(16, "")
    """Draws whose edge of hunting is searched: each takes as many searches as there are steps."""

    steps_of_an_edge: int = setting(17, "")
    """Bandwidths tried for each: fewer tell the edge more coarsely."""

    reach_of_an_edge: float = setting(1.6, "")
    """Factor about the edge of the stage itself over which they lie: wider, the steps are coarser."""

    most_draws: int = setting(100_000, "")
    """At the edge of hunting a draw takes 50 ms: more take hours."""

    largest_memory_block: int = setting(2048, "")
    """Enough that all lanes are busy nearly to its end."""

    largest_survey_block: int = setting(256, "")
    """A hundred runs are needed for each cell: larger blocks report progress too rarely."""

    look_interval: float = setting(0.05, "s")
    """Interval between checks that someone still waits; longer ones are felt after Ctrl-C."""

    block_timeout: float = setting(10.0, "s")
    """Blocks that were told to end do so within a step of all lanes."""

    rows_together: int = setting(100_000, "")
    """Keeps what is held in memory to some tens of megabytes."""

    most_knots: int = setting(40, "")
    """A virgin curve has no more bends that a measurement could show."""

    knot_distance: float = setting(1e-6, "")
    """Knots closer than this share of the last are one."""

    rounded_points: float = setting(1e-6, "")
    """Points written in files are off by this share of the end."""

    end_weight: float = setting(1e4, "")
    """The curve has to reach its end: a smaller weight lets noise decide."""

    blurred_scatters: float = setting(10.0, "")
    """Within so many scatters of 0 no curve is told to bend."""

    least_noise: float = setting(0.01, "")
    """Least noise, as a share of the end, where points are too few to show their noise."""

    fit_steps: int = setting(10_000, "")
    """A fit that needs more goes round in circles."""

    hopeless_criterion: float = setting(100.0, "")
    """From so much worse a criterion on no fewer knots can be the better ones."""

    least_points: int = setting(3, "")
    """Two points are a line."""

    most_points: int = setting(100_000, "")
    """More points take seconds and tell nothing more."""

    reached_friction: float = setting(0.9, "")
    """A curve that ends below it does not show the break-away."""

    late_points: int = setting(20, "")
    """One in so many points goes as far: an outlier alone does not."""

    backward_share: float = setting(0.01, "")
    """Displacements that go back by less are noise, not a turn."""

    curve_error: float = setting(0.02, "")
    """Virgin curves that differ by less are the same in a measurement."""

    number_gain: int = setting(4, "")
    """Twice as much as by Akaike's criterion: fewer free numbers are taken."""

    likely_difference: float = setting(8.0, "")
    """Fits whose Akaike criterion is worse by less are as likely as the best."""

    slope_errors: float = setting(3.0, "")
    """Standard errors of the first slope within which fits are alike."""

    first_friction: float = setting(1 / 3, "")
    """A first point that bears more says nothing of the stiffness of the start."""

    finer_factor: int = setting(4, "")
    """A boundary is shown four times finer; eight times would take most of the runs."""

    refined_share: float = setting(0.2, "")
    """Share of the fine grid that is run; fewer runs may step over small islands."""

    lattice_step: int = setting(8, "")
    """Spacing of the first runs in the fine grid; a smaller one leaves fewer runs for the boundary."""

    refine_batches: int = setting(100, "")
    """Each batch is chosen after the results of the last one; more batches wait for their slowest cell."""

    late_settling: float = setting(10.0, "s")
    """The thesis counts peaks after it: a run that settles so late counts as one that swings."""

    least_blocks: int = setting(8, "")
    """So that an interruption loses an eighth of a study at most."""

    usual_blocks: int = setting(250, "")
    """More blocks hold up the workers by writing."""

    largest_stored_block: int = setting(16384, "")
    """Larger chunks are read whole for a single cell."""

    stored_block: int = setting(1024, "")
    """Cells of a block of a study that has no more than the usual number of blocks."""

    surveyed_block: int = setting(32, "")
    """A survey takes a hundred runs of a cell: an interruption costs seconds there too."""

    trace_bins: int = setting(150, "")
    """A drawn line of as many points is a few hundred pixels wide."""

    samples_per_bin: int = setting(20, "")
    """Fewer samples miss the extremes of fast motion."""

    traces_together: int = setting(256, "")
    """Keeps what is held in memory to some tens of megabytes."""

    tighter_factor: float = setting(100.0, "")
    """A smaller factor leaves errors of both runs alike."""

    least_verified: int = setting(50, "")
    """Fewer cells give no meaningful share."""

    wanted_survival: float = setting(0.99, "")
    """Share of the outcomes that survive at an automatic tolerance."""

    candidate_rtols: tuple[float, ...] = setting((1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8), "")
    """Tolerances for the automatic choice, the loosest first."""

    points_of_a_loop: int = setting(1000, "")
    """Samples of a period of a hysteresis loop; fewer cut its corners."""

    loop_periods: int = setting(3, "")
    """Periods of a hysteresis loop, the last of which counts; fewer still move away from the first way there."""

    loop_speed: float = setting(1e-3, "")
    """In Stribeck velocities: faster loops lose energy in the damping of bristles, which the table has by itself."""

    loop_tolerance: float = setting(1e-6, "")
    """Relative tolerance of the solver along a loop; the last digit of the table is then that of the law."""

    loop_amplitudes: tuple[float, float] = setting((0.1, 0.5), "")
    """In deflections of the first stiffness by static friction: one where bristles hardly slip, one where they do."""

    loop_error: float = setting(0.05, "")
    """Loops whose areas or stiffnesses differ by less are hardly told apart in a log."""

    needed_bandwidths: int = setting(48, "")
    """Bandwidths at which a controller alone is tried: 5 % apart over a factor of ten."""

    needed_machines: int = setting(200, "")
    """Machines on which it is tried; of fewer a share of 99 % does not show."""

    needed_rtol: float = setting(1e-5, "")
    """Relative tolerance of their moves, whose times are then off by a thousandth; that moves none into position."""

    limit_factors: int = setting(400, "")
    """Factors on the bandwidth that are looked at below a limit of it: the fastest lies within a percent of it."""

    followed_share: float = setting(0.5, "")
    """Share of machines in position from which on longer runs tell whether they stay there. With fewer, an option does
    not do, and its longer runs would take as long as all others together."""
