"""Settings of return maps: how they are sampled, refined, and read."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class ReturnMapSettings(Settings):
    """Settings of return maps, which predict the next sticking distance from the present one.

    A landing is where a stage sticks after a swing.
    """

    maps_decide: bool = True
    """Whether maps decide what attracts a stage. Without them every stage is searched from many starts: a comparison
    shows whether maps are right."""


settings = ReturnMapSettings.live()
