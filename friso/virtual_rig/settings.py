"""Settings of `friso.virtual_rig`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class RigSettings(Settings):
    """Settings of runs with the real drive."""

    rig_rtol: float = setting(1e-4, "")
    """Relative tolerance of runs. A step is at most a sample long. Looser runs show in the logs; tighter ones take
    longer."""

    steps_per_sample: int = setting(200, "")
    """Largest mean number of steps per sample. Runs that need more chatter, and would never end."""

    most_delay_samples: int = setting(64, "")
    """Largest delay in samples. Longer delays take memory for every sample of every run."""

    sample_memory: float = setting(2.5e8, "B")
    """Memory for the samples of the runs in progress. Larger machines gain nothing from more."""

    points_per_length: int = setting(12, "")
    """Table points per correlation length of the rail. Fewer show corners in the rail's friction; tables grow in
    proportion."""

    points_per_wave: int = setting(40, "")
    """Table points per wave. Fewer flatten the ripple by a percent; tables grow in proportion."""

    table_margin: float = setting(0.01, "m")
    """Margin of tables beyond the motion. Stages that overshoot further leave the rail."""

    table_share: float = setting(0.5, "")
    """Margin of tables in long moves, as a fraction of the travel. Stages that overshoot further leave the rail."""

    points_per_period: int = setting(10, "")
    """Points per period of the highest frequency of the floor. Fewer flatten it by some percent."""


settings = RigSettings.live()
