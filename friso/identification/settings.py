"""Settings of identification: doubts, the inverse model, experiments, and how results are shown."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DoubtSettings(Settings):
    """Settings of doubts about logs: when one is raised, and how far its consequences reach."""

    error_share_of_a_cause: float = setting(0.7, "")
    """Largest ratio of model errors with and without a cause for the cause to count. Nearer 1, chance finds causes."""

    error_ratio_of_rival_causes: float = setting(1.5, "")
    """Largest ratio of a cause's error to the best cause's error for both to count."""

    motion_periods_of_a_shift: float = setting(0.25, "")
    """Longest shift of the force searched, in periods of the motion's bandwidth. Beyond it a sign would turn."""

    motion_periods_of_an_average: float = setting(1.0, "")
    """Longest average searched, in periods of the motion's bandwidth. Longer averages leave no motion."""

    places_of_a_force: int = setting(40, "")
    """Number of places along the way with a separate force. Fewer miss cogging; more take longer."""

    rows_for_each_place: int = setting(20, "")
    """Fewest rows of the inverse model for each place with a separate force. With fewer, a place fits noise."""

    samples_of_a_reference: int = setting(20, "")
    """Fewest samples of a segment from which the filter can compute the reference's motion."""

    speed_share_of_a_fast_stage: float = setting(0.1, "")
    """Speed above which a missing feedforward must show, relative to the highest. Of 400 drawn sound logs, 1 was
    reported (98 if all speeds counted); of 186 logs without their feedforward, 130 were (174)."""

    power_share_of_an_oscillation: float = setting(0.5, "")
    """Fraction of the residual's power in one peak that counts as an oscillation."""

    samples_of_a_spectrum: int = setting(256, "")
    """Number of samples in each piece of the residual for its spectrum. Longer pieces resolve more and scatter more."""

    share_of_a_whole_record: float = setting(0.75, "")
    """Length of the longest stretch without gaps below which gaps are reported, relative to the record."""

    digits_of_a_fine_position: float = setting(500.0, "")
    """Smallest travel at which the resolution of the position is fine, in steps of the position."""

    force_share_of_a_constant_force: float = setting(0.1, "")
    """Smallest constant force that is reported beside friction, relative to the force's standard deviation."""

    force_share_of_no_friction: float = setting(1e-3, "")
    """Smallest possible Coulomb friction, relative to the force's standard deviation."""

    deviations_of_differing_halves: float = setting(3.29, "")
    """Standard deviations by which the halves of a sound record differ once in a thousand times."""

    ratio_of_comparable_halves: float = setting(3.0, "")
    """Largest ratio of the halves' RMS speeds, and of their RMS accelerations, at which they are compared."""

    noise_ratio_of_a_lacking_model: float = setting(5.0, "")
    """Ratio of residual to noise above which the model lacks something. It was at most 2.6 on 12 drawn sound logs, and
    8 on two logs with play."""

    noise_ratio_of_imitated_bristles: float = setting(3.0, "")
    """Ratio of residual to noise above which missing effects may look like bristles. With play, a fit that left 8 times
    the noise gave 31 to 96 kN/m instead of 262 kN/m."""

    bristles_fitted_too_soft: float = setting(10.0, "")
    """Largest ratio of the true stiffness or damping of bristles to one that missing effects imitate. With play it was
    8.5."""

    bristles_fitted_too_stiff: float = setting(3.0, "")
    """Largest ratio of imitated stiffness or damping of bristles to the true one. None above 1 was seen."""

    error_of_a_poor_model: float = setting(0.3, "")
    """Relative error of the force above which a model does not describe the record."""

    error_of_an_unsettled_record: float = setting(0.1, "")
    """Residual, relative to the force, of both the fit and the best cause above which intervals are widened."""

    error_share_of_a_clearly_better_model: float = setting(0.5, "")
    """Ratio of the whole model's error to the best cause's, or the inverse model's, below which no cause is named, and
    the whole model is not rejected."""

    error_ratio_of_a_contradiction: float = setting(1.5, "")
    """Ratio of the whole model's error to the inverse model's above which it contradicts the log."""

    error_of_a_fine_model: float = setting(0.01, "")
    """Relative error of the force below which a whole model contradicts nothing."""

    widening_where_much_is_left: float = setting(2.0, "")
    """Factor on intervals if a large residual is unexplained, and on intervals of slow friction if any is. Without it,
    intervals missed the truth by up to 1.8 half-widths on known machines with filtered signals."""

    bandwidths_of_a_coupling: float = setting(2.0, "")
    """Cut-off of the motion in tests for a coupling, relative to its bandwidth. For 3 kg with a third behind 40 Hz, 2
    and 3 correct a mass 1.3 % too large; 5 corrects half of the error."""

    mass_share_of_a_tried_coupling: float = setting(0.05, "")
    """Force of a tried coupling, relative to inertia. Larger forces are not linear."""

    share_of_a_tried_load: float = setting(0.02, "")
    """Size of tried load-dependent friction, relative to the motor's force."""

    shares_of_a_load: tuple[float, ...] = setting((0.02, 0.5), "")
    """Smallest and largest plausible ratio of load-dependent friction to the motor's force. It was below 0.009 on sound
    logs; above 0.5 a transmission locks itself."""

    power_left_by_a_load: float = setting(0.7, "")
    """Largest fraction of the residual's power left by load-dependent friction if it is named. It was 0.02 to 0.26 on
    drawn logs with a ratio of 0.1, and at least 0.92 on sound logs."""

    friction_share_of_a_digit: float = setting(0.1, "")
    """Resolution of the force above which it is coarse, relative to Coulomb friction."""

    power_left_by_an_effect: float = setting(0.85, "")
    """Largest fraction of the residual's power that an effect leaves if it is named. On 45 drawn logs with effects of a
    tenth of the friction and more, the right effect left 0.01 to 0.84; on sound logs no effect explained anything."""

    reach_of_an_effect: float = setting(2.0, "")
    """Factor by which intervals exceed the shift of the fit by an effect. One linear step recovered at most 60 % of an
    error of 1.5 % by a coupling, and half (in the logarithm) of the damping that three samples of delay doubled."""

    places_of_a_force_along: int = setting(12, "")
    """Number of places along the way with a separate force or friction; each takes a simulated run."""

    travels_of_a_pitch: tuple[float, ...] = setting((2.0, 60.0), "")
    """Least and largest number of cogging periods along the travel that are tried."""

    pitches_for_each_travel: int = setting(4, "")
    """Number of pitches tried per additional period along the travel. Between two of them the phase slips by a quarter
    turn."""

    digits_of_a_play: float = setting(5.0, "")
    """Smallest width of a play that can be named, in steps of the position."""

    tried_falling_damping: float = setting(0.1, "")
    """Tried damping at rest of bristles whose damping falls with the speed, relative to half of the critical one."""

    least_falling_damping: float = setting(0.1, "")
    """Smallest fitted damping at rest that counts as falling, relative to half of the critical one."""

    stiffer_bristles: tuple[float, ...] = setting((4.0, 8.0, 16.0), "")
    """Stiffnesses of bristles that are tried beside the fitted one, relative to it."""

    plays_tried: tuple[float, ...] = setting((8e-6, 1e-3), "m")
    """Smallest and largest width of play that is tried. Narrower play passes within a few samples; wider play is
    obvious."""

    ratio_of_plays: float = setting(1.4, "")
    """Ratio of successive tried widths of play. A width wrong by a factor of 1.5 explains half of the effect."""

    force_share_of_a_told_effect: float = setting(0.015, "")
    """Fraction of the force's standard deviation below which a force along the way only widens intervals, unnamed.
    Sound logs showed up to 0.014; a tenth of the friction is at least 0.02."""

    samples_of_a_crossing: float = setting(5.0, "")
    """Fewest samples, on average, in which a load crosses a tried play. With 2, reversals of a sound sine at 500 Hz
    looked like play; with 10, plays of 20 um would be missed at 1 kHz."""

    bandwidths_of_a_play: float = setting(4.0, "")
    """Bandwidth of the motion in tests for play, relative to the usual bandwidth. At 1 a gap that is crossed in 5 ms is
    blurred; at 16 noise dominates."""

    power_share_of_a_drift: float = setting(0.5, "")
    """Largest ratio of residuals with a changing and a constant delay. It was 0.02 to 0.25 on drawn logs."""

    mass_share_of_a_tried_play: float = setting(0.05, "")
    """Tried loose fraction of the mass. Play acts in proportion to it."""

    mass_share_of_a_loose_load: float = setting(0.5, "")
    """Assumed mass of a loose load that friction slows down, relative to the total mass."""

    most_of_a_play: float = setting(1.5, "")
    """Largest plausible fitted fraction of mass or friction behind a play. Much more than 1 shows another effect."""

    mass_share_of_a_play: float = setting(0.1, "")
    """Smallest loose fraction of the mass for which play is reported. It was 0.03 to 0.08 on 4 of 40 drawn sound logs,
    and at least 0.12 on 8 with play."""

    bandwidths_of_a_delayed_force: float = setting(10.0, "")
    """Cut-off of the force for its derivative, in bandwidths of the motion. Beyond it the derivative is noise."""

    samples_of_a_tried_delay: float = setting(0.05, "")
    """Tried delay, in samples. Larger delays act on break-aways in jumps."""

    power_left_by_a_delay: float = setting(0.3, "")
    """Largest fraction of the residual's power that a delay leaves if it is named. It was 0.01 to 0.09 on 6 drawn logs
    with a delay, and at least 0.4 on 6 sound logs of coarse encoders."""

    samples_of_a_delay: float = setting(0.25, "")
    """Smallest reported delay, in samples. Shorter delays may come from holding the force between samples."""

    bandwidths_of_a_controller: float = setting(3.0, "")
    """Cut-off of error and force in bandwidths of the motion, above which the derivative of the error is noise."""

    rows_for_each_gain: int = setting(5, "")
    """Fewest rows for each gain in either part of a record. With fewer a gain fits noise."""

    shares_of_a_part: tuple[float, ...] = setting((0.1, 0.9), "")
    """Range of the fractions of a record between which gains may change. Shorter parts show too little."""

    levels_of_a_part: int = setting(17, "")
    """Number of instants, speeds and places at which gains may change. Between two of them, a twentieth of the record
    is in the wrong part."""

    power_left_by_changing_gains: float = setting(0.3, "")
    """Largest ratio of the residual's power with two controllers and one. Of 150 drawn machines with gains reduced to
    0.4 to 0.7 in a part, 149 were reported; of 100 sound ones and 100 with a limited force, none."""

    deviations_at_a_limit: float = setting(6.0, "")
    """Distance below the largest force at which no limit acts, in standard deviations of the noise."""

    likeness_of_a_law: float = setting(0.8, "")
    """Smallest correlation of the force with the control law of the other part. It was at least 0.88 on drawn machines
    with changed gains, and 0.02 to 0.1 on a hunting stage."""

    logarithm_of_a_gain: float = setting(0.2, "")
    """Smallest change of the gains that is reported, as a logarithm. Drifting clocks, and filters in a sound
    controller, change the law by 0.1."""

    speed_share_of_creeping: float = setting(0.01, "")
    """Speed up to which friction has no direction, relative to the highest."""

    friction_share_of_a_tried_force: float = setting(0.05, "")
    """Size of a tried force, relative to Coulomb friction."""

    friction_share_of_a_change: float = setting(0.1, "")
    """Smallest reported change of friction or constant force, relative to Coulomb friction."""

    speeds_of_a_start: int = setting(50, "")
    """Number of speeds at which a fitted friction curve is evaluated, up to the speed of a body that just began to
    move."""

    stribeck_velocities_of_sliding: float = setting(2.0, "")
    """Speed, in Stribeck velocities, at which 2 % of the Stribeck effect is left (exponent 2)."""


