"""Settings of identification: doubts, the inverse model, and experiments."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DoubtSettings(Settings):
    """Settings of doubts about logs: when one is raised, and how far its consequences reach."""

    error_share_of_a_cause: float = setting(0.7, "")
    """Largest ratio of errors with and without a cause that counts. Nearer 1, chance finds some."""

    error_ratio_of_rival_causes: float = setting(1.5, "")
    """Ratio of errors up to which causes count beside the best one."""

    motion_periods_of_a_shift: float = setting(0.25, "")
    """Longest shift of the force searched, in periods of the motion's bandwidth. Beyond it a sign would turn."""

    motion_periods_of_an_average: float = setting(1.0, "")
    """Longest average searched, in periods of the motion's bandwidth. Longer ones leave no motion."""

    places_of_a_force: int = setting(40, "")
    """Places along the way with a separate force. Fewer miss cogging; more take longer."""

    rows_for_each_place: int = setting(20, "")
    """Fewest rows of the inverse model for each such place. With fewer a place fits noise."""

    samples_of_a_reference: int = setting(20, "")
    """Fewest samples of a segment for the motion of its reference, which the filter needs."""

    speed_share_of_a_fast_stage: float = setting(0.1, "")
    """Speed from which a missing feedforward has to show, relative to the highest. Of 400 drawn logs without a missing
    one, one was reported, 98 if all speeds counted; of 186 with a missing one, 130, and 174."""

    power_share_of_an_oscillation: float = setting(0.5, "")
    """Fraction of the residual's power in one peak that counts as an oscillation."""

    samples_of_a_spectrum: int = setting(256, "")
    """Samples of each piece of the residual for its spectrum. Longer ones resolve more and scatter more."""

    share_of_a_whole_record: float = setting(0.2, "")
    """Longest stretch of a record, relative to the whole, up to which gaps are reported."""

    digits_of_a_fine_position: float = setting(500.0, "")
    """Travel in steps of the position from which its resolution is fine."""

    force_share_of_a_constant_force: float = setting(0.1, "")
    """Smallest constant force that is reported beside friction, over the force's standard deviation."""

    force_share_of_no_friction: float = setting(1e-3, "")
    """Coulomb friction below which it is impossible, over the force's standard deviation."""

    deviations_of_differing_halves: float = setting(3.29, "")
    """Standard deviations by which the halves of a record differ by chance once in a thousand times."""

    noise_ratio_of_a_lacking_model: float = setting(5.0, "")
    """Ratio of residual to noise above which a fit lacks something: at most 2.6 on 12 drawn sound logs, 8 on two with
    play that no effect explained."""

    noise_ratio_of_imitated_bristles: float = setting(3.0, "")
    """Ratio of residual to noise above which what the model lacks may pass for bristles. With play, a log that left 8
    times the noise had bristles of 31 to 96 kN/m for 262."""

    error_of_a_poor_model: float = setting(0.3, "")
    """Relative error of the force above which a model does not describe the record."""

    error_of_an_unsettled_record: float = setting(0.1, "")
    """Residual of a fit and of the best cause, over the force, above which intervals widen."""

    error_share_of_a_clearly_better_model: float = setting(0.5, "")
    """Ratio of errors below which a whole model needs no cause."""

    error_ratio_of_a_contradiction: float = setting(1.5, "")
    """Ratio of the whole model's error to the inverse model's above which it contradicts the log."""

    error_of_a_fine_model: float = setting(0.01, "")
    """Relative error of the force below which a whole model contradicts nothing."""

    widening_where_much_is_left: float = setting(2.0, "")
    """Factor on intervals with a large unexplained residual, and on those of slow friction with any. Without it,
    intervals missed the truth by up to 1.8 half-widths on known machines with filtered signals."""

    sample_share_of_a_direction: float = setting(0.2, "")
    """Fewest counted samples in one direction for a separate fit, over all."""

    cost_share_of_either_direction: float = setting(0.5, "")
    """Largest squares of separate fits over the common one if friction differs by direction (friso's choice)."""

    bandwidths_of_a_coupling: float = setting(2.0, "")
    """Cut-off of the motion in bandwidths, well below the coupling. For 3 kg with a third behind 40 Hz, a mass 1.3 %
    too large becomes right at 2 and 3, and by half at 5."""

    mass_share_of_a_tried_coupling: float = setting(0.05, "")
    """Force of a tried coupling over inertia. Larger ones are not linear."""

    share_of_a_tried_load: float = setting(0.02, "")
    """Tried friction in proportion to the motor's force, over that force."""

    shares_of_a_load: tuple[float, ...] = setting((0.02, 0.5), "")
    """Least and largest ratio of such friction to the motor's force. It was below 0.009 on sound logs, and from a half
    on a transmission locks itself."""

    power_left_by_a_load: float = setting(0.7, "")
    """Largest fraction of the residual's power that such friction leaves: 0.02 to 0.26 on drawn logs with a tenth of
    it, 0.92 and more on sound ones."""

    friction_share_of_a_digit: float = setting(0.1, "")
    """Resolution of the force over Coulomb friction above which it is coarse."""

    power_left_by_an_effect: float = setting(0.85, "")
    """Largest fraction of the residual's power that an effect leaves if it is named. Of 45 drawn logs with effects of a
    tenth of the friction and more the right one left 0.01 to 0.84; on sound ones none explained anything."""

    reach_of_an_effect: float = setting(2.0, "")
    """Factor by which intervals exceed the shift of the fit by an effect. One linear step recovered at most 60 % of an
    error of 1.5 % by a coupling, and half (in the logarithm) of the damping that three samples of delay doubled."""

    places_of_a_force_along: int = setting(12, "")
    """Places along the way with a separate force or friction, each of which takes a simulated run."""

    travels_of_a_pitch: tuple[float, ...] = setting((2.0, 60.0), "")
    """Least and largest number of cogging periods along the travel that are tried."""

    pitches_for_each_travel: int = setting(4, "")
    """Pitches that are tried for each further period along the travel. Between two of them the phase slips by a quarter
    turn."""

    plays_tried: tuple[float, ...] = setting((8e-6, 1e-3), "m")
    """Least and largest width of play that is tried. A narrower one passes within a few samples; a wider one is
    obvious."""

    ratio_of_plays: float = setting(1.4, "")
    """Ratio of successive widths that are tried. At 1.5 times its width a play explains half of it."""

    force_share_of_a_told_effect: float = setting(0.01, "")
    """Share of the force's standard deviation below which a force along the way widens intervals without a sentence:
    of sound logs at 500 Hz 0.004 was seen, and a tenth of the friction is 0.02 and more."""

    samples_of_a_crossing: float = setting(5.0, "")
    """Samples in which a load crosses a play that is tried, on average: of a sound sine at 500 Hz, reversals passed for
    one that took 2 samples; with 10, plays of 20 um would be missed at 1 kHz."""

    bandwidths_of_a_play: float = setting(4.0, "")
    """Bandwidth of the motion for play, over the usual one. At 1 a gap that is crossed in 5 ms is blurred; at 16 noise
    counts."""

    power_share_of_a_drift: float = setting(0.5, "")
    """Largest residual with a changing delay over that with a constant one: 0.02 to 0.25 on drawn logs."""

    mass_share_of_a_tried_play: float = setting(0.05, "")
    """Tried loose fraction of the mass. Play acts in proportion to it."""

    mass_share_of_a_loose_load: float = setting(0.5, "")
    """Assumed mass of a loose load with friction, over the whole, by which it slows down."""

    most_of_a_play: float = setting(1.5, "")
    """Fraction of mass or friction up to which a play is plausible. More than all is another effect."""

    mass_share_of_a_play: float = setting(0.03, "")
    """Loose fraction of the mass from which play is reported."""

    bandwidths_of_a_delayed_force: float = setting(10.0, "")
    """Cut-off of the force in bandwidths of the motion, above which its derivative is noise."""

    samples_of_a_tried_delay: float = setting(0.05, "")
    """Tried delay in samples. Larger ones are followed in jumps."""

    samples_of_a_delay: float = setting(0.25, "")
    """Smallest delay in samples that is reported. Shorter ones are within the hold of the force."""

    bandwidths_of_a_controller: float = setting(3.0, "")
    """Cut-off of error and force in bandwidths of the motion, above which the derivative of the error is noise."""

    rows_for_each_gain: int = setting(5, "")
    """Fewest rows for each gain in either part of a record. With fewer a gain fits noise."""

    shares_of_a_part: tuple[float, ...] = setting((0.1, 0.9), "")
    """Range of a record, from 0 to 1, within which gains may change. A shorter part shows too little."""

    levels_of_a_part: int = setting(17, "")
    """Instants, speeds and places at which gains may change. Between two of them a twentieth is in the wrong part."""

    power_left_by_changing_gains: float = setting(0.3, "")
    """Largest residual's power with two controllers over that with one. Of 150 drawn machines with gains 0.4 to 0.7
    times as large in a part 149 were reported, of 100 sound ones and 100 with a limited force none."""

    deviations_at_a_limit: float = setting(6.0, "")
    """Distance below the largest force at which no limit acts, in standard deviations of the noise."""

    likeness_of_a_law: float = setting(0.8, "")
    """Least correlation of the force with the law of the other part: 0.88 and more on drawn machines with other gains,
    0.02 to 0.1 on a stage that hunts."""

    logarithm_of_a_gain: float = setting(0.1, "")
    """Smallest change of the gains that is reported, as a logarithm. Drifting clocks change the law by less."""

    speed_share_of_creeping: float = setting(0.01, "")
    """Speed up to which friction has no direction, relative to the highest."""

    friction_share_of_a_tried_force: float = setting(0.05, "")
    """Tried force over Coulomb friction."""

    friction_share_of_a_change: float = setting(0.1, "")
    """Smallest change that is reported, over Coulomb friction."""

    speeds_of_a_start: int = setting(50, "")
    """Speeds at which the curve of a fit is evaluated, up to that of a body that has begun to move."""

    stribeck_velocities_of_sliding: float = setting(2.0, "")
    """Speed in Stribeck velocities at which 2 % of the Stribeck effect is left, for the exponent 2."""


