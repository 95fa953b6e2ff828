"""Settings of identification: of the doubts about logs of moves."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DoubtSettings(Settings):
    """When a doubt is raised, and how far its consequences reach."""

    error_share_of_a_cause: float = setting(0.7, "")
    """A cause counts if the model without it has at most this share of the error; nearer 1, chance finds some."""

    error_ratio_of_rival_causes: float = setting(1.5, "")
    """Causes count beside the best up to this ratio of errors: they cannot be told apart; larger names many."""

    motion_periods_of_a_shift: float = setting(0.25, "")
    """Longest shift of the force searched, in periods of the motion's bandwidth; beyond it a sign would turn."""

    motion_periods_of_an_average: float = setting(1.0, "")
    """Longest average searched, in periods of the motion's bandwidth; longer ones leave no motion."""

    places_of_a_force: int = setting(40, "")
    """Places along the way with a force of their own; fewer miss cogging, more take longer."""

    rows_for_each_place: int = setting(20, "")
    """Rows of the inverse model for each such place at least; with fewer a place fits noise."""

    samples_of_a_reference: int = setting(20, "")
    """Samples of a segment at least for the motion of its reference; the filter needs as many."""

    speed_share_of_a_fast_stage: float = setting(0.1, "")
    """From this share of the highest speed a missing feedforward has to show. Of 400 drawn logs of the whole force, one
    was said to lack a feedforward, 98 where all speeds counted; of 186 that lacked one, 130 were, and 174."""

    power_share_of_an_oscillation: float = setting(0.5, "")
    """Share of the residual's power in one peak that counts as an oscillation; less is in any coloured noise."""

    samples_of_a_spectrum: int = setting(256, "")
    """Samples of each piece of the residual for its spectrum: longer ones resolve more and scatter more."""

    share_of_a_whole_record: float = setting(0.2, "")
    """Share of a record in its longest stretch up to which gaps are told: little is then fitted."""

    digits_of_a_fine_position: float = setting(500.0, "")
    """Steps of the position's digits over the travel from which on they are fine enough not to be told."""

    force_share_of_a_constant_force: float = setting(0.1, "")
    """Share of the force's standard deviation that a constant force exceeds to be told, beside the friction."""

    force_share_of_no_friction: float = setting(1e-3, "")
    """Share of the force's standard deviation below which Coulomb friction is that of no bearing."""

    deviations_of_differing_halves: float = setting(3.29, "")
    """Deviations by which the halves of a record differ by chance once in a thousand times."""

    noise_ratio_of_a_lacking_model: float = setting(10.0, "")
    """A fit that leaves so many times the noise lacks something; smaller doubts what friction is to LuGre."""

    error_of_a_poor_model: float = setting(0.3, "")
    """Relative error of the force from which on a model does not describe the record."""

    error_of_an_unsettled_record: float = setting(0.1, "")
    """Share of the force that a fit and the best cause may both leave; beyond it, intervals widen."""

    error_share_of_a_clearly_better_model: float = setting(0.5, "")
    """A whole model below this share of the error without a cause needs no cause."""

    error_ratio_of_a_contradiction: float = setting(1.5, "")
    """A whole model whose steady friction leaves so many times the inverse model's error contradicts the log."""

    error_of_a_fine_model: float = setting(0.01, "")
    """Relative error of the force below which a whole model contradicts nothing, whatever the inverse leaves."""

    widening_where_much_is_left: float = setting(2.0, "")
    """Intervals are so many times as wide where much is left that nothing explains, and those of slow friction where
    anything is: without, of known machines with a filtered signal, a reference for a position, intervals missed the
    truth by up to 1.8 half-widths."""

    sample_share_of_a_direction: float = setting(0.2, "")
    """Share of the counted samples in a direction at least for a fit of its own; fewer show too little."""

    cost_share_of_either_direction: float = setting(0.5, "")
    """Share of the squares that fits to either direction leave at most where friction differs: our choice."""

    bandwidths_of_a_coupling: float = setting(2.0, "")
    """Cut-off of the motion in bandwidths, well below the coupling, whose swinging no derivative describes. Of 3 kg
    with a third behind 40 Hz, a mass 1.3 % too large becomes right at 2 and 3, and by half at 5."""

    mass_share_of_a_tried_coupling: float = setting(0.05, "")
    """Share of the inertia by which the force is changed for its effect: larger ones are out of proportion."""

    reach_of_a_coupling: float = setting(2.0, "")
    """Intervals reach so many times as far as a coupling moves the fit: one linear step recovered no more than 60 % of
    1.5 % by which the mass of a machine on a coupling was off."""

    mass_share_of_a_coupling: float = setting(0.003, "")
    """Share of the mass by which a coupling moves it to be told; less is within good sensors' errors."""

    share_of_a_tried_load: float = setting(0.02, "")
    """Share of the motor's force by which friction is changed for its effect on the record."""

    shares_of_a_load: tuple[float, ...] = setting((0.02, 0.5), "")
    """Shares of the motor's force that friction in proportion to it may have: it was below 0.009 on sound logs, and
    from a half on a transmission locks itself."""

    power_left_by_a_load: float = setting(0.7, "")
    """Share of the residual's power that such friction leaves at most: of drawn logs with a tenth of it 0.02 to 0.26,
    of sound ones 0.92 and more."""

    friction_share_of_a_digit: float = setting(0.1, "")
    """Share of Coulomb friction from which on digits of the force are coarse: below, the noise of most logs is more."""

    rounding_of_a_digit: float = setting(1e-6, "")
    """Share of the largest step of the force below which a step is rounding."""

    error_of_a_whole_digit: float = setting(0.05, "")
    """Error of a whole number of digits, that of texts of few figures: a force of noise has 0.5."""

    power_left_by_an_effect: float = setting(0.85, "")
    """Share of the residual's power that an effect leaves at most to be named: of 45 drawn logs with effects of a tenth
    of the friction and more the right one left 0.01 to 0.84, and of sound ones none explained anything."""

    reach_of_an_effect: float = setting(2.0, "")
    """Intervals reach so many times as far as an effect moves the fit: that is one linear step."""

    places_of_a_force_along: int = setting(12, "")
    """Places along the way that have a force, or friction, of their own: each takes a simulated run."""

    travels_of_a_pitch: tuple[float, ...] = setting((2.0, 60.0), "")
    """Pitches of cogging that are tried, as parts of the travel: a coarser one is a force by place."""

    pitches_for_each_travel: int = setting(4, "")
    """Pitches that are tried for each further period along the travel: between two of them the phase slips by a
    quarter turn."""

    plays_tried: tuple[float, ...] = setting((8e-6, 1e-3), "m")
    """Widths of play that are tried: a narrower one passes within a few samples, a wider one is seen without a test."""

    ratio_of_plays: float = setting(1.4, "")
    """Ratio of one width that is tried to the next: at 1.5 times its width a play explains half of it."""

    force_share_of_a_told_effect: float = setting(0.01, "")
    """Share of the force's standard deviation below which a force along the way widens intervals without a sentence:
    of sound logs at 500 Hz 0.004 was seen, and a tenth of the friction is 0.02 and more."""

    samples_of_a_crossing: float = setting(5.0, "")
    """Samples in which a load crosses a play that is tried, on average: of a sound sine at 500 Hz, reversals passed for
    one that took 2 samples; with 10, plays of 20 um would be missed at 1 kHz."""

    bandwidths_of_a_play: float = setting(4.0, "")
    """Bandwidth of the motion over the usual one of smoothing: at one a gap that is crossed in 5 ms is blurred, at 16
    the noise of the position counts."""

    power_share_of_a_drift: float = setting(0.5, "")
    """Share that a delay which changes leaves at most of what one leaves that stays: of drawn logs 0.02 to 0.25."""

    mass_share_of_a_tried_play: float = setting(0.05, "")
    """Share of the mass that is loose for its effect on the record: play acts in proportion to it."""

    mass_share_of_a_loose_load: float = setting(0.5, "")
    """Share of the mass that a loose load with friction is taken to have, by which it slows down: what is found of it
    is fitted."""

    most_of_a_play: float = setting(1.5, "")
    """Share of mass or friction up to which a play is believed: more than all is another effect."""

    mass_share_of_a_play: float = setting(0.03, "")
    """Share of the mass that is loose from which on a play is told."""

    bandwidths_of_a_delayed_force: float = setting(10.0, "")
    """Cut-off of the force in bandwidths of the motion, above which its derivative is noise."""

    samples_of_a_tried_delay: float = setting(0.05, "")
    """Samples by which the force is moved for its effect: larger ones are followed in jumps."""

    reach_of_a_delay: float = setting(2.0, "")
    """Intervals reach so many times as far as a delay moves the fit: one linear step recovered 40 to 50 % (in the
    logarithm) of the damping of bristles that three samples more than doubled."""

    samples_of_a_delay: float = setting(0.25, "")
    """Samples of delay from which on it is told; shorter ones are within the hold of the force."""

    bandwidths_of_a_controller: float = setting(3.0, "")
    """Cut-off of error and force in bandwidths of the motion: above it the derivative of the error is noise."""

    rows_for_each_gain: int = setting(5, "")
    """Rows for each gain in either part of a record at least; with fewer a gain fits noise."""

    shares_of_a_part: tuple[float, ...] = setting((0.1, 0.9), "")
    """Shares of a record between which gains may change: a shorter part shows too little."""

    levels_of_a_part: int = setting(17, "")
    """Instants, speeds and places at which gains may change: between two of them a twentieth is in the wrong part."""

    power_left_by_changing_gains: float = setting(0.3, "")
    """Share of the residual's power that two controllers leave at most of what one leaves: of 150 drawn machines with
    gains 0.4 to 0.7 times as large in a part 149 were told, of 100 sound ones and 100 with a limited force none."""

    deviations_at_a_limit: float = setting(6.0, "")
    """Deviations of the force's noise below its largest value from which on no limit acts: noise reaches three to
    either side of a limit."""

    likeness_of_a_law: float = setting(0.8, "")
    """Correlation of the force with the law of the other part at least: of drawn machines with other gains 0.88 and
    more; of a stage that hunts, of which two laws fit more, 0.02 to 0.1."""

    logarithm_of_a_gain: float = setting(0.1, "")
    """Change of the gains, as a logarithm, from which on it is told: clocks that drift apart change the law by less."""

    speed_share_of_creeping: float = setting(0.01, "")
    """Share of the highest speed up to which friction is not counted as that of one direction."""

    friction_share_of_a_tried_force: float = setting(0.05, "")
    """Share of Coulomb friction by which the force is changed for its effect on the record."""

    friction_share_of_a_change: float = setting(0.1, "")
    """Share of Coulomb friction by which something has to change to be told."""

    speeds_of_a_start: int = setting(50, "")
    """Speeds at which the curve of a fit is looked at, up to that of a body that has begun to move."""

    stribeck_velocities_of_sliding: float = setting(2.0, "")
    """At so many Stribeck velocities 2 % of the effect is left, by the exponent 2; less would be friction."""


