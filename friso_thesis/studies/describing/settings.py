"""Settings of describing functions, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DescribingSettings(Settings):
    """Settings of describing functions and harmonic balance."""

    logarithm_nudge: float = setting(1e-5, "")
    """Step in the logarithms of amplitude and frequency for numerical derivatives. Smaller steps drown in the error of
    the describing function."""

    balance_newton_steps: int = setting(20, "")
    """Newton steps after which a balance does not converge."""

    longest_log_step: float = setting(1.0, "")
    """Longest Newton step in the logarithms. A longer one jumps to another solution."""

    balance_residual: float = setting(1e-6, "")
    """Relative residual of a solution, the accuracy of the describing functions."""

    grid_halvings: int = setting(12, "")
    """Halvings of the grid. A resonance that needs more has no damping."""

    amplitudes_per_decade: int = setting(32, "1/decade")
    """Amplitudes per decade. Fewer step over two roots that lie close together."""

    amplitudes_beyond: float = setting(30.0, "")
    """Factor beyond the amplitudes of a stuck and a free cart within which roots are searched."""

    stuck_amplitude: float = setting(1e-3, "")
    """Amplitude below which bristles are springs, in units of the scale of the law's state."""

    stateless_amplitude: float = setting(1e-12, "m")
    """Amplitude scale of a law without a state of its own, far below any motion that matters."""

    free_amplitude: float = setting(10.0, "")
    """Amplitude, relative to that of a cart without friction, beyond which friction does not matter."""

    most_decades: int = setting(8, "")
    """Most decades searched. A law that needs more is unbounded."""

    force_error: float = setting(1e-10, "")
    """Relative error of the force at a root. Larger ones show in curves."""

    most_root_steps: int = setting(60, "")
    """Most steps to a root; halving alone needs fewer."""

    samples_per_harmonic: int = setting(32, "")
    """Intervals per harmonic. Fewer alias the corners of friction into the harmonics."""

    least_intervals: int = setting(4096, "")
    """Least number of intervals. Fewer miss the instant at which friction reverses."""

    series_newton_steps: int = setting(40, "")
    """Newton steps after which a series does not converge."""

    series_step: float = setting(1e-9, "")
    """Step, relative to the amplitude, below which a change is only rounding."""

    longest_step_share: float = setting(0.5, "")
    """Longest step relative to the amplitude. A longer one jumps to another solution, or to rest."""

    series_halvings: int = setting(6, "")
    """Halvings of a step after which its direction is useless."""

    resting_share: float = setting(1e-3, "")
    """Amplitude relative to the previous one below which a series is the rest at the reference."""

    gap_tolerances: float = setting(1e3, "")
    """Largest gap of a periodic state, in relative tolerances of the run."""

    widest_gap: float = setting(1e-4, "")
    """Largest relative mismatch of a state after one period, at any tolerance. It changes the third digit of
    stiffness."""

    secant_steps: int = setting(12, "")
    """Most secant steps. States that need more repeat only after several periods."""

    least_secant: float = setting(1e-4, "")
    """Least distance of the points of a secant. Closer ones differ by errors of the runs."""

    most_samples: int = setting(1 << 20, "")
    """Most samples in memory, tens of megabytes."""

    state_newton_steps: int = setting(30, "")
    """Newton steps for laws with one state, which converge in a handful."""

    state_error: float = setting(1e-12, "")
    """Largest Newton step of the friction state, relative to the state, at which the state has converged."""


settings = DescribingSettings.live()
