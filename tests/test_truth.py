"""The adversary of benchmarks.truth judges swings by itself, draws the same stages again, and keeps its attacks."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from variants import VARIANTS

from benchmarks.truth import __main__ as command
from benchmarks.truth import refute
from benchmarks.truth.attack import GIVEN_UP, STOOD, WRONG, _outcomes
from benchmarks.truth.claims import RUNS_AWAY, Claim, Edge, checked
from benchmarks.truth.classes import classes_of
from benchmarks.truth.draws import SERIES, draw
from benchmarks.truth.kept import KeptAttacks
from benchmarks.truth.refute import ALL, Refutation, _different, _edge, _kicks, _verdict, attempts, may_attract
from benchmarks.truth.swings import RESTS, SWINGS, UNSURE, judge, legs
from benchmarks.truth.tally import COLUMNS, document, page
from benchmarks.truth.trials import Bench, Outcome
from friso.engine.allowance import Exhausted
from friso.equations.bandwidth import bandwidth, faster
from friso.hunting import Kick, find_swings
from friso.stage.files import loads

END = 1000.0


def word(times: np.ndarray, sizes: np.ndarray, patient: bool = False) -> str:
    """Return the verdict on a run that turns at `times` [s], by `sizes` to either side in turn."""
    values = sizes * (-1.0) ** np.arange(len(sizes))
    late = values[times >= 0.75 * END]
    return judge(legs(times, values, END), float(np.ptp(late)) if late.size else 0.0, 1e-3, patient)


def evenly(sizes: np.ndarray) -> str:
    return word(np.linspace(0.0, END, len(sizes)), sizes)


def test_a_cycle_swings_on_whatever_its_period() -> None:
    long_and_short = np.tile([1.0, 0.4, 0.7], 100)
    assert evenly(np.ones(300)) == evenly(long_and_short) == SWINGS


@pytest.mark.parametrize("share", [0.9999, 1.0001])
def test_what_grows_or_decays_slowly_is_followed_on(share: float) -> None:
    assert evenly(share ** np.arange(400)) == UNSURE


def test_shrinking_by_a_share_at_every_ever_longer_stop_is_no_cycle() -> None:
    """A stage waits the longer the nearer it sticks: in time its swings shrink as 1/t."""
    sizes = 0.97 ** np.arange(200)
    times = np.cumsum(1 / sizes)
    times *= END / times[-1]
    assert word(times, sizes) == UNSURE
    assert word(times, sizes, patient=True) == RESTS


def test_small_swings_are_rest() -> None:
    assert evenly(np.full(300, 1e-4)) == RESTS


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("series", SERIES)
def test_stages_are_drawn_again_by_seed_and_number(series: str) -> None:
    for number in range(len(SERIES[series])):
        stage = draw(7, number, series)
        assert stage == draw(7, number, series)
        assert loads(stage.to_toml()) == stage
        assert stage.flat() != draw(8, number, series).flat()


@pytest.mark.parametrize(
    ("windows", "attracts", "refuted"),
    [((), True, [0.03, 1.0]), ((), False, []), (((0.02, 2.0),), True, []), (((1e-3, 3.0),), False, [1.1e-3, 2.5])],
)
def test_displacements_that_are_said_to_rest_are_tried(windows: tuple, attracts: bool, refuted: list[float]) -> None:
    """A stage that hunts from 0.02 to 2 m; also where no displacement is said to hunt. That one hunts which should not
    counts where its neighbours do too."""

    def follow(sizes: np.ndarray, rtol: float, any_will_do: bool) -> Any:
        words = np.where((sizes > 0.02) & (sizes < 2.0), SWINGS, RESTS)
        return SimpleNamespace(words=words, ends=sizes[:, None], periods=np.ones(len(sizes)))

    bench: Any = SimpleNamespace(released=lambda sizes: sizes, follow=follow, sustains=lambda *beside: attracts)
    claim: Any = SimpleNamespace(sure=True)
    counterexamples = [*_kicks(claim, Kick(windows, (1e-3, 100.0)), bench)]
    said = [float(re.findall(r"by ([\d.]+) m", item.why)[0]) for item in counterexamples]
    assert all(any(0.8 < size / wrong < 1.25 for size in said) for wrong in refuted)
    assert bool(said) == bool(refuted)


def test_stages_are_those_that_the_documentation_counts() -> None:
    """Whatever other series draw besides."""
    assert draw(1, 18).flat()["motion.displacement"] == pytest.approx(0.679328, rel=1e-5)
    assert draw(2, 5).flat()["motion.displacement"] == pytest.approx(0.0217155, rel=1e-5)


def test_a_stage_that_runs_away_is_said_to_and_another_that_is_said_to_is_refuted() -> None:
    """An integrator far too strong: m s^3 + sigma_2 s^2 + kp s + ki has roots on the right."""
    chosen = VARIANTS["rigid stage, PI"]
    (claim,) = checked(chosen.replace({"controller.ki": "5e6 N/(m*s)"})).claims
    assert (claim.verdict, claim.sure) == (RUNS_AWAY, True)
    assert [*attempts(claim, 0)["verdict"]] == []
    (wrong,) = attempts(replace(claim, stage=chosen), 0)["verdict"]
    assert (wrong.of, wrong.sure) == ("own motion", True)


def test_above_an_edge_nothing_is_tried_where_hunting_is_said_to_be_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    class Quiet(Bench):
        def starts(self, *args: Any) -> Any:
            tried.append(bandwidth(self.flat))
            return super().starts(1, 1, 1, 0, 0)

        def follow(self, *args: Any, **options: Any) -> Any:
            return SimpleNamespace(words=np.array([UNSURE]), swinging=np.array([], int), amplitude=np.zeros(1))

    monkeypatch.setattr(refute, "Bench", Quiet)
    chosen = VARIANTS["rigid"]
    own = bandwidth(chosen.flat())
    edge = Edge(1.0, sure=True, reserve=0.0, quiet=1.01, windows=((1.05, 1.2), (1.5, np.inf)))
    claim = Claim("given", chosen, "hunts", sure=True, edge=edge, kick=None)
    assert [*_edge(claim, edge, 0)] == []
    above = [value / own for value in tried if value > own]
    assert above == pytest.approx([1.002, 1.005, 1.01])


HUNTING = VARIANTS["rigid"]
SWINGING = np.array([SWINGS, SWINGS, SWINGS, RESTS, SWINGS], dtype=object)


@cache
def attracting() -> Any:
    """Return the stable motion of a stage as friso finds it."""
    (motion,) = find_swings(HUNTING.flat())
    return motion


class Narrow(Bench):
    """A stage that keeps swinging only if it begins close enough to its stable motion.

    `swing`: largest distance to that motion, as a share of it.
    """

    def follow(self, trial: Any, *args: Any, **options: Any) -> Any:
        distance = trial.states[:, self.kernel.position] / attracting().distance
        near = np.abs(distance - 1) < self.swing
        return SimpleNamespace(words=np.where(near, SWINGS, RESTS).astype(object))


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(("share", "refuted"), [(0.011, False), (0.0015, False), (0.0005, True)])
def test_a_basin_of_a_hundredth_is_found_before_a_claim_is_called_wrong(share: float, refuted: bool) -> None:
    """Number 3 of seed 777, whose cycle attracts from 1 % to either side: no start of the battery comes so near."""
    claim: Any = SimpleNamespace(attracted=True, kick=None, sure=True, motions=(attracting(),))
    bench = Narrow(HUNTING.flat(), share)
    assert SWINGS not in bench.follow(bench.starts(*ALL, 0)).words
    assert bool([*_verdict(claim, bench, 0)]) == refuted


def test_what_is_said_to_attract_is_followed_from_close_beside_it() -> None:
    """A hunting stage keeps its cycle up, and a much faster one, begun there, does not."""
    assert may_attract(Bench(HUNTING.flat()), attracting())
    assert not may_attract(Bench(faster(HUNTING.flat(), 8)), attracting())


def test_starts_that_swing_alike_are_looked_at_once() -> None:
    amplitude = np.array([2.0, 1.0, 2.0001, 0.0, 3.0])
    assert _different(Outcome(SWINGING, amplitude, *[np.zeros(5)] * 3)).tolist() == [0, 1, 4]


def refutation(number: int) -> Refutation:
    return Refutation("verdict", True, str(number))


def given_up(*refutations: Refutation) -> Iterator[Refutation]:
    yield from refutations
    raise Exhausted


def test_what_was_found_before_an_attack_is_given_up_counts() -> None:
    tried = {"verdict": given_up(refutation(1), refutation(2)), "edge": given_up()}
    assert _outcomes(tried) == ({"verdict": WRONG, "edge": GIVEN_UP}, [refutation(1), refutation(2)])
    assert _outcomes({"verdict": iter(())}) == ({"verdict": STOOD}, [])


@pytest.mark.slow
def test_stages_are_counted_by_class_of_machine() -> None:
    """Classes are law, joint and controller, settings, backlash, and friction on both sides of a transmission."""
    names = {name for series in SERIES for number in range(30) for name in classes_of(draw(7, number, series).flat())}
    settings = {
        "dead band of the error",
        "leak of the integral",
        "limit of the integral",
        "force limit, no anti-windup",
    }
    assert names >= settings | {"backlash", "transmission", "two frictions", "joint: free", "friction: gms"}
    assert classes_of(draw(7, 2, "drives").flat()) == [
        "controller: pid",
        "friction: none",
        "joint: rigid",
        "transmission",
    ]


def outcome(number: int, wrong: bool = False) -> dict[str, Any]:
    """Return an invented outcome of an attack on a stage."""
    ends_as = {"verdict": WRONG if wrong else STOOD, "edge": GIVEN_UP, "static friction": STOOD}
    classes = ["joint: free"] if number % 2 else ["joint: rigid", "backlash"]
    claim = {"says": "given: hunts", "case": "given", "classes": classes, "verdict": "hunts", "sure": True, "edge": 1.1}
    claims = [claim | {"edge_sure": True, "friction_sure": number != 4, "doubts": {}, "outcomes": ends_as}]
    refuted = [{"case": "given", "of": "verdict", "sure": True, "why": "no start swings on"}] if wrong else []
    stage = {"series": "stages", "seed": 1, "number": number, "cpu": 0.1, "work": 1.0, "attack_cpu": 0.2, "error": ""}
    return stage | {"claims": claims, "refuted": refuted}


@pytest.mark.slow
def test_attacks_are_told_by_class_and_in_a_table(tmp_path: Path) -> None:
    kept = KeptAttacks(tmp_path / "attacks.jsonl")
    records = [kept.add(outcome(number, wrong=number == 2)) for number in range(5)]
    tally = document(records)
    assert [tally["all"][key] for key in COLUMNS] == [5, 5, 5, 4, 1, 5, 5, 0, 0, 5, 4, 4, 0]
    assert [tally["classes"]["backlash"][key] for key in COLUMNS] == [3, 3, 3, 2, 1, 3, 3, 0, 0, 3, 2, 2, 0]
    assert [witness["stage"] for witness in tally["wrong"]] == ["stages 1:2"]
    assert len(tally["given_up"]) == 5
    assert "| backlash | 3 | 3 | 3 | 2 | 1 | 3 | 3 | 0 | 0 | 3 | 2 | 2 | 0 |" in page(records, tally)


class Attacked:
    """The command, run on five stages with a made-up attack that stops it at some of them."""

    def __init__(self, folder: Path, patched: pytest.MonkeyPatch) -> None:
        self.file, self.patched = folder / "attacks.jsonl", patched
        self.attacked: list[int] = []
        self.stops_at: int | None = None
        patched.setattr(command, "attack", self.attack)
        patched.setattr(command, "needed_kernels", lambda stage: set())

    def attack(self, seed: int, number: int, *options: Any) -> dict[str, Any]:
        if number == self.stops_at:
            raise KeyboardInterrupt
        self.attacked.append(number)
        return outcome(number)

    def run(self, *options: str) -> list[int]:
        """The numbers that are attacked."""
        self.attacked = []
        choices = ["--stages", "5", "--workers", "1", "--out", str(self.file.parent), *options]
        self.patched.setattr("sys.argv", ["truth", *choices])
        command.main()
        return self.attacked


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Attacked:
    return Attacked(tmp_path, monkeypatch)


def test_a_run_that_was_stopped_goes_on_and_ends_like_an_unbroken_one(run: Attacked) -> None:
    assert run.run() == [0, 1, 2, 3, 4]
    unbroken = run.file.read_text()
    run.file.unlink()
    run.stops_at = 3
    assert run.run() == [0, 1, 2]
    run.stops_at = None
    assert run.run() == [3, 4]
    assert run.file.read_text() == unbroken
    assert run.run() == []


def test_attacks_by_other_code_are_shown_and_made_again_on_request_alone(
    run: Attacked, capsys: pytest.CaptureFixture[str]
) -> None:
    run.run()
    first, *others = run.file.read_text().splitlines(keepends=True)
    run.file.write_text(json.dumps(json.loads(first) | {"code": "earlier"}) + "\n" + "".join(others))
    capsys.readouterr()
    assert run.run("--json") == []
    assert json.loads(capsys.readouterr().out)["of_other_code"] == ["stages 1:0"]
    assert run.run("--redo") == [0]
    assert run.run("--redo") == []
    capsys.readouterr()
    assert run.run("--report", "--json") == []
    assert json.loads(capsys.readouterr().out)["of_other_code"] == []