@dataclass(frozen=True)
class IdentificationSettings(Settings):
    """Settings of the inverse model, of the spread of fits, and of the stage file that is written."""

    # Estimates of several experiments.
    chance_of_agreement: float = setting(0.01, "")
    """Probability below which a scatter is a disagreement."""

    # What a file holds, shown before it is identified.
    bins_of_a_small_plot: int = setting(24, "")
    """Parts of a channel whose means make its small plot."""

    # Residuals over place and speed.
    bins_of_a_residual: int = setting(40, "")
    """Places and speeds in which the mean residual is taken. Fewer hide cogging; more contain noise."""

    # The inverse model: filters, decimation, and what of a motion counts.
    smoothing_bandwidths: float = setting(5.0, "")
    """Cut-off of the position in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_bandwidths: float = setting(2.0, "")
    """Cut-off of the decimation in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_pass: float = setting(0.8, "")
    """Passband of the decimation over half the new sampling frequency. Nearer 1 it aliases."""

    order_of_smoothing: int = setting(4, "")
    """Order of the Butterworth filter of the position (Gautier, Janot, Vandanjon 2013)."""

    order_of_decimation: int = setting(8, "")
    """Order of the Chebyshev filter before decimation."""

    ripple_of_decimation: float = setting(0.05, "dB")
    """Ripple of that filter, common to the force and to all columns."""

    sampling_of_splines: float = setting(0.15, "")
    """Cut-off times sample time from which splines take derivatives. Differences lose 1 % of the acceleration."""

    samples_of_an_edge: int = setting(49, "")
    """Samples left out at the start, where the filters settle."""

    power_share_of_the_motion: float = setting(0.95, "")
    """Fraction of the acceleration's power within the bandwidth. Nearer 1 noise determines it."""

    power_above_noise: float = setting(4.0, "")
    """Ratio of the position's spectrum to its noise where it counts."""

    pieces_of_a_spectrum: int = setting(8, "")
    """Pieces into which a record is cut for its spectrum (Welch). More scatter less and resolve less."""

    way_share_of_a_direction: float = setting(0.02, "")
    """Least part of the way in one direction for friction to be separated from a constant force."""

    deviations_of_standing_still: float = setting(20.0, "")
    """Largest motion at standstill, in standard deviations of the position's noise."""

    speed_share_of_sliding: float = setting(0.01, "")
    """Speed below which a stage rests, relative to the highest. The sign of the velocity is noise there."""

    time_of_a_left_out_rest: float = setting(0.1, "s")
    """Shortest rest that is left out, because the controller determines friction at rest."""

    rows_of_an_inverse_model: int = setting(20, "")
    """Fewest rows of an inverse model. Fewer leave four numbers without an interval."""

    # How uncertain a fit is whose errors are alike.
    row_share_of_likeness: float = setting(0.1, "")
    """Largest distance of correlated rows, over all rows."""

    blocks_of_time: int = setting(10, "")
    """Blocks of time in which errors may be correlated."""

    bins_of_place_and_speed: int = setting(20, "")
    """Bins of place and of speed in which errors may be correlated. More contain too few rows."""

    least_freedom_of_groups: float = setting(3.0, "")
    """Fewest degrees of freedom, because some groups are always correlated (friso's choice)."""

    eigenvalue_of_likeness: float = setting(1e-6, "")
    """Ratio of eigenvalues below which columns count as one."""

    # The stage file that is written.
    bend_of_made_up_bristles: float = setting(5e-6, "m")
    """Deflection of the bristles of a stage made up for a log (friso's choice)."""

    made_up_stribeck_velocity: float = setting(1e-3, "m/s")
    """Stribeck velocity of a stage made up for a log (friso's choice)."""

    digits_of_an_uncertainty: int = setting(2, "")
    """Significant digits of an uncertainty, and so of its value."""

    # Which estimates the keys of a stage file can take.
    share_of_a_least_value: float = setting(1e-3, "")
    """Lower end of a range that would contain 0, over its upper end."""


