"""Doubt: the force drifts along the record."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from friso.errors import InputError
from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit the inverse model with a force in proportion to time as an additional column.

    The force of a channel that warms up, or of a process, may drift while the machine does not change.
    """
    log = case.log
    with suppress(InputError):
        time = {"drift": log.time - log.time.mean()}
        model = case.modelled(log, extra=time)
        rate = f"{model.value('drift'):.2g} {case.unit}/s"
        words = f"a force drifting by {rate} accounts for most of it"
        yield RaisedDoubt(words=words, size=model.value("drift"), unit=f"{case.unit}/s", without=model, spoils=True)


DOUBT = Doubt(
    "cause",
    find,
    "the fit of the inverse model with a force that grows with time",
    "intervals reach to the values without it; friction at low speed is refused",
    "the force at rest, before and after",
    after=("timing",),
)
