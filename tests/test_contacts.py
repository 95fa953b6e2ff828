"""Friction that nobody measured: ranges of similar machines, by the contact or by what a log shows."""

from dataclasses import replace

import numpy as np
import pytest

from friso.axis import KINDS
from friso.identification.estimate import Estimate
from friso.identification.stage_file import CHOSEN, with_unknown
from friso.interface.inputs import correlations_of
from friso.stage import Stage, loads
from friso.stage.contacts import FRICTIONS, any_contact, contacts
from friso.stage.correlations import draw
from friso.stage.tables import USUAL

GUESSED = {
    "masses": {"cart": "12 kg"},
    "friction": {"guess": "recirculating ball, size 25, light preload, 4 carriages"},
    "controller": {"kind": "pid", "crossover": "20 Hz", "alpha": 0.1, "beta": 2},
    "motion": {"kind": "step", "size": "1 mm", "duration": "5 s"},
}

SCREW = {
    "transmission": {"mass": "2 kg", "stiffness": "120 N/um", "damping": "2e3 N*s/m"},
    "encoder": {"position": "load", "velocity": "motor"},
    "friction": {"model": "none"},
}


def test_a_guess_gives_ranges_and_says_that_nobody_knows_them() -> None:
    """Coulomb friction of four carriages: seals 0.5 to 3 times 2 N, and 0 to 3 % of 26.5 kN times 0.002 to 0.004."""
    stage = Stage(**GUESSED)
    coulomb = stage.uncertain()["friction.coulomb"]
    assert (coulomb.low, coulomb.high) == (4.0, pytest.approx(4 * (6 + 0.004 * 0.03 * 26500), rel=0.01))
    assert {*stage.unknown_keys} == {key for key in stage.uncertain() if key.startswith("friction.")}
    assert not stage.doubt
    assert Stage(**stage.as_written()) == stage


def test_what_the_file_states_is_kept_and_known() -> None:
    friction = GUESSED["friction"] | {"coulomb": "8 N", "stribeck_velocity": "2 mm/s"}
    stage = Stage(**GUESSED | {"friction": friction})
    assert stage.flat()["friction.coulomb"] == 8
    assert "friction.coulomb" not in stage.unknown_keys
    low, high = (getattr(stage.uncertain()["friction.static"], end) for end in ("low", "high"))
    assert (low, high) == (pytest.approx(8.4), pytest.approx(16))
    assert "friction.static" not in stage.replace({"friction.static": "9 N"}).unknown_keys


def test_drawn_machines_have_ratios_of_their_contact() -> None:
    """Static over Coulomb friction, and damping over stiffness, lie in the contact's ranges, at every level."""
    stage = Stage(**GUESSED)
    keys = draw(stage, correlations_of(stage, stage), 256, 0).keys
    contact = contacts()["recirculating ball"]
    for upper, lower, ends in (
        ("static", "coulomb", contact.ratio),
        ("bristle_damping", "bristle_stiffness", contact.settling),
    ):
        ratios = keys[f"friction.{upper}"] / keys[f"friction.{lower}"]
        assert ends[0] <= ratios.min() * (1 + 1e-9)
        assert ratios.max() <= ends[1] * (1 + 1e-9)
        spread = (ends[1] / ends[0]) ** 0.5
        assert ratios.max() > spread * ratios.min()
        assert abs(np.corrcoef(np.log(ratios), np.log(keys[f"friction.{lower}"]))[0, 1]) < 0.2


@pytest.mark.parametrize("kind", ["linear", "rotary"])
def test_the_range_of_any_contact_holds_those_of_all(kind: str) -> None:
    every = any_contact(KINDS[kind])
    for contact in contacts(kind).values():
        assert contact.source
        for name in ("ratio", "stribeck_velocity", "presliding", "settling", "viscous"):
            low, high = getattr(contact, name)
            assert getattr(every, name)[0] <= low < high <= max(high, getattr(every, name)[1])