@dataclass(frozen=True)
class IdentificationSettings(Settings):
    """Settings of the inverse model, of the spread of fits, and of the stage file that is written."""

    most_asymmetry_of_friction: float = setting(0.3, "")
    """Largest difference of friction by direction, relative to its mean, that bearings show. A constant force beyond
    that is no asymmetry."""

    # Estimates of several experiments.
    chance_of_agreement: float = setting(0.01, "")
    """Probability (chi-square) below which the scatter of estimates counts as disagreement."""

    # Contents of a file, shown before identification.
    bins_of_a_small_plot: int = setting(24, "")
    """Number of parts of a channel whose means make its small plot."""

    # Residuals over place and speed.
    bins_of_a_residual: int = setting(40, "")
    """Number of bins of place, and of speed, in which the mean residual is taken. Fewer hide cogging; more contain
    noise."""

    # The inverse model: filters, decimation, and the parts of a motion that count.
    smoothing_bandwidths: float = setting(5.0, "")
    """Cut-off of the position in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_bandwidths: float = setting(2.0, "")
    """Cut-off of the decimation in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_pass: float = setting(0.8, "")
    """Passband of the decimation filter, relative to half the new sampling frequency. Nearer 1 it aliases."""

    order_of_smoothing: int = setting(4, "")
    """Order of the Butterworth filter of the position (Gautier, Janot, Vandanjon 2013)."""

    order_of_decimation: int = setting(8, "")
    """Order of the Chebyshev filter before decimation."""

    ripple_of_decimation: float = setting(0.05, "dB")
    """Ripple of the Chebyshev filter before decimation, common to the force and all columns."""

    sampling_of_splines: float = setting(0.15, "")
    """Cut-off times sample time above which splines give derivatives. Differences would lose 1 % of the
    acceleration."""

    samples_of_an_edge: int = setting(49, "")
    """Number of samples left out at the start of a record, where the filters settle."""

    bandwidths_of_a_poor_model: tuple[float, ...] = setting((2.0, 4.0, 0.5, 0.25, 0.125), "")
    """Bandwidths that are tried where an inverse model is poor, relative to the log's, in this order. Smaller ones are
    for moves beyond which the log vibrates."""

    power_share_of_the_motion: float = setting(0.95, "")
    """Fraction of the acceleration's power within the bandwidth. Nearer 1 noise determines it."""

    power_above_noise: float = setting(4.0, "")
    """Smallest ratio of the position's spectrum to its noise at frequencies that count."""

    lines_of_a_gap: int = setting(5, "")
    """Widest gap in the spectrum of a motion, in frequencies of its strongest line. Equal moves to and fro have every
    second line, and their duration may cancel two in a row."""

    pieces_of_a_spectrum: int = setting(8, "")
    """Number of pieces into which a record is cut for its spectrum (Welch). More scatter less and resolve less."""

    travels_of_a_single_pass: float = setting(1.5, "")
    """Way below which a record passes its places once, in ranges of the position. To and fro makes 2."""

    way_share_of_a_direction: float = setting(0.02, "")
    """Smallest fraction of the way in either direction for separating friction from a constant force."""

    deviations_of_standing_still: float = setting(20.0, "")
    """Largest motion at standstill, in standard deviations of the position's noise."""

    power_share_of_friction: float = setting(0.1, "")
    """Correlation of force and velocity above which the force clearly feeds friction, so that its sign is right."""

    speed_shares_of_sliding: tuple[float, ...] = setting((0.01, 0.02, 0.05, 0.1, 0.2, 0.4), "")
    """Speeds, relative to the highest, one of which separates rest and bending bristles from sliding. In 30 drawn clean
    logs of smooth moves with dwells, the error of the force fell from up to 22 % at 0.01 to below 1 % at another."""

    rows_of_an_inverse_model: int = setting(20, "")
    """Fewest rows of an inverse model. With fewer, its four coefficients have no interval."""

    # Uncertainty of a fit with correlated errors.
    row_share_of_likeness: float = setting(0.1, "")
    """Largest distance of correlated rows, relative to the number of rows."""

    blocks_of_time: int = setting(10, "")
    """Number of blocks of time within which errors may be correlated."""

    bins_of_place_and_speed: int = setting(20, "")
    """Number of bins of place, and of speed, within which errors may be correlated. More contain too few rows."""

    least_freedom_of_groups: float = setting(3.0, "")
    """Smallest number of degrees of freedom of correlated groups that is assumed (friso's choice)."""

    eigenvalue_of_likeness: float = setting(1e-6, "")
    """Ratio of an eigenvalue to the largest, below which columns cannot be distinguished."""

    # The stage file that is written.
    bend_of_made_up_bristles: float = setting(5e-6, "m")
    """Deflection of the bristles of a stage made up for a log (friso's choice)."""

    made_up_stribeck_velocity: float = setting(1e-3, "m/s")
    """Stribeck velocity of a stage made up for a log (friso's choice)."""

    digits_of_an_uncertainty: int = setting(2, "")
    """Number of significant digits of an uncertainty, which also sets the digits of the value."""

    # Estimates that the keys of a stage file can take.
    share_of_a_least_value: float = setting(1e-3, "")
    """Lower end of a range that would otherwise reach 0, relative to its upper end."""


