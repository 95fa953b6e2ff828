"""Margins in static friction, and in a joint's stroke and stiffness."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from book import BOOK
from made_up import FakeCase, fake_stage, hunts, settles
from variants import VARIANTS

from friso.equations.bandwidth import least_static_factor, static_frictions, with_friction, with_static_friction
from friso.hunting import (
    AttractionEnd,
    BandwidthAdvice,
    BandwidthWindow,
    Margin,
    ParameterMargin,
    advised,
    check,
    find_attractors,
    joint_margins,
)
from friso.questions.check.cases import joint_margins_document
from friso.questions.check.margin_words import friction_sentences, margin_sentence, thin_margins
from friso.questions.check.question import CheckAnswer
from friso.questions.check.words import details_sentences, verdict_sentence
from friso.shown.motion_words import ShownCase
from friso.stage import Stage

RIGID = VARIANTS["rigid"].replace({"controller.crossover": "8 Hz"})


def attracts(stage: Stage, factor: float) -> bool:
    """Whether simulations from many starts find that something attracts a stage with so much static friction."""
    return bool(find_attractors(with_static_friction(stage.flat(), factor), 1).attracts[0])


def test_a_margin_ends_where_a_search_from_many_starts_says_so() -> None:
    """The rigid mass hunts; with half its static friction it does not, nor with half as much again."""
    case = check(RIGID)["given"]
    margin, edge = case.static_friction, case.judgement.margin
    assert margin.certain
    for end in (margin.below, margin.above):
        assert attracts(RIGID, end.inside)
        assert not attracts(RIGID, end.outside)
        assert abs(np.log(end.outside / end.inside)) < 0.06
    assert (edge.crossover, edge.kind, edge.certain) == (pytest.approx(9.770, abs=1e-3), "flip", True)
    assert edge.factor < edge.quiet < 1.02 * edge.factor
    assert (margin.below.kind, margin.above.kind) == ("lost", "flip")
    assert margin.below.inside < 1 < margin.above.inside


@pytest.mark.slow
@pytest.mark.usefixtures("own_bandwidth")
def test_an_end_just_above_coulomb_friction_is_found() -> None:
    """Hunting ended between 107 and 109 mN, closer to Coulomb friction than a step beyond an orbit's end."""
    stage = BOOK["ends just above Coulomb friction"]
    margin = check(stage)["given"].static_friction
    assert margin.below.certain
    assert margin.range[0] <= margin.below.outside < 0.107 / 0.2222 < margin.below.inside < 0.112 / 0.2222
    assert attracts(stage, 0.109 / 0.2222)
    assert not attracts(stage, 0.107 / 0.2222)


def test_where_hunting_begins_is_told_of_a_stage_that_settles() -> None:
    """At half its static friction the rigid mass settles; with a little more it hunts. The first lines say so."""
    case = check(RIGID.replace({"friction.static": "1.4 N"}))["given"]
    margin = case.static_friction
    assert not margin.attracts
    assert margin.range == pytest.approx((1 / 1.4, 3.0))
    assert not attracts(case.stage, margin.above.outside)
    assert attracts(case.stage, margin.above.inside)
    (sentence,) = friction_sentences(case)
    assert "1.00 to" in sentence


def test_static_friction_alone_is_scaled_or_all_of_it() -> None:
    """Doubling all friction leaves every deflection and speed of a law unchanged."""
    for name in ("rigid", "two frictions") if "two frictions" in VARIANTS else ("rigid",):
        flat = VARIANTS[name].flat()
        twice = with_friction(flat, 2.0)
        assert twice["friction.static"] == 2 * flat["friction.static"]
        assert twice["friction.bristle_stiffness"] == 2 * flat["friction.bristle_stiffness"]
        assert twice["friction.stribeck_velocity"] == flat["friction.stribeck_velocity"]
        more = with_static_friction(flat, 2.0)
        assert {key for key in flat if more[key] != flat[key]} == set(static_frictions(flat))
        assert least_static_factor(flat) == flat["friction.coulomb"] / flat["friction.static"]


@pytest.mark.slow
def test_the_joint_has_margins_where_it_is_free(rig: Stage) -> None:
    cases = check(rig)
    margins = joint_margins(cases["free"].stage, cases["free"].judgement)
    assert set(margins) == {"joint.stroke", "joint.stiffness"}
    assert not joint_margins(cases["locked"].stage, cases["locked"].judgement)


