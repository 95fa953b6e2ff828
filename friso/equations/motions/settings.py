"""Settings of motions: limits of their size, and the search for reversals."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class MotionSettings(Settings):
    """Limits on moves and sinusoids, and the resolution of the search for reversals."""

    most_moves: int = setting(100, "")
    """Most moves of a profile. Each has eight pieces or more, and its own settling time."""

    most_tones: int = setting(24, "")
    """Most sinusoids of a reference. Each adds to the code of every step, which takes longer to compile."""

    samples_per_period: float = setting(32.0, "")
    """Samples in a period of the fastest sinusoid, among which reversals are sought. With fewer, two reversals close
    together are missed, and between them feedforward by direction has the wrong sign. More take longer."""


settings = MotionSettings.live()
