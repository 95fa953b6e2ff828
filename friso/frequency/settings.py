"""Tuning numbers of `friso.frequency`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class FrequencySettings(Settings):
    """Settings of linear loops, their margins, and describing functions."""

    shown_beyond: float = setting(5.0, "")
    """Less hides the slopes beyond crossovers and resonances; more makes the curves between them small."""

    curve_points: int = setting(1200, "")
    """Fewer show corners on a screen; more make the page larger."""

    unseen_pole: float = setting(1e-7, "")
    """A pole below this share of the fastest is a position or its integral, which the velocity loop does not see."""

    lowest_crossover: float = setting(0.1, "Hz")
    """Slower loops settle after the moves of any stage here."""

    highest_crossover: float = setting(1e4, "Hz")
    """Faster loops are beyond the sampling of any drive here."""

    crossover_steps: int = setting(161, "")
    """Fewer step over a narrow range that is stable; each costs the margins of all limit cases."""

    search_density: int = setting(60, "1/decade")
    """Fewer frequencies miss the peak of a resonance between them; the search takes proportionally longer."""

    search_biases: int = setting(9, "")
    """Bias forces for each state of the limiter; fewer miss the softest bristle, more cost time alone."""

    crossover_nudge: float = setting(1e-5, "")
    """A crossover this share above or below the end of a range is surely beyond it, and no other to the user."""

    logarithm_nudge: float = setting(1e-5, "")
    """Smaller derivatives drown in the error of the describing function, larger ones in its curvature."""

    balance_newton_steps: int = setting(20, "")
    """A balance that needs more does not converge from that start."""

    longest_log_step: float = setting(1.0, "")
    """A longer step of the logarithms jumps to another solution."""

    balance_residual: float = setting(1e-6, "")
    """The describing functions themselves hold to about this share."""

    grid_halvings: int = setting(12, "")
    """A loop that still turns too far between two frequencies has a resonance without damping."""

    amplitudes_per_decade: int = setting(32, "1/decade")
    """Fewer step over two roots that lie close together; the time grows in proportion."""

    amplitudes_beyond: float = setting(30.0, "")
    """Roots lie between a stuck and a free cart; this covers laws that creep."""

    stuck_amplitude: float = setting(1e-3, "")
    """Below it, in units of the scale of the law's state, the bristles are springs."""

    stateless_amplitude: float = setting(1e-12, "m")
    """Stands for the scale of a law without a state of its own: far below any motion that matters."""

    free_amplitude: float = setting(10.0, "")
    """From so many times the amplitude of a cart without friction on, friction no longer counts."""

    most_decades: int = setting(8, "")
    """Amplitudes that still do not enclose the force belong to a law without bounds."""

    force_error: float = setting(1e-10, "")
    """Roots of the force as exact as the describing function is smooth; looser ones show in curves."""

    most_root_steps: int = setting(60, "")
    """Halving alone reaches the error in fewer."""

    samples_per_harmonic: int = setting(32, "")
    """Fewer alias the corners of friction into the harmonics that are solved for."""

    least_intervals: int = setting(4096, "")
    """Fewer miss the instant at which friction reverses, even for a single harmonic."""

    series_newton_steps: int = setting(40, "")
    """A series that needs more does not converge from that start."""

    series_step: float = setting(1e-9, "")
    """A step of this share of the amplitude is rounding."""

    longest_step_share: float = setting(0.5, "")
    """A longer step jumps to another solution, or to rest."""

    series_halvings: int = setting(6, "")
    """A direction that leads away from the solution even then is useless."""

    resting_share: float = setting(1e-3, "")
    """A series this small beside the one before is the rest at the reference."""

    gap_tolerances: float = setting(1e3, "")
    """A state returns to itself within so many relative tolerances of the run."""

    widest_gap: float = setting(1e-4, "")
    """No looser tolerance of the run allows a larger gap: it shows in the third digit of stiffness."""

    secant_steps: int = setting(12, "")
    """States that need more repeat themselves only after several periods."""

    least_secant: float = setting(1e-4, "")
    """Closer points of a secant differ by the error of the runs alone."""

    most_samples: int = setting(1 << 20, "")
    """Keeps what is held in memory to tens of megabytes."""

    state_newton_steps: int = setting(30, "")
    """Laws with one state converge in a handful; more means that they do not."""

    state_error: float = setting(1e-12, "")
    """A change of the state by less is rounding."""

    light_damping: float = setting(0.3, "")
    """Poles with more damping have no peak that a grid of frequencies could miss."""

    pade_order: int = setting(4, "")
    """With the phase below, the error of a delay stays under 1e-6; a higher order is ill-conditioned."""

    pade_phase: float = setting(2.5, "rad")
    """Phase that one rational function of that order stands for."""

    least_delay_phase: float = setting(5.0, "rad")
    """Less leaves the poles of a delay too near those of the loop."""

    most_delay_phase: float = setting(20.0, "rad")
    """A loop whose resonance turns farther within its delay is unstable anyway."""

    most_delay_sections: int = setting(24, "")
    """Longer rows make the eigenvalues inaccurate; delays that need them are refused."""

    most_delay_samples: int = setting(64, "")
    """Longer delays make the state of a sampled drive too large to find its eigenvalues."""

    members_together: int = setting(256, "")
    """Arrays of so many members stay in the cache; larger ones are slower."""

    family_density: int = setting(35, "1/decade")
    """Fewer miss which member is closest; the exact margin is located afterwards."""

    members_solved_whole: int = setting(16, "")
    """More at once take memory for all frequencies; fewer gain nothing."""

    closest_members: int = setting(16, "")
    """Members looked at exactly; the one with the least margin is among the nearest on the coarse grid."""

    slowest_speed_share: float = setting(1e-3, "")
    """Slower than this share of the law's slowest speed the cart is as if stuck."""

    fastest_speed_factor: float = setting(1e3, "")
    """Faster than so many times the law's fastest speed only viscous friction is left."""

    slowest_bristle_rate: float = setting(0.1, "1/s")
    """Bristles that give way more slowly are springs to any loop."""

    fastest_bristle_rate: float = setting(1e5, "1/s")
    """Bristles that give way faster leave nothing but viscous friction."""

    bristle_length: float = setting(1e-6, "m")
    """Stands for the bristles of a law without: its force is the same at all speeds."""

    undamped_ratio: float = setting(1e-9, "")
    """Poles with less damping are on the imaginary axis, but for rounding."""

    slow_pole_share: float = setting(1e-6, "")
    """Sampling and delay do not change poles below this share of their own frequency."""

    margin_density: int = setting(250, "1/decade")
    """Fewer step over two crossings that lie close together; the time grows in proportion."""

    frequencies_beyond: float = setting(100.0, "")
    """Less misses crossings outside of the poles; beyond it loops only fall."""

    negligible_pole: float = setting(1e-12, "")
    """A pole below this share of the fastest is 0, but for rounding."""

    rest_frequency: float = setting(1e-6, "")
    """At so low a frequency a finite loop no longer changes."""

    real_share: float = setting(1e-9, "")
    """A smaller imaginary part beside the real one may be rounding."""

    vanishing_loop: float = setting(1e-8, "")
    """A smaller loop is nothing but rounding: a mass behind a hold at half the sampling frequency."""

    alias_share: float = setting(1e-3, "")
    """Nearer to the rate of the slowest loop the aliases of rest drown a locus in rounding."""

    jump_share: float = setting(1e-3, "")
    """A function that keeps more than this share of its values where it changes sign jumps there."""

    greatest_bias_share: float = setting(0.999, "")
    """A stuck stage nearer to break-away has no stiffness left to linearise."""

    end_precision: float = setting(4e-6, "")
    """Ends of ranges are then exact in the digits that are shown."""