@dataclass(frozen=True)
class IdentificationSettings(Settings):
    """The inverse model, spreads of fits, and the stage file that is written."""

    # Estimates of several experiments.
    chance_of_agreement: float = setting(0.01, "")
    """A scatter less likely than this is a disagreement; 1 in 100 keeps false ones rare."""

    # What a file holds, shown before it is identified.
    bins_of_a_small_plot: int = setting(24, "")
    """Parts of a channel whose means make its small plot."""

    # Residuals over place and speed.
    bins_of_a_residual: int = setting(40, "")
    """Places and speeds in which the mean residual is taken: fewer hide cogging, more hold noise."""

    # The inverse model: filters, decimation, and what of a motion counts.
    smoothing_bandwidths: float = setting(5.0, "")
    """Cut-off of the position in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_bandwidths: float = setting(2.0, "")
    """Cut-off of the decimation in bandwidths of the motion (Gautier, Janot, Vandanjon 2013)."""

    decimation_pass: float = setting(0.8, "")
    """Share of half the new sampling frequency that the decimation passes; nearer 1 it aliases."""

    order_of_smoothing: int = setting(4, "")
    """Order of the Butterworth filter of the position (Gautier, Janot, Vandanjon 2013)."""

    order_of_decimation: int = setting(8, "")
    """Order of the Chebyshev filter before decimation."""

    ripple_of_decimation: float = setting(0.05, "dB")
    """Ripple of that filter, common to the force and to all columns."""

    sampling_of_splines: float = setting(0.15, "")
    """From this cut-off times sample time on splines take derivatives: differences lose 1 % of the acceleration."""

    samples_of_an_edge: int = setting(49, "")
    """Samples left out at the start, where the filters swing in."""

    power_share_of_the_motion: float = setting(0.95, "")
    """Share of the acceleration's power within the bandwidth; nearer 1 it is that of the noise."""

    power_above_noise: float = setting(4.0, "")
    """Ratio by which the position's spectrum stands above its noise where it counts."""

    pieces_of_a_spectrum: int = setting(8, "")
    """Pieces into which a record is cut for its spectrum (Welch): more scatter less and resolve less."""

    way_share_of_a_direction: float = setting(0.02, "")
    """Share of the way gone in a direction at least, for friction to be told from a constant force."""

    deviations_of_standing_still: float = setting(20.0, "")
    """Deviations of the position's noise within which nothing has moved."""

    speed_share_of_sliding: float = setting(0.01, "")
    """Share of the highest speed below which a stage rests: the velocity's sign is noise there."""

    time_of_a_left_out_rest: float = setting(0.1, "s")
    """Rests of this length are left out: friction at rest is what the controller makes it."""

    rows_of_an_inverse_model: int = setting(20, "")
    """Rows at least: fewer leave four numbers without an interval."""

    # How uncertain a fit is whose errors are alike.
    row_share_of_likeness: float = setting(0.1, "")
    """Share of the rows over which errors are looked at for likeness: farther ones are few."""

    blocks_of_time: int = setting(10, "")
    """Blocks of time in which errors may be alike."""

    bins_of_place_and_speed: int = setting(20, "")
    """Bins of place and of speed in which errors may be alike: more hold too few rows."""

    least_freedom_of_groups: float = setting(3.0, "")
    """Degrees of freedom at least: some groups are always much alike (our choice)."""

    eigenvalue_of_likeness: float = setting(1e-6, "")
    """Share of the largest eigenvalue below which columns count as one: differences are no more precise."""

    # The stage file that is written.
    bend_of_made_up_bristles: float = setting(5e-6, "m")
    """Bristles of a stage made up around a log bend by this, as those of many bearings (our choice)."""

    made_up_stribeck_velocity: float = setting(1e-3, "m/s")
    """Stribeck velocity of a stage made up around a log (our choice)."""

    digits_of_an_uncertainty: int = setting(2, "")
    """Significant digits of an uncertainty, and so of its value."""

    # Which estimates the keys of a stage file can take.
    share_of_a_least_value: float = setting(1e-3, "")
    """Share of the upper end at which a range begins that would hold 0: smaller makes no difference."""


