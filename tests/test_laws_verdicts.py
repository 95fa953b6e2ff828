"""The verdict across friction laws: which are asked, whether it hangs on the law, and what would decide."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from inside import friso_inside
from variants import VARIANTS, gains, lugre, release, stage

from friso.studies.laws.conversion import convert
from friso.studies.laws.verdicts import LawVerdict, Trial, VerdictsByLaw, verdicts_by_law
from friso.views.check.laws import laws_document, laws_rows, laws_sentences

RIGID = VARIANTS["rigid"]
PD = stage(release(), friction=lugre(2), controller=gains(kp=1000, kd=20, tau=1e-3))
"""Without an integrator, which nothing winds up in: it cannot hunt."""


def case(verdict: str, edge: float | None = None, amplitude: float = 5e-4) -> Any:
    """As much of a case as the verdicts across laws look at."""
    cycle = SimpleNamespace(amplitude=amplitude, multiplier=-0.5) if verdict == "hunts" else None
    margin = None if edge is None else SimpleNamespace(crossover=edge, factor=edge / 4)
    judgement = SimpleNamespace(cycle=cycle, margin=margin, hunting=SimpleNamespace(certain=True))
    return SimpleNamespace(verdict=verdict, judgement=judgement)


def under(law: str, *verdicts: tuple[str, float | None]) -> LawVerdict:
    conversion = convert(RIGID, law)
    keys = list(conversion.open)
    trials = [
        Trial(conversion.stage, {keys[0]: float(n)} if n else {}, {"given": case(*verdict)})
        for n, verdict in enumerate(verdicts)
    ]
    return LawVerdict(conversion, tuple(trials))


def across(*verdicts: LawVerdict) -> VerdictsByLaw:
    return VerdictsByLaw(RIGID, verdicts, {"dahl": ("break-away",)})


def test_one_verdict_under_all_laws() -> None:
    laws = across(under("lugre", ("hunts", 9.7)), under("gms", ("hunts", 9.1), ("hunts", 10.4)))
    assert laws.hunts("given") is True
    (sentence, left_out) = laws_sentences(laws)
    assert "hunts, edge 9.10 to 10.4 Hz" in sentence
    assert "dahl (break-away)" in left_out
    assert laws_document(laws)["cases"]["given"]["measure"] == []
    rows = dict(laws_rows(laws))
    assert rows["As given: edge"] == ["9.70 Hz", "9.10 to 10.4 Hz"]


def test_laws_that_disagree() -> None:
    """What tells the fewer from the others decides."""
    laws = across(
        under("lugre", ("hunts", 9.7)),
        under("gms", ("hunts", 9.1)),
        under("rolling", ("settles", 6.0), ("settles", 6.1)),
    )
    assert laws.hunts("given") is None
    assert laws.deciding("given") == ["force over displacement from rest up to break-away"]
    assert "hangs on the law" in laws_sentences(laws)[0]
    document = laws_document(laws)["cases"]["given"]
    assert document["hangs_on_the_law"]
    assert document["laws"]["rolling"]["verdicts"] == ["settles"]


def test_a_verdict_that_hangs_on_what_is_open_in_a_law() -> None:
    laws = across(under("lugre", ("hunts", 9.7)), under("gms", ("hunts", 9.1), ("settles", 7.0)))
    assert laws.verdicts[1].hunts("given") is None
    assert ["how far it lags" in text for text in laws.deciding("given")] == [True]


def test_failed_runs_leave_it_open() -> None:
    laws = across(under("lugre", ("failed", None)))
    assert laws.hunts("given") is None


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
