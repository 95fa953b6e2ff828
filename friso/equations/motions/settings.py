"""Tuning numbers of motions."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class MotionSettings(Settings):
    """Reversals of references that are sums of sinusoids."""

    samples_per_period: float = setting(32.0, "")
    """Samples in a period of the fastest sinusoid among which reversals are sought. With fewer, two reversals that are
    close to each other are missed, between which feedforward by direction has the wrong sign; more take longer."""
