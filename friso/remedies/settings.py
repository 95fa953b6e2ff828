"""Settings of `friso.remedies`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings


@dataclass(frozen=True)
class RemedySettings(Settings):
    """Settings of the search for remedies against hunting."""

    confirming_work: float = 4e8
    """Work to confirm a tuned stage, about 5 s on one core, and as much for nearby bandwidths. Most stages take a tenth
    of it; a stage that takes more is not sure to work."""

    search_work: float = 4e8
    """Work for a search, about 5 s on one core. Less ends a search of four keys early."""


settings = RemedySettings.live()
