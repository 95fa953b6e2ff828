"""Settings of what several kinds of experiment read off a log."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ReadingSettings(Settings):
    """Settings of readings: passes, slips, ramps, friction over speed and place."""

    # The body on the bearing, from what the drive commands and the sensor sees.
    points_per_sample: int = setting(8, "")
    """Points per sample when a structural mode is simulated. One of a tenth of the sampling rate is off by 0.05 %."""

    periods_of_a_record: int = setting(20, "")
    """Shortest record, in periods of the low-pass."""

    sampled_frequency: float = setting(0.2, "")
    """Highest frequency of the motion, over the sampling frequency, that a spline follows."""

    share_left_unexplained: float = setting(0.2, "")
    """Largest residual of a useful model, over the standard deviation of friction."""

    periods_of_an_edge: float = setting(2.0, "")
    """Ends of a record that the low-pass distorts, in its periods."""

    deviations_of_seen_motion: float = setting(10.0, "")
    """Smallest visible motion, in standard deviations of the noise."""

    rounding_of_a_position: float = setting(1e-9, "")
    """Largest motion that is rounding, relative to the largest position."""

    deflection_share_of_bending: float = setting(0.02, "")
    """Smallest deflection of a joint that bends, relative to the motion."""

    deviations_of_bending: float = setting(3.0, "")
    """Smallest deflection of a joint that bends, in standard deviations of the sensor's noise."""

    contact_ratio_of_bending: float = setting(3.0, "")
    """Smallest deflection of a joint that bends, relative to that of the contact that holds it."""

    # Means, noise and digits of signals.
    blocks_of_a_mean: int = setting(8, "")
    """Blocks of a stretch for its mean. Each must be long enough to forget the previous one."""

    linearity_of_sensors: float = setting(1e-3, "")
    """Relative error of the ratio of two channels, the linearity of good sensors and amplifiers."""

    rounding_of_a_signal: float = setting(1e-12, "")
    """Steps, relative to a signal, that are rounding of numbers rather than its resolution."""

    levels_of_a_digit: int = setting(8, "")
    """Levels at which a signal stays from which its resolution shows."""

    error_of_a_digit: float = setting(0.1, "")
    """Largest distance of levels from multiples of the resolution, relative to it."""

    power_of_clear_motion: float = setting(100.0, "")
    """Power over the noise's from which motion is visible. Less is chance among many lines."""

    power_of_strong_motion: float = setting(1e-3, "")
    """Power over the largest of the acceleration from which motion is visible."""

    spectrum_share_of_noise: float = setting(0.25, "")
    """Upper part of the spectrum that is taken for noise."""

    lines_of_a_spectrum: int = setting(1000, "")
    """Lines of the spectrum. More resolve more and scatter more."""

    # How a log goes that nobody has named.
    range_share_of_a_turn: float = setting(0.1, "")
    """Smallest reversal of a signal that counts as a turn, relative to its range."""

    travel_share_of_a_rest: float = setting(0.01, "")
    """Largest motion of a position at rest, relative to the travel."""

    share_of_most_of_a_way: float = setting(0.75, "")
    """Fraction of the way that counts as most of it. Moves cover a sixth to a half at constant speed."""

    variance_share_of_a_spring: float = setting(0.99, "")
    """Fraction of the force's variance between rests that the place explains if a spring acts."""

    places_of_a_spring: int = setting(4, "")
    """Fewest places that show a spring."""

    hysteresis_of_a_spring: float = setting(0.05, "")
    """Largest difference of a spring's force between both sides, relative to its range. Friction differs by more."""

    returns_to_a_place: int = setting(2, "")
    """Fewest places reached from both sides that show a spring."""

    log_share_of_a_rest: float = setting(0.01, "")
    """Shortest rest of a position, relative to the log."""

    log_share_of_ramps: float = setting(0.25, "")
    """Least part of a log that force ramps take together. Moves start within a few per cent of theirs."""

    force_share_off_a_line: float = setting(0.1, "")
    """Largest deviation of a ramp from a line, relative to its break-away force."""

    force_share_before_a_ramp: float = setting(0.05, "")
    """Largest force before a ramp, relative to it. An integrator passes zero without a rest."""

    samples_of_a_blur: int = setting(20, "")
    """Samples over which a position is averaged before its travel is summed, against noise."""

    # Friction over the place on the rail.
    points_of_a_friction_map: int = setting(400, "")
    """Places of a friction map over the whole travel."""

    correlation_of_passes: float = setting(0.5, "")
    """Correlation of the maps of two passes from which they repeat each other."""

    fields_drawn: int = setting(300, "")
    """Random fields for the interval of the correlation length. Fewer leave its ends to chance."""

    correlation_lengths_of_a_pass: float = setting(5.0, "")
    """Shortest pass that shows a correlation length, in correlation lengths."""

    harmonics_of_a_pass: int = setting(3, "")
    """Harmonics reported for each pass."""

    # Friction over speed.
    span_of_speeds: float = setting(1.5, "")
    """Ratio of speeds from which Coulomb and viscous friction can be separated."""

    speeds_of_a_curve: int = setting(5, "")
    """Distinct speeds from which a curve of four parameters may be fitted."""

    ratio_of_distinct_speeds: float = setting(1.1, "")
    """Ratio from which two speeds are distinct."""

    speeds_of_a_line: int = setting(3, "")
    """Distinct speeds from which a deviation from a straight line shows."""

    rounding_of_a_force: float = setting(1e-9, "")
    """Smallest error of a mean, relative to the largest force."""

    # Loads of a joint between slips.
    fewest_loads: int = setting(3, "")
    """Fewest loads between slips. Fewer give no error of the stiffness."""

    # Stretches of constant velocity.
    low_pass_of_passes: float = setting(25.0, "Hz")
    """Low-pass of the velocity by which constant stretches are found."""

    time_of_a_pass: float = setting(0.1, "s")
    """Shortest stretch of constant velocity, the settling time of the filter."""

    samples_of_a_pass: int = setting(40, "")
    """Fewest samples of such a stretch."""

    swing_of_a_steady_pass: float = setting(0.3, "")
    """Largest swing of a steady velocity over its mean. With more, a body sticks and slips, or oscillates."""

    quick_swing_of_a_steady_pass: float = setting(0.02, "")
    """Largest fast swing of a steady velocity. One of 940 Hz, sampled at 1 kHz, looks 17 times slower than it is."""

    rounding_of_a_step: float = setting(1e-6, "")
    """Steps of a position that are rounding, relative to the largest one."""

    error_of_whole_digits: float = setting(0.1, "")
    """Largest distance of steps from multiples of the resolution."""

    power_of_a_clear_line: float = setting(20.0, "")
    """Power over the median from which a spectral line is no noise."""

    samples_in_common: int = setting(16, "")
    """Fewest samples of each pass on the stretch that all passes cover."""

    share_in_common: float = setting(0.5, "")
    """Shortest common way, relative to the shortest pass."""

    change_of_a_kept_velocity: float = setting(0.1, "")
    """Largest change of a constant velocity within a period of the cut-off."""

    speed_share_of_creeping: float = setting(1e-4, "")
    """Speed below which a body creeps, relative to the largest one."""

    speed_share_of_settling: float = setting(1e-3, "")
    """Speed below which a body settles rather than keeps its velocity (friso's choice)."""

    acceleration_of_a_constant_speed: float = setting(0.02, "")
    """Acceleration below which the reference has constant velocity, relative to its largest."""

    # The greatest friction before a body breaks away.
    deviations_of_a_kernel: int = setting(4, "")
    """Half-width at which the Gaussian is cut off, in standard deviations."""

    widths_tried: int = setting(12, "")
    """Widths of the Gaussian among which one is chosen."""

    ramp_share_of_a_width: float = setting(0.1, "")
    """Largest width of the Gaussian, relative to the second half of a ramp."""

    # Ramps of the force from rest.
    low_pass_of_ramps: float = setting(100.0, "Hz")
    """Low-pass of force and velocity of force ramps."""

    periods_of_a_ramp: float = setting(2.0, "")
    """Shortest second half of a ramp whose break-away can be read, in periods of the low-pass."""

    samples_of_a_ramp: int = setting(5, "")
    """Fewest samples from which the rate of a ramp is read."""

    smoothing_of_a_ramp: int = setting(40, "")
    """Smoothing of a push, as a fraction of its samples (one in so many), to find its second half."""

    fewest_ramps: int = setting(3, "")
    """Fewest ramps that determine static friction, or contradict a fit."""

    samples_with_a_ramp: int = setting(20, "")
    """Fewest samples of a segment with a ramp."""

    force_share_of_a_start: float = setting(0.5, "")
    """Largest initial force of a ramp, relative to break-away. With more, bristles are bent already."""

    # Break-away at the rate of a ramp.
    least_bristle_rate: float = setting(100.0, "N/s")
    """Least product of bristle stiffness and Stribeck velocity, of Canudas de Wit et al. 1995; the thesis has 160."""

    spread_of_rates: float = setting(3.0, "")
    """Ratio of force rates from which break-aways are extrapolated to rate 0."""

    range_of_rates: float = setting(12.0, "")
    """Highest rate that is used, over the lowest. The power law holds for small rates only."""

    share_extrapolated: float = setting(0.15, "")
    """Largest extrapolation or bound, relative to static friction."""

    # Slips.
    speed_share_of_a_slip: float = setting(0.1, "")
    """Speed from which the body slips, relative to the highest."""

    deviations_of_a_slip: float = setting(8.0, "")
    """Speed of a slip in standard deviations of the noise."""

    time_before_a_slip: float = setting(0.05, "s")
    """Shortest rest before a slip, which shows the rate of the force."""

    samples_before_a_slip: int = setting(10, "")
    """Fewest samples of that rest."""

    speed_share_of_an_onset: float = setting(0.01, "")
    """Speed at which the motion of a slip becomes visible, relative to its highest."""

    time_share_of_sliding: float = setting(0.6, "")
    """Fraction of time above the threshold from which a body slides rather than sticks and slips."""

    # Stribeck curves through forces at some speeds.
    chance_of_a_curve: float = setting(0.01, "")
    """Probability below which a curve shows, or an exponent is refuted."""

    grid_of_velocities: int = setting(81, "")
    """Stribeck velocities of the grid. Fewer miss its valley."""

    grid_of_exponents: int = setting(41, "")
    """Exponents of the grid."""

    refinements_of_the_grid: int = setting(2, "")
    """Refinements of the grid around the possible region."""

    margin_of_the_grid: int = setting(2, "")
    """Steps of the grid beyond the possible region."""

    usual_exponent: float = setting(2.0, "")
    """Exponent assumed for few forces, because another parameter costs too much."""

    ratio_below_the_slowest: float = setting(30.0, "")
    """Ratio by which a Stribeck velocity may lie below the slowest speed."""

    ratio_above_the_fastest: float = setting(2.0, "")
    """Ratio by which a Stribeck velocity may lie above the fastest speed."""
