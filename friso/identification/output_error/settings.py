"""Settings of the fit of the whole model by its output error."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class OutputErrorSettings(Settings):
    """How the whole model is fitted to a log, and what of the fit is believed."""

    # Starts of a fit, and how far each is refined.
    starts_of_a_fit: int = setting(1024, "")
    """Starts that are simulated: a quarter misses optima of stick-slip records, more takes longer."""

    starts_refined_first: int = setting(20, "")
    """Best starts that are refined a little: of a stage that sticks the best often lead elsewhere."""

    starts_refined_further: int = setting(6, "")
    """Starts that are refined further; the best of these to the end."""

    logarithm_of_core_starts: float = setting(0.3, "")
    """How far starts of mass and friction are off the inverse model, each way: farther ones are lost."""

    range_share_of_core_starts: float = setting(0.02, "")
    """How far starts of parameters that may be 0 are off, each way, as a share of their range."""

    samples_of_all_starts: float = setting(1e7, "")
    """Samples over which all starts together are simulated; beyond it long records are cut."""

    stretches_of_a_screening: int = setting(8, "")
    """Stretches into which a long record is cut for its starts: slow motion may come anywhere."""

    iterations_of_first_starts: int = setting(3, "")
    """Iterations that show what a start is worth."""

    iterations_of_further_starts: int = setting(5, "")
    """Further iterations of the starts that are kept."""

    iterations_of_a_fit: int = setting(30, "")
    """Iterations of the best start at most; fits that need more are on a ridge."""

    cost_share_of_a_fit: float = setting(1e-6, "")
    """Share by which the squares of the best fit fall at last; larger leaves slow parameters short."""

    starts_near_a_fit: int = setting(127, "")
    """Starts about an earlier fit: the loop of a stage that hunts has optima of its own."""

    deviations_of_near_starts: float = setting(3.0, "")
    """How many times as far as its covariance says: that fit is of another problem."""

    noise_ratio_of_an_explained_record: float = setting(2.0, "")
    """A fit that leaves at most so many times the noise explains its record."""

    smallest_singular_value: float = setting(1e-3, "")
    """Share of the largest singular value below which fitted numbers cannot be told apart."""

    seed_of_starts: int = setting(7, "")
    """Seed of the starts, so that results repeat."""

    # What is believed of bearings: ranges of the parameters.
    highest_friction_ratio: float = setting(4.0, "")
    """Largest ratio of static to Coulomb friction believed of a bearing; the thesis's rig has 3."""

    shortest_bristle_bend: float = setting(5e-8, "m")
    """Least length that bristles bend before they slip, of any bearing."""

    longest_bristle_bend: float = setting(3e-4, "m")
    """Largest length that bristles bend before they slip, of any bearing."""

    stribeck_exponents: tuple[float, ...] = setting((0.5, 2.5), "")
    """Exponents believed of a Stribeck curve: 0.5 to 2 in Armstrong-Helouvry et al. 1994, and a margin."""

    exponent_share_of_a_start: float = setting(0.995, "")
    """Share of the stated exponent at which its fit begins: 1 and 2 have equations without it."""

    bearing_radii: tuple[float, ...] = setting((5e-3, 0.5), "m")
    """Radii of bearings that turn, by which lengths become angles."""

    highest_stribeck_velocity: float = setting(0.02, "m/s")
    """Speed up to which the Stribeck effect of a bearing may act."""

    # Simulation of a stage on a log: what counts, and how it is held to the log.
    derivative_step: float = setting(1e-4, "")
    """Step of a fitted number for derivatives: smaller drowns in the tolerance, larger passes break-aways."""

    run_tolerance: float = setting(1e-5, "")
    """Relative tolerance of the runs: looser ones blur derivatives."""

    bandwidth_of_holding: float = setting(10.0, "Hz")
    """Highest bandwidth of the controller that holds a stage to a log; a faster one shakes the bristles."""

    time_of_a_start: float = setting(0.1, "s")
    """For so long a closed loop shows how it was started, and does not count: our choice."""

    record_share_of_a_start: float = setting(0.05, "")
    """Share of a record that this takes at most: our choice."""

    samples_of_first_velocity: int = setting(10, "")
    """Samples from which the velocity at the beginning is taken."""

    time_of_a_rest: float = setting(0.1, "s")
    """Time for which a stage has to stand still to rest."""

    deviations_of_a_rest: float = setting(20.0, "")
    """Deviations of the position's noise within which a stage rests."""

    smoothing_steps: tuple[int, ...] = setting((1, 2, 4, 8), "")
    """Cut-offs at which the position is smoothed, over that of the inverse model, tried in turn."""

    time_constants_of_settling: float = setting(3.0, "")
    """After so many time constants the holding controller has forgotten the start."""

    samples_of_outputs: int = setting(16384, "")
    """Samples for which outputs are computed at once: they stay in the processor's caches."""

    sample_time_tolerance: float = setting(1e-3, "")
    """Share by which sample times of log and drive may differ to count as one."""

    # Profiles: how far a parameter can be moved, all others following.
    points_of_a_profile: int = setting(7, "")
    """Values over its range at which a parameter is held; fewer make intervals coarser, no narrower."""

    deviations_of_a_profile: float = setting(4.0, "")
    """Deviations about the fit that the values reach at first."""

    widening_of_a_profile: float = setting(5.0, "")
    """Times as far each time that the interval does not end within."""

    iterations_of_a_profile: int = setting(5, "")
    """Iterations of each fit at most; fewer make intervals along a ridge too narrow."""

    cost_share_of_a_profile: float = setting(0.1, "")
    """Share of what ends an interval by which a fit may still fall; larger ends too early on a ridge."""

    # Levenberg-Marquardt steps.
    first_damping: float = setting(1e-2, "")
    """Damping of the first step, as a share of the curvature."""

    highest_damping: float = setting(1e3, "")
    """Damping at which a fit that gets no better is left."""

    cost_share_of_refinement: float = setting(1e-4, "")
    """Share by which the squares of a fit fall at last, unless more is asked."""

    range_share_inside: float = setting(1e-9, "")
    """Share of a range by which a number is kept inside it."""

    # Repetitions of a fit on simulated logs.
    repetitions_of_a_fit: int = setting(4, "")
    """Simulated logs that the fit is repeated on: Student's t of 4 is 1.4 times that of a known spread."""

    iterations_of_a_repetition: int = setting(8, "")
    """Iterations from the truth on: what has not settled by then is far off."""

    seed_of_repetitions: int = setting(11, "")
    """Seed of the noise of simulated logs, so that results repeat."""

    # From fitted numbers to keys of the stage file.
    static_error_of_following: float = setting(0.05, "")
    """Static friction comes out 3 to 6 % too high where a stage follows a log (docs/evidence/identify.md)."""

    widest_logarithm: float = setting(0.7, "")
    """Half an interval of the logarithm beyond which a record bounds nothing: linear steps fail by a factor of 2."""

    # What a motion covers: steady speeds, and starts in which bristles bend.
    friction_share_of_inertia: float = setting(0.5, "")
    """Share of Coulomb friction that inertia stays below in a steady motion."""

    time_of_steady_motion: float = setting(0.02, "s")
    """Shortest steady motion; shorter ones show no speed above the noise."""

    speed_factor_of_coverage: float = setting(3.0, "")
    """A Stribeck velocity is shown by steady motion within this factor to both sides."""

    deviations_of_a_bend: float = setting(5.0, "")
    """Deviations of the position's noise by which bristles have to bend to be seen."""

    samples_of_a_bend: int = setting(5, "")
    """Samples in which bristles are seen bending at the start of a motion, at least."""

    starts_with_a_bend: int = setting(3, "")
    """Such starts of a motion at least: one may be chance."""

    # Machines drawn from what a record leaves open.
    machines_drawn: int = setting(16, "")
    """Machines drawn from what a record leaves open: two fillings of the lanes."""

    seed_of_draws: int = setting(5, "")
    """Seed of these draws, so that results repeat."""

    # What a log does not say of the motion between its samples.
    probability_of_an_effect: float = setting(0.999, "")
    """Probability with which a worse explanation has to be wrong to be left out."""

    # Which parameters a record shows.
    noise_ratio_of_a_closed_fit: float = setting(1.2, "")
    """A fit within this ratio of the noise is where it belongs, and is judged by its noise alone."""

    residual_ratio_out_of_step: float = setting(1.5, "")
    """A closed loop that leaves so many times what the stage that follows the log leaves is out of step."""

    probability_of_more_parameters: float = setting(0.99, "")
    """Probability that parameters which nothing shows one by one improve the fit."""

    better_fits_by_profiles: int = setting(3, "")
    """Times at most that a profile leads to a better fit."""

    sampled_bristle_frequency: float = setting(0.25, "")
    """Frequency of the mass on its bristles, times the sample time, that a log still follows."""

    factor_of_a_sharp_profile: float = setting(3.0, "")
    """Factor between the ends of an interval within which a parameter counts as shown."""
