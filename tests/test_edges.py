"""Test extreme inputs, of a float, a file or a person: one message that says what is wrong, at once."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import friso_inside
from refusals import refused

import friso
from friso.errors import InputError, StageError
from friso.identification.logs import mapping
from friso.identification.logs.read import read_frequency_response
from friso.stage import Stage, loads, numeric_keys, parse_set
from friso.stage.plausible import implausible_values
from friso.stage.tables_of_files import parsed

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG = (EXAMPLES / "thesis_rig.toml").read_text(encoding="utf-8")
LEAVES = friso.load(EXAMPLES / "thesis_leaves.toml")
DEEP = ".".join(["a"] * 10_000)
SPECIFICATION = EXAMPLES / "specs" / "thesis.toml"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("flexure.spacing", "1e200 m"),
        ("controller.crossover", "1e-300 Hz"),
        ("friction.static", "1e300 N"),
        ("flexure.length", "1e-30 m"),
        ("controller.anti_windup", "backcalculation"),
    ],
)
def test_values_that_no_machine_has(key: str, value: str) -> None:
    """If squares of them overflowed, a check would end in a traceback."""
    with refused() as error:
        LEAVES.replace({key: value})
    assert error.value.key in key
    assert "class" not in error.value.expected + error.value.example


@pytest.mark.parametrize(
    "text",
    [
        RIG.replace("stribeck_exponent = 2", f"stribeck_exponent = {'1' * 5000}"),
        f"{RIG}\n[more]\na = {'1' * 40_000}",
        RIG.replace('"1.2 kg"', f'"{"1" * 40_000} kg"'),
        f"a = {'[' * 3000}{']' * 3000}",
        f"a = {'{b = ' * 3000}1{'}' * 3000}",
        *(f"{RIG}\n{text}" for text in (f"{DEEP} = 1", f"[{' . '.join(['a'] * 10_000)}]", f'"a"{".a" * 10_000} = 1')),
    ],
)
def test_what_is_too_long_or_too_deep(text: str) -> None:
    with refused():
        loads(text)


def test_a_value_nested_too_deeply() -> None:
    key, value = parse_set(f"masses.cart={{{DEEP} = 1}}")
    with refused("masses.cart"):
        loads(RIG).replace({key: value})
    deep: dict[str, object] = {}
    for _ in range(5000):
        deep = {"a": deep}
    with pytest.raises(InputError, match="a table"):
        loads(RIG).replace({"name": deep})


@pytest.mark.parametrize(("unit", "meant"), [("hz", "Hz"), ("KHZ", "kHz"), ("RPM", "rpm")])
def test_a_unit_in_other_capitals_is_recognised(unit: str, meant: str) -> None:
    with pytest.raises(InputError, match=f"not a known unit; {meant}"):
        loads(RIG.replace('"8 Hz"', f'"25{unit}"'))


@pytest.mark.parametrize(
    ("old", "new", "below"),
    [
        ('"8 Hz"', '"8 Hz', '"'),
        ('"8 Hz"', '8 Hz"', '"'),
        ("[masses]", "[masses", ""),
        ("alpha = 0.1", "alpha 0.1", "0"),
        ('"8 Hz"', "\u201c8 Hz\u201d", "\u201c"),
    ],
)
def test_the_line_is_shown_with_a_caret(old: str, new: str, below: str) -> None:
    with refused(kind=StageError) as error:
        loads(RIG.replace(old, new))
    lines = str(error.value).splitlines()
    (caret,) = (k for k, line in enumerate(lines) if line.strip() == "^")
    assert new in lines[caret - 1]
    assert lines[caret - 1][lines[caret].index("^") :].startswith(below)


def test_a_specification_given_as_a_stage_is_recognised_and_the_reverse(tmp_path: Path) -> None:
    rig = EXAMPLES / "thesis_rig.toml"
    done = friso_inside(tmp_path, "check", SPECIFICATION)
    assert done.returncode == 2
    assert "a specification of a design" in done.stderr
    done = friso_inside(tmp_path, "design", rig, rig)
    assert done.returncode == 2
    assert "a stage file" in done.stderr


def test_what_is_wrong_in_several_tables_is_told_at_once() -> None:
    """Missing keys, misspelled ones, values; a key that a misspelled one explains is not said to be missing."""
    text = RIG.replace('static = "3 N"\n', "").replace("crossover =", "crosover =").replace('"1.2 kg"', '"1.2 kq"')
    text = text.replace("\n[motion]", "\nbeta2 = 3\n[motoin]").replace('stroke = "1 mm"\n', "")
    with pytest.raises(InputError) as caught:
        loads(text)
    wrong = {caught.value.key: caught.value.actual, **dict(caught.value.also)}
    unknown, missing = {"motoin", "controller.crosover", "controller.beta2"}, {"friction.static", "joint.stroke"}
    assert wrong.keys() == {*unknown, *missing, "masses.cart"}
    assert {key for key, actual in wrong.items() if actual.startswith("nothing")} == missing
    assert {key for key, actual in wrong.items() if "unknown" in actual} == unknown
    assert "kq" in wrong["masses.cart"]


@pytest.mark.parametrize(
    "text",
    [
        'sample_time = "1e300 s"',
        'sample_time = "1e-300 s"',
        "sample_time = 3",
        f"sample_time = {'1' * 5000}",
        "experiment = 3",
        f"a = {'[' * 3000}{']' * 3000}",
        '[roles]\nvolume = "a"',
        "[units]\nposition = 3",
        "roles = 3",
        "\xff",
    ],
)
def test_a_mapping_that_is_kept_is_checked_like_an_option(tmp_path: Path, text: str) -> None:
    log = tmp_path / "log.csv"
    mapping.sidecar(log).write_text(text, encoding="utf-8")
    with refused():
        mapping.load_mapping(log)


@pytest.mark.parametrize("time", ["1e300 s", "1e-300 s", "2 h"])
def test_a_sample_time_beyond_all_measure_is_refused(time: str) -> None:
    with pytest.raises(InputError, match="--dt"):
        mapping.from_options(dt=time)


@pytest.mark.cases(first=7)
@pytest.mark.parametrize(
    ("stage", "key", "value", "meant"),
    [
        ("thesis_rig", "masses.cart", "3000 kg", "g"),
        ("thesis_rig", "friction.static", "52 kN", "N"),
        ("thesis_rig", "joint.stroke", "1000 m", "mm"),
        ("thesis_rig", "friction.stribeck_velocity", "1600 m/s", "mm/s"),
        ("thesis_rig", "friction.bristle_stiffness", "100 N/m", "N/um"),
        ("ball_screw_axis", "transmission.inertia", "6.1 kg*m^2", "kg*cm^2"),
        ("ball_screw_axis", "transmission.lead", "10 m", "mm"),
        ("ball_screw_axis", "transmission.stiffness", "35 N/m", "N/um"),
        ("ball_screw_axis", "transmission.backlash", "5 mm", "um"),
        ("ball_screw_axis", "motor_friction.static", "16 kN", "N"),
        ("twincat_cascade", "controller.kp", "90 kN*s/mm", "N*s/m"),
        ("twincat_cascade", "controller.velocity_integral_time", "4000 s", "ms"),
        ("twincat_cascade", "controller.filters.1.frequency", "300 kHz", "Hz"),
        ("twincat_cascade", "drive.delay", "125 s", "us"),
        ("thesis_drive", "drive.encoder_resolution", "1 mm", "nm"),
        ("thesis_rig_gms", "friction.element_stiffness.3", "20.5 N/m", "N/um"),
        ("emps_axis", "masses.cart", "12 g", "kg"),
    ],
)
def test_a_value_that_is_hardly_meant_is_questioned(stage: str, key: str, value: str, meant: str) -> None:
    """In one sentence, even if it is that of the mass, by which friction and gains are judged."""
    (doubt,) = implausible_values(friso.load(EXAMPLES / f"{stage}.toml").replace({key: value}))
    assert doubt.startswith(f"{key} = {value} ")
    assert doubt.endswith(f"was {meant} meant?")


def test_rows_of_an_array_are_no_tables() -> None:
    rows = "  [0.5, 'a'],\n" * 1100
    assert len(parsed(f"rows = [\n{rows}]\n", "a stage")["rows"]) == 1100
    with pytest.raises(InputError, match="tables"):
        parsed("".join(f'[ a . "b {k}" ] # a, b\n' for k in range(1100)), "a stage")


@pytest.mark.slow
def test_a_doubt_is_said_before_the_answer(tmp_path: Path) -> None:
    done = friso_inside(tmp_path, "bode", EXAMPLES / "thesis_rig.toml", "--set", "friction.static=52 kN")
    assert "52 kN" in done.stderr.partition("\n")[0]


@pytest.mark.parametrize("path", [*EXAMPLES.glob("*.toml"), EXAMPLES.parent / "friso" / "templates" / "stage.toml"])
def test_usual_stages_raise_no_doubts(path: Path) -> None:
    assert not [*implausible_values(friso.load(path))]


def test_frictions_in_a_wrong_unit_are_not_blamed_on_the_mass() -> None:
    axis = friso.load(EXAMPLES / "emps_axis.toml")
    for heavy in ({"friction.static": "40 kN"}, {"friction.static": "40 kN", "friction.coulomb": "35 kN"}):
        doubts = implausible_values(axis.replace(heavy))
        assert [doubt.partition(" ")[0] for doubt in doubts] == [*heavy]


@pytest.mark.parametrize("empty", [(3,), (9,), (7, 8, 9), (0, 4)])
def test_empty_cells_of_a_frequency_response_are_refused(tmp_path: Path, empty: tuple[int, ...]) -> None:
    rows = [f"{k + 1};-20;{'' if k in empty else -90}" for k in range(10)]
    (tmp_path / "frf.csv").write_text("\n".join(["f [Hz];magnitude [dB];phase [deg]", *rows]))
    with pytest.raises(InputError):
        read_frequency_response(tmp_path / "frf.csv")


NUMBERS = st.one_of(
    st.integers(0, 10**80), st.floats(allow_nan=True), st.sampled_from([10**60, 10**70, 10**308, 10**400, True])
)


KEYS = sorted(numeric_keys(loads(RIG).flat()))


@pytest.mark.slow
@given(key=st.sampled_from(KEYS), number=NUMBERS, unit=st.sampled_from(["", "m", "N"]))
@settings(max_examples=200)
def test_what_is_a_stage_can_be_saved_and_read_again(key: str, number: float, unit: str) -> None:
    field = numeric_keys(loads(RIG).flat())[key]
    try:
        stage = loads(RIG).replace({key: f"{number!r} {unit or field.unit}" if field.unit else number})
    except InputError:
        return
    again = loads(stage.to_toml())
    assert again == stage
    assert again.flat() == stage.flat()


@pytest.mark.slow
@given(text=st.text(st.characters(), max_size=20))
def test_any_text_can_be_saved_and_read_again(text: str) -> None:
    try:
        stage: Stage = loads(RIG).replace({"name": text, "source": text})
    except InputError:
        return
    assert loads(stage.to_toml()) == stage