@dataclass(frozen=True)
class ExperimentSettings(Settings):
    """What analyses of kinds of experiment look for in their logs."""

    hysteresis_of_swings: float = setting(0.3, "of half the swing")
    """With less, noise is counted as cycles of hunting; with more, cycles that lean to one side are missed."""

    # Excitations and moves, told apart by what repeats.

    # Moves.
    harmonics_of_an_excitation: float = setting(7.0, "")
    """From so many harmonics a log is an excitation; moves have 1 to 7, a multisine of 8 equal lines more."""

    rests_of_moves: float = setting(0.1, "")
    """Share of the time at rest from which what repeats is moves: an excitation hardly rests."""

    samples_of_moves: int = setting(40_000, "")
    """Samples that are used: more moves of one kind take longer and show little more (our choice)."""

    # Small motion before sliding.
    low_pass_of_a_check: float = setting(0.7, "")
    """Low-pass of the second fit that checks the first, over that of the first: nearer 1 it repeats it."""

    low_pass_of_the_motion: float = setting(5.0, "")
    """Low-pass of the motion over that of the fit: friction depends on faster motion than is fitted."""

    samples_of_a_presliding_period: int = setting(40, "")
    """Samples per period of the low-pass: more take longer and show no more."""

    samples_of_presliding: int = setting(1000, "")
    """Samples of a record at least: fewer leave an interval of no use."""

    bending_range: tuple[float, ...] = setting((1e-6, 5.0), "")
    """Range of the bristles' bending over that of the motion, from a straight line to slip at once."""

    stiffness_ratio_of_a_joint: float = setting(3.0, "")
    """Up to this ratio to the joint's stiffness it may well be the joint that is seen."""

    # Slow sliding.
    low_pass_below_a_mode: float = setting(1 / 3, "")
    """Highest low-pass over the frequency of the structure's mode, which nothing here describes."""

    low_pass_of_sliding: float = setting(8.0, "")
    """Low-pass of the motion over that of the fit: slips are quicker than what is fitted."""

    samples_of_slow_sliding: int = setting(60_000, "")
    """Samples that are used: more take longer and show no more."""

    fewest_samples_of_sliding: int = setting(2000, "")
    """Samples at least: fewer leave an interval of no use."""

    stribeck_starts: tuple[float, ...] = setting((0.2, 0.5), "")
    """Stribeck velocities, over the RMS velocity, from which the fit starts: one alone may miss."""

    sliding_bounds: tuple[float, ...] = setting((0.01, 10.0), "")
    """Bounds of what is fitted, over RMS velocity and mean friction: no bearing is beyond."""

    tolerance_of_sliding: float = setting(1e-6, "")
    """Share of squares and numbers to which the fit comes: far within any interval."""

    step_of_sliding: float = setting(1e-3, "")
    """Step over the size of a number for derivatives: smaller ones drown in the runs' tolerance."""

    stribeck_velocities_gone: float = setting(1.5, "")
    """Stribeck velocities that the motion has to go: at 1.5 a tenth of the fall is left."""

    # Position steps with the cart fixed.
    low_pass_of_steps: float = setting(25.0, "Hz")
    """Low-pass of the force of position steps (thesis, Sec. 4.2.2)."""

    drift_of_a_settled_force: float = setting(0.02, "")
    """Share of a step by which the force may drift in a settled window beyond the deflection's part."""

    drift_of_a_settled_place: float = setting(0.1, "")
    """Share by which the deflection may, where none drifts less: slow integrators take long."""

    travel_of_a_fixed_cart: float = setting(0.02, "")
    """Share of the position's steps by which a cart that counts as fixed may follow."""

    # Slow motion that sticks and slips.
    low_pass_of_stick_slip: float = setting(100.0, "Hz")
    """Low-pass of deflection and velocity: slips are slower than this."""

    share_of_held_slips: float = setting(0.5, "")
    """Share of slips before which the force had stopped rising, from which none shows static friction."""

    share_near_a_peak: float = setting(0.01, "")
    """Share of its peak within which the force is near it."""

    duration_near_a_peak: float = setting(4.0, "")
    """A force near its peak so many times as long as usual had stopped rising."""

    stroke_share_at_a_stop: float = setting(0.05, "")
    """Share of the stroke left where the limiter counts as touched: the filter smears it."""

    stiffness_share_of_a_limiter: float = setting(0.1, "")
    """Up to this share of the limiter's stiffness a stiffness is the joint's."""
