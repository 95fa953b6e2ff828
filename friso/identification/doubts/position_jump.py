"""Doubt: the position jumps, as after homing or a reset of the counter."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.logs.checks import jumps


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Look for a step between two samples that no motion makes, many times larger than nearly all others.

    The inverse model turns it into an impossible force.
    """
    log = case.log
    size, sample = jumps(log["position"][log.longest])
    if size:
        at = log.time[log.longest][sample]
        words = f"the position jumps by {size:.3g} m at {at:.4g} s, as after homing or a reset: cut the record there"
        yield RaisedDoubt(words, size, "m")


DOUBT = Doubt("fault", find, "steps of the position between samples", "reported", "the record cut at the jump")
