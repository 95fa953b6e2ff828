"""Mutated example files: no exception but InputError, and whatever loads holds the values of the file."""

import math
import tomllib
from pathlib import Path
from typing import Any

import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import friso.equations.friction  # noqa: F401  the friction laws register themselves
from friso.errors import InputError
from friso.quantities import as_toml
from friso.stage import Stage, loads, numeric_keys, parse_set

FOLDER = Path(__file__).parents[1]
FILES = [*sorted((FOLDER / "examples").glob("*.toml")), FOLDER / "friso" / "templates" / "stage.toml"]
TEXTS = [path.read_text(encoding="utf-8") for path in FILES]
KEYS = [
    (text, table, key)
    for text in TEXTS
    for table, keys in tomllib.loads(text).items()
    if isinstance(keys, dict)
    for key in keys
]
UNITS = pint.UnitRegistry()


def si_value(text: str, unit: str) -> float:
    """The slow twin of friso.quantities: the longest number in front, and pint's own conversion."""
    number, length = next((text[:n], n) for n in range(len(text), 0, -1) if is_number(text[:n]))
    quantity = UNITS.Quantity(float(number), text[length:].strip()).to_root_units()
    turns = 2 * math.pi if unit == "Hz" and "radian" in str(quantity.units) else 1
    return quantity.magnitude / turns / UNITS.Quantity(1, unit).to_root_units().magnitude


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def check(text: str) -> None:
    """Load, and compare every key of the file with what the stage holds."""
    try:
        stage = loads(text)
    except InputError:
        return
    file, flat = tomllib.loads(text.removeprefix("\ufeff")), stage.flat()
    units = {key: field.unit for key, field in numeric_keys(flat).items()}
    for key, value in one_by_one(flattened(file)).items():
        if key in ("name", "source"):
            assert getattr(stage, key) == value
        elif isinstance(value, dict):
            assert all(f"{key}.{name}" in flat for name in value)
        elif isinstance(value, str) and key in units:
            assert flat[key] == pytest.approx(
                si_value(value, units[key]), rel=1e-12, abs=5e-318
            )  # the twin rounds subnormals
        else:
            assert flat[key] == (value if isinstance(value, bool | str) else float(value))
            assert isinstance(flat[key], bool) == isinstance(value, bool)
    assert loads(stage.to_toml()).flat() == flat
    assert flattened(tomllib.loads(stage.to_toml())) == flattened(file)


def flattened(file: dict[str, Any]) -> dict[str, Any]:
    tables = {
        f"{name}.{key}": item for name, table in file.items() if isinstance(table, dict) for key, item in table.items()
    }
    return tables | {key: value for key, value in file.items() if not isinstance(value, dict)}


def one_by_one(values: dict[str, Any]) -> dict[str, Any]:
    """The values with an entry for each element of an array, numbered from 1."""
    arrays = {key: array for key, array in values.items() if isinstance(array, list)}
    elements = {f"{key}.{number}": item for key, array in arrays.items() for number, item in enumerate(array, 1)}
    return {key: value for key, value in values.items() if key not in arrays} | elements


numbers = st.one_of(
    st.floats(1e-3, 1e6).map(repr),
    st.integers(-(10**6), 10**20).map(str),
    st.floats().map(repr),
    st.sampled_from(["0", "1e400", "1e-400", "+.5", "5.", "1,5", "1_0", "−2", "٣", "0x1F", "1e", "--1", "", "1 000"]),
)
UNIT_NAMES = (
    "m mm um µm s ms min kg g N kN lbf Hz kHz rpm rad/s deg/s 1/s N/m N/mm N*s/m N/(m*s) m/s mm/s m/s^2 m/s² degC degF "
    "dB % m^9^9 m*N*s*kg (m m) N//m parsec flurb count/s Bq rad turn/s kg*m/s^2/mm N·s/m"
)
unit_names = st.sampled_from(UNIT_NAMES.split())
KINDS = {
    "kg": "kg g lb t N*s^2/m",
    "N": "N mN kN lbf kg*m/s^2 J/m",
    "m": "m mm um µm inch N/(N/m)",
    "s": "s ms min h 1/(1/s)",
    "m/s": "m/s mm/s km/h m·s^-1",
    "m/s^2": "m/s^2 mm/s² m/s/s N/kg",
    "N/m": "N/m N/mm N/um kg/s^2 lbf/inch",
    "N*s/m": "N*s/m N/(m/s) kg/s N·s/mm",
    "N/(m*s)": "N/(m*s) N/m/s kg/s^3",
    "Hz": "Hz kHz rad/s rpm deg/s turn/min",
}
quantities = st.builds("{}{}{}".format, numbers, st.sampled_from([" ", "", "  ", "\t", "\u00a0"]), unit_names)
scalars = st.one_of(
    quantities,
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.sampled_from(["lugre", "none", "dahl", "stribeck", "pid", "error", "measurement", "clamp", "ramp", "hold"]),
)


def values_for(place: tuple[str, str, str]) -> st.SearchStrategy[tuple[tuple[str, str, str], object]]:
    """A place with a value for it: half of them with a unit that the key takes."""
    text, table, key = place
    field = numeric_keys(loads(text).flat()).get(f"{table}.{key}")
    units = KINDS.get(field.unit, "1") if field else "1"
    fitting = st.builds("{} {}".format, numbers, st.sampled_from(units.split()))
    return st.tuples(st.just(place), fitting | scalars)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.sampled_from(KEYS).flatmap(values_for))
def test_value_mutations(case: tuple[tuple[str, str, str], object]) -> None:
    (text, table, key), value = case
    tables = {**tomllib.loads(text), table: {**tomllib.loads(text)[table], key: value}}
    check(written(tables))


@pytest.mark.slow
@settings(max_examples=300)
@given(
    st.sampled_from(KEYS),
    st.one_of(scalars, st.none(), st.lists(scalars, max_size=2), st.dictionaries(st.text(), scalars)),
)
def test_changes(place: tuple[str, str, str], value: object) -> None:
    text, table, key = place
    stage = loads(text)
    for name in (f"{table}.{key}", table, f"{table}.{key}.x", key):
        try:
            changed = stage.replace({name: value})
        except InputError:
            continue
        assert isinstance(changed, Stage)
        check(changed.to_toml())


@settings(max_examples=200)
@given(st.text() | quantities)
def test_set_values_come_through(text: str) -> None:
    assert parse_set(f"name={as_toml(text)}") == ("name", text)
    try:
        key, value = parse_set(f"name={text}")
    except InputError:  # a quote that is not closed
        assert text.strip()[0] in "\"'"
        return
    assert key == "name"
    assert value == text.strip() or not isinstance(value, str) or as_toml(value)[1:-1] in text


def written(tables: dict[str, Any]) -> str:
    lines = [f"{key} = {as_toml(value)}" for key, value in tables.items() if not isinstance(value, dict)]
    for name, table in tables.items():
        if isinstance(table, dict):
            lines += [f"[{name}]", *(f"{key} = {as_toml(value)}" for key, value in table.items())]
    return "\n".join(lines)
