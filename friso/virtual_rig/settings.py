"""Tuning numbers of `friso.virtual_rig`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class RigSettings(Settings):
    """Settings of the machine as built."""

    rig_rtol: float = setting(1e-4, "")
    """A step is at most a sample long: looser runs show in the logs, tighter ones take longer."""

    steps_per_sample: int = setting(200, "")
    """Runs that need more on average chatter, and would never end."""

    most_delay_samples: int = setting(64, "")
    """Longer delays take memory for every sample of every run."""

    sample_memory: float = setting(2.5e8, "B")
    """Memory for the samples of the runs in progress; larger machines gain nothing from more."""

    points_per_length: int = setting(12, "")
    """Fewer points show corners in the rail's friction; tables grow in proportion."""

    points_per_wave: int = setting(40, "")
    """Fewer points flatten the ripple by a percent; tables grow in proportion."""

    table_margin: float = setting(0.01, "m")
    """Stages that overshoot further leave the rail."""

    table_share: float = setting(0.5, "")
    """Margin of tables in long moves, as a share of their way: stages that overshoot further leave the rail."""

    points_per_period: int = setting(10, "")
    """Fewer points flatten the highest frequency of the floor by some percent."""
