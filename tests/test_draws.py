"""The probability that an uncertain stage hunts: against known edges, single stages and made-up verdicts."""

import json
import sys
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import pytest
from pages import Page
from refusals import rows_of
from scipy.stats import beta

import friso
from friso.cli import main
from friso.hunting import find_margin
from friso.hunting.criteria import ATTRACTED, VERDICTS
from friso.questions.check.draws import draws_document, draws_figure, draws_sentences
from friso.shown.documents import plain_json
from friso.stage import Stage, save
from friso.stage.correlations import Correlations, Sample, draw
from friso.studies.draws import DrawnBandwidths, Draws, Fates, by_bandwidth, different, fates
from friso.studies.settings import StudySettings

CROSSOVER = "controller.crossover"
EDGE = 9.75
"""Crossover [Hz] at which the rig, its joint locked, stops hunting (tests/test_cli.py)."""


def locked(rig: Stage, crossover: str) -> Stage:
    """The rig with its joint locked as by fixtures that nobody takes off: its one case."""
    return rig.replace({"joint.locked": True, "joint.stiffness": None, CROSSOVER: crossover})


def fate(stage: Stage, count: int, seed: int = 0) -> tuple[Fates, Sample]:
    drawn = draw(stage, Correlations(), count, seed)
    return fates(stage, drawn, 1e-6)["given"], drawn


@pytest.mark.thorough
def test_half_of_the_stages_about_the_edge_hunt(rig: Stage) -> None:
    """Stages below the edge have a stable cycle, and others do not."""
    outcome, drawn = fate(locked(rig, "9.75 Hz +/- 1.5 Hz"), 16)
    clear = np.abs(drawn.keys[CROSSOVER] - EDGE) > 0.04  # so near, friso check too takes a transient for hunting
    assert clear.sum() >= 14
    below = drawn.keys[CROSSOVER] < EDGE
    assert np.array_equal(np.isin(outcome.verdicts, ATTRACTED)[clear], below[clear])
    share = outcome.share(ATTRACTED)
    assert share.probability == pytest.approx(0.5, abs=0.1)
    assert share.low < 0.5 < share.high
    assert outcome.separations(drawn.keys)[CROSSOVER] == pytest.approx(-1, abs=0.05)


@pytest.mark.parametrize(("crossover", "words"), [("8 Hz +/- 2 %", ATTRACTED), ("20 Hz .. 22 Hz", ("settles",))])
def test_all_stages_far_from_the_edge_share_their_fate(rig: Stage, crossover: str, words: tuple[str, ...]) -> None:
    outcome, drawn = fate(locked(rig, crossover), 8)
    assert outcome.share(words).probability == 1
    assert outcome.share(words).low == pytest.approx(0.025 ** (1 / 8), rel=1e-6)
    assert outcome.share(words).high == 1
    assert outcome.separations(drawn.keys) == {}


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_verdicts_are_those_of_single_stages(rig: Stage) -> None:
    """The slow twin: friso check on each of the stages that were drawn."""
    stage = locked(rig, "6 Hz .. 14 Hz").replace({"friction.static": "2.5 N +/- 0.5 N"})
    outcome, drawn = fate(stage, 3, seed=3)
    alone = [
        friso.check(stage.with_numbers({key: float(values[k]) for key, values in drawn.keys.items()}))["given"].verdict
        for k in range(drawn.count)
    ]
    assert outcome.verdicts.tolist() == alone
    assert len(set(alone)) > 1


@pytest.mark.slow
def test_cases_and_seeds(rig: Stage) -> None:
    """The free joint settles where the locked one hunts; "given" is the free one; the same seed, the same verdicts."""
    stage = rig.replace({CROSSOVER: "8 Hz +/- 1 %"})
    drawn, steps = draw(stage, Correlations(), 4, seed=1), []
    result = fates(stage, drawn, 1e-6, lambda *step: steps.append(step))
    assert steps[-1][:2] == (8, 8)
    assert len(different(stage)) == 2
    assert result["given"] is result["free"]
    assert result["free"].counts["settles"] == 4
    assert result["locked"].share(ATTRACTED).probability == 1
    again = fates(stage, draw(stage, Correlations(), 4, seed=1), 1e-6)
    assert all(np.array_equal(again[name].verdicts, result[name].verdicts) for name in result)


