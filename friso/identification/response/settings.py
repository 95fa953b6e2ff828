"""Settings of frequency responses."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class ResponseSettings(Settings):
    """Settings of the estimation and explanation of frequency responses."""

    modes_at_most: int = 4
    """Largest number of modes, more than a bench shows in a band."""


settings = ResponseSettings.live()
