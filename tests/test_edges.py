"""Test extreme inputs, of a float, a file or a person: one message that says what is wrong, at once."""

from pathlib import Path

import pytest

import friso
from friso.errors import InputError
from friso.stage import loads
from friso.stage.plausible import implausible_values

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG = (EXAMPLES / "thesis_rig.toml").read_text(encoding="utf-8")


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
    for text, words in ((f"rows = [\n{rows}]\n", "unknown"), ('[ a . "b" ] # a, b\n' * 1100, " tables")):
        with pytest.raises(InputError) as caught:
            loads(f"{text}{RIG}")
        assert words in caught.value.actual


@pytest.mark.parametrize("path", [*EXAMPLES.glob("*.toml"), EXAMPLES.parent / "friso" / "templates" / "stage.toml"])
def test_usual_stages_raise_no_doubts(path: Path) -> None:
    assert not [*implausible_values(friso.load(path))]


def test_frictions_in_a_wrong_unit_are_not_blamed_on_the_mass() -> None:
    axis = friso.load(EXAMPLES / "emps_axis.toml")
    for heavy in ({"friction.static": "40 kN"}, {"friction.static": "40 kN", "friction.coulomb": "35 kN"}):
        doubts = implausible_values(axis.replace(heavy))
        assert [doubt.partition(" ")[0] for doubt in doubts] == [*heavy]
