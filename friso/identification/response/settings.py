"""Settings of frequency responses."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ResponseSettings(Settings):
    """How frequency responses are estimated and explained."""

    # Which lines of a response the models are fitted to.
    frequency_above_friction: float = setting(1 / 7, "")
    """Share of the highest frequency below which friction may bend a response: looked at again."""

    frequency_of_one_body: float = setting(0.4, "")
    """Share of the antiresonance's frequency up to which both masses move as one (to 1.2)."""

    # Responses to arbitrary excitation.
    order_of_local_polynomials: int = setting(2, "")
    """Order of the local polynomials of response and transient."""

    lines_on_a_side: int = setting(8, "")
    """Lines on each side in a local fit: 17 complex equations for 6 unknowns."""

    amplitude_of_a_weak_line: float = setting(1e-4, "")
    """Amplitude over the largest below which a line is not excited (-80 dB)."""

    # What the drive and modes above the band add.
    periods_of_a_delay: float = setting(0.4, "")
    """Largest delay over the highest frequency's period: a drive is late by 0.38 at four samples each."""

    periods_of_a_sample: float = setting(0.25, "")
    """Share of that period that an unknown sample time usually has at most."""

    # Feedback.
    past_of_the_input: int = setting(60, "")
    """Past samples of the input from which it is foretold: it remembers more than the output."""

    past_of_the_output: int = setting(8, "")
    """Past samples of the output from which the input is foretold."""

    samples_of_a_feedback_test: int = setting(600, "")
    """Samples needed to say whether there is feedback."""

    chance_of_feedback: float = setting(1e-6, "")
    """Chance below which the output is said to foretell the input."""

    share_of_surprise: float = setting(0.05, "")
    """Share of the input's surprise that the output explains: small imperfections do not count."""

    bands_of_a_bias: int = setting(5, "")
    """Bands in which the mean difference of two estimates is tested: a bias is smooth."""

    difference_of_played_periods: float = setting(1e-6, "")
    """Difference between periods of an input below which it was played from a table."""

    # Where friction bends a response.
    lines_of_a_window: int = setting(9, "")
    """Neighbouring lines judged together: scatter averages out over them, a departure does not."""

    chance_of_a_departure: float = setting(0.01, "")
    """Chance below which a window of lines is off the model."""

    # Fits to responses.
    tolerance_of_a_fit: float = setting(1e-6, "")
    """Change of squares or parameters that ends a fit: far below what noise does to them."""

    factor_of_a_loose_interval: float = setting(1e3, "")
    """Factor to either side from which a linear interval says nothing of a positive quantity."""

    # Straight lines in a response.
    scatter_of_a_straight_line: float = setting(0.02, "")
    """Scatter beyond its noise that a line may have: drives, guides and cables are never quite straight."""

    factor_between_lines: float = setting(1.5, "")
    """Two lines are two if the level between leaves both by this factor: a mode, not a bend."""

    lines_of_a_band: int = setting(4, "")
    """Frequency lines of a band at least."""

    octaves_of_a_band: float = setting(0.4, "")
    """Width of a band at least."""

    edges_tried: int = setting(300, "")
    """Frequencies tried as ends of a band at most."""

    # Modes.
    modes_at_most: int = setting(4, "")
    """Modes at most: more than a bench shows in a band."""

    error_of_a_response: float = setting(0.01, "")
    """Error below which no model is trusted; keeps a few strong lines from ruling the fit."""

    misfit_of_a_right_model: float = setting(3.0, "")
    """Squares over degrees of freedom up to which a model counts as right."""

    widths_of_cancelling: float = setting(1.0, "")
    """Distance of resonance and antiresonance, in half-widths, up to which they nearly cancel."""

    # One mass or two.
    squares_left_by_two: float = setting(0.5, "")
    """Share of the squares of one mass that two may leave: unevenness explains some, but not half."""

    chance_of_two_masses: float = setting(1e-3, "")
    """Chance that noise alone makes two masses explain so much more."""

    starts_refined: int = setting(3, "")
    """Starts that are refined."""

    width_of_a_start: float = setting(0.1, "")
    """Half-width of the mode on the spring from which a fit starts, over its frequency."""

    # The period of an input.
    amplitude_switched_off: float = setting(0.01, "")
    """Share of the input's range below which a trailing stretch is switched off."""

    change_between_periods: float = setting(0.2, "")
    """Change from one period to the next, in twice the variance, of an input that repeats."""

    change_of_a_slip: float = setting(0.02, "")
    """Such a change from which a slip of the generator's clock is looked for."""

    growth_of_a_slip: float = setting(2.0, "")
    """Times as much that has changed after two periods: a slip changes four times as much."""

    # Averages over periods and realisations.
    lines_sharing_variance: int = setting(5, "")
    """Neighbouring lines that share their variance where few realisations leave it uncertain."""

    period_tolerance: float = setting(1e-3, "")
    """Share by which the periods of realisations may differ, as those of clocks do."""

    tolerance_of_equal_periods: float = setting(1e-6, "")
    """Share up to which periods are equal."""

    freedom_of_a_variance: int = setting(10, "")
    """Degrees of freedom per line from which a variance stands on its own."""

    # Rational models.
    criterion_of_a_mode: float = setting(10.0, "")
    """Fall of the information criterion for another mode (Kass, Raftery 1995: very strong evidence)."""

    squares_left_by_a_mode: float = setting(0.8, "")
    """Share of squares that another mode may leave: the criterion alone fits wiggles of friction."""

    frequencies_tried: int = setting(60, "")
    """Frequencies at which a further mode is tried."""

    dampings_tried: tuple[float, ...] = setting((0.003, 0.01, 0.03, 0.1, 0.3), "")
    """Damping ratios at which a further mode is tried."""

    # Records of one realisation.
    amplitude_of_an_excited_line: float = setting(0.01, "")
    """Amplitude over the strongest line's below which a line is not excited (-40 dB)."""

    deviations_of_an_excited_line: float = setting(3.0, "")
    """Deviations of its mean by which an excited line stands out of the noise."""

    step_between_lines: float = setting(2.5, "")
    """Step down between amplitudes that parts lines that are meant from the rest."""

    power_of_meant_lines: float = setting(0.95, "")
    """Share of the power that the lines that are meant hold."""

    samples_of_a_slip: float = setting(0.05, "")
    """Samples by which a generator's clock slips over the record from which it is taken anew."""

    distance_of_a_transient: float = setting(1.5, "")
    """A leading period that lies so much further off than others is a transient."""

    # Lines of a response that are used.
    coherence_of_a_line: float = setting(0.5, "")
    """Coherence from which on, where it is known, a line is used."""

    lines_of_a_scatter: int = setting(15, "")
    """Lines from which the scatter between neighbours is taken."""

    # Simulated friction.
    periods_simulated: int = setting(10, "")
    """Periods simulated; friction forgets the start within one or two."""

    # Two masses.
    resonance_ratios: tuple[float, ...] = setting((1.05, 1.2, 1.5, 2.0, 3.0), "")
    """Resonance over antiresonance from which the fit starts."""

    misfit_of_no_model: float = setting(0.4, "")
    """RMS logarithm of response over model beyond which a model is none of the response."""
