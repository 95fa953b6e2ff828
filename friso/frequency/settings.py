"""Settings of `friso.frequency`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class FrequencySettings(Settings):
    """Settings of linear loops and margins."""

    shown_beyond: float = setting(5.0, "")
    """Factor by which curves extend beyond crossovers and resonances."""

    curve_points: int = setting(1200, "")
    """Points of a curve. Fewer show corners on a screen; more make the page larger."""

    unseen_pole: float = setting(1e-7, "")
    """Largest pole, relative to the fastest, that counts as 0. It belongs to the position or its integral, which the
    velocity loop does not affect."""

    lowest_crossover: float = setting(0.1, "Hz")
    """Lowest crossover of the search. Slower loops settle after the moves of any stage."""

    highest_crossover: float = setting(1e4, "Hz")
    """Highest crossover of the search, beyond the sampling of any drive."""

    crossover_steps: int = setting(161, "")
    """Crossovers of the search. Fewer step over a narrow stable range; each costs the margins of all limit cases."""

    search_density: int = setting(60, "1/decade")
    """Frequencies per decade of the search. Fewer miss the peak of a resonance."""

    search_biases: int = setting(9, "")
    """Bias forces for each state of the limiter. Fewer miss the softest bristle."""

    crossover_nudge: float = setting(1e-5, "")
    """Relative distance from the end of a range at which a crossover is certainly beyond it."""

    light_damping: float = setting(0.3, "")
    """Damping ratio below which a pole has a peak that a frequency grid could miss."""

    pade_order: int = setting(4, "")
    """Order of the rational function of a delay. With the phase `pade_phase`, its error stays under 1e-6; a higher
    order is ill-conditioned."""

    pade_phase: float = setting(2.5, "rad")
    """Phase that one rational function of `pade_order` covers."""

    least_delay_phase: float = setting(5.0, "rad")
    """Least phase covered by the rational functions. With less, their poles lie too near the loop's poles."""

    most_delay_phase: float = setting(20.0, "rad")
    """Largest phase of a resonance within the delay. A loop with more is unstable in any case."""

    most_delay_sections: int = setting(24, "")
    """Most rational functions of a delay. More make the eigenvalues inaccurate."""

    most_delay_samples: int = setting(64, "")
    """Most samples of a delay. More make the state of a sampled drive too large for eigenvalues."""

    members_together: int = setting(256, "")
    """Members computed together. Larger arrays leave the processor's cache."""

    family_density: int = setting(35, "1/decade")
    """Frequencies per decade for a family. They find the states closest to -1, whose margins are then exact."""

    members_solved_whole: int = setting(16, "")
    """Members for which all frequencies are solved at once, limited by memory."""

    closest_members: int = setting(16, "")
    """Members computed exactly, the nearest to -1 on the coarse grid."""

    slowest_speed_share: float = setting(1e-3, "")
    """Slowest speed over the slowest velocity of the law. A slower cart is as if stuck."""

    fastest_speed_factor: float = setting(1e3, "")
    """Fastest speed over the fastest velocity of the law. Beyond it only viscous friction is left."""

    slowest_bristle_rate: float = setting(0.1, "1/s")
    """Slowest rate at which bristles give way. Slower ones are springs to any loop."""

    fastest_bristle_rate: float = setting(1e5, "1/s")
    """Fastest rate at which bristles give way. Faster ones leave only viscous friction."""

    bristle_length: float = setting(1e-6, "m")
    """Length scale of a law without bristles, whose force does not depend on speed."""

    undamped_ratio: float = setting(1e-9, "")
    """Damping ratio below which poles are on the imaginary axis, within rounding."""

    slow_pole_share: float = setting(1e-6, "")
    """Relative frequency below which sampling and delay do not change poles."""

    margin_density: int = setting(250, "1/decade")
    """Frequencies per decade for margins. Fewer step over two crossings that lie close together."""

    frequencies_beyond: float = setting(100.0, "")
    """Factor beyond the poles up to which crossings are searched; beyond it loops only fall."""

    negligible_pole: float = setting(1e-12, "")
    """Pole over the fastest that is 0 within rounding."""

    rest_frequency: float = setting(1e-6, "")
    """Frequency, relative to the loop's, below which a finite loop no longer changes."""

    real_share: float = setting(1e-9, "")
    """Imaginary over real part that may be rounding."""

    vanishing_loop: float = setting(1e-8, "")
    """Magnitude of a loop that is only rounding: a mass behind a hold at half the sampling frequency."""

    alias_share: float = setting(1e-3, "")
    """Distance from the rate of the slowest loop, relative to it, within which rounding spoils a locus."""

    jump_share: float = setting(1e-3, "")
    """Remaining value of a function at a sign change, relative to its values, above which it jumps there."""

    greatest_bias_share: float = setting(0.999, "")
    """Largest bias force over the break-away force. A stage nearer to break-away has no stiffness."""

    end_precision: float = setting(4e-6, "")
    """Relative accuracy of the ends of ranges, beyond the digits that are shown."""


settings = FrequencySettings.live()
