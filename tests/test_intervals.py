"""Ranges of quantities as a specification gives them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friso.errors import InputError
from friso.intervals import Span
from friso.quantities import Bound, Number, Quantity, positive

FORCE = Span(Quantity("N", positive, "3 N"), "1 N .. 3 N")
SHARE = Span(Number(Bound("0 to 1", lambda value: (value >= 0) & (value <= 1)), "0.5"), "0.3 .. 0.8")


@pytest.mark.parametrize(
    ("given_text", "low", "high"),
    [
        ("1 N .. 3 N", 1.0, 3.0),
        ("1 N..3 N", 1.0, 3.0),
        ("200 mN .. 0.5 N", 0.2, 0.5),
        ("2 N +/- 5 %", 1.9, 2.1),
        ("2 N +/- 5%", 1.9, 2.1),
        ("2 N ± 100 mN", 1.9, 2.1),
        ("2 N +/- 0 %", 2.0, 2.0),
        ("2 N", 2.0, 2.0),
        ("1 N .. 1 N", 1.0, 1.0),
    ],
)
def test_quantities(given_text: str, low: float, high: float) -> None:
    value = FORCE.read(given_text)
    assert (value.low, value.high) == pytest.approx((low, high), rel=1e-12)
    assert value.text == given_text
    assert FORCE.read(value) is value


@pytest.mark.parametrize(
    ("given_text", "low", "high"),
    [
        ("0.3 .. 0.8", 0.3, 0.8),
        (0.5, 0.5, 0.5),
        ("0.5", 0.5, 0.5),
        ("0.5 +/- 10 %", 0.45, 0.55),
        ("0.5 ± 0.1", 0.4, 0.6),
    ],
)
def test_numbers(given_text: str | float, low: float, high: float) -> None:
    value = SHARE.read(given_text)
    assert (value.low, value.high) == pytest.approx((low, high), rel=1e-12)


@pytest.mark.parametrize(
    ("given_text", "said"),
    [
        ("3 N .. 1 N", "a reversed range"),
        ("1 .. 3 N", "N"),
        ("1 N .. 3", "N"),
        ("1 N ..", "N"),
        ("1 mm .. 3 mm", "mm"),
        ("2 N +/- 5", "N"),
        ("2 N +/- 100 %", "not a percentage"),
        ("2 N +/- -5 %", "not a percentage"),
        ("2 N +/- x %", "not a number"),
        ("2 N +/- 3 N", "-1 to 5 N"),
        ("-1 N .. 3 N", "greater than 0"),
        ("1 N .. inf N", ""),
        ("nan N", ""),
        ("", ""),
        (2.0, ""),
        (True, ""),
        (None, ""),
    ],
)
def test_refused_quantities(given_text: object, said: str) -> None:
    with pytest.raises(InputError) as caught:
        FORCE.read(given_text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "given_text", ["0.3 .. 1.8", "-0.1 .. 0.5", "0.8 .. 0.3", "a .. b", "0.5 N", True, None, "0.9 +/- 0.2"]
)
def test_refused_numbers(given_text: object) -> None:
    with pytest.raises(InputError):
        SHARE.read(given_text)


def test_what_is_expected_names_unit_and_forms() -> None:
    assert "N" in FORCE.expected
    assert "LOW .. HIGH" in FORCE.expected
    assert "VALUE +/- TOLERANCE" in FORCE.expected
    assert FORCE.written_example == '"1 N .. 3 N"'
    assert "0 to 1" in SHARE.expected


@settings(max_examples=50)
@given(low=st.floats(1e-6, 1e6), width=st.floats(0, 1e6), share=st.floats(0, 1))
def test_places_between(low: float, width: float, share: float) -> None:
    value = FORCE.read(f"{low!r} N .. {low + width!r} N")
    assert (value.low, value.high) == pytest.approx((low, low + width), rel=1e-12)
    assert value.at(0) == value.low
    assert value.at(1) == pytest.approx(value.high, rel=1e-12)
    assert value.low <= value.at(share) <= value.high * (1 + 1e-12)
    assert value.at(0.5) == pytest.approx(value.centre, rel=1e-12)


@settings(max_examples=50)
@given(value=st.floats(1e-6, 1e6), percent=st.floats(0, 99))
def test_tolerance(value: float, percent: float) -> None:
    result = FORCE.read(f"{value!r} N +/- {percent!r} %")
    assert result.centre == pytest.approx(value, rel=1e-12)
    assert result.high - result.low == pytest.approx(2 * value * percent / 100, rel=1e-9, abs=1e-12 * value)
