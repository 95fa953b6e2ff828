"""Settings of the fit of the whole model by its output error."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class OutputErrorSettings(Settings):
    """Settings of the fit of the whole model, and of the decision which parameters to report."""

    # Starts of a fit, and how far each is refined.
    starts_of_a_fit: int = setting(1024, "")
    """Starts that are simulated. A quarter misses optima of stick-slip records; more take longer."""

    starts_refined_first: int = setting(20, "")
    """Best starts that are refined a little, because the very best often lead to worse optima in stick-slip records."""

    starts_refined_further: int = setting(6, "")
    """Starts that are refined further; only the best of these is finished."""

    logarithm_of_core_starts: float = setting(0.3, "")
    """Distance of starts of mass and friction from the inverse model, in the logarithm, each way. Farther ones fail."""

    range_share_of_core_starts: float = setting(0.02, "")
    """Distance of starts of parameters that may be 0, each way, relative to their range."""

    samples_of_all_starts: float = setting(6e6, "")
    """Samples over which all starts together are simulated. Longer records are cut."""

    stretches_of_a_screening: int = setting(8, "")
    """Stretches into which a long record is cut for its starts, because slow motion may occur anywhere."""

    iterations_of_first_starts: int = setting(3, "")
    """First iterations, which show the quality of a start."""

    iterations_of_further_starts: int = setting(5, "")
    """Further iterations of the starts that are kept."""

    iterations_of_a_fit: int = setting(30, "")
    """Most iterations of the best start. Fits that need more are on a ridge."""

    cost_share_of_a_fit: float = setting(1e-6, "")
    """Relative decrease of the squares at which the best fit ends. A larger one leaves slow parameters short."""

    starts_near_a_fit: int = setting(127, "")
    """Starts around an earlier fit, because the loop of a stage that hunts has other optima."""

    deviations_of_near_starts: float = setting(3.0, "")
    """Width of these starts in standard deviations of the earlier fit, which is of another problem."""

    noise_ratio_of_an_explained_record: float = setting(2.0, "")
    """Largest ratio of residual to noise of a fit that explains its record."""

    smallest_singular_value: float = setting(1e-3, "")
    """Ratio of singular values below which fitted numbers cannot be distinguished."""

    seed_of_starts: int = setting(7, "")
    """Seed of the starts, which makes results repeatable."""

    # What is believed of bearings: ranges of the parameters.
    highest_friction_ratio: float = setting(4.0, "")
    """Largest plausible ratio of static to Coulomb friction of a bearing. The thesis's rig has 3."""

    shortest_bristle_bend: float = setting(5e-8, "m")
    """Smallest deflection of a bearing's bristles before they slip."""

    longest_bristle_bend: float = setting(3e-4, "m")
    """Largest deflection of a bearing's bristles before they slip."""

    stribeck_exponents: tuple[float, ...] = setting((0.5, 2.5), "")
    """Range of plausible exponents of a Stribeck curve: 0.5 to 2 in Armstrong-Helouvry et al. 1994, with a margin."""

    exponent_share_of_a_start: float = setting(0.995, "")
    """Factor on the stated exponent at which its fit starts, because 1 and 2 have equations without an exponent."""

    bearing_radii: tuple[float, ...] = setting((5e-3, 0.5), "m")
    """Smallest and largest radius of rotary bearings, by which lengths become angles."""

    highest_stribeck_velocity: float = setting(0.02, "m/s")
    """Highest plausible Stribeck velocity of a bearing."""

    # Simulation of a stage on a log: what counts, and how it is held to the log.
    derivative_step: float = setting(1e-4, "")
    """Step of a fitted number for derivatives. Smaller ones drown in the tolerance; larger ones shift break-aways."""

    run_tolerance: float = setting(1e-5, "")
    """Relative tolerance of the runs. Looser ones blur derivatives."""

    bandwidth_of_holding: float = setting(10.0, "Hz")
    """Highest bandwidth of the controller that drives a stage along a log. A faster one shakes the bristles."""

    time_of_a_start: float = setting(0.1, "s")
    """Time at the start of a closed loop that does not count (friso's choice)."""

    record_share_of_a_start: float = setting(0.05, "")
    """Largest part of a record that this time may take (friso's choice)."""

    samples_of_first_velocity: int = setting(10, "")
    """Samples from which the initial velocity is computed."""

    time_of_a_rest: float = setting(0.1, "s")
    """Shortest time for which a stage at rest stands still."""

    deviations_of_a_rest: float = setting(20.0, "")
    """Largest motion of a stage at rest, in standard deviations of the position's noise."""

    smoothing_steps: tuple[int, ...] = setting((1, 2, 4, 8), "")
    """Cut-offs at which the position is smoothed, over that of the inverse model, tried in turn."""

    time_constants_of_settling: float = setting(3.0, "")
    """Time constants after which the guiding controller has forgotten the start."""

    samples_of_outputs: int = setting(16384, "")
    """Samples for which outputs are computed at once, to stay in the processor's caches."""

    sample_time_tolerance: float = setting(1e-3, "")
    """Relative difference below which the sample times of log and drive are equal."""

    # Profiles: how far a parameter can be moved, all others following.
    points_of_a_profile: int = setting(5, "")
    """Values over its range at which a parameter is fixed. Fewer make intervals coarser, not narrower."""

    deviations_of_a_profile: float = setting(4.0, "")
    """First reach of these values about the fit, in standard deviations."""

    widening_of_a_profile: float = setting(5.0, "")
    """Factor by which the reach grows each time that the interval does not end within."""

    iterations_of_a_profile: int = setting(5, "")
    """Most iterations of each fit. Fewer make intervals along a ridge too narrow."""

    cost_share_of_a_profile: float = setting(0.1, "")
    """Relative decrease of the excess at which a fit of a profile ends. A larger one ends too early on a ridge."""

    # Levenberg-Marquardt steps.
    first_damping: float = setting(1e-2, "")
    """Damping of the first step, relative to the curvature."""

    highest_damping: float = setting(1e3, "")
    """Damping at which a fit that does not improve is abandoned."""

    cost_share_of_refinement: float = setting(1e-4, "")
    """Relative decrease of the squares at which a fit ends by default."""

    range_share_inside: float = setting(1e-9, "")
    """Distance of numbers from the ends of their ranges, relative to the range."""

    # Repetitions of a fit on simulated logs.
    repetitions_of_a_fit: int = setting(4, "")
    """Simulated logs on which the fit is repeated. Student's t of 4 is 1.4 times that of a known spread."""

    iterations_of_a_repetition: int = setting(8, "")
    """Iterations of a repeated fit, started from the true values."""

    seed_of_repetitions: int = setting(11, "")
    """Seed of the noise of simulated logs, which makes results repeatable."""

    # From fitted numbers to keys of the stage file.
    static_error_of_following: float = setting(0.05, "")
    """Relative error by which static friction is too high where a stage follows a log, 3 to 6 %
    (docs/evidence/identify.md)."""

    widest_logarithm: float = setting(0.7, "")
    """Half-width of an interval, in the logarithm, beyond which a record bounds nothing."""

    # What a motion covers: steady speeds, and starts in which bristles bend.
    friction_share_of_inertia: float = setting(0.5, "")
    """Largest inertia in steady motion, relative to Coulomb friction."""

    time_of_steady_motion: float = setting(0.02, "s")
    """Shortest steady motion. Shorter ones show no speed above the noise."""

    speed_factor_of_coverage: float = setting(3.0, "")
    """Factor to both sides of the Stribeck velocity within which there must be steady motion."""

    deviations_of_a_bend: float = setting(5.0, "")
    """Smallest visible bend of bristles, in standard deviations of the position's noise."""

    samples_of_a_bend: int = setting(5, "")
    """Fewest samples in which bristles are seen bending at the start of a motion."""

    starts_with_a_bend: int = setting(3, "")
    """Fewest starts of motion with visible bending. One may be chance."""

    # Machines drawn from what a record leaves open.
    machines_drawn: int = setting(16, "")
    """Machines drawn from the ranges that a record leaves open: two fillings of the lanes."""

    seed_of_draws: int = setting(5, "")
    """Seed of these draws, which makes results repeatable."""

    # What a log does not say of the motion between its samples.
    probability_of_an_effect: float = setting(0.999, "")
    """Probability above which a worse explanation is dropped."""

    # Which parameters a record shows.
    noise_ratio_of_a_closed_fit: float = setting(1.2, "")
    """Ratio of residual to noise up to which a closed-loop fit is judged by its noise alone."""

    residual_ratio_out_of_step: float = setting(1.5, "")
    """Ratio of residuals above which a closed loop is out of step with the log."""

    probability_of_more_parameters: float = setting(0.99, "")
    """Probability above which parameters that are not determined one by one improve the fit."""

    better_fits_by_profiles: int = setting(3, "")
    """Most times that a profile may lead to a better fit."""

    sampled_bristle_frequency: float = setting(0.25, "")
    """Highest frequency of the mass on its bristles, times the sample time, that a log can show."""

    factor_of_a_sharp_profile: float = setting(3.0, "")
    """Largest ratio between the ends of an interval of a determined parameter."""
