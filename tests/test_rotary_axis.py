"""A rotary axis has the numbers of a linear one with the same SI values, in other units, through every command."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from inside import friso_inside

import friso
from friso.axis import LINEAR, ROTARY, AxisKind
from friso.intervals import UncertainValue
from friso.stage import Stage, numeric_keys
from friso.stage.plausible import implausible_values

EXAMPLES = Path(__file__).parents[1] / "examples"

LENGTHS = re.compile(r"[0-9]\s(?:[mnµu]?m|k?N|kg)(?![a-zA-Z·*])")
"""Numbers in units of a linear axis."""


def turned(value: Any) -> Any:
    """Return a value of a stage file with the unit of a rotary axis."""
    if isinstance(value, dict):
        return {key: turned(item) for key, item in value.items()}
    if isinstance(value, list):
        return [turned(item) for item in value]
    number, _, unit = value.partition(" ") if isinstance(value, str) else ("", "", "")
    return f"{number} {ROTARY.unit(unit)}" if unit and number[:1].isdigit() else value


def rotary(stage: Stage) -> Stage:
    tables = stage.as_written()
    tables = {key: turned(item) if isinstance(item, dict) else item for key, item in tables.items()}
    return Stage(**{**tables, "axis": {"kind": "rotary"}})


def numbers(document: Any, axis: AxisKind = ROTARY) -> Any:
    """A document without its texts, its keys as on an axis of this kind."""
    if isinstance(document, dict):
        items = ((axis.suffix(key), item) for key, item in document.items() if key not in ("files", "written"))
        return {key: numbers(item, axis) for key, item in items}
    if isinstance(document, list):
        return [numbers(item, axis) for item in document]
    return None if isinstance(document, str) else document


@pytest.fixture(scope="module")
def pair() -> tuple[Stage, Stage]:
    linear = friso.load(EXAMPLES / "thesis_drive.toml").replace(
        {"joint": None, "parasitic": None, "motion": {"kind": "step", "size": "5 mm", "duration": "10 s"}}
    )
    return linear, rotary(linear)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, pair: tuple[Stage, Stage]) -> Path:
    folder = tmp_path_factory.mktemp("rotary")
    for name, stage in zip(("linear", "rotary"), pair, strict=True):
        (folder / f"{name}.toml").write_text(stage.to_toml(), encoding="utf-8")
    return folder


def test_the_numbers_are_those_of_a_linear_axis_in_other_units(pair: tuple[Stage, Stage]) -> None:
    linear, turntable = pair
    flat = turntable.flat()
    assert flat.pop("axis.kind") == "rotary"
    assert flat == linear.flat()
    assert friso.loads(turntable.to_toml()) == turntable
    units = {key: field.unit for key, field in numeric_keys(turntable.flat()).items()}
    assert units["masses.cart"] == "kg*m^2"
    assert units["friction.bristle_damping"] == "N*m*s/rad"
    assert units["drive.encoder_resolution"] == "rad"
    assert units["controller.crossover"] == "Hz"
    assert not [*implausible_values(turntable)]
    assert turntable.with_numbers({"friction.static": 2.5}).flat()["friction.static"] == 2.5
    texts = {"static": "300 N*cm +/- 10 %", "stribeck_velocity": "0.1 deg/s", "bristle_stiffness": "1e5 N*m"}
    changes = {**{f"friction.{key}": text for key, text in texts.items()}, "masses.cart": "1.2e4 kg*cm^2"}
    changed = turntable.replace(changes)
    assert [changed.flat()[key] for key in changes] == pytest.approx([3.0, np.radians(0.1), 1e5, 1.2])
    assert isinstance(changed.friction.static, UncertainValue)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("linear", "turned"),
    [
        ("N*s/m", "N*m*s/rad"),
        ("N/(m*s)", "N*m/(rad*s)"),
        ("m/N", "rad/(N*m)"),
        ("kg", "kg*m^2"),
        ("um", "urad"),
        ("N/mm", "N*m/mrad"),
        ("m/s^2", "rad/s^2"),
        ("Hz", "Hz"),
        ("1", "1"),
    ],
)
def test_units(linear: str, turned: str) -> None:
    assert ROTARY.unit(linear) == turned
    assert ROTARY.unit(turned) == turned
    assert LINEAR.unit(linear) == linear


@pytest.mark.slow
def test_time_responses(folder: Path) -> None:
    documents = []
    for name in ("linear", "rotary"):
        answer = friso_inside(folder, "simulate", f"{name}.toml", "--sample-time", "10 ms", "--out", name, "--json")
        assert answer.returncode == 0
        documents.append(json.loads(answer.stdout))
    assert numbers(documents[0]) == numbers(documents[1], LINEAR)
    tables = [pd.read_csv(folder / name / f"{name}_response.csv") for name in ("linear", "rotary")]
    assert (tables[0].values == tables[1].values).all()
    assert {"position [rad]", "velocity [rad/s]", "force [N*m]", "bristle_deflection [rad]"} <= {*tables[1]}
    assert not LENGTHS.search(documents[1]["conclusion"])


COMMANDS = {
    "check": (),
    "bode": (),
    "boundary": ("--x", "controller.crossover=6 Hz..15 Hz"),
    "map": ("--x", "controller.crossover=6 Hz..12 Hz:2", "--y", "{static}:2"),
}


WRITTEN = (("check", "rotary"), ("map", "linear"), ("map", "rotary"))
"""Commands and kinds of axis whose pages and figures are drawn as well."""


@pytest.mark.cases(slow=2)
@pytest.mark.parametrize("command", ["bode", "map", "check", "boundary"])
def test_commands(folder: Path, command: str) -> None:
    documents = []
    for name, static in (("linear", "friction.static=2 N..3 N"), ("rotary", "friction.static=2 N*m..3 N*m")):
        options = [option.format(static=static) for option in COMMANDS[command]]
        out = folder / f"{command}_{name}{'.zarr' if command == 'map' else ''}"
        written = ("--out", out) if (command, name) in WRITTEN else ()
        answer = friso_inside(folder, command, f"{name}.toml", *options, *written, "--json")
        assert answer.returncode == 0, answer.stderr
        documents.append(json.loads(answer.stdout))
        assert bool(written) == bool([*folder.glob(f"{command}_{name}*")])
    match = LENGTHS.search(answer.stderr + " ".join(texts(documents[1])))
    assert not match, match
    assert numbers(documents[0]) == numbers(documents[1], LINEAR)


def texts(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for item in value.values() for text in texts(item)]
    if isinstance(value, list):
        return [text for item in value for text in texts(item)]
    return [value] if isinstance(value, str) else []


@pytest.mark.thorough
def test_logs_of_the_rig_are_in_its_units(folder: Path, undrawn: None) -> None:
    answer = friso_inside(folder, "rig", "presliding", "rotary.toml", "--out", "log", "--json")
    assert answer.returncode == 0, answer.stderr
    first = next(path for path in (folder / "log").glob("*.csv"))
    heading = first.read_text(encoding="utf-8").splitlines()[1]
    assert "position [rad]" in heading
    assert "force [N*m]" in heading
    assert not LENGTHS.search(" ".join(texts(json.loads(answer.stdout))))
