"""The adversary of benchmarks.truth judges swings by itself, and draws the same stages again."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from variants import VARIANTS

from benchmarks.truth import refute
from benchmarks.truth.claims import RUNS_AWAY, Claim, Edge, checked
from benchmarks.truth.draws import FORMS, SERIES, draw
from benchmarks.truth.refute import _edge, _kicks, refutations
from benchmarks.truth.swings import RESTS, SWINGS, UNSURE, judge, legs
from benchmarks.truth.trials import Bench
from friso.equations.bandwidth import bandwidth
from friso.hunting import Kick
from friso.stage.files import loads
from friso.stage.tables import FRICTION

END = 1000.0


def word(times: np.ndarray, sizes: np.ndarray, patient: bool = False) -> str:
    """Of a run that turns at times [s] by so much to either side in turn."""
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


@pytest.mark.parametrize("series", SERIES)
def test_stages_are_drawn_again_by_seed_and_number(series: str) -> None:
    for number in range(len(SERIES[series])):
        stage = draw(7, number, series)
        assert stage == draw(7, number, series)
        assert loads(stage.to_toml()) == stage
        assert stage.flat() != draw(8, number, series).flat()


@pytest.mark.parametrize(("windows", "refuted"), [((), [0.03, 1.0]), (((0.02, 2.0),), [])])
def test_displacements_that_are_said_to_rest_are_tried(windows: tuple, refuted: list[float]) -> None:
    """A stage that hunts from 0.02 to 2 m; also where no displacement is said to hunt."""

    def follow(sizes: np.ndarray, rtol: float, any_will_do: bool) -> Any:
        return SimpleNamespace(words=np.where((sizes > 0.02) & (sizes < 2.0), SWINGS, RESTS))

    bench: Any = SimpleNamespace(released=lambda sizes: sizes, follow=follow)
    claim: Any = SimpleNamespace(sure=True)
    counterexamples = [*_kicks(claim, Kick(windows, (1e-3, 100.0)), bench)]
    said = [float(re.findall(r"by ([\d.]+) m", item.why)[0]) for item in counterexamples]
    assert all(any(0.8 < size / wrong < 1.25 for size in said) for wrong in refuted)
    assert bool(said) == bool(refuted)


def test_stages_are_those_that_the_documentation_counts() -> None:
    """Whatever other series draw besides."""
    assert draw(1, 18).flat()["motion.displacement"] == pytest.approx(0.679328, rel=1e-5)
    assert draw(2, 5).flat()["motion.displacement"] == pytest.approx(0.0217155, rel=1e-5)


def test_stages_of_every_friction_law_are_drawn() -> None:
    laws = {name for name, law in FRICTION.classes.items() if law.__module__.startswith("friso.")}
    assert {form.friction for form in FORMS} == laws


def test_a_stage_that_runs_away_is_said_to_and_another_that_is_said_to_is_refuted() -> None:
    """An integrator far too strong: m s^3 + sigma_2 s^2 + kp s + ki has roots on the right."""
    chosen = VARIANTS["rigid stage, PI"]
    (claim,) = checked(chosen.replace({"controller.ki": "5e6 N/(m*s)"})).claims
    assert (claim.verdict, claim.sure) == (RUNS_AWAY, True)
    assert [*refutations(claim, 0)] == []
    (wrong,) = refutations(replace(claim, stage=chosen), 0)
    assert (wrong.of, wrong.sure) == ("own motion", True)


def test_above_an_edge_nothing_is_tried_where_hunting_is_said_to_be_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    class Quiet(Bench):
        def starts(self, *args: Any) -> Any:
            tried.append(bandwidth(self.flat))
            return super().starts(1, 1, 1, 0, 0)

        def follow(self, *args: Any, **options: Any) -> Any:
            return SimpleNamespace(words=np.array([UNSURE]), swinging=np.array([], int))

    monkeypatch.setattr(refute, "Bench", Quiet)
    chosen = VARIANTS["rigid"]
    own = bandwidth(chosen.flat())
    edge = Edge(1.0, sure=True, reserve=0.0, quiet=1.01, windows=((1.05, 1.2), (1.5, np.inf)))
    claim = Claim("given", chosen, "hunts", sure=True, edge=edge, kick=None)
    assert [*_edge(claim, 0)] == []
    above = [value / own for value in tried if value > own]
    assert above == pytest.approx([1.002, 1.005, 1.01])