@dataclass(frozen=True)
class ExperimentSettings(Settings):
    """Settings of the analyses of single kinds of experiment."""

    hysteresis_of_swings: float = setting(0.3, "of half the swing")
    """Hysteresis in counting swings. With less, noise counts as hunting; with more, lopsided cycles are missed."""

    transient_swing_share: float = setting(0.2, "")
    """Largest difference in size from the later cycles. Cycles that differ more at the beginning are a transient."""

    # Excitations and moves, distinguished by what repeats.

    # Moves.
    harmonics_of_an_excitation: float = setting(7.0, "")
    """Effective number of harmonics above which a log is a broad-band excitation. Moves have 1 to 7."""

    rests_of_moves: float = setting(0.1, "")
    """Fraction of time at rest above which a repeating log consists of moves."""

    samples_of_moves: int = setting(40_000, "")
    """Largest number of samples of moves that are used (friso's choice)."""

    # Small motion before sliding.
    low_pass_of_a_check: float = setting(0.7, "")
    """Ratio of the low-pass frequencies of the second fit, a check, and the first fit."""

    low_pass_of_the_motion: float = setting(5.0, "")
    """Ratio of the low-pass frequencies of motion and fit in pre-sliding. Friction depends on faster motion than is
    fitted."""

    samples_of_a_presliding_period: int = setting(40, "")
    """Number of samples per period of the low-pass in pre-sliding. More take longer and show no more."""

    samples_of_presliding: int = setting(1000, "")
    """Fewest samples of a record of pre-sliding. With fewer, the interval is useless."""

    share_of_a_seen_spring: float = setting(0.02, "")
    """Smallest residual of bristles, relative to the force, that a spring beside them may explain."""

    bend_share_of_a_seen_spring: float = setting(0.1, "")
    """Smallest motion that tells a spring from bristles, relative to the longest bend. A smaller one shows a line."""

    share_left_by_soft_bristles: float = setting(0.99, "")
    """Fraction of the squared residual below which bristles softer than those of a bearing fit better: a spring."""

    share_left_by_a_spring: float = setting(0.25, "")
    """Fraction of the squared residual below which a spring beside the bristles is taken to act."""

    bending_beside_a_spring: float = setting(200.0, "")
    """Largest bending parameter of bristles that is tried beside a spring, relative to the motion."""

    bending_range: tuple[float, ...] = setting((1e-6, 5.0), "")
    """Range of the bristles' bending parameter in a fit, relative to the motion: from a straight line to immediate
    slip."""

    stiffness_ratio_of_a_joint: float = setting(3.0, "")
    """Largest ratio of a measured stiffness to the stage file's joint stiffness for it to be the joint's."""

    # Slow sliding.
    low_pass_below_a_mode: float = setting(1 / 3, "")
    """Highest low-pass frequency, relative to the structural mode, which the model lacks."""

    low_pass_of_sliding: float = setting(8.0, "")
    """Ratio of the low-pass frequencies of motion and fit in slow sliding. Slips are faster than the fitted force."""

    samples_of_slow_sliding: int = setting(60_000, "")
    """Largest number of samples of slow sliding that are used. More take longer and show no more."""

    fewest_samples_of_sliding: int = setting(2000, "")
    """Fewest samples of slow sliding. With fewer, the interval is useless."""

    stribeck_starts: tuple[float, ...] = setting((0.2, 0.5), "")
    """Stribeck velocities from which fits start, relative to the RMS velocity. One start alone may miss the best
    fit."""

    sliding_bounds: tuple[float, ...] = setting((0.01, 10.0), "")
    """Bounds of the fitted numbers of slow sliding, relative to RMS velocity and mean friction."""

    tolerance_of_sliding: float = setting(1e-6, "")
    """Relative change of squares and parameters that ends a fit of slow sliding, far within any interval."""

    step_of_sliding: float = setting(1e-3, "")
    """Relative step for finite differences in slow sliding. Smaller steps drown in rounding errors."""

    stribeck_velocities_gone: float = setting(1.5, "")
    """Speed that slow sliding must reach, in Stribeck velocities. At 1.5 a tenth of the fall of friction is left."""

    # Position steps with the cart fixed.
    low_pass_of_steps: float = setting(25.0, "Hz")
    """Low-pass of the force of position steps (thesis, Sec. 4.2.2)."""

    drift_of_a_settled_force: float = setting(0.02, "")
    """Largest drift of the force in a settled window beyond the deflection's share, relative to a step."""

    drift_of_a_settled_place: float = setting(0.1, "")
    """Largest drift of the deflection in a settled window if no window drifts less, relative to a step."""

    travel_of_a_fixed_cart: float = setting(0.02, "")
    """Largest motion of a fixed cart, relative to the position's steps."""

    # Slow motion that sticks and slips.
    low_pass_of_stick_slip: float = setting(100.0, "Hz")
    """Low-pass of deflection and velocity in stick-slip motion, faster than any slip."""

    share_of_held_slips: float = setting(0.5, "")
    """Fraction of slips without a rising force above which the log does not show static friction."""

    share_near_a_peak: float = setting(0.01, "")
    """Distance below its peak within which the force counts as near the peak, relative to the peak."""

    duration_near_a_peak: float = setting(4.0, "")
    """Time near the peak above which a force had stopped rising, relative to the usual time."""

    stroke_share_at_a_stop: float = setting(0.05, "")
    """Distance from the stroke at which the limiter counts as touched, relative to the stroke."""

    stiffness_share_of_a_limiter: float = setting(0.1, "")
    """Largest stiffness of a joint, relative to its limiter's stiffness."""