def test_the_document_holds_the_margins_of_the_joint_where_details_are_wanted(rig: Stage) -> None:
    """Margins are given as multiples of the stage file's keys and as values in the units of its axis."""
    begins = ParameterMargin(False, AttractionEnd(0.75, 0.8, True), None, (1 / 3, 3.0), (1,))
    margins = {"joint.stroke": begins, "joint.stiffness": replace(begins, below=None)}
    document = joint_margins_document(rig, margins)["joint_margins"]
    stroke, stiffness = rig.flat()["joint.stroke"], rig.flat()["joint.stiffness"]
    below = document["stroke"].pop("below")
    assert below == {
        **{"same_at_factor": 0.8, "other_at_factor": 0.75, "certain": True, "kind": "seen"},
        **{"same_m": pytest.approx(0.8 * stroke), "other_m": pytest.approx(0.75 * stroke)},
    }
    rest = {"hunts": False, "above": None, "searched": [1 / 3, 3.0], "not_determined": ["above"]}
    assert document == {
        "stroke": {"yours_m": stroke, **rest},
        "stiffness": {"yours_n_per_m": stiffness, "below": None, **rest},
    }
    answer = CheckAnswer({"given": SimpleNamespace(stage=rig)}, stage=rig, draws=None, laws=None)
    vars(answer)["joint_margins"] = margins
    assert answer.document_of_details().keys() == {"joint_margins"}


def made_up_case(margin: ParameterMargin, judgement: Any) -> Any:
    stage = fake_stage()
    stage.flat = lambda: {"friction.static": 3.0, "friction.coulomb": 1.0}
    return FakeCase(stage, None, judgement, static_friction=margin)


@pytest.mark.parametrize(
    ("attracts", "below", "above", "others", "value", "wanted", "unwanted"),
    [
        (False, None, (1.4, 1.3149), {}, (), ("Robust", "0.333 to 1.31 times"), "not"),
        (True, (0.5011, 0.4449), (1.3, 1.4411), {}, (), ("0.502 to 1.3 times",), "not"),
        (False, None, (1.08, 1.0), {}, (), ("No hunting",), "not det"),
        (True, None, (1.3, 1.4), {"again": {1: AttractionEnd(2.2, 2.1, True)}}, (10.0, "N"), ("from 21",), "not"),
        (True, None, None, {"open_sides": (-1,)}, (), ("not determined",), "certain"),
        (False, (0.7, 0.8, False), None, {"open_sides": (1,)}, (), ("not certain", "not determined"), "again"),
        # 12.65 N, at which nothing hunts, was rounded out of its own range
        (False, None, (1.05, 1.0), {"range": (1.0, 3.0)}, (12.65, "N"), ("as yours",), "12.7 to 12.6"),
        (False, (0.9, 0.93), (1.05, 1.0), {"range": (0.5, 3.0)}, (12.65, "N"), ("up to yours",), "to 12.6"),
        (False, (0.97, 1.0), (1.4, 1.3), {"range": (0.5, 3.0)}, (12.65, "N"), ("16.4 N", "yours"), "12.7 to"),
        (False, (0.97, 0.9995), (1.05, 1.0005), {"range": (0.5, 3.0)}, (12.65, "N"), ("1.05 times",), "to 12.6"),
    ],
)
def test_a_margin_is_told_with_its_ends_rounded_towards_the_stage(
    attracts: bool, below: Any, above: Any, others: dict[str, Any], value: Any, wanted: tuple[str, ...], unwanted: str
) -> None:
    ends = [None if end is None else AttractionEnd(*(*end, True)[:3]) for end in (below, above)]
    margin = ParameterMargin(attracts, *ends, **{"range": (1 / 3, 3.0), **others})
    assert margin.certain == (not margin.open_sides)
    sentence = margin_sentence("static friction", margin, *value)
    assert all(text in sentence for text in wanted)
    assert unwanted not in sentence


def test_the_lower_bandwidth_advised_keeps_a_factor_from_hunting() -> None:
    """Below 0.5 of its own a stage does not hunt, but from 0.3 to 0.4 it does: 0.5/1.2 is too near to that window."""
    lower, again = AttractionEnd(0.51, 0.5, True), BandwidthWindow(None, AttractionEnd(0.4, 0.41, True))

    def slower(judgement: Any) -> Any:
        return advised(fake_stage(), judgement, (), None, 0.0)[1]

    assert slower(hunts(lower=lower)).factor == pytest.approx(0.5 / 1.2)
    assert slower(hunts(lower=lower, windows=(again,))).just_beyond
    assert slower(hunts(lower=AttractionEnd(0.29, 0.28, True))).just_beyond  # below the bandwidths searched


