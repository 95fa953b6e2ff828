"""The verdict across friction laws: which are tried, whether it depends on the law, and what would decide."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from inside import friso_inside
from variants import VARIANTS, gains, lugre, release, stage

from friso.questions.check.laws import laws_document, laws_rows, laws_sentences
from friso.shown.drawing.prefixes import NOTHING
from friso.stage import violations
from friso.stage.tables import friction_law
from friso.studies.laws.conversion import convert
from friso.studies.laws.verdicts import LawVerdict, Trial, VerdictsByLaw, frictions_that_keep, verdicts_by_law

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
    hunting = SimpleNamespace(certain=certain, target=cycle)
    judgement = SimpleNamespace(cycle=cycle, margin=margin, hunting=hunting, given_up=given_up, observed=False)
    return SimpleNamespace(verdict=verdict, judgement=judgement)


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


def test_one_verdict_under_all_laws() -> None:
    laws = across(under("lugre", ("hunts", 9.7)), under("gms", ("hunts", 9.1), ("hunts", 10.4)))
    assert laws.hunts("given") is True
    wording(" ".join(laws_sentences(laws)))
    document = laws_document(laws)
    assert document["cases"]["given"]["measure"] == []
    assert [*document["left_out"]] == ["dahl"]
    rows = dict(laws_rows(laws))
    assert rows["As given: edge"] == ["9.70 Hz", "9.10 to 10.4 Hz"]


def test_laws_that_disagree() -> None:
    """The measurement that separates the fewer laws from the others is named.

    No measurement separates LuGre from all others.
    """
    alone = across(under("lugre", ("hunts", 9.7)), under("elasto_plastic", ("settles", 9.1)))
    assert alone.deciding("given") == [friction_law("elasto_plastic").decided_by[""]]
    laws = across(
        under("lugre", ("hunts", 9.7)),
        under("gms", ("hunts", 9.1)),
        under("rolling", ("settles", 6.0), ("settles", 6.1)),
    )
    assert laws.hunts("given") is None
    (deciding,) = laws.deciding("given")
    assert deciding in friction_law("rolling").decided_by.values()
    wording(laws_sentences(laws)[0])
    document = laws_document(laws)["cases"]["given"]
    assert document["depends_on_law"]
    assert document["laws"]["rolling"]["verdicts"] == ["settles"]


def test_a_stage_that_can_hunt_but_settles_after_this_move_does_not_hunt_for_sure() -> None:
    laws = across(under("lugre", ("bistable", 9.7)), under("elasto_plastic", ("hunts", 9.1)))
    assert laws.hunts("given") is True
    wording(" ".join(laws_sentences(laws)))


def test_a_verdict_that_hangs_on_what_is_open_in_a_law() -> None:
    laws = across(under("lugre", ("hunts", 9.7)), under("gms", ("hunts", 9.1), ("settles", 7.0)))
    assert laws.verdicts[1].hunts("given") is None
    assert laws.deciding("given") == [friction_law("gms").decided_by["friction.attraction"]]
    wording(laws_sentences(laws)[0])


def test_failed_runs_leave_it_open() -> None:
    laws = across(under("lugre", ("failed", None)))
    assert laws.hunts("given") is None
    assert not laws.depends_on_law("given")
    assert dict(laws_rows(laws))["As given: edge"] == ["not determined"]
    wording(laws_sentences(laws)[0])


@pytest.mark.parametrize("verdict", [("settles", 6.0, False), ("hunts", 6.0, False), ("failed", None)])
def test_a_law_whose_verdict_is_not_certain_counts_neither_way(verdict: tuple) -> None:
    laws = across(under("lugre", ("settles", 6.0)), under("rolling", ("settles", 6.1)), under("gms", verdict))
    assert laws.hunts("given") is None
    assert laws.uncertain("given") == ["gms"]
    assert laws.deciding("given") == [friction_law("gms").decided_by[""]]
    wording(laws_sentences(laws)[0])
    assert dict(laws_rows(laws))["As given: verdict"] == ["settles", "settles", f"{verdict[0]} (not certain)"]
    document = laws_document(laws)["cases"]["given"]
    assert (document["hunts"], document["depends_on_law"], document["not_certain"]) == (None, False, ["gms"])


def test_laws_that_certainly_disagree_do_so_beside_one_that_is_not_certain() -> None:
    laws = across(
        under("lugre", ("hunts", 9.7)), under("rolling", ("settles", 6.0)), under("gms", ("settles", 7.0, False))
    )
    assert laws.depends_on_law("given")
    wording(laws_sentences(laws)[0])


def test_no_law_is_certain() -> None:
    laws = across(under("lugre", ("settles", 6.0, False)), under("gms", ("hunts", 6.0, False)))
    assert (laws.hunts("given"), laws.depends_on_law("given")) == (None, False)
    wording(laws_sentences(laws)[0])


def test_a_law_that_is_certain_with_some_of_what_is_open() -> None:
    """Measuring an open parameter may exclude the values with which the law is uncertain."""
    laws = across(under("lugre", ("settles", 6.0)), under("gms", ("settles", 7.0), ("settles", 7.1, False)))
    assert laws.hunts("given") is None
    assert laws.deciding("given") == [friction_law("gms").decided_by["friction.attraction"]]
    wording(laws_sentences(laws)[0])


def test_no_law_that_gives_one_answer() -> None:
    """The text says nothing of the stage before the first law; values that differ are printed differently."""
    gms = under("gms", ("hunts", 9.1), ("settles", 7.0))
    (key,), trials = gms.conversion.open, gms.trials
    close = tuple(replace(trial, drawn={key: value}) for trial, value in zip(trials, (1.0, 1.0004), strict=True))
    wording(laws_sentences(across(replace(gms, trials=close)))[0])


def test_edges_that_were_given_up_are_not_told_as_absent() -> None:
    lost = ("settles", None, True, True, ("other bandwidths",))
    laws = across(under("lugre", ("settles", None)), under("gms", lost))
    wording(laws_sentences(laws)[0])
    assert dict(laws_rows(laws))["As given: edge"] == [NOTHING, "not determined"]
    some = across(under("lugre", ("settles", 6.0)), under("gms", lost))
    wording(laws_sentences(some)[0])
    none = across(under("lugre", ("settles", None)), under("gms", ("settles", None)))
    wording(laws_sentences(none)[0])


def test_edges_as_factors_that_look_the_same_are_one_number() -> None:
    laws = across(under("lugre", ("settles", 8.0)), under("gms", ("settles", 8.001), ("settles", 8.08)))
    for trial in (trial for verdict in laws.verdicts for trial in verdict.trials):
        trial.cases["given"].judgement.margin.crossover = None
    gains = replace(laws, stage=PD)
    assert dict(laws_rows(gains))["As given: edge"] == ["at 2 times the bandwidth", "at 2 to 2.02 times the bandwidth"]
    several = replace(gains.verdicts[1], trials=gains.verdicts[1].trials[:1])
    assert "edge at 2 times the bandwidth." in laws_sentences(replace(gains, verdicts=(laws.verdicts[0], several)))[0]


def test_an_edge_that_is_not_certain_says_so() -> None:
    laws = across(under("lugre", ("settles", 6.0)), under("gms", ("settles", 7.0, True, False)))
    wording(laws_sentences(laws)[0])
    assert dict(laws_rows(laws))["As given: edge"] == ["6.00 Hz", "7.00 to 9.33 Hz (not certain)"]
    trial = laws_document(laws)["cases"]["given"]["laws"]["gms"]["trials"][0]
    assert not trial["edge_certain"]


def test_an_edge_that_is_known_up_to_a_share_is_a_range() -> None:
    laws = across(under("lugre", ("settles", 6.0)), under("gms", ("settles", 7.0)))
    laws.verdicts[0].trials[0].cases["given"].judgement.margin.reserve = 0.01
    assert dict(laws_rows(laws))["As given: edge"] == ["5.94 to 6.06 Hz", "7.00 Hz"]


def test_laws_keep_what_is_measured_of_each_of_several_machines() -> None:
    """A law's open parameters are adapted to each machine's friction.

    Bristles that hold 1 N elastically would be too strong for 0.15 N.
    """
    machines = [RIGID.with_numbers({"friction.static": s, "friction.coulomb": c}) for s, c in ((3.0, 1.0), (1.0, 0.15))]
    frictions = frictions_that_keep(machines).frictions
    assert {name.split(",")[0] for name in frictions} == {"elasto_plastic", "gms", "rolling"}
    for friction in frictions.values():
        assert not violations({**RIGID.flat(), **friction})
        assert friction["friction.static"] == pytest.approx([3.0, 1.0])
    most = frictions["elasto_plastic, most breakaway_deflection"]["friction.breakaway_deflection"]
    assert most[1] < most[0]


def test_ends_that_only_some_machines_have_are_tried_and_laws_that_only_some_lose_are_named() -> None:
    """Hardly any Coulomb friction leaves the bristles nothing to hold; dahl has no friction that falls."""
    machines = [RIGID.with_numbers({"friction.static": s, "friction.coulomb": c}) for s, c in ((1.0, 1e-3), (3.0, 3.0))]
    laws = frictions_that_keep(machines)
    assert laws.lost == {"dahl": [0]}
    least, most = (
        laws.frictions[name]["friction.breakaway_deflection"]
        for name in ("elasto_plastic", "elasto_plastic, most breakaway_deflection")
    )
    assert most[0] == least[0]
    assert most[1] > least[1]


def test_nothing_hunts_without_an_integrator() -> None:
    laws = verdicts_by_law(PD)
    assert [verdict.law for verdict in laws.verdicts] == ["lugre", "elasto_plastic", "gms", "rolling"]
    assert {*laws.left_out} == {"dahl", "stribeck"}
    assert laws.hunts("given") is False
    assert all(len(verdict.trials) > 1 for verdict in laws.verdicts[1:])
    assert [trial.drawn for trial in laws.verdicts[0].trials] == [{}]
    assert laws.verdicts[0].conversion.stage == PD


def test_the_command(tmp_path: Path) -> None:
    file = tmp_path / "pd.toml"
    file.write_text(PD.to_toml())
    done = friso_inside(tmp_path, "check", file, "--laws", "--json")
    assert done.returncode == 0
    laws = json.loads(done.stdout)["laws"]
    assert laws["cases"]["given"]["hunts"] is False
    assert {*laws["cases"]["given"]["laws"]} == {"lugre", "elasto_plastic", "gms", "rolling"}
    shown = friso_inside(tmp_path, "check", file, "--laws")
    assert "settles" in shown.stdout
    assert "Across friction laws" in shown.stdout
