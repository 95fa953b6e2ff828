"""Values of a stage file that nobody knows: listed as unknown, and nothing that rests on them is certain."""

import json
from pathlib import Path
from typing import Any

import pytest
from inside import friso_inside

import friso
from friso.stage import Stage
from friso.studies.laws import convert

KEY = "friction.bristle_stiffness"


@pytest.fixture(scope="module")
def guessed(rig: Stage) -> Stage:
    """The thesis rig, locked, whose bristle stiffness is a guess."""
    return rig.replace({"joint.locked": True, "unknown": KEY})


def test_the_list_is_read_and_written(guessed: Stage) -> None:
    again = friso.loads(guessed.to_toml())
    assert again == guessed
    assert again.unknown_keys == (KEY,)
    assert guessed.replace({"unknown": "controller, friction.static"}).unknown_keys == ("controller", "friction.static")


def test_what_is_set_is_known(guessed: Stage) -> None:
    tables = guessed.replace({"unknown": f"{KEY}, controller"}).as_written()
    both = guessed.replace({"unknown": f"{KEY}, controller"})
    for stage, changes, unknown in (
        (guessed, {KEY: "2e5 N/m"}, ()),
        (guessed, {"friction.static": "4 N"}, (KEY,)),
        (guessed, {"friction": None}, ()),
        (guessed, {"friction": tables["friction"]}, ()),
        (both, {"controller.crossover": "9 Hz"}, (KEY, "controller")),
        (both, {"controller": tables["controller"]}, (KEY,)),
    ):
        assert stage.replace(changes).unknown_keys == unknown
    assert "unknown" not in guessed.replace({KEY: "2e5 N/m"}).to_toml()


def test_what_follows_from_an_unknown_value_is_unknown(guessed: Stage) -> None:
    """Numbers that friso sets, cells of a map, machines drawn, and the friction of another law."""
    assert guessed.with_numbers({KEY: 2e5, "friction.static": 4.0}).unknown_keys == (KEY,)
    cell = friso.sweep(guessed, {"friction.static": "2 N..4 N:2"}, metric="outcome").cell(1)
    assert cell.unknown_keys == (KEY,)
    converted = convert(guessed, "gms").stage
    assert converted.unknown_keys == ("friction",)
    assert friso.loads(converted.to_toml()) == converted


@pytest.fixture(scope="module")
def checked(guessed: Stage) -> Any:
    return friso.check(guessed)


@pytest.mark.slow
def test_no_verdict_edge_or_margin_is_certain(checked: Any, rig: Stage) -> None:
    sure = friso.check(rig.replace({"joint.locked": True}))["locked"]
    case = checked["locked"]
    assert case.verdict == sure.verdict == "hunts"
    for of, certain in ((sure, True), (case, False)):
        assert of.judgement.hunting.certain == of.judgement.margin.certain == of.static_friction.certain == certain
    assert case.judgement.margin.crossover == sure.judgement.margin.crossover
    assert KEY in case.judgement.hunting.reason
    assert not checked["free"].static_friction.certain  # no end was found, and that is not certain either
    free = checked.sentences()[1]
    assert "No hunting was found" in free
    assert free.rstrip(".").endswith("(not certain)")


@pytest.mark.slow
def test_every_headline_is_conditional(checked: Any) -> None:
    first, *rest = checked.sentences()
    assert first.startswith(f"If {KEY} is 100 kN/m, which the stage file lists as unknown: ")
    assert all(", if so" in text.partition(":")[0] for text in rest if ": hunts" in text or ": settles" in text)
    assert "The free joint stops the hunting" not in " ".join(checked.sentences())
    assert repr(checked).startswith(f"<friso check: If {KEY}")
    document = checked.to_dict()
    assert document["conclusion"].startswith(f"If {KEY}")
    assert document["condition"].startswith(f"If {KEY}")
    assert not any(case["certain"] or (case["margin"] or {}).get("certain") for case in document["cases"].values())
    assert "other motions may end in hunting" not in first  # the search itself was certain
    main = checked.files()["report.html"].partition("<main>")[2]
    assert main.index("lists as unknown") < main.index("±")


@pytest.mark.slow
def test_a_key_that_is_varied_is_no_condition(guessed: Stage, rig: Stage) -> None:
    over_it = friso.sweep(guessed, {KEY: "5e4 N/m..2e5 N/m:2"}, metric="outcome")
    assert not over_it.sentences()[0].startswith("If")
    assert friso.bode(guessed).sentences()[0].startswith(f"If {KEY}")
    plain = friso.bode(rig)
    assert not plain.sentences()[0].startswith("If")
    assert "condition" not in plain.to_dict()


@pytest.mark.slow
def test_pictures_and_conclusions_are_conditional(guessed: Stage) -> None:
    for answer in (
        friso.sweep(guessed, {"controller.crossover": "4 Hz..20 Hz:3"}, metric="sketch"),
        friso.boundary(guessed, x="controller.crossover=6 Hz..12 Hz"),
    ):
        assert answer.figures()[0].note.startswith(f"If {KEY}")
        assert answer.to_dict()["conclusion"].startswith(f"If {KEY}")
        assert answer.sentences()[0].count(f"If {KEY}") == 1


@pytest.mark.slow
def test_the_command_line_reads_the_list(guessed: Stage, tmp_path: Path) -> None:
    path = tmp_path / "guessed.toml"
    path.write_text(guessed.to_toml(), encoding="utf-8")
    document = json.loads(friso_inside(tmp_path, "simulate", path, "--json").stdout)
    assert document["condition"].startswith(f"If {KEY}")
    assert document["conclusion"].startswith(f"If {KEY}")
    assert "condition" not in json.loads(
        friso_inside(tmp_path, "simulate", path, "--set", f"{KEY}=2e5 N/m", "--out", "known", "--json").stdout
    )
