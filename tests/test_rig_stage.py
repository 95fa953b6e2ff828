"""The stage file's tables for the real drive and its surroundings: values, round trip, and refused values."""

import pickle
import re
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import friso.equations.friction  # noqa: F401  the friction laws register themselves
from friso.stage import Stage, load, loads, numeric_keys, violations
from friso.virtual_rig.run import reference
from friso.virtual_rig.task import own_motion

EXAMPLE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"
FLOOR = {
    "frequency": ["1 Hz", "10 Hz", "0.1 kHz"],
    "acceleration": ["1e-5 m/s^2/Hz^0.5", "0.1 mm/s^2/√Hz", "2e-4 m/s^2/sqrt(Hz)"],
}
DRIVE_IN_SI = {
    "sample_time": ("50 us", 5e-5),
    "delay": ("5 ms", 5e-3),
    "current_bandwidth": ("2 kHz", 2000.0),
    "encoder_resolution": ("1 nm", 1e-9),
    "encoder_noise": ("0 nm", 0.0),
    "relative_noise": ("30 nm", 3e-8),
    "motor_constant_ratio": (1.47, 1.47),
    "ripple": (0.02, 0.02),
    "ripple_pitch": ("24 mm", 0.024),
    "feedforward_mass": ("1.7 kg", 1.7),
    "feedforward_coulomb": ("1 N", 1.0),
    "feedforward_viscous": ("0.5 N*s/m", 0.5),
    "integrator_deadband": ("1 um", 1e-6),
    "integrator_reset": (True, True),
}
DRIVE = {key: text for key, (text, _) in DRIVE_IN_SI.items()}
RAIL = {
    "seed": 7,
    "offset": -0.1,
    "static_deviation": 0.2,
    "coulomb_deviation": 0.3,
    "correlation_length": "5 mm",
    "rolling_pitch": "4 mm",
    "first_harmonic": 0.1,
    "second_harmonic": 0.05,
    "third_harmonic": 0.02,
}


@pytest.fixture(scope="module")
def built() -> Stage:
    """A stage with every key of the drive as built."""
    return load(EXAMPLE).replace({"drive": DRIVE, "rail": RAIL, "floor": FLOOR})


def test_drive_and_surroundings_in_si(built: Stage) -> None:
    flat = built.flat()
    drive = {key.removeprefix("drive."): value for key, value in flat.items() if key.startswith("drive.")}
    assert drive == {key: value for key, (_, value) in DRIVE_IN_SI.items()}
    numbers = RAIL | {"correlation_length": 5e-3, "rolling_pitch": 4e-3}
    assert {key: flat[f"rail.{key}"] for key in RAIL} == numbers
    assert (flat["cable.stiffness"], flat["cable.drag"]) == (5.0, 0.1)
    assert {type(value) for value in flat.values()} == {float, bool, str}
    assert built.floor
    assert built.floor.frequency == (1.0, 10.0, 100.0)
    assert built.floor.acceleration == (1e-5, 1e-4, 2e-4)
    assert not any(key.startswith("floor.") for key in flat)


def test_what_is_left_out_does_nothing(built: Stage) -> None:
    plain = built.replace({"drive": {}, "rail": {"seed": 0}, "cable": {}, "floor": None})
    flat = plain.flat()
    assert [key for key in flat if key.startswith("drive.")] == ["drive.integrator_reset"]
    assert flat["drive.integrator_reset"] is False
    assert {value for key, value in flat.items() if key.startswith(("rail.", "cable."))} == {0.0}


def test_round_trip(built: Stage) -> None:
    again = loads(built.to_toml())
    assert again == built
    assert again.as_written() == built.as_written()
    assert tomllib.loads(built.to_toml())["floor"] == FLOOR
    assert again.floor
    assert built.floor
    assert again.floor.acceleration.text == built.floor.acceleration.text
    assert pickle.loads(pickle.dumps(built)).to_toml() == built.to_toml()
    assert hash(again) == hash(built)


@st.composite
def spectra(draw: st.DrawFn) -> dict[str, list[str]]:
    frequencies = sorted(draw(st.sets(st.integers(1, 10**9), min_size=2, max_size=6)))
    level = st.floats(1e-12, 1e3, allow_subnormal=False)
    densities = draw(st.lists(level, min_size=len(frequencies), max_size=len(frequencies)))
    return {
        "frequency": [f"{frequency} uHz" for frequency in frequencies],
        "acceleration": [f"{density!r} m/s^2/Hz^0.5" for density in densities],
    }


@pytest.mark.slow
@settings(max_examples=50)
@given(spectra())
def test_floors_come_through(floor: dict[str, list[str]]) -> None:
    result = loads(load(EXAMPLE).replace({"floor": floor}).to_toml()).floor
    assert result
    assert result.as_written() == floor
    assert [*result.acceleration] == [float(text.split()[0]) for text in floor["acceleration"]]
    assert all(low < high for low, high in pairwise(result.frequency))


def test_commented_lines_of_the_example_load() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    for key in ("[floor]", "frequency =", "acceleration = [", "motor_constant_ratio"):
        assert text.count(f"# {key}") == 1
        text = text.replace(f"# {key}", key)
    stage = loads(text)
    assert stage.floor
    assert stage.flat()["drive.motor_constant_ratio"] == 0.68


def test_uncertain_keys(built: Stage) -> None:
    stage = built.replace(
        {"drive.delay": "40 us .. 60 us", "rail.offset": "0.1 +/- 0.05", "cable.drag": "1 N*s/m +/- 5 %"}
    )
    assert {*stage.uncertain()} == {"drive.delay", "rail.offset", "cable.drag"}
    with refused("rail.seed"):
        built.replace({"rail.seed": "0 .. 10"})


def test_rails_are_swept_over_their_seed(built: Stage) -> None:
    assert numeric_keys(built.flat())["rail.seed"].unit == ""
    flat = built.flat({"rail.seed": np.arange(3.0), "rail.first_harmonic": np.array([0.1, 0.95, -0.1])})
    where = {
        tuple(re.findall(r"rail\.\w+", why)): np.broadcast_to(broken, 3).tolist() for broken, why in violations(flat)
    }
    assert where == {
        ("rail.first_harmonic",): [False, False, True],
        ("rail.first_harmonic", "rail.second_harmonic", "rail.third_harmonic"): [False, True, False],
    }


@pytest.mark.parametrize(
    "changes",
    [
        {"drive.sample_time": "12.5 ms"},
        {"controller.crossover": "2 kHz"},
        {"drive.delay": "1 s"},
        {"rail": {"seed": 0, "correlation_length": "5 mm", "rolling_pitch": "4 mm"}},
        {"rail": {"seed": 0, "first_harmonic": 0.5, "rolling_pitch": "4 mm"}},
        {"rail": {"seed": 0, "coulomb_deviation": 0.5, "correlation_length": "4 mm"}},
        {"floor": None},
    ],
)
def test_what_is_allowed(built: Stage, changes: dict[str, object]) -> None:
    stage = built.replace(changes)
    assert loads(stage.to_toml()) == stage


def test_a_step_is_carried_out(built: Stage) -> None:
    """The stage stands at 0 when the reference steps."""
    stepping = built.replace({"motion": {"kind": "step", "size": "1 mm", "duration": "2 s"}})
    task, sample = own_motion(stepping), stepping.flat()["drive.sample_time"]
    assert task.displacement == 0
    assert reference(task, np.array([0.0, sample, 1.0])).tolist() == [0.0, 0.001, 0.001]