@dataclass(frozen=True)
class ExperimentSettings(Settings):
    """Settings of the analyses of single kinds of experiment."""

    hysteresis_of_swings: float = setting(0.3, "of half the swing")
    """Hysteresis in counting swings. With less, noise counts as hunting; with more, lopsided cycles are missed."""

    # Excitations and moves, told apart by what repeats.

    # Moves.
    harmonics_of_an_excitation: float = setting(7.0, "")
    """Harmonics from which a log is an excitation. Moves have 1 to 7, a multisine of 8 equal lines more."""

    rests_of_moves: float = setting(0.1, "")
    """Fraction of time at rest from which a repetition consists of moves."""

    samples_of_moves: int = setting(40_000, "")
    """Most samples of moves that are used (friso's choice)."""

    # Small motion before sliding.
    low_pass_of_a_check: float = setting(0.7, "")
    """Low-pass of the second fit, which checks the first, over that of the first."""

    low_pass_of_the_motion: float = setting(5.0, "")
    """Low-pass of the motion over that of the fit. Friction depends on faster motion than is fitted."""

    samples_of_a_presliding_period: int = setting(40, "")
    """Samples per period of the low-pass. More take longer and show no more."""

    samples_of_presliding: int = setting(1000, "")
    """Fewest samples of a record. Fewer leave a useless interval."""

    bending_range: tuple[float, ...] = setting((1e-6, 5.0), "")
    """Range of the bristles' bending over that of the motion, from a straight line to immediate slip."""

    stiffness_ratio_of_a_joint: float = setting(3.0, "")
    """Ratio to the joint's stiffness up to which a stiffness may be the joint's."""

    # Slow sliding.
    low_pass_below_a_mode: float = setting(1 / 3, "")
    """Highest low-pass over the frequency of the structural mode, which the model lacks."""

    low_pass_of_sliding: float = setting(8.0, "")
    """Low-pass of the motion over that of the fit. Slips are faster than what is fitted."""

    samples_of_slow_sliding: int = setting(60_000, "")
    """Most samples that are used. More take longer and show no more."""

    fewest_samples_of_sliding: int = setting(2000, "")
    """Fewest samples. Fewer leave a useless interval."""

    stribeck_starts: tuple[float, ...] = setting((0.2, 0.5), "")
    """Stribeck velocities, over the RMS velocity, from which the fit starts. One alone may miss."""

    sliding_bounds: tuple[float, ...] = setting((0.01, 10.0), "")
    """Bounds of the fitted numbers, over RMS velocity and mean friction."""

    tolerance_of_sliding: float = setting(1e-6, "")
    """Relative change of squares and numbers that ends the fit, far within any interval."""

    step_of_sliding: float = setting(1e-3, "")
    """Relative step for derivatives. Smaller ones drown in the tolerance of the runs."""

    stribeck_velocities_gone: float = setting(1.5, "")
    """Speed in Stribeck velocities that the motion must reach. At 1.5 a tenth of the fall is left."""

    # Position steps with the cart fixed.
    low_pass_of_steps: float = setting(25.0, "Hz")
    """Low-pass of the force of position steps (thesis, Sec. 4.2.2)."""

    drift_of_a_settled_force: float = setting(0.02, "")
    """Largest drift of the force in a settled window, over a step, beyond that by deflection."""

    drift_of_a_settled_place: float = setting(0.1, "")
    """Largest drift of the deflection, over a step, if none drifts less. Slow integrators take long."""

    travel_of_a_fixed_cart: float = setting(0.02, "")
    """Largest motion of a fixed cart, over the position's steps."""

    # Slow motion that sticks and slips.
    low_pass_of_stick_slip: float = setting(100.0, "Hz")
    """Low-pass of deflection and velocity: slips are slower than this."""

    share_of_held_slips: float = setting(0.5, "")
    """Fraction of slips without a rising force from which none shows static friction."""

    share_near_a_peak: float = setting(0.01, "")
    """Distance from its peak within which the force is near it, relative to the peak."""

    duration_near_a_peak: float = setting(4.0, "")
    """Time near the peak, over the usual one, from which a force had stopped rising."""

    stroke_share_at_a_stop: float = setting(0.05, "")
    """Distance from the stroke at which the limiter counts as touched, relative to the stroke."""

    stiffness_share_of_a_limiter: float = setting(0.1, "")
    """Largest stiffness of a joint, over that of its limiter."""
