"""Settings of describing functions, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class DescribingSettings(Settings):
    """Settings of describing functions and harmonic balance."""

    secant_steps: int = 12
    """Most secant steps. States that need more repeat only after several periods."""


settings = DescribingSettings.live()