def test_hunting_again_on_the_side_advised_is_in_the_first_sentences() -> None:
    """A stage hunts below 0.7 times its bandwidth and from 1.16 to 2.57 times: whoever makes it faster has to know."""
    again = BandwidthWindow(AttractionEnd(1.1597, 1.1487, True), AttractionEnd(2.57, 2.59, True))
    far = BandwidthWindow(AttractionEnd(0.3, 0.29, True), AttractionEnd(0.4, 0.41, True))
    edge = Margin(0.7, None, True, 0.707)
    barely = ShownCase(
        "given", "As given", "", FakeCase(fake_stage(), None, settles(margin=edge, windows=(far, again)))
    )
    first = verdict_sentence(barely, {})
    assert "below 0.7 times" in first
    assert "1.16 to 2.57 times" in first
    assert "barely" in first
    assert "0.3 to" not in first
    advice = BandwidthAdvice(1.05, AttractionEnd(1.02, 1.03, True), True, None)
    judgement = hunts(margin=Margin(1.02, None, True, 1.03), windows=(far, again))
    cured = replace(barely, case=replace(barely.case, judgement=judgement, faster=advice))
    assert "1.16 to 2.57 times" in verdict_sentence(cured, {})
    (rest,) = (text for text in details_sentences(barely, {}) if "again" in text)
    assert "0.3 to 0.4" in rest
    assert "1.16" not in rest


def test_little_reserve_is_told_with_what_brings_hunting_back() -> None:
    near = ParameterMargin(False, None, AttractionEnd(1.1, 1.05, True), (1 / 3, 3.0))
    far = ParameterMargin(False, None, AttractionEnd(1.6, 1.5, True), (1 / 3, 3.0))
    assert any("1.1 times" in text for text in thin_margins(made_up_case(near, settles())))
    assert not thin_margins(made_up_case(far, settles(margin=None)))


def test_static_friction_is_never_told_below_coulomb_friction() -> None:
    """Its least multiple, rounded down, would be 2 mN below; the numbers that stand beside each other agree."""
    stage = VARIANTS["rigid"].replace({"friction.static": "26.3 N", "friction.coulomb": "11.31 N"})
    lowest = least_static_factor(stage.flat())
    margin = ParameterMargin(True, AttractionEnd(lowest * 1.1, lowest, False), None, (lowest, 3.0))
    (says,) = friction_sentences(FakeCase(stage, None, static_friction=margin))
    assert "11.308" not in says
    assert "11.3" in says or "12.5" in says


@pytest.mark.parametrize(
    ("force_limit", "weight", "held"), [("6.7 N", 0, True), ("9.5 N", 0, False), ("12.7 N", 6, True), (None, 0, False)]
)
def test_friction_beyond_the_force_limit_is_told_as_that(force_limit: str | None, weight: float, held: bool) -> None:
    """Static friction of 9 N ends hunting, where the limit, less the weight that is carried, cannot break it away."""
    changes = {"controller.force_limit": force_limit, "controller.anti_windup": "clamp"} if force_limit else {}
    changes |= {"bias": {"stage": f"-{weight} N"}} if weight else {}
    stage = VARIANTS["rigid"].replace({"friction.static": "3 N", **changes})
    margin = ParameterMargin(True, None, AttractionEnd(2.7, 3.0, True), (1 / 3, 3.0))
    says = friction_sentences(FakeCase(stage, None, static_friction=margin))
    assert says[0].startswith("Hunts")
    assert any("force limit" in text and "6.70 N" in text for text in says) == held


@pytest.mark.parametrize(("factor", "quiet", "at"), [(0.99, 1.01, True), (0.98, 0.99, False), (1.0, 1.01, False)])
def test_a_stage_between_the_ends_of_an_edge_lies_at_it(factor: float, quiet: float, at: bool) -> None:
    margin = Margin(factor, None, False, quiet)
    assert replace(settles(), margin=margin).at_an_edge == at
    window = BandwidthWindow(None, AttractionEnd(factor, quiet, False))
    assert replace(settles(), windows=(window,)).at_an_edge == at
