"""Settings of `friso.virtual_rig`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class RigSettings(Settings):
    """Settings of runs with the real drive."""

    rig_rtol: float = 1e-4
    """Relative tolerance of runs. A step is at most a sample long. Looser runs show in the logs; tighter ones take
    longer."""


settings = RigSettings.live()
