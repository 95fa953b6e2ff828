"""Settings of frequency responses."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ResponseSettings(Settings):
    """Settings of the estimation and explanation of frequency responses."""

    # Which lines of a response the models are fitted to.
    frequency_above_friction: float = setting(1 / 7, "")
    """Frequency below which friction may distort a response, relative to its highest measured frequency."""

    # Responses to arbitrary excitation.
    order_of_local_polynomials: int = setting(2, "")
    """Order of the local polynomials of response and transient."""

    lines_on_a_side: int = setting(8, "")
    """Number of lines on each side in a local fit: 17 complex equations for 6 unknowns."""

    amplitude_of_a_weak_line: float = setting(1e-4, "")
    """Amplitude below which a line counts as not excited, relative to the largest (-80 dB)."""

    # Effects of the drive and of modes above the band.
    periods_of_a_delay: float = setting(0.4, "")
    """Largest delay, in periods of the highest frequency. A drive with four samples per period is late by 0.38."""

    periods_of_a_sample: float = setting(0.25, "")
    """Usual largest sample time if it is not known, in periods of the highest frequency."""

    # Feedback.
    past_of_the_input: int = setting(60, "")
    """Number of past samples of the input from which the input is predicted."""

    past_of_the_output: int = setting(8, "")
    """Number of past samples of the output from which the input is predicted."""

    samples_of_a_feedback_test: int = setting(600, "")
    """Fewest samples of a test for feedback."""

    chance_of_feedback: float = setting(1e-6, "")
    """Probability (F-test) below which the output counts as predicting the input."""

    share_of_surprise: float = setting(0.05, "")
    """Least fraction of the input's unpredicted part that the output must explain."""

    difference_of_played_periods: float = setting(1e-6, "")
    """Relative difference between periods of an input below which it was played from a table."""

    # Departure of a response by friction.
    lines_of_a_window: int = setting(9, "")
    """Number of neighbouring lines tested together: scatter averages out over them, a departure does not."""

    chance_of_a_departure: float = setting(0.01, "")
    """Probability below which a window of lines departs from the model."""

    # Fits to responses.
    tolerance_of_a_fit: float = setting(1e-6, "")
    """Relative change of squares or parameters that ends a fit, far below their noise."""

    factor_of_a_loose_interval: float = setting(1e3, "")
    """Factor to either side beyond which a linear interval of a positive quantity means nothing."""

    # Straight lines in a response.
    scatter_of_a_straight_line: float = setting(0.02, "")
    """Relative scatter allowed on a straight line beyond its noise, by drives, guides and cables."""

    factor_between_lines: float = setting(1.5, "")
    """Factor by which the level between two straight lines must differ from both to show a mode, not a bend."""

    lines_of_a_band: int = setting(4, "")
    """Fewest spectral lines of a straight line. Fewer leave its slope uncertain."""

    octaves_of_a_band: float = setting(0.4, "")
    """Narrowest band of a straight line, in octaves. In narrower bands the slope is uncertain."""

    edges_tried: int = setting(300, "")
    """Largest number of frequencies tried as ends of a band."""

    # Modes.
    modes_at_most: int = setting(4, "")
    """Largest number of modes, more than a bench shows in a band."""

    error_of_a_response: float = setting(0.01, "")
    """Smallest relative error of a spectral line, which keeps a few strong lines from dominating the fit."""

    misfit_of_a_right_model: float = setting(3.0, "")
    """Largest sum of squares over degrees of freedom of a model that counts as right."""

    widths_of_cancelling: float = setting(1.0, "")
    """Distance of resonance and antiresonance, in half-widths, up to which they nearly cancel."""

    # One mass or two.
    squares_left_by_two: float = setting(0.5, "")
    """Largest ratio of the sums of squares of two masses and one mass for two masses to be needed."""

    chance_of_two_masses: float = setting(1e-3, "")
    """Probability that noise alone makes two masses fit so much better."""

    starts_refined: int = setting(3, "")
    """Number of starting points of the one-mass fit that are refined."""

    width_of_a_start: float = setting(0.1, "")
    """Half-width of the mode of the mass on its spring from which a fit starts, relative to its frequency."""

    # The period of an input.
    amplitude_switched_off: float = setting(0.01, "")
    """Amplitude below which the end of an input counts as switched off, relative to the input's range."""

    change_between_periods: float = setting(0.2, "")
    """Largest change from one period to the next of an input that repeats, in twice the variance."""

    change_of_a_slip: float = setting(0.02, "")
    """Change between periods above which a slip of the generator's clock is searched, in twice the variance."""

    growth_of_a_slip: float = setting(2.0, "")
    """Smallest ratio of changes after two periods and after one that shows a slip of the clock, whose ratio is 4."""

    # Averages over periods and realisations.
    lines_sharing_variance: int = setting(5, "")
    """Number of neighbouring lines that share their variance if there are few realisations."""

    period_tolerance: float = setting(1e-3, "")
    """Largest relative difference between the periods of realisations."""

    tolerance_of_equal_periods: float = setting(1e-6, "")
    """Relative difference below which periods count as equal."""

    freedom_of_a_variance: int = setting(10, "")
    """Degrees of freedom from which a spectral line's own variance is used."""

    # Rational models.
    criterion_of_a_mode: float = setting(10.0, "")
    """Decrease of the information criterion for another mode (Kass, Raftery 1995: very strong evidence)."""

    squares_left_by_a_mode: float = setting(0.8, "")
    """Largest ratio of the sums of squares with and without another mode. The criterion alone would fit friction's
    ripple."""

    frequencies_tried: int = setting(60, "")
    """Number of frequencies at which a further mode is tried."""

    dampings_tried: tuple[float, ...] = setting((0.003, 0.01, 0.03, 0.1, 0.3), "")
    """Damping ratios at which a further mode is tried."""

    # Records of one realisation.
    amplitude_of_an_excited_line: float = setting(0.01, "")
    """Amplitude below which a line counts as not excited, relative to the strongest line (-40 dB)."""

    deviations_of_an_excited_line: float = setting(3.0, "")
    """Distance of an excited line from the noise, in standard deviations of its mean."""

    step_between_lines: float = setting(2.5, "")
    """Ratio of amplitudes that separates intended lines from unintended ones."""

    power_of_meant_lines: float = setting(0.95, "")
    """Smallest fraction of the power that intended lines must contain."""

    samples_of_a_slip: float = setting(0.05, "")
    """Slip of a generator's clock, in samples over the record, from which the record is resampled."""

    distance_of_a_transient: float = setting(1.5, "")
    """Smallest distance of a leading period from the others that makes it a transient, in their variance."""

    # Spectral lines that are used.
    coherence_of_a_line: float = setting(0.5, "")
    """Smallest coherence of a spectral line that is used, if known."""

    lines_of_a_scatter: int = setting(15, "")
    """Number of lines from which the scatter between neighbours is computed."""

    # Two masses.
    resonance_ratios: tuple[float, ...] = setting((1.05, 1.2, 1.5, 2.0, 3.0), "")
    """Ratios of resonance to antiresonance from which the fit starts."""

    misfit_of_no_model: float = setting(0.4, "")
    """RMS logarithm of the ratio of response to model above which the model does not describe the response."""


settings = ResponseSettings.live()
