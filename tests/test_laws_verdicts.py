"""The verdict across friction laws: which are tried, whether it depends on the law, and what would decide."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from inside import friso_inside
from variants import VARIANTS, gains, lugre, release, stage

from friso.hunting import AttractionEnd, BandwidthWindow
from friso.questions.check.laws import laws_document, laws_rows, laws_sentences
from friso.stage.tables import friction_law
from friso.studies.laws import LawVerdict, Trial, VerdictsByLaw, convert, verdicts_by_law

RIGID = VARIANTS["rigid"]
PD = stage(release(), friction=lugre(2), controller=gains(kp=1000, kd=20, tau=1e-3))
"""Without an integrator, which nothing winds up in: it cannot hunt."""


def case(
    verdict: str, edge: float | None = None, certain: bool = True, edge_certain: bool = True, given_up: Any = ()
) -> Any:
    """Return an invented case with what the verdicts across laws read."""
    cycle = SimpleNamespace(amplitude=5e-4, multiplier=-0.5) if verdict == "hunts" else None
    quiet = None if edge is None else edge / (4 if edge_certain else 3)
    margin = edge and SimpleNamespace(crossover=edge, factor=edge / 4, certain=edge_certain, quiet=quiet, reserve=1e-5)
    hunting = SimpleNamespace(certain=certain, target=cycle, reason="")
    said = {"given_up": given_up, "observed": False, "windows": ()}
    judgement = SimpleNamespace(cycle=cycle, margin=margin, hunting=hunting, **said)
    loop = {"runs_away": False, "unstable": (), "stick_slip": None}
    return SimpleNamespace(verdict=verdict, judgement=judgement, **loop)


def under(law: str, *verdicts: Any) -> LawVerdict:
    """Return an invented law verdict with a trial for each verdict, edge [Hz] and further values (see `case`)."""
    conversion = convert(RIGID, law)
    keys = list(conversion.open)
    trials = [
        Trial(conversion.stage, {keys[0]: float(n)} if n else {}, {"given": case(*verdict)})
        for n, verdict in enumerate(verdicts)
    ]
    return LawVerdict(conversion, tuple(trials))


def across(*verdicts: LawVerdict) -> VerdictsByLaw:
    return VerdictsByLaw(RIGID, verdicts, {"dahl": ("static",)})


FAST, SLOW, LOST = ("hunts", 9.7), ("settles", 6.0), ("settles", None, True, True, ("other bandwidths",))


@pytest.mark.cases(first=4)
@pytest.mark.parametrize(
    ("lugre", "other", "verdicts", "hunts", "words"),
    [
        (
            FAST,
            "gms",
            [("hunts", 9.1), ("hunts", 10.4)],
            True,
            "hunts, edge 9.10 to 10.4 Hz. The advice keeps clear",
        ),
        (FAST, "elasto_plastic", [("settles", 9.1)], None, "the verdict depends on the friction law"),
        (("bistable", 9.7), "elasto_plastic", [("hunts", 9.1)], True, "the stage can hunt, edge 9.10 to 9.70 Hz"),
        (
            FAST,
            "gms",
            [("hunts", 9.1), ("settles", 7.0)],
            None,
            "hunts with attraction 160 N/s and settles with attrac",
        ),
        (("failed", None), "gms", [("failed", None)], None, "the verdict is not certain under any law"),
        (("settles", 6.0, False), "gms", [("hunts", 6.0, False)], None, "the verdict is not certain under any law"),
        (SLOW, "gms", [("settles", 7.0), ("settles", 7.1, False)], None, "N/s and is not certain with attraction 1.00"),
        (("settles", None), "gms", [LOST], False, "its edge of hunting not determined under gms"),
        (SLOW, "gms", [LOST], False, "edge 6.00 Hz, not determined under gms"),
        (("settles", None), "gms", [("settles", None)], False, "no edge of hunting between 0.25 and 10 times"),
        (SLOW, "gms", [("settles", 7.0, True, False)], False, "edge 6.00 to 9.33 Hz (not certain)"),
    ],
)
def test_what_laws_say_together(lugre: Any, other: str, verdicts: list[Any], hunts: bool | None, words: str) -> None:
    laws = across(under("lugre", lugre), under(other, *verdicts))
    assert laws.hunts("given") is hunts
    assert words in laws_sentences(laws)[0]
    assert laws.depends_on_law("given") == ("depends on the friction law" in laws_sentences(laws)[0])


@pytest.mark.slow
def test_what_decides_between_laws() -> None:
    """The measurement that separates the fewer laws from the others, or what is open in the law that is not certain."""
    rolling = under("rolling", ("settles", 6.0), ("settles", 6.1))
    laws = across(under("lugre", FAST), under("gms", ("hunts", 9.1, True, False)), rolling)
    (deciding,) = laws.deciding("given")
    assert deciding in friction_law("rolling").decided_by.values()
    assert across(under("lugre", FAST), under("elasto_plastic", SLOW)).deciding("given") == [
        friction_law("elasto_plastic").decided_by[""]
    ]
    for verdicts in ([("hunts", 9.1), SLOW], [SLOW, ("settles", 7.1, False)]):
        lugre = FAST if verdicts[1] == SLOW else SLOW
        assert across(under("lugre", lugre), under("gms", *verdicts)).deciding("given") == [
            friction_law("gms").decided_by["friction.attraction"]
        ]
    beside = laws_sentences(across(under("lugre", FAST), rolling, under("gms", ("settles", 7.0, False))))[0]
    assert "hunts under lugre; settles under rolling. Under gms that is not certain" in beside
    document = laws_document(laws)
    assert [*document["left_out"]] == ["dahl"]
    expected = document["cases"]["given"]
    assert expected["depends_on_law"]
    assert expected["laws"]["rolling"]["verdicts"] == ["settles"]
    assert not expected["laws"]["gms"]["trials"][0]["edge_certain"]
    alike = across(under("lugre", FAST), under("elasto_plastic", ("hunts", 9.1)))
    assert laws_document(alike)["cases"]["given"]["measure"] == []
    said = " ".join(laws_sentences(alike))
    assert "dahl (break-away)" in said
    assert "misses the virgin curve by 12 %" in said


def test_hunting_beyond_the_edge_is_told_under_any_law() -> None:
    laws = across(under("lugre", FAST), under("gms", ("hunts", 9.1)))
    begins = AttractionEnd(5.0, 4.9, True)
    laws.verdicts[1].trials[0].cases["given"].judgement.windows = (BandwidthWindow(begins, None),)
    assert "edge 9.10 to 9.70 Hz, and hunting again from 19.6 Hz" in laws_sentences(laws)[0]


@pytest.mark.parametrize("verdict", [("settles", 6.0, False), ("hunts", 6.0, False), ("failed", None)])
def test_a_law_whose_verdict_is_not_certain_counts_neither_way(verdict: tuple) -> None:
    laws = across(under("lugre", ("settles", 6.0)), under("rolling", ("settles", 6.1)), under("gms", verdict))
    assert laws.hunts("given") is None
    assert laws.uncertain("given") == ["gms"]
    assert laws.deciding("given") == [friction_law("gms").decided_by[""]]
    assert "Under gms that is not certain. Edge 6.00 to 6.10 Hz" in laws_sentences(laws)[0]
    words = verdict[0] if verdict[0] == "failed" else f"{verdict[0]} (not certain)"
    assert dict(laws_rows(laws))["As given: verdict"] == ["settles", "settles", words]
    document = laws_document(laws)["cases"]["given"]
    assert (document["hunts"], document["depends_on_law"], document["not_certain"]) == (None, False, ["gms"])


def test_no_law_says_that_a_stage_does_not_hunt_whose_reference_keeps_moving() -> None:
    """There is no verdict then: each law says whether the stage slides smoothly, in sentence and table alike."""
    laws = across(under("lugre", ("none",)), under("gms", ("none",)))
    for verdict, sticks in zip(laws.verdicts, (True, False), strict=True):
        verdict.trials[0].cases["given"].stick_slip = SimpleNamespace(lasts=sticks, sticks=sticks)
    assert (laws.hunts("given"), laws.answers("given")) == (None, set())
    says = laws_sentences(laws)[0]
    assert ("hunt" in says, says.count("smoothly under gms")) == (False, 1)
    assert dict(laws_rows(laws))["As given: verdict"] == ["sticks and slips", "slides smoothly"]


OTHERS = ("dwell", "elasto_plastic", "gms", "load_dependent", "rolling")
"""Laws that keep what is measured under LuGre."""


@pytest.mark.slow
def test_nothing_hunts_without_an_integrator() -> None:
    laws = verdicts_by_law(PD)
    assert [verdict.law for verdict in laws.verdicts] == ["lugre", *OTHERS]
    assert {*laws.left_out} == {"dahl", "stribeck"}
    assert laws.answers("given") == {False}
    assert laws.uncertain("given") == ["load_dependent"]  # no proof covers friction that follows the drive
    assert all(len(verdict.trials) > 1 for verdict in laws.verdicts[1:])
    assert [trial.drawn for trial in laws.verdicts[0].trials] == [{}]
    assert laws.verdicts[0].conversion.stage == PD


@pytest.mark.slow
def test_the_command(tmp_path: Path) -> None:
    file = tmp_path / "pd.toml"
    file.write_text(PD.to_toml())
    done = friso_inside(tmp_path, "check", file, "--laws", "--json")
    assert done.returncode == 0
    laws = json.loads(done.stdout)["laws"]
    assert laws["cases"]["given"]["hunts"] is None
    assert {*laws["cases"]["given"]["laws"]} == {"lugre", *OTHERS}
    shown = friso_inside(tmp_path, "check", file, "--laws")
    assert "settles" in shown.stdout
    assert "Across friction laws" in shown.stdout
