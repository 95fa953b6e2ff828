"""Settings of the engine: steps, room for results, work, and the building of machine code."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class BuildSettings(Settings):
    """Settings of the building of machine code, and of its cache."""

    priority_time: float = 0.5  # [s]
    """Longest time for which a question has priority. After that, nobody is still watching, and the compilation of its
    kernel must not keep others waiting."""

    kept_size: int = 200_000_000  # [bytes]
    """Size of the cache beyond which code is deleted that was not used within a day."""


build_settings = BuildSettings.live()
