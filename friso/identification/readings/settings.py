"""Settings of what several kinds of experiment read off a log."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ReadingSettings(Settings):
    """Settings of readings: passes, slips, ramps, friction over speed and place."""

    # Mass and friction at uneven instants.
    degree_of_polynomials: int = setting(3, "")
    """Degree of local polynomials of force and velocity; a position has one more. With 2 a quintic move of 17 samples
    shows 3 % too much mass, with 3 0.2 %."""

    widths_of_polynomials: tuple[int, ...] = setting((5, 7, 9, 13, 19, 27, 39), "")
    """Numbers of samples tried for local polynomials. Noise needs many, short moves need few."""

    speed_share_of_stamped_sliding: float = setting(0.03, "")
    """Smallest speed that counts as sliding, relative to the highest."""

    steps_of_a_hole: float = setting(4.0, "")
    """Longest step between uneven instants over which a polynomial may reach, in usual steps."""

    rows_of_a_stamped_fit: int = setting(30, "")
    """Fewest samples within moves for mass and friction. With fewer, four numbers have no honest interval."""

    # Force and motion of the body on the bearing, from command and sensor.
    points_per_sample: int = setting(8, "")
    """Points per sample when a structural mode is simulated. A mode at a tenth of the sampling rate errs by 0.05 %."""

    periods_of_a_record: int = setting(20, "")
    """Shortest record, in periods of the low-pass."""

    sampled_frequency: float = setting(0.2, "")
    """Highest frequency of motion that a spline follows, relative to the sampling frequency."""

    share_left_unexplained: float = setting(0.2, "")
    """Largest residual of a useful model, relative to the standard deviation of friction."""

    periods_of_an_edge: float = setting(2.0, "")
    """Length of the stretch at each end of a record that the low-pass distorts, in periods of its cut-off."""

    deviations_of_seen_motion: float = setting(10.0, "")
    """Smallest visible motion, in standard deviations of the noise."""

    rounding_of_a_position: float = setting(1e-9, "")
    """Largest motion that counts as rounding error, relative to the largest position."""

    deflection_share_of_bending: float = setting(0.02, "")
    """Smallest deflection of a joint that bends, relative to the motion."""

    deviations_of_bending: float = setting(3.0, "")
    """Smallest deflection of a joint that bends, in standard deviations of the sensor's noise."""

    contact_ratio_of_bending: float = setting(3.0, "")
    """Smallest deflection of a joint that bends, relative to the deflection of the contact that holds it."""

    # Means, noise and digits of signals.
    blocks_of_a_mean: int = setting(8, "")
    """Blocks of a stretch for its mean. Each must be long enough to forget the previous one."""

    linearity_of_sensors: float = setting(1e-3, "")
    """Relative error of the ratio of two channels, the linearity of good sensors and amplifiers."""

    rounding_of_a_signal: float = setting(1e-12, "")
    """Largest step that is rounding of numbers rather than the signal's resolution, relative to the signal."""

    levels_of_a_digit: int = setting(8, "")
    """Fewest distinct levels at which a signal must stay for its resolution to show."""

    error_of_a_digit: float = setting(0.1, "")
    """Largest distance of levels from multiples of the resolution, relative to it."""

    share_of_commanded_changes: float = setting(0.03, "")
    """Largest fraction of samples at which a stepped command changes. A rounded signal that is logged ten times as
    often as it changes has more."""

    digits_of_a_commanded_step: float = setting(1.5, "")
    """Smallest usual jump of a stepped command, in common steps of its levels. A rounded signal that changes seldom is
    slow, and changes by one step."""

    power_of_clear_motion: float = setting(100.0, "")
    """Smallest power of visible motion, relative to the noise. Less occurs by chance among many spectral lines."""

    power_of_strong_motion: float = setting(1e-3, "")
    """Smallest spectral power of visible motion, relative to the acceleration's largest."""

    spectrum_share_of_noise: float = setting(0.25, "")
    """Upper part of the spectrum that is taken for noise."""

    lines_of_a_spectrum: int = setting(1000, "")
    """Lines of the spectrum. More resolve more and scatter more."""

    # Course of a log whose kind of experiment is not stated.
    range_share_of_a_turn: float = setting(0.1, "")
    """Smallest reversal of a signal that counts as a turn, relative to its range."""

    travel_share_of_a_rest: float = setting(0.01, "")
    """Largest motion of a position at rest, relative to the travel."""

    share_of_most_of_a_way: float = setting(0.75, "")
    """Fraction of the way that counts as most of the way. Moves cover a sixth to a half at constant speed."""

    variance_share_of_a_spring: float = setting(0.99, "")
    """Smallest fraction of the force's variance between rests that position must explain for a spring to act."""

    variance_share_of_bristles: float = setting(0.25, "")
    """Smallest fraction of the force's variance that the position must explain before a fit of bristles is tried."""

    places_of_a_spring: int = setting(4, "")
    """Fewest rest positions that show a spring."""

    hysteresis_of_a_spring: float = setting(0.05, "")
    """Largest difference of a spring's force between both sides, relative to its range. Friction differs by more."""

    returns_to_a_place: int = setting(2, "")
    """Fewest places reached from both sides that show a spring."""

    log_share_of_a_rest: float = setting(0.01, "")
    """Shortest rest of a position, relative to the log."""

    log_share_of_ramps: float = setting(0.25, "")
    """Smallest fraction of a log that force ramps must take together. The starts of moves take a few per cent."""

    force_share_off_a_line: float = setting(0.1, "")
    """Largest deviation of a ramp from a line, relative to its break-away force."""

    force_share_before_a_ramp: float = setting(0.05, "")
    """Largest force before a ramp, relative to the ramp's. An integrator passes zero without a rest."""

    samples_of_a_blur: int = setting(20, "")
    """Number of samples over which a position is averaged, against noise, before its travel is summed."""

    # Friction over the place on the rail.
    points_of_a_friction_map: int = setting(400, "")
    """Number of places of a friction map over the whole travel."""

    correlation_of_passes: float = setting(0.5, "")
    """Correlation of the maps of two passes from which they repeat each other."""

    fields_drawn: int = setting(300, "")
    """Number of random fields drawn for the interval of the correlation length. Fewer leave its ends to chance."""

    correlation_lengths_of_a_pass: float = setting(5.0, "")
    """Shortest pass that shows a correlation length, in correlation lengths."""

    harmonics_of_a_pass: int = setting(3, "")
    """Number of harmonics reported for each pass."""

    # Friction over speed.
    span_of_speeds: float = setting(1.5, "")
    """Ratio of speeds from which Coulomb and viscous friction can be separated."""

    speeds_of_a_curve: int = setting(5, "")
    """Fewest distinct speeds to which a curve with four parameters is fitted."""

    ratio_of_distinct_speeds: float = setting(1.1, "")
    """Smallest ratio of two distinct speeds."""

    speeds_of_a_line: int = setting(3, "")
    """Fewest distinct speeds that show a deviation from a straight line."""

    # Loads of a joint between slips.
    fewest_loads: int = setting(3, "")
    """Fewest loads of a joint between slips. Fewer give no error of the stiffness."""

    # Stretches of constant velocity.
    low_pass_of_passes: float = setting(25.0, "Hz")
    """Cut-off frequency of the velocity in which stretches of constant velocity are searched."""

    time_of_a_pass: float = setting(0.1, "s")
    """Shortest stretch of constant velocity, the settling time of the filter."""

    samples_of_a_pass: int = setting(40, "")
    """Fewest samples of a stretch of constant velocity."""

    swing_of_a_steady_pass: float = setting(0.3, "")
    """Largest swing of a steady velocity, relative to its mean. With more, a body sticks and slips, or oscillates."""

    quick_swing_of_a_steady_pass: float = setting(0.02, "")
    """Largest fast swing of a steady velocity, relative to its mean. Aliasing may make it appear smaller."""

    rounding_of_a_step: float = setting(1e-6, "")
    """Largest step of a position that counts as rounding error, relative to the largest step."""

    error_of_whole_digits: float = setting(0.1, "")
    """Largest distance of steps from multiples of the resolution."""

    power_of_a_clear_line: float = setting(20.0, "")
    """Smallest power of a spectral line that stands out of the noise, relative to the median."""

    samples_in_common: int = setting(16, "")
    """Fewest samples of each pass on the way that all passes share."""

    share_in_common: float = setting(0.5, "")
    """Shortest common way, relative to the shortest pass."""

    change_of_a_kept_velocity: float = setting(0.1, "")
    """Largest change of a constant velocity within a period of the cut-off."""

    speed_share_of_creeping: float = setting(1e-4, "")
    """Speed below which a body creeps, relative to the highest speed."""

    speed_share_of_settling: float = setting(1e-3, "")
    """Speed below which a body settles rather than keeps its velocity, relative to the highest (friso's choice)."""

    acceleration_of_a_constant_speed: float = setting(0.02, "")
    """Acceleration below which the reference has constant velocity, relative to its largest."""

    # The greatest friction before a body breaks away.
    deviations_of_a_kernel: int = setting(4, "")
    """Half-width at which the smoothing Gaussian is cut off, in standard deviations."""

    widths_tried: int = setting(12, "")
    """Number of widths of the smoothing Gaussian among which the best is chosen."""

    ramp_share_of_a_width: float = setting(0.1, "")
    """Largest width of the smoothing Gaussian, relative to the second half of a ramp."""

    # Ramps of the force from rest.
    low_pass_of_ramps: float = setting(100.0, "Hz")
    """Cut-off frequency of force and velocity in force ramps."""

    periods_of_a_ramp: float = setting(2.0, "")
    """Shortest second half of a ramp whose break-away can be read, in periods of the low-pass."""

    samples_of_a_ramp: int = setting(5, "")
    """Fewest samples from which the rate of a ramp is read."""

    smoothing_of_a_ramp: int = setting(40, "")
    """Divisor of a ramp's number of samples that gives the smoothing width for finding the ramp's second half."""

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
    """Smallest ratio of highest to lowest force rate at which break-aways are extrapolated to rate 0."""

    range_of_rates: float = setting(12.0, "")
    """Largest ratio of used force rates to the lowest. The power law holds for small rates only."""

    share_extrapolated: float = setting(0.15, "")
    """Largest extrapolation or bound, relative to static friction."""

    # Slips.
    speed_share_of_a_slip: float = setting(0.1, "")
    """Speed above which a body slips, relative to the highest speed."""

    deviations_of_a_slip: float = setting(8.0, "")
    """Smallest speed of a slip, in standard deviations of the noise."""

    time_before_a_slip: float = setting(0.05, "s")
    """Shortest rest before a slip, which shows the rate of the force."""

    samples_before_a_slip: int = setting(10, "")
    """Fewest samples of the rest before a slip."""

    speed_share_of_an_onset: float = setting(0.01, "")
    """Speed at which the motion of a slip becomes visible, relative to its highest."""

    time_share_of_sliding: float = setting(0.6, "")
    """Fraction of time above the slip threshold beyond which a body slides rather than sticks and slips."""

    # Stribeck curves through forces at some speeds.
    chance_of_a_curve: float = setting(0.01, "")
    """Probability below which a Stribeck curve is significant, or an exponent is refuted."""

    grid_of_velocities: int = setting(81, "")
    """Number of Stribeck velocities in the grid. Fewer miss the valley of the cost."""

    grid_of_exponents: int = setting(41, "")
    """Number of Stribeck exponents in the grid."""

    refinements_of_the_grid: int = setting(2, "")
    """Number of refinements of the grid around the possible region."""

    margin_of_the_grid: int = setting(2, "")
    """Number of grid steps that a refined grid reaches beyond the possible region."""

    usual_exponent: float = setting(2.0, "")
    """Stribeck exponent assumed for few forces, which cannot determine one more parameter."""

    ratio_below_the_slowest: float = setting(30.0, "")
    """Ratio by which a Stribeck velocity may lie below the slowest speed."""

    ratio_above_the_fastest: float = setting(2.0, "")
    """Ratio by which a Stribeck velocity may lie above the fastest speed."""


settings = ReadingSettings.live()
