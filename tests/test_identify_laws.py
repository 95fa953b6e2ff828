"""Friction laws fitted to the same record: what they are made of, what they find, and which a record supports."""

from dataclasses import replace

import numpy as np
import pytest
from variants import VARIANTS

import friso
from friso.equations.friction.measured import MeasuredFriction
from friso.errors import InputError
from friso.identification import method
from friso.identification.laws.comparison import LawComparison, LawPrediction, comparable
from friso.identification.laws.fit import DraggedRecord, LawFit, LawProblem, blocks, dragged_record
from friso.identification.method import Identification
from friso.identification.readings.at_bearing import Between, LowPass
from friso.identification.readings.common import record
from friso.stage import Stage
from friso.stage.correlations import Correlations
from friso.stage.tables import friction_law
from friso.studies.laws.conversion import with_friction

STEP, MASS, NOISE = 1e-3, 1.7, 0.005
"""Sample time [s], moving mass [kg], noise of the force [N]."""


@pytest.fixture(scope="module")
def rig() -> Stage:
    return VARIANTS["rigid"].replace({"friction.coulomb": "2 N", "friction.bristle_damping": "20 N*s/m"})


@pytest.fixture(scope="module")
def lugre(rig: Stage) -> MeasuredFriction:
    return friction_law("lugre").shown(rig.flat())


@pytest.mark.parametrize("law", comparable())
def test_a_law_that_is_fitted_shows_the_friction_and_the_stiffness_it_is_made_with(
    law: str, rig: Stage, lugre: MeasuredFriction
) -> None:
    shape = {name: start for name, (_, start, _) in friction_law(law).shape.items()}
    shown = friction_law(law).shown(with_friction(rig, law, friction_law(law).shaped(lugre, shape)).flat())
    assert shown.stiffness == pytest.approx(lugre.stiffness, rel=1e-9)
    assert (shown.levels.coulomb, shown.levels.viscous) == pytest.approx((2.0, 0.5), rel=1e-9)
    assert shown.force[-1] == pytest.approx(shown.levels.static, rel=2e-3)  # a power law gets there slowly


def test_a_record_may_begin_in_motion(lugre: MeasuredFriction) -> None:
    """Bristles that do not slip are a spring and a damper, from wherever the record begins."""
    time = np.arange(1000) * STEP
    place = 5e-6 * np.sin(2 * np.pi * 3 * time)
    drag = DraggedRecord("made", place, LowPass(time, 1 / STEP), np.zeros(len(time) - 4), np.zeros(0))
    keys = friction_law("elasto_plastic").shaped(lugre, {"elastic_share": 0.6})
    friction = drag.friction({**keys, "friction.model": "elasto_plastic"}, 1)[0]
    speed = np.gradient(place, STEP)
    expected = lugre.stiffness * place + (lugre.damping + lugre.levels.viscous) * speed
    assert friction == pytest.approx(expected[2:-2], abs=0.01 * lugre.stiffness * 5e-6)


def test_a_law_finds_its_own_numbers_in_a_record(lugre: MeasuredFriction) -> None:
    """Elasto-plastic friction under loops of several amplitudes and a slow stroke, from other numbers."""
    law, time = "elasto_plastic", np.arange(3000) * STEP
    place = np.interp(time, [0, 1, 2, 3], [4e-6, 1e-5, 3e-5, 3e-4]) * np.sin(2 * np.pi * 1.5 * time)
    true = friction_law(law).shaped(lugre, {"elastic_share": 0.6})
    drag = DraggedRecord("made", place, LowPass(time, 1 / STEP), np.zeros(len(time) - 4), np.zeros(0))
    friction = np.pad(drag.friction({**true, "friction.model": law}, 1)[0], 2, mode="edge")
    force = friction + MASS * np.gradient(np.gradient(place, STEP), STEP)
    force += NOISE * np.random.default_rng(1).standard_normal(len(time))
    read = dragged_record(record("made.csv", STEP, position=place, force=force), Between(delay=0.0, mass=MASS))
    assert isinstance(read, DraggedRecord)
    off = replace(lugre, stiffness=1.6e5, damping=60.0, levels=replace(lugre.levels, static=2.4, coulomb=1.7))
    problem = LawProblem(law, 1.3 * MASS, off, [read])
    fit = problem.fitted([np.ones(len(read.force), bool)], problem.start[None])
    assert fit.mass == pytest.approx(MASS, rel=0.3)
    for key in ("bristle_stiffness", "coulomb", "breakaway_deflection"):
        assert fit.keys[f"friction.{key}"] == pytest.approx(true[f"friction.{key}"], rel=0.1), key


def prediction(law: str, *errors: float) -> LawPrediction:
    return LawPrediction(LawFit(law, MASS, {}, np.zeros(1)), np.array(errors))


@pytest.mark.parametrize(
    ("laws", "supported"),
    [
        ((prediction("a", 0.05, 0.06, 0.05), prediction("b", 0.09, 0.11, 0.10)), ["a"]),
        ((prediction("a", 0.05, 0.06, 0.05), prediction("b", 0.05, 0.05, 0.065)), ["a", "b"]),
        ((prediction("a", 0.05, 0.06, 0.05), prediction("b", 0.052, 0.062, 0.052)), ["a", "b"]),
        ((prediction("a", 0.05, 0.06, 0.05), prediction("b", 0.05, np.inf, 0.05)), ["a"]),
        ((prediction("a", 0.5, 0.6, 0.5), prediction("b", 0.5, 0.6, 0.5)), []),
        ((prediction("a", *[0.01] * 9), prediction("b", *[0.04] * 8, 0.9)), ["a"]),
        ((prediction("a", *[0.01] * 3), prediction("b", 0.02, 0.02, 0.9)), ["a"]),
    ],
)
def test_laws_are_supported_that_predict_as_well_as_the_best(
    laws: tuple[LawPrediction, ...], supported: list[str]
) -> None:
    assert [law.law for law in LawComparison(laws, ("made",), {}, 3).supported] == supported


@pytest.mark.parametrize(("law", "doubted"), [("lugre", False), ("gms", True), ("stribeck", False)])
def test_bristles_of_a_law_that_the_record_does_not_support_are_doubted(
    law: str, doubted: bool, rig: Stage, lugre: MeasuredFriction, monkeypatch: pytest.MonkeyPatch
) -> None:
    predictions = (prediction("lugre", *[0.01] * 9), prediction("gms", *[0.2] * 9))
    monkeypatch.setattr(method, "compare_laws", lambda *_: LawComparison(predictions, ("made",), {}, 9))
    nothing = Identification(None, Correlations(), (), (), ())
    stage = with_friction(rig, law, friction_law(law).keeping(lugre, 2))
    assert bool(method.with_laws(nothing, [], stage).doubts) == doubted


def test_every_sample_is_left_out_once() -> None:
    whole = DraggedRecord("one", np.zeros(9), LowPass(np.arange(9.0), 1.0), np.zeros(11), np.zeros(11))
    for records, parts in (
        ([whole], 5),
        ([whole, replace(whole, name="two")], 6),
        ([replace(whole, name=str(k)) for k in range(5)], 5),
    ):
        masks = blocks(records, 5)
        assert len(masks) == parts
        assert all(np.sum([part[i] for part in masks], axis=0).tolist() == [1] * 11 for i in range(len(records)))


def test_laws_without_a_stage_are_refused_before_any_work() -> None:
    with pytest.raises(InputError, match="--stage"):
        friso.identify("that_is_not_read.csv", laws=True)