def test_a_stage_that_cannot_hunt_settles(rig: Stage) -> None:
    """A reference that never stands still may cause stick-slip, but no hunting about a place."""
    ramp = {"motion": {"kind": "ramp", "velocity": "0.1 m/s", "duration": "20 s"}}
    stage = locked(rig, "8 Hz +/- 1 %")
    keys = {"controller.tuned_mass": np.array([0.17, 1.7])}  # for a tenth of the mass the loop is unstable
    assert fates(stage.replace(ramp), Sample(keys, 2, 0, {}), 1e-6)["given"].unstable.tolist() == [True, False]
    outcome, drawn = fate(stage.replace(ramp), 8)
    assert outcome.verdicts[0] in ("settles", "transient")
    assert friso.check(stage.replace(ramp)).verdict == "none"
    assert outcome.share(ATTRACTED).probability == 0
    assert drawn.count == 8


# what is made of verdicts


def made(hunts: int, settles: int, undecided: int = 0, unstable: int = 0) -> Fates:
    words = np.array(["hunts"] * hunts + ["settles"] * settles + ["undecided"] * undecided, dtype=object)
    return Fates(words, np.arange(len(words)) < unstable)


def test_undecided_draws_widen_the_interval() -> None:
    """The interval covers none and all of them hunting (Clopper and Pearson, by the beta distribution)."""
    share = made(30, 60, 10).share(("hunts",))
    assert share.probability == pytest.approx(30 / 90)
    assert share.low == pytest.approx(beta(30, 71).ppf(0.025))
    assert share.high == pytest.approx(beta(41, 60).ppf(0.975))
    assert made(0, 5).share(("hunts",)).low == 0
    assert np.isnan(made(0, 0, 5).share(("hunts",)).probability)
    assert (made(0, 0, 5).share(("hunts",)).low, made(0, 0, 5).share(("hunts",)).high) == (0, 1)


def test_the_decisive_key_comes_first() -> None:
    result, rng = made(50, 50, 4), np.random.default_rng(0)
    some = np.r_[rng.normal(0.5, 1, 50), rng.normal(0, 1, 54)]
    separation = result.separations({"nothing": rng.normal(size=104), "falls": np.arange(104.0), "some": some})
    assert list(separation) == ["falls", "some", "nothing"]
    assert separation["falls"] == -1
    assert 0.1 < separation["some"] < 0.5


def draws(fates: Fates) -> Draws:
    count = len(fates.verdicts)
    drawn = Sample({"friction.coulomb": np.linspace(0.5, 1.5, count)}, count, 2, {"a rule": 3})
    stage = friso.load(Path(__file__).parents[1] / "examples" / "lugre_stick_slip.toml")
    return Draws(stage, drawn, 7, {"given": fates}, drawn.count)


def test_the_cure_holds_for_all_draws_over_a_step() -> None:
    """A bandwidth at which none hunts, but one does a little above, is no cure; an uncertain draw counts as hunting."""
    factors = np.array([0.8, 1.0, 1.1, 1.3, 1.4, 1.7, 2.2])
    hunts = np.array([[1, 1, 1, 0, 0, 0, 0], [1, 1, 0, 0, np.nan, 0, 0], [0, 1, 0, 0, 0, 0, 0.0]])
    tried = DrawnBandwidths(factors, hunts, 10.0)
    assert tried.cure == (1.7, 2.2)
    low, high = tried.edges
    assert (low[0], high[0], low[2], high[2]) == (1.1, 1.3, 1.0, 1.1)
    assert DrawnBandwidths(factors[:4], hunts[:, :4], 10.0).cure is None
    shown = replace(draws(made(3, 0)), bandwidths={"given": tried})
    document = draws_document(shown, "given")
    assert document["cure_hz"] == [17.0, 22.0]
    assert document["edge_hz"] == [10.0, 13.0]