@dataclass(frozen=True)
class WitnessSettings(Settings):
    """Settings of the replay of the given controller on a log."""

    force_left_by_the_controller: float = setting(0.15, "")
    """Largest share of the logged force that a controller leaves which explains it. Sound records leave 0.02 to 0.09,
    a clock that is off by two 0.6 and more."""

    error_of_an_agreeing_slope: float = setting(0.15, "")
    """Largest error of the force by the given controller. Sound records have slopes of 0.94 to 1.00."""

    slopes_of_a_scale: tuple[float, float] = setting((0.3, 3.0), "")
    """Slopes between which gains may be others than stated. Beyond, a unit or a sign is wrong."""

    share_of_a_limit: float = setting(0.999, "")
    """Share of the largest force from which a sample counts as at the limit."""

    share_at_a_limit: float = setting(0.005, "")
    """Share of samples at the largest force above which it counts as a limit."""

    reach_of_a_clock: float = setting(20.0, "")
    """Largest ratio of clocks searched. Larger ones are units, which the logged names tell."""

    clocks_tried: int = setting(41, "")
    """Clocks tried over that range, a sixth apart. The best one is refined."""

    refinements_of_a_clock: int = setting(6, "")
    """Halvings of the step between clocks. Six find a clock to 0.3 %."""

    share_left_by_a_cause: float = setting(0.4, "")
    """Largest share left with another clock or feedforward, relative to that without, for the cause to be believed."""

    shares_of_a_record: tuple[float, float] = setting((0.2, 0.8), "")
    """First and last share of a record at which gains may be switched."""

    instants_tried: int = setting(13, "")
    """Instants tried over that range."""

    samples_of_a_start: int = setting(10, "")
    """Samples at the start that do not count, in which filters of the controller forget that they began at rest."""

    least_share_of_a_state: float = setting(1e-9, "")
    """Smallest effect on the force, relative to the largest, by which states of the controller are told apart."""

    samples_of_a_replay: int = setting(50, "")
    """Fewest samples of a replay that says anything."""

    samples_of_delay: int = setting(4, "")
    """Longest delay searched from position to force [samples]."""


