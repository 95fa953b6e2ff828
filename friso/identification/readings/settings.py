"""Settings of what several kinds of experiment read off a log."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ReadingSettings(Settings):
    """What is read off logs: passes, slips, ramps, friction over speed and place."""

    # The body on the bearing, from what the drive commands and the sensor sees.
    points_per_sample: int = setting(8, "")
    """Points per sample for a mode of the structure: one of a tenth of the sampling rate is off by 0.05 %."""

    periods_of_a_record: int = setting(20, "")
    """Periods of the low-pass that a record lasts at least."""

    sampled_frequency: float = setting(0.2, "")
    """Highest frequency of the motion over that of the samples that a spline still follows."""

    share_left_unexplained: float = setting(0.2, "")
    """Share of the friction's deviation that a model may leave unexplained."""

    periods_of_an_edge: float = setting(2.0, "")
    """Periods of the low-pass at either end of a record that its ends touch."""

    deviations_of_seen_motion: float = setting(10.0, "")
    """Deviations of the noise that those of the motion have to reach to be seen."""

    rounding_of_a_position: float = setting(1e-9, "")
    """Share of the largest position that a motion has to exceed: less is rounding."""

    deflection_share_of_bending: float = setting(0.02, "")
    """A joint bends where its deflection reaches this share of the motion."""

    deviations_of_bending: float = setting(3.0, "")
    """Deviations of its sensor's noise that the deflection reaches then."""

    contact_ratio_of_bending: float = setting(3.0, "")
    """Times what the contact that holds the joint gives that the deflection reaches then."""

    # Means, noise and digits of signals.
    blocks_of_a_mean: int = setting(8, "")
    """Blocks of a stretch for its mean: enough for an interval, each long enough to forget the last."""

    linearity_of_sensors: float = setting(1e-3, "")
    """Share by which the ratio of two channels may be off: linearity of good sensors and amplifiers."""

    rounding_of_a_signal: float = setting(1e-12, "")
    """Steps below this share of a signal are rounding of numbers, no digit of a sensor."""

    levels_of_a_digit: int = setting(8, "")
    """Levels at which a signal stays, from which on these show its digit."""

    error_of_a_digit: float = setting(0.1, "")
    """Share of a digit by which levels may be off it."""

    power_of_clear_motion: float = setting(100.0, "")
    """Power over the noise's from which motion is seen: less is chance among many lines."""

    power_of_strong_motion: float = setting(1e-3, "")
    """Power over the largest of the acceleration from which motion is seen."""

    spectrum_share_of_noise: float = setting(0.25, "")
    """Share of the spectrum, at its top, that is taken for noise."""

    lines_of_a_spectrum: int = setting(1000, "")
    """Lines of the spectrum: more resolve more and scatter more."""

    # How a log goes that nobody has named.
    range_share_of_a_turn: float = setting(0.1, "")
    """A signal turns where it goes back by this share of its range: less is noise."""

    travel_share_of_a_rest: float = setting(0.01, "")
    """Share of the travel within which a position rests."""

    share_of_most_of_a_way: float = setting(0.75, "")
    """Share of the way that is most of it; of moves a sixth to a half goes at constant speed."""

    variance_share_of_a_spring: float = setting(0.99, "")
    """Share of the force's variance from rest to rest that place explains where a spring holds."""

    places_of_a_spring: int = setting(4, "")
    """Different places at least to say so."""

    hysteresis_of_a_spring: float = setting(0.05, "")
    """Share of its range by which the force may depend on the side: friction depends by more."""

    returns_to_a_place: int = setting(2, "")
    """Places that have to be reached from both sides to say so."""

    log_share_of_a_rest: float = setting(0.01, "")
    """Share of a log for which a position has to rest."""

    log_share_of_ramps: float = setting(0.25, "")
    """Share of a log that force ramps take together; moves begin within a few per cent of theirs."""

    force_share_off_a_line: float = setting(0.1, "")
    """Share of its break-away force by which a ramp may be off its line."""

    force_share_before_a_ramp: float = setting(0.05, "")
    """Share by which the force may be off none before: an integrator passes zero without a rest."""

    samples_of_a_blur: int = setting(20, "")
    """Samples over which a position is averaged, for its way not to be that of its noise."""

    # Friction over the place on the rail.
    points_of_a_friction_map: int = setting(400, "")
    """Places of a map over the whole travel."""

    correlation_of_passes: float = setting(0.5, "")
    """Correlation of the maps of two passes from which they repeat each other."""

    fields_drawn: int = setting(300, "")
    """Random fields for the interval of the correlation length: fewer leave its ends to chance."""

    correlation_lengths_of_a_pass: float = setting(5.0, "")
    """Correlation lengths that a pass holds for its correlation length to be shown."""

    harmonics_of_a_pass: int = setting(3, "")
    """Harmonics reported of each pass."""

    # Friction over speed.
    span_of_speeds: float = setting(1.5, "")
    """Ratio of speeds from which Coulomb and viscous friction can be told apart."""

    speeds_of_a_curve: int = setting(5, "")
    """Distinct speeds from which a curve of four parameters may be fitted."""

    ratio_of_distinct_speeds: float = setting(1.1, "")
    """Ratio from which two speeds are distinct."""

    speeds_of_a_line: int = setting(3, "")
    """Distinct speeds from which it shows whether friction is a straight line over them."""

    rounding_of_a_force: float = setting(1e-9, "")
    """Share of the greatest force better than which no mean is known."""

    # Loads of a joint between slips.
    fewest_loads: int = setting(3, "")
    """Loads between slips at least: fewer leave no error of the stiffness."""

    # Stretches of constant velocity.
    low_pass_of_passes: float = setting(25.0, "Hz")
    """Low-pass of the velocity by which constant stretches are found."""

    time_of_a_pass: float = setting(0.1, "s")
    """Shortest stretch of constant velocity: the filter takes as long to settle."""

    samples_of_a_pass: int = setting(40, "")
    """Samples of such a stretch at least."""

    swing_of_a_steady_pass: float = setting(0.3, "")
    """Deviation of the velocity over its mean from which a body sticks and slips, or swings."""

    quick_swing_of_a_steady_pass: float = setting(0.02, "")
    """Such a swing above the cut-off: one of 940 Hz, sampled at 1 kHz, looks 17 times slower than it is."""

    rounding_of_a_step: float = setting(1e-6, "")
    """Share of the largest step of a position up to which steps are rounding."""

    error_of_whole_digits: float = setting(0.1, "")
    """How far steps in digits may be from whole numbers."""

    power_of_a_clear_line: float = setting(20.0, "")
    """Power over the median from which a line of a spectrum is no noise."""

    samples_in_common: int = setting(16, "")
    """Samples of each pass on the way that all of them share."""

    share_in_common: float = setting(0.5, "")
    """Share of the shortest pass that all of them share, from which it is enough."""

    change_of_a_kept_velocity: float = setting(0.1, "")
    """Share by which a body that keeps its velocity changes it within a period of the cut-off."""

    speed_share_of_creeping: float = setting(1e-4, "")
    """Share of the greatest speed below which a body creeps: no speed that was asked for."""

    speed_share_of_settling: float = setting(1e-3, "")
    """Share below which a body settles where it does not keep its velocity (our choice)."""

    acceleration_of_a_constant_speed: float = setting(0.02, "")
    """Share of the reference's largest acceleration below which its velocity is constant."""

    # The greatest friction before a body breaks away.
    deviations_of_a_kernel: int = setting(4, "")
    """Deviations of the Gaussian beyond which it is cut off."""

    widths_tried: int = setting(12, "")
    """Widths of the Gaussian among which one is chosen."""

    ramp_share_of_a_width: float = setting(0.1, "")
    """Longest deviation of the Gaussian as a share of the ramp's second half."""

    # Ramps of the force from rest.
    low_pass_of_ramps: float = setting(100.0, "Hz")
    """Low-pass of force and velocity of force ramps."""

    periods_of_a_ramp: float = setting(2.0, "")
    """Periods of the low-pass that the second half of a ramp lasts for its break-away to be read."""

    samples_of_a_ramp: int = setting(5, "")
    """Samples of that half from which its rate is read."""

    smoothing_of_a_ramp: int = setting(40, "")
    """A push is smoothed over one in so many of its samples to see where its second half begins."""

    fewest_ramps: int = setting(3, "")
    """Ramps that show static friction at least, or contradict a fit: fewer may be chance."""

    samples_with_a_ramp: int = setting(20, "")
    """Samples of a segment that may hold a ramp."""

    force_share_of_a_start: float = setting(0.5, "")
    """Share of its break-away force from below which a ramp rises: else bristles are bent already."""

    # Break-away at the rate of a ramp.
    least_bristle_rate: float = setting(100.0, "N/s")
    """Bristle stiffness times Stribeck velocity at least, of Canudas de Wit et al. 1995; the thesis has 160."""

    spread_of_rates: float = setting(3.0, "")
    """Ratio of force rates from which break-aways are extrapolated to rate 0."""

    range_of_rates: float = setting(12.0, "")
    """Rates up to this multiple of the lowest enter: the power law holds for small rates alone."""

    share_extrapolated: float = setting(0.15, "")
    """Share of static friction over which it may be extrapolated, or widened by a bound."""

    # Slips.
    speed_share_of_a_slip: float = setting(0.1, "")
    """Share of the highest speed from which the body slips."""

    deviations_of_a_slip: float = setting(8.0, "")
    """Deviations of noise by which the speed of a slip stands out."""

    time_before_a_slip: float = setting(0.05, "s")
    """Least rest before a slip: it shows the rate at which the force rises."""

    samples_before_a_slip: int = setting(10, "")
    """Samples of that rest at least."""

    speed_share_of_an_onset: float = setting(0.01, "")
    """Share of a slip's highest speed at which its motion begins to be visible."""

    time_share_of_sliding: float = setting(0.6, "")
    """Share of the time above the threshold from which a body slides, and does not stick and slip."""

    # Stribeck curves through forces at some speeds.
    chance_of_a_curve: float = setting(0.01, "")
    """Chance below which a curve is shown, or an exponent is another than stated."""

    grid_of_velocities: int = setting(81, "")
    """Stribeck velocities of the grid: fewer miss its valley."""

    grid_of_exponents: int = setting(41, "")
    """Exponents of the grid."""

    refinements_of_the_grid: int = setting(2, "")
    """How often the grid is laid out again around what is possible."""

    margin_of_the_grid: int = setting(2, "")
    """Steps beyond what is possible: the valley may be narrower than a step."""

    usual_exponent: float = setting(2.0, "")
    """Exponent with which a curve has to show alone where forces are few: another costs a parameter."""

    ratio_below_the_slowest: float = setting(30.0, "")
    """How far below the slowest speed a Stribeck velocity may lie."""

    ratio_above_the_fastest: float = setting(2.0, "")
    """How far above the fastest speed a Stribeck velocity may lie."""
