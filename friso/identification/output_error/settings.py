"""Settings of the fit of the whole model by its output error."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class OutputErrorSettings(Settings):
    """Settings of the fit of the whole model, and of the decision which parameters to report."""

    # Starting points of a fit and their refinement.
    starts_of_a_fit: int = setting(1024, "")
    """Number of starting points of a fit. A quarter of them misses optima of stick-slip records."""

    starts_refined_first: int = setting(20, "")
    """Number of best starts that are refined briefly. For stick-slip records the very best often lead to worse
    optima."""

    starts_refined_further: int = setting(6, "")
    """Number of briefly refined starts that are refined further. Only the best of them is iterated to convergence."""

    logarithm_of_core_starts: float = setting(0.3, "")
    """Largest distance of starting masses and frictions from the inverse model's values, in the logarithm."""

    range_share_of_core_starts: float = setting(0.02, "")
    """Largest distance of a start from the inverse model's value, relative to the range, for parameters that may be
    0."""

    samples_of_all_starts: float = setting(6e6, "")
    """Total number of samples simulated for all starts together. Longer records are cut."""

    stretches_of_a_screening: int = setting(8, "")
    """Stretches into which a long record is cut for its starts, because slow motion may occur anywhere."""

    iterations_of_first_starts: int = setting(5, "")
    """Number of iterations of the brief refinement, which shows how good a start is."""

    iterations_of_further_starts: int = setting(7, "")
    """Number of further iterations of the starts kept after the brief refinement."""

    iterations_of_a_fit: int = setting(30, "")
    """Largest number of iterations of the best start. Fits that need more are on a ridge."""

    cost_share_of_a_fit: float = setting(1e-6, "")
    """Relative decrease of the sum of squares per iteration at which the best fit ends. Larger values stop too
    early."""

    cost_share_of_another_optimum: float = setting(0.9, "")
    """Ratio of a new fit's sum of squares to the last one's below which it counts as another optimum, and a further
    search may pay."""

    further_searches: int = setting(4, "")
    """Largest number of further searches, each of which follows another optimum."""

    starts_near_a_fit: int = setting(127, "")
    """Number of starts around an earlier fit, needed because the closed loop of a hunting stage has other optima."""

    deviations_of_near_starts: float = setting(3.0, "")
    """Spread of the starts around an earlier fit, in that fit's standard deviations."""

    noise_ratio_of_an_explained_record: float = setting(2.0, "")
    """Largest ratio of residual to noise of a fit that explains its record."""

    smallest_singular_value: float = setting(1e-3, "")
    """Ratio of a singular value of the Jacobian to the largest, below which parameters cannot be distinguished."""

    seed_of_starts: int = setting(7, "")
    """Random seed of the starts, which makes results repeatable."""

    # Plausible ranges of a bearing's parameters.
    coulomb_friction_of_one_way: tuple[float, float] = setting((0.18, 2.2), "")
    """Range left to Coulomb friction, in shares of its sum with a constant force. A cable or a tilt helps a motion by
    half of the friction, or opposes it by four times as much."""

    highest_friction_ratio: float = setting(4.0, "")
    """Largest plausible ratio of static to Coulomb friction of a bearing. The thesis's rig has 3."""

    shortest_bristle_bend: float = setting(5e-8, "m")
    """Smallest deflection of a bearing's bristles before they slip."""

    longest_bristle_bend: float = setting(3e-4, "m")
    """Largest deflection of a bearing's bristles before they slip."""

    stribeck_exponents: tuple[float, ...] = setting((0.5, 2.5), "")
    """Range of plausible exponents of a Stribeck curve: 0.5 to 2 in Armstrong-Helouvry et al. 1994, with a margin."""

    exponent_share_of_a_start: float = setting(0.995, "")
    """Start of a fitted Stribeck exponent, relative to the stated one. Exactly 1 and 2 have simplified equations."""

    bearing_radii: tuple[float, ...] = setting((5e-3, 0.5), "m")
    """Smallest and largest radius of rotary bearings, which convert bristle deflections to angles."""

    highest_stribeck_velocity: float = setting(0.02, "m/s")
    """Highest plausible Stribeck velocity of a bearing."""

    friction_share_of_linearity: float = setting(0.01, "")
    """Largest error of a force sensor's linearity that counts, relative to Coulomb friction. More would hide effects
    of a tenth of the friction."""

    # Simulation of a stage along a log, and the samples that count.
    derivative_step: float = setting(1e-4, "")
    """Step of a fitted number for finite differences. Smaller steps drown in the solver's tolerance."""

    run_tolerance: float = setting(1e-5, "")
    """Relative tolerance of simulations for a fit. Looser tolerances spoil finite differences."""

    bandwidth_of_holding: float = setting(10.0, "Hz")
    """Highest bandwidth of the controller that drives a stage along a log. A faster one shakes the bristles."""

    time_of_a_start: float = setting(0.1, "s")
    """Time at the start of a closed-loop record that the fit leaves out (friso's choice)."""

    record_share_of_a_start: float = setting(0.05, "")
    """Largest fraction of a record that is left out at its start (friso's choice)."""

    samples_of_first_velocity: int = setting(10, "")
    """Number of samples from which the initial velocity is computed."""

    time_of_a_rest: float = setting(0.1, "s")
    """Shortest standstill that counts as rest."""

    deviations_of_a_rest: float = setting(20.0, "")
    """Largest motion of a stage at rest, in standard deviations of the position's noise."""

    smoothing_steps: tuple[int, ...] = setting((1, 2, 4, 8), "")
    """Cut-off frequencies tried for smoothing the position, relative to the inverse model's cut-off."""

    time_constants_of_settling: float = setting(3.0, "")
    """Number of its time constants after which the guiding controller has forgotten the initial state."""

    samples_of_outputs: int = setting(16384, "")
    """Number of samples whose outputs are computed at once, to stay in the processor's caches."""

    sample_time_tolerance: float = setting(1e-3, "")
    """Relative difference below which sample times of log and drive count as equal."""

    # Profile intervals: one parameter is moved and all others refitted.
    points_of_a_profile: int = setting(5, "")
    """Number of values at which a profiled parameter is fixed. Fewer make intervals coarser, not narrower."""

    deviations_of_a_profile: float = setting(4.0, "")
    """First distance from the fit to which a profile reaches, in standard deviations."""

    widening_of_a_profile: float = setting(5.0, "")
    """Factor by which a profile's reach grows whenever the interval's end lies beyond it."""

    iterations_of_a_profile: int = setting(5, "")
    """Largest number of iterations of each fit of a profile. Fewer make intervals along a ridge too narrow."""

    cost_share_of_a_profile: float = setting(0.1, "")
    """Relative decrease of the excess cost per iteration at which a fit of a profile ends. Larger values end too
    early."""

    # Levenberg-Marquardt steps.
    first_damping: float = setting(1e-2, "")
    """Levenberg-Marquardt damping of the first step, relative to the curvature."""

    highest_damping: float = setting(1e3, "")
    """Levenberg-Marquardt damping at which a fit that does not improve is abandoned."""

    cost_share_of_refinement: float = setting(1e-4, "")
    """Relative decrease of the sum of squares per iteration at which a fit ends by default."""

    share_of_predicted_fall: float = setting(0.5, "")
    """Fall of the sum of squares, relative to its prediction, below which derivatives are computed anew."""

    range_share_inside: float = setting(1e-9, "")
    """Smallest distance of a fitted number from the ends of its range, relative to the range."""

    # Repetitions of a fit on simulated logs.
    repetitions_of_a_fit: int = setting(4, "")
    """Number of simulated logs on which a fit is repeated. With 4, Student's t is 1.4 times the normal quantile."""

    iterations_of_a_repetition: int = setting(15, "")
    """Number of iterations of a repeated fit, which starts from the true values."""

    seed_of_repetitions: int = setting(11, "")
    """Random seed of the noise of simulated logs, which makes results repeatable."""

    # From fitted numbers to keys of the stage file.
    static_error_of_following: float = setting(0.05, "")
    """Relative error by which static friction is too high where a stage follows a log, 3 to 6 %
    (docs/evidence/identify.md)."""

    widest_logarithm: float = setting(0.7, "")
    """Half-width of a 95 % interval, in the logarithm, beyond which a parameter counts as not determined."""

    # Coverage of a motion: steady speeds, and starts in which bristles bend.
    friction_share_of_inertia: float = setting(0.5, "")
    """Largest inertia force in motion that counts as steady, relative to Coulomb friction."""

    time_of_steady_motion: float = setting(0.02, "s")
    """Shortest stretch of steady motion. Shorter stretches show no speed above the noise."""

    speed_factor_of_coverage: float = setting(3.0, "")
    """Factor below and above the Stribeck velocity within which a record must move steadily to show it."""

    deviations_of_a_bend: float = setting(5.0, "")
    """Smallest visible bend of bristles, in standard deviations of the position's noise."""

    samples_of_a_bend: int = setting(5, "")
    """Fewest samples that must show the bristles bending at the start of a motion."""

    starts_with_a_bend: int = setting(3, "")
    """Fewest starts of motion with visible bending. One may be chance."""

    # Machines drawn from what a record leaves open.
    machines_drawn: int = setting(16, "")
    """Number of machines drawn from the ranges that a record leaves open; they fill the solver's lanes twice."""

    seed_of_draws: int = setting(5, "")
    """Random seed of the drawn machines, which makes results repeatable."""

    # Choices that a log leaves open for the motion between its samples.
    probability_of_an_effect: float = setting(0.999, "")
    """Confidence with which one explanation of a record must be better before the other is dropped."""

    # Which parameters a record shows.
    noise_ratio_of_a_closed_fit: float = setting(1.2, "")
    """Ratio of residual to noise up to which a closed-loop fit is judged by its noise alone."""

    residual_ratio_out_of_step: float = setting(1.5, "")
    """Ratio of residuals above which a closed loop is out of step with the log."""

    probability_of_more_parameters: float = setting(0.99, "")
    """Confidence (F-test) with which parameters not determined singly must improve a fit together to be kept."""

    better_fits_by_profiles: int = setting(3, "")
    """Largest number of times that a fit is replaced by a better one found in a profile."""

    sampled_bristle_frequency: float = setting(0.25, "")
    """Highest frequency of the mass on its bristles, times the sample time, that a log can show."""

    factor_of_a_sharp_profile: float = setting(3.0, "")
    """Largest ratio of upper to lower end of the interval of a determined parameter."""


settings = OutputErrorSettings.live()
