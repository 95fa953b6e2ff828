"""No doubt claims what its record cannot contain: sizes are bounded by the record, and a single pass has no places."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friso.errors import InputError
from friso.identification.doubt import (
    DOUBTS,
    Doubt,
    Moment,
    RaisedDoubt,
    RecordCase,
    ValueCase,
    causes,
    raised,
)
from friso.identification.inverse_model import inverse_model, passes_once
from friso.identification.logs.checks import clipped_share
from friso.identification.output_error.identifiable import Coverage
from friso.identification.readings.common import record

DT = 1e-3
BY_PLACE = {"cogging", "friction-by-place", "force-by-place", "play"}


def quintic(u: np.ndarray) -> np.ndarray:
    u = np.clip(u, 0, 1)
    return u**3 * (10 - 15 * u + 6 * u * u)


def passing(count: int, mass: float, friction: float, scale: float, odd: str, blur: float, seed: int) -> RecordCase:
    """Return a record of a number of passes, with something odd in its force, and its inverse model."""
    time = np.arange(2500) * DT
    place, phase = np.divmod(time, 2.5 / count)
    way = quintic((phase - 0.1 / count) / (2.2 / count))
    position = 0.02 * np.where(place % 2 == 0, way, 1 - way)
    velocity = np.gradient(position, DT)
    force = mass * np.gradient(velocity, DT) + friction * np.sign(np.round(velocity, 9)) + 3 * velocity
    force = (
        force
        + friction
        * {
            "nothing": 0 * time,
            "drift": 0.5 * time,
            "place": np.sin(900 * position),
            "spring": 50 * position,
            "offset": 2 + 0 * time,
            "warming": np.sign(np.round(velocity, 9)) * time,
        }[odd]
    )
    noise = np.random.default_rng(seed).standard_normal((2, len(time)))
    log = record("passes", DT, position=position + 1e-8 * noise[0], force=scale * (force + blur * friction * noise[1]))
    return RecordCase(log, inverse_model(log))


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from([1, 2, 5]),
    st.floats(0.05, 20),
    st.floats(0.1, 50),
    st.sampled_from([1e-3, 1.0, 1e4]),
    st.sampled_from(["nothing", "drift", "place", "spring", "offset", "warming"]),
    st.sampled_from([1e-4, 0.1, 1.0]),
    st.integers(0, 99),
)
def test_no_doubt_is_larger_than_its_record(
    count: int, mass: float, friction: float, scale: float, odd: str, blur: float, seed: int
) -> None:
    try:
        case = passing(count, mass, friction, scale, odd, blur, seed)
    except InputError:
        return
    force = float(np.ptp([0.0, *case.log["force"]]))
    values = raised("value", ValueCase(case.log, case.inverse, lacks=True))
    findings = [*raised("record", case), *causes(case), *values]
    for finding in findings:
        if finding.unit == "N":
            assert abs(finding.size) <= force
        elif finding.unit == "m":
            assert abs(finding.size) <= np.ptp(case.log["position"])
        elif finding.unit == "s":
            assert abs(finding.size) <= case.log.sample_time * len(case.log.time)
    assert case.passes_once == (count == 1)
    if count == 1:
        assert not BY_PLACE & {finding.doubt for finding in findings}


@pytest.mark.parametrize("moment", ["record", "fault", "cause", "otherwise", "value"])
@pytest.mark.parametrize("unit", ["N", "m", "s", "m/s", "kg", "N*s/m"])
def test_any_doubt_is_bounded_by_its_record(moment: Moment, unit: str) -> None:
    """A doubt of any moment that claims too much is left out, if it is an effect, or its size is bounded."""
    case = passing(2, 2.0, 5.0, 1.0, "nothing", 0.01, 0)
    made_up = ValueCase(case.log, case.inverse)

    def find(case: Any) -> Iterator[RaisedDoubt]:
        yield RaisedDoubt(words="fits", size=0.5 * case.largest(unit), unit=unit)
        yield RaisedDoubt(words="is too large", size=-1e3 * case.largest(unit), unit=unit)

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(DOUBTS.added, "made-up", (Doubt(moment, find, "", "", ""), "made up"))
        findings = [finding for finding in raised(moment, made_up) if finding.doubt == "made-up"]
    assert [finding.words for finding in findings] == ["fits", "is too large"][: 1 if moment == "cause" else 2]
    assert all(abs(finding.size) <= case.largest(unit) for finding in findings)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.floats(0.0, 1e-3), st.booleans())
def test_a_way_is_passed_once_by_motion_in_one_direction_alone(count: int, blur: float, back: bool) -> None:
    time = np.arange(4000) * DT
    steps = np.floor(time / (4.0 / count)) + quintic((time % (4.0 / count)) / (3.0 / count))
    position = steps if not back else 1 - np.abs(1 - steps % 2)
    position = position + blur * np.random.default_rng(count).standard_normal(len(time))
    assert passes_once(position) == (not back or count == 1)


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-12, 1e-3), st.lists(st.floats(1e-9, 1.0), min_size=1, max_size=20))
def test_rest_is_no_gap_between_speeds(slowest: float, speeds: list[float]) -> None:
    low, high = Coverage(np.sort(speeds), (), 0.0, slowest).gap
    assert low >= 1e-4 * max(speeds)
    assert high > low


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 1.0), st.floats(0.1, 1.0), st.floats(1e-3, 1e3))
def test_a_rest_at_both_ends_is_not_clipped(before: float, after: float, size: float) -> None:
    time = np.arange(0, before + 2 + after, DT)
    ramp = size * np.clip(time - before, 0, 2)
    assert clipped_share(ramp) == 0
    assert clipped_share(-ramp) == 0
    assert clipped_share(np.clip(np.sin(6 * time), -0.8, 0.8)) > 0.1
