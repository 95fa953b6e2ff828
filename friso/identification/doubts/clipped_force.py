"""Doubt: the force channel clips, with many samples at its extremes."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.logs import checks
from friso.identification.logs.settings import settings
from friso.quantities import percent


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Count the samples at the largest and the smallest force.

    A clipped force is too small exactly where inertia is large, which distorts mass and friction.
    """
    share = checks.clipped_share(case.log["force"])
    if share > settings.share_of_clipped_samples:
        words = f"{percent(share)} of the force samples lie at its extremes: the channel clips"
        yield RaisedDoubt(words, share, spoils=True)


DOUBT = Doubt(
    "cause", find, "force samples at the extremes", "friction at low speed is refused", "a wider range of the channel"
)
