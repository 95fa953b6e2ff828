"""Doubt: an identified value is implausible for a positioning stage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from friso.identification.doubt import Doubt, RaisedDoubt
from friso.identification.estimate import Estimate
from friso.stage import Stage, plausible


def find(case: tuple[Stage, Sequence[Estimate]]) -> Iterator[RaisedDoubt]:
    """List identified keys of a stage whose values are implausible.

    `case` has the stage and the estimates.
    """
    stage, estimates = case
    keys = [estimate.name for estimate in estimates if estimate.determined]
    for sentence in plausible.implausible_values(stage):
        if sentence.partition(" ")[0] in keys:
            yield RaisedDoubt(words=f"{sentence}: a wrong unit or --scale of a channel?")


DOUBT = Doubt("stage", find, "values that no positioning stage has", "reported", "units and scales of the channels")