@pytest.mark.parametrize("case", ["locked", "free"])
def test_each_case_has_its_own_bandwidths(rig: Stage, case: str) -> None:
    """The drawn stages hunt with the joint locked, and do not with it free; the case given is told as what it is."""
    judged = {"locked": made(9, 0), "free": made(0, 9)}
    sample = Sample({"friction.coulomb": np.linspace(0.5, 1.5, 9)}, 9, 0, {})
    factors = np.array([0.5, 0.8, 1.0, 1.3, 2.0])
    rows = {"locked": [1.0, 1.0, 1.0, 0.0, 0.0], "free": [1.0, 0.0, 0.0, 0.0, 0.0]}
    tried = {name: DrawnBandwidths(factors, np.tile(row, (9, 1)), 8.0) for name, row in rows.items()}
    tried["given"], judged["given"] = tried[case], judged[case]
    shown = Draws(rig.replace({"joint.locked": case == "locked"}), sample, 0, judged, 9, tried)
    assert draws_document(shown, "locked")["cure_hz"] == pytest.approx([10.4, 16.0])
    assert draws_document(shown, "free")["edge_hz"] == pytest.approx([4.0, 6.4])
    locked_says, free_says = draws_sentences(shown)
    assert ("Cure" in locked_says, "Cure" in free_says) == (True, False)


def test_bandwidths_of_draws_agree_with_the_margin_of_each_stage(rig: Stage) -> None:
    """Each stage hunts up to its own edge; the cure lies beyond the farther one, by less than a coarse step."""
    stage = locked(rig, "8 Hz")
    own = stage.flat()["friction.static"]
    tried = by_bandwidth(stage, Sample({"friction.static": np.array([own, 1.1 * own])}, 2, 0, {}))
    margins = [find_margin(stage.replace({"friction.static": f"{share * own} N"}), True) for share in (1, 1.1)]
    low, high = tried.edges
    for row, alone in enumerate(margins):
        assert 8 * low[row] <= 1.001 * alone.crossover
        assert alone.crossover <= 1.001 * 8 * high[row]
    farther = max(one.crossover for one in margins)
    assert farther / 1.001 < 8 * tried.cure[0] < 1.26 * farther


def test_verdicts_that_hang_on_uncertain_keys_are_not_certain(rig: Stage) -> None:
    """Static friction on both sides of an edge: the headline says may, and names the key."""
    stage = locked(rig, "8 Hz").replace({"friction.static": "1.2 N .. 3 N", "unknown": "friction.static"})
    answer = friso.check(stage, draws=24)
    assert answer.draws.split("given")
    assert not answer["given"].judgement.hunting.certain
    assert "may hunt" in answer.sentences()[0]
    assert "friction.static, which nobody measured" in answer.sentences()[0]
    conclusion, page = answer.to_dict()["conclusion"], Page(str(answer.files()["report.html"])).text
    for sentence in answer.sentences():
        assert sentence in conclusion
        assert sentence in page
        assert escape(sentence) in answer._repr_html_()
    assert any(text.startswith("At the centre of the ranges") and text in page for text in answer.details())
    assert answer.tables()[0].title == f"{stage.name}, at the centre of its ranges"


def test_machines_without_integral_action_cannot_hunt(rig: Stage) -> None:
    """Their sentence is that of fixed numbers, with how far off they rest: friction over stiffness at most."""
    gains = {"controller": {"kind": "pid", "kp": "3 N/mm", "kd": "60 N*s/m", "derivative_on": "measurement"}}
    stage = rig.replace({**gains, "joint": None, "parasitic": None, "friction.static": "2 N .. 3 N"})
    answer = friso.check(stage, draws=8)
    (says,) = answer.sentences()
    assert "cannot hunt, because the controller has no integral action" in says
    assert "8 machines" in says
    assert "%" not in says
    off = answer.draws.fates["given"].offsets
    assert len(off) == 8
    assert np.all((off > 0) & (off < 3 / 3000))
    alone = friso.check(stage.replace({"friction.static": "2.5 N"}))["given"]
    assert off.min() <= abs(alone.offset) <= off.max()


@pytest.mark.parametrize(("hunts", "may"), [([1, 0, 0], True), ([1, 1, 0], True), ([0, 0, 0], False)])
def test_hunting_that_begins_at_the_machines_own_controller_may_be_there(hunts: list[int], may: bool) -> None:
    tried = DrawnBandwidths(np.array([0.5, 1.0, 1.3]), np.tile(np.array(hunts, float), (9, 1)), 8.0)
    shown = replace(draws(made(0, 9)), bandwidths={"given": tried})
    assert shown.split("given") == may


