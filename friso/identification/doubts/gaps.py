"""Doubt: gaps leave little of the record to fit."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the longest stretch without a gap, which alone is fitted, with the whole record.

    Derivatives and filters do not reach across a gap.
    """
    part, step, count = case.log.longest, case.log.sample_time, len(case.log.time)
    share = (part.stop - part.start) / count
    if share > doubt_settings.share_of_a_whole_record:
        return
    words = (
        f"The record has gaps, and the longest stretch without one, {step * (part.stop - part.start):.3g} s of "
        f"{step * count:.3g} s, is all that is fitted: export it without gaps"
    )
    yield RaisedDoubt(words, share)


DOUBT = Doubt("record", find, "gaps between samples", "reported", "a record exported without gaps")