def test_what_a_log_does_not_show_becomes_a_range_that_holds_the_file_s_own_value(rig: Stage) -> None:
    """Bounds of the log cut the range; without Coulomb friction there is none."""
    origins = dict.fromkeys(rig.flat(), "as given")
    key, damping = "friction.bristle_stiffness", "friction.bristle_damping"
    atleast = Estimate.unknown(key, "N/m", "moves", "too few moves", 5e4)
    stage = with_unknown(rig, origins, [key], [atleast])
    interval = stage.uncertain()[key]
    assert (interval.low, interval.high) == (5e4, pytest.approx(1 / 0.3e-6, rel=0.01))
    assert stage.unknown_keys == (key,)
    narrow = replace(atleast, high=6e4)
    outside = with_unknown(rig, origins, [key], [narrow]).uncertain()[key]
    assert outside.low <= 5e4
    assert outside.high >= rig.flat()[key]
    both = with_unknown(rig, origins, [key, damping], [narrow]).uncertain()
    assert both[damping].high / both[key].high <= 5e-3 * 1.01
    nothing = with_unknown(rig, origins | {"friction.static": CHOSEN}, ["friction.static", "friction.coulomb"], [])
    assert nothing.assumed_keys == ("friction.static", "friction.coulomb")


@pytest.mark.parametrize(
    ("friction", "contact"),
    [
        (
            {"model": "lugre", **dict.fromkeys(USUAL, "unknown"), "stribeck_exponent": 2, "coulomb": "8 N"},
            "contact bearing",
        ),
        ({"guess": "ball screw", "static": "unknown", "coulomb": "8 N"}, "ball screw"),
        ({"guess": "ball screw", "coulomb": "8 N"}, "ball screw"),
    ],
)
def test_unknown_means_the_range_of_the_contact(friction: dict[str, str], contact: str) -> None:
    """The file keeps the word, a value that is set is known, and one that friso computes stays unknown."""
    stage = Stage(**GUESSED | {"friction": friction})
    interval, ends = stage.uncertain()["friction.static"], contacts()[contact].ratio
    assert (interval.low, interval.high) == pytest.approx((8 * ends[0], 8 * ends[1]))
    assert {*stage.unknown_keys} == {f"friction.{key}" for key in USUAL if key != "coulomb"}
    assert not stage.doubt
    assert stage.as_written()["friction"]["static"] == "unknown"
    assert loads(stage.to_toml()) == stage
    assert "friction.static" not in stage.replace({"friction.static": "9 N"}).unknown_keys
    assert "friction.static" in stage.with_numbers({"friction.static": 9.0}).unknown_keys
    assert (
        "friction.static"
        in stage.replace({"friction.static": "9 N"}).replace({"friction.static": "unknown"}).unknown_keys
    )


@pytest.mark.parametrize(
    ("stated", "lead", "follows"),
    [
        ({"coulomb": "8 N"}, "coulomb", True),
        ({"coulomb": "6 N .. 10 N"}, "coulomb", True),
        ({"static": "12 N"}, "static", True),
        ({"static": "12 N"}, "coulomb", True),
        ({}, "coulomb", True),
        ({"coulomb": "8 N"}, "static", False),
    ],
)
@pytest.mark.parametrize("table", FRICTIONS)
def test_a_guessed_value_follows_the_key_it_was_guessed_from(
    stated: dict[str, str], lead: str, follows: bool, table: str
) -> None:
    """A sweep over that key gives the stages that a file with each value would; over another key, nothing changes."""
    stage = Stage(**GUESSED | SCREW | {table: GUESSED["friction"] | stated})
    swept = stage.flat({f"{table}.{lead}": np.array([10.0, 11.0])})
    for k, value in enumerate((10.0, 11.0)):
        of_file = stage.replace({f"{table}.{lead}": f"{value} N"})
        numbers = {key: item for key, item in of_file.flat().items() if isinstance(item, float)}
        assert {key: np.broadcast_to(swept[key], 2)[k] for key in numbers} == pytest.approx(numbers)
    assert (np.ndim(swept[f"{table}.bristle_stiffness"]) == 1) is follows