def test_the_document_of_draws() -> None:
    shown = draws(made(6, 3, 1))
    document = json.loads(json.dumps(plain_json(draws_document(shown, "given")), allow_nan=False))
    verdicts = {"hunts": 6, "bistable": 0, "transient": 0, "settles": 3, "undecided": 1, "failed": 0}
    assert document["verdicts"] == verdicts
    assert (document["count"], document["seed"], document["left_out"]) == (10, 7, 5)
    assert document["hunts"]["probability"] == pytest.approx(2 / 3)
    assert document["separation"] == {"friction.coulomb": -1.0}
    assert "may hunt: 66.7 % (26.2 to 93.3 %) of 10 machines" in draws_sentences(shown)[0]
    lost = draws(made(6, 3, unstable=2))
    text = draws_sentences(lost)[0]
    assert text.index("unstable") < text.index("may hunt")
    assert draws_document(lost, "given")["loop_unstable"] == 2
    unknown = plain_json(draws_document(draws(made(0, 0, 3)), "given"))
    assert unknown["hunts"] == {"probability": None, "low": 0.0, "high": 1.0}
    words, swings = np.array(["hunts"] * 30, dtype=object), np.linspace(2.5e-4, 3e-4, 30)
    swinging = draws(Fates(words, np.zeros(30, bool), amplitudes=swings, periods=np.linspace(1.4, 1.9, 30)))
    assert draws_document(swinging, "given")["amplitude_m"] == [2.5e-4, 3e-4]


def test_the_figure_holds_every_draw() -> None:
    (panel,) = draws_figure(draws(made(60, 30, 10))).panels
    shown = [word for word in VERDICTS if word in ("hunts", "settles", "undecided")]
    assert [band.label for band in panel.bands] == shown
    assert panel.bands[-1].high[::2].sum() == 100
    assert panel.x.label == "friction.coulomb [N]"
    assert "settles" in draws_figure(draws(made(0, 30))).panels[0].title


# the command


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["friso", *map(str, arguments)])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


@pytest.mark.slow
def test_check_draws(
    rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Correlations come from the file beside the stage; a key made certain by --set drops out of them."""
    path = tmp_path / "stage.toml"
    friction = {"friction.static": "3 N +/- 1 %", "friction.coulomb": "1 N +/- 1 %"}
    save(locked(rig, "14 Hz +/- 1 %").replace(friction), path)
    beside = tmp_path / "stage.correlations.toml"
    beside.write_text('keys = ["friction.static", "friction.coulomb"]\nmatrix = [[1, 1], [1, 1]]')
    options = ("--draws", "8", "--json", "--set", "friction.coulomb=1 N", "--out", tmp_path / "out")
    assert run(monkeypatch, "check", path, *options) == 0
    streams = capsys.readouterr()
    assert "centre" not in streams.err
    draws = json.loads(streams.out)["cases"]["given"]["draws"]
    assert set(draws["verdicts"]) == set(VERDICTS)
    assert sum(draws["verdicts"].values()) == 8
    assert draws["attracting_cycle"]["probability"] == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "none of 8 machines" in page
    beside.write_text('keys = ["masses.cart"]\nmatrix = [[1]]')
    assert run(monkeypatch, "check", path, *options, "--overwrite") == 2
    assert "masses.cart" in rows_of(capsys.readouterr().err)["given"]


@pytest.mark.slow
def test_ctrl_c_keeps_the_stages_judged_so_far(rig: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Named so, with the verdicts that there are; before the first group of stages there is nothing to keep."""
    stage, sample = rig, Sample({"masses.stage": np.linspace(0.4, 0.6, 10)}, 10, 0, {})
    judged = []

    def judge(flat: object, count: int, rtol: float, attracted: object) -> np.ndarray:
        judged.append(count)
        if len(judged) == most:
            raise KeyboardInterrupt
        return np.full(count, "settles", dtype=object)

    monkeypatch.setattr("friso.studies.draws.judge_many", judge)
    variants = len(different(stage))
    with StudySettings(stages_together=4).in_use():
        most = 2 * variants + 1
        drawn = Draws.of(stage, sample, 1, 1e-6)
        assert (drawn.sample.count, drawn.asked) == (8, 10)
        assert len(drawn.sample.keys["masses.stage"]) == len(drawn.fates["given"].verdicts) == 8
        assert draws_sentences(drawn)[0] == "Interrupted: 8 of 10 stages were drawn so far."
        judged, most = [], 1
        with pytest.raises(KeyboardInterrupt):
            Draws.of(stage, sample, 1, 1e-6)
