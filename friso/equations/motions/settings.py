"""Tuning numbers of motions."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class MotionSettings(Settings):
    """Limits on the numbers of moves and sinusoids, and the resolution of the search for reversals."""

    most_moves: int = setting(100, "")
    """Moves of a profile: each has eight pieces or more, and settling is told for each."""

    most_tones: int = setting(24, "")
    """Sinusoids of a reference: each adds to the code of every step, which takes longer to compile."""

    samples_per_period: float = setting(32.0, "")
    """Samples in a period of the fastest sinusoid among which reversals are sought. With fewer, two reversals that are
    close to each other are missed, between which feedforward by direction has the wrong sign; more take longer."""
