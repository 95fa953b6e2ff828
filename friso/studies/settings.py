"""Settings of `friso.studies`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class StudySettings(Settings):
    """Settings of sweeps, stores, draws and conversions of friction laws."""

    scheduler_timeout: float = 10.0  # [s]
    """Time within which a scheduler on a busy network answers."""

    expected_swing: float = 1.03e-3  # [m]
    """Hunting amplitude of the template's stage with its joint locked (docs/hunting.md)."""

    stages_together: int = 256
    """Stages computed between progress reports. Fewer do not fill the processor's registers."""


settings = StudySettings.live()
