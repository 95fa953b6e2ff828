"""Lengths in sentences: none is finer than a step of the encoder, or than a run resolves."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import friso
from friso.axis import KINDS, LINEAR, speaking_of
from friso.shown.text import length_at_rest, range_with_unit, swing_with_unit, with_unit

EXAMPLES = Path(__file__).parents[1] / "examples"
PREFIXES = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0}
_LENGTH = re.compile(r"(?<![\w.])([\d.]+(?:e-?\d+)?) ?([nµm]?)(?:m|rad)(?![\w·/²*^])")


def lengths(text: str) -> list[float]:
    """Return the lengths [m or rad] that a text states."""
    return [float(number) * PREFIXES[prefix] for number, prefix in _LENGTH.findall(text)]


def test_a_length_that_nobody_sees_is_said_to_be_shorter() -> None:
    with speaking_of(replace(LINEAR, counted=(("count", 1e-6),))):
        assert with_unit(3e-7, "m") == length_at_rest(3e-7) == "< 1.00 µm"
        assert with_unit(1e-6, "m") == "1.00 µm"
        assert (with_unit(0.0, "m"), with_unit(3e-7, "s")) == ("0 m", "300 ns")
        assert swing_with_unit(3e-7, 0.0, "m") == "less than ±1.00 µm"
        assert range_with_unit(2e-7, 3e-7, "m") == "< 1.00 µm"
        assert range_with_unit(2e-7, 3e-6, "m") == "< 1.00 µm to 3.00 µm"
        assert length_at_rest(3e-6, 5e-6) == "< 5.00 µm"
    with speaking_of(KINDS["rotary"]):
        assert "e-" not in with_unit(6.07e-18, "m")
        assert with_unit(6.07e-18, "m").endswith("nrad")
    with speaking_of(LINEAR):
        assert with_unit(5e-10, "m") == "0.500 nm"
        assert length_at_rest(5e-10) == "< 1.00 nm"


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("name", ["robot_wrist", "lugre_stick_slip", "ball_screw_axis"])
def test_check_states_no_length_below_a_step_of_the_encoder(name: str) -> None:
    stage = friso.load(EXAMPLES / f"{name}.toml")
    step = "20 urad" if stage.axis_kind.name == "rotary" else "20 um"
    said = str(friso.check(stage.replace({"drive.encoder_resolution": step})))
    assert min(lengths(said)) >= 20e-6 * (1 - 1e-6), said
