"""Settings of the page, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class AppSettings(Settings):
    """Settings of what the page computes by itself."""

    begun_share: float = setting(0.01, "")
    """Share of its range by which a quantity leaves its first value when a move begins. Noise of a log is smaller."""

    most_values: int = setting(40, "")
    """Largest number of values along the slider of a key. A page asks for eleven."""


app_settings = AppSettings.live()
