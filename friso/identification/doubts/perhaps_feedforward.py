"""Doubt: a feedforward may be missing from the logged force, but the log does not decide."""

from __future__ import annotations

from collections.abc import Iterator

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.doubts import missing_feedforward
from friso.identification.inverse_model import unit_of
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """State the mass in case the logged force leaves out a feedforward.

    The doubt is raised if the reference's acceleration explains much more of the force, but not clearly while the stage
    is fast.
    """
    fed, share = missing_feedforward.fed_forward(case), doubt_settings.error_share_of_a_cause
    if case.commanded or fed is None or fed[0].error >= share * case.inverse.error:
        return
    if missing_feedforward.lacks_when_fast(case.inverse, fed[1]):
        return
    mass, kg = case.inverse.value("mass") - fed[0].value(missing_feedforward.ACCELERATION), unit_of("kg", case.log)
    words = f"if the force leaves out a feedforward, which this log does not tell, the mass is about {mass:.2g} {kg}"
    yield RaisedDoubt(words=words, size=mass, unit=kg)


DOUBT = Doubt(
    "otherwise",
    find,
    "the fit of the inverse model with acceleration and direction of the reference",
    "reported",
    "a log of the whole force of the drive",
)