@dataclass(frozen=True)
class PresentationSettings(Settings):
    """Settings of how results are written and drawn."""

    digits_without_an_interval: int = setting(4, "")
    """Largest number of significant digits of a value without interval, as many as instruments have."""

    zeros_before_an_exponent: int = setting(4, "")
    """Zeros before the decimal point above which a number gets an exponent, which is then shorter."""

    decimals_before_an_exponent: int = setting(7, "")
    """Decimals above which a number gets an exponent, which is then shorter."""

    digits_of_an_exact_value: int = setting(15, "")
    """Largest number of digits after the first one; a floating-point number has no more."""

    plain_forces: tuple[float, float] = setting((1e-2, 1e4), "N")
    """Range of forces, and of quantities per newton, without an SI prefix; they are compared with each other."""

    misfit_at_the_top: float = setting(5.0, "")
    """Upper end of the axis of a profile, in units of the misfit at the ends of the 95 % interval."""

    ratio_of_a_logarithmic_axis: float = setting(8.0, "")
    """Ratio of its ends above which a profile has a logarithmic axis."""

    periods_of_a_force_record: float = setting(40.0, "")
    """Length of the force record at the head of the page, in periods of the motion's bandwidth."""

    points_of_a_record: int = setting(5000, "")
    """Number of points drawn of a record of slow sliding; more make a page heavy and show nothing."""

    points_of_a_curve: int = setting(200, "")
    """Number of points drawn of the friction curve at steady velocities, which then looks smooth."""


doubt_settings = DoubtSettings.live()
witness_settings = WitnessSettings.live()
identification_settings = IdentificationSettings.live()
experiment_settings = ExperimentSettings.live()
presentation_settings = PresentationSettings.live()
