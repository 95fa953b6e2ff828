"""Test what a check shows: its figures, sentences, table and page, on made-up cases."""

import base64
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from made_up import (
    NO_RETURN,
    both_joints,
    cannot_hunt,
    check_html,
    fake_case,
    fake_cycle,
    fake_hunting,
    fake_solver,
    fake_stage,
    fake_trace,
    hunts,
    mpl_arrays,
    plotly_arrays,
    same,
    settles,
)
from pages import Page, packed_values
from patched import patched
from snapshots import Snapshots

import friso
from friso.hunting import (
    AttractionEnd,
    BandwidthWindow,
    CheckPart,
    Judgement,
    Kick,
    LoopState,
    LowerGains,
    Margin,
    StickSlipSpeeds,
    Swing,
    advised,
)
from friso.hunting.criteria import Verdict
from friso.questions.check.cases import case_document, rows, rows_behind
from friso.questions.check.figures import check_figures
from friso.questions.check.words import answer, conclusion, details_sentences, edge_text, verdict_sentence
from friso.shown import blocks, pages
from friso.shown.blocks import AnswerBlock
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.figure import Figure
from friso.shown.motion_words import ShownCase, shown_cases
from friso.stage import Stage

# ---------------------------------------------------------------- figures of a check


def figure_of(name: str, cases: dict[str, Any]) -> Figure:
    return next(figure for figure in check_figures(cases) if figure.name == name)


def test_figures_of_a_stage_with_a_joint():
    figures = {figure.name: figure for figure in check_figures(both_joints())}
    assert list(figures) == ["settled", "return-map", "cycle", "overview", "shares", "joint", "friction"]
    zoom, settling = figures["settled"].panels
    assert zoom.x.limits == (10.0, 20.0)
    assert [line.label for line in zoom.series] == ["Locked", "Free (as given)"]
    assert zoom.markers[0].label == "counted peaks, locked: 6"
    assert np.array_equal(zoom.markers[0].x, both_joints()["locked"].peak_times)
    assert settling.y.log
    assert [limit.values for limit in settling.limits] == [(1e-6,), (1e-5,)]
    assert [line.label for line in figures["shares"].panels[0].series] == ["P", "I", "D", "total"]
    assert figures["shares"].panels[0].y.limits == figures["shares"].panels[1].y.limits
    assert figures["joint"].panels[0].limits[0].values == (-1e-3, 1e-3)
    assert [item.label for item in shown_cases({"given": fake_case()})] == ["As given"]


@pytest.mark.cases(first=1, slow=4)
@pytest.mark.parametrize("kind", ["there_and_back", "step", "ramp", "release", "hold"])
@pytest.mark.parametrize("hunting", [False, True])
def test_every_motion_gives_figures_that_can_be_drawn(kind, hunting):
    case = fake_case(hunting, kind=kind, drop=["joint_deflection"])
    figures = check_figures({"given": case})
    cycle = ["cycle"] if hunting else []
    assert [figure.name for figure in figures] == ["settled", "return-map", *cycle, "overview", "shares", "friction"]
    for figure in figures:
        if hunting:
            assert matplotlib_renderer.image(figure, "png").startswith(b"\x89PNG")
        assert same(mpl_arrays(figure), plotly_arrays(figure))


def test_what_a_stage_lacks_has_no_panel():
    bare = ["friction_force", "force_p", "force_i", "force_d", "joint_deflection"]
    case = replace(fake_case(drop=bare), judgement=cannot_hunt())
    assert [figure.name for figure in check_figures({"given": case})] == ["settled", "overview"]
    assert "The friction" not in check_html({"given": case})
    case = fake_case(hunting=True)
    case.trace["force_i"][:] = 0.0
    assert [line.label for line in figure_of("shares", {"given": case}).panels[0].series] == ["P", "D", "total"]
    near, far = (fake_case(hunting=True, stage=fake_stage(force_limit=bound)) for bound in (6.0, 200.0))
    panel = figure_of("overview", {"given": near}).panels[1]
    assert panel.limits[0].values == (-6.0, 6.0)
    assert panel.y.limits[1] > 6.0
    assert figure_of("overview", {"given": far}).panels[1].limits == ()


def test_a_cart_that_rests_is_a_point():
    cases = both_joints() | {"free": fake_case(stage=fake_stage(locked=False), kind="hold")}
    panel = check_figures(cases)[-1].panels[0]
    assert [marker.label for marker in panel.markers] == ["Free (as given): at rest"]
    figures = check_figures({"given": fake_case(kind="hold")})
    panel = figures[-1].panels[0]
    assert (len(panel.series), len(panel.markers)) == (0, 1)
    case = replace(fake_case(), trace=fake_trace("hold", duration=4.0, samples=401))
    assert check_figures({"given": case})[0].panels[0].x.limits == (2.0, 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("start", [0, 1000, 2400, 4000])
def test_nan_of_a_failed_run_breaks_nothing(start):
    case = fake_case(hunting=True, stage=fake_stage(locked=True))
    assert case.trace is not None
    for name in case.trace.data_vars:
        case.trace[name][start:] = np.nan if name != "force" else np.inf
    solver = fake_solver("underflow")
    numbers = {"peak_to_peak": float("nan"), "period": float("nan")}
    failed = replace(case, judgement=hunts(verdict="failed"), solver=solver, **numbers)
    cases = {"given": failed, "locked": failed, "free": fake_case(stage=fake_stage(locked=False))}
    for figure in check_figures(cases):
        assert same(mpl_arrays(figure), plotly_arrays(figure))
    page = check_html(cases)
    assert "underflow" in page
    assert "NaN" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_nothing_is_shaded_where_swings_to_one_side_differ_and_that_is_said() -> None:
    uneven = hunts(hunting=fake_hunting(fake_cycle(symmetric=False)))
    figure = figure_of("return-map", {"given": replace(fake_case(hunting=True), judgement=uneven)})
    assert figure.panels[0].bands == ()
    even = figure_of("return-map", both_joints())
    assert even.panels[0].bands
    bounded = hunts(hunting=fake_hunting(fake_cycle(), fake_cycle(symmetric=False, multiplier=1.2)))
    beside = figure_of("return-map", {"given": replace(fake_case(hunting=True), judgement=bounded)})
    assert beside.panels[0].bands  # a pair of leaning cycles bounds the basin of a symmetric stage


def test_return_map_with_the_swings_of_this_motion():
    locked, free = figure_of("return-map", both_joints()).panels
    assert locked.x.limits == locked.y.limits == pytest.approx((0.0, 2.2 * 5.2e-4))
    diagonal, curve, motion = locked.series
    assert np.array_equal(diagonal.x, diagonal.y)
    assert np.isnan(curve.y[curve.x < 2e-4]).all()
    assert np.isfinite(curve.y[(curve.x > 2e-4) & (curve.x < 1e-3)]).all()
    assert motion.x[:4] == pytest.approx(5.2e-4 * 0.9 ** np.array([0, 1, 1, 2]))
    assert motion.y[:4] == pytest.approx(5.2e-4 * 0.9 ** np.array([1, 1, 2, 2]))
    (cycle,) = locked.markers
    assert (cycle.label, *cycle.x, *cycle.y) == ("attracts", *[pytest.approx(5.2e-4)] * 4)
    assert free.markers == ()
    assert NO_RETURN in figure_of("return-map", both_joints()).caption


def test_ringing_does_not_count_as_a_swing():
    case = fake_case(hunting=True)
    ringing = np.array([4e-4, 4.2e-4, -1e-4, -3e-4, -2e-4, 1e-4])
    turns = {"turning_time": ("turning_point", np.arange(6.0) + 1), "turning_deviation": ("turning_point", ringing)}
    case = replace(case, trace=case.trace.drop_vars(list(turns)).assign(turns))
    motion = figure_of("return-map", {"given": case}).panels[0].series[2]
    assert motion.x == pytest.approx([4.2e-4, 3e-4, 3e-4, 1e-4])
    assert motion.y == pytest.approx([3e-4, 3e-4, 1e-4, 1e-4])


# ---------------------------------------------------------------- report


@pytest.fixture(scope="module")
def page() -> str:
    """Return a page with its print images."""
    with patched({pages: {"image": blocks.image}}):
        return check_html(both_joints())


def test_report_opens_offline(page):
    parsed = Page(page)
    text = " ".join(" ".join(parsed.words).split())
    assert conclusion(both_joints()) in text
    assert page.count(plotly_renderer.script()) == 1
    assert [{*figure} for figure in packed_values(page)] == 7 * [{"data", "layout", "narrow", "bars", "config"}]
    assert "default-src 'none'" in page
    own = page.replace(plotly_renderer.script(), "")
    assert not re.findall(r"https?://[^\"'<> ]*", own)
    assert "sendChartToCloud" not in own
    assert len(parsed.loads) == 7  # a print of every figure
    for address in parsed.loads:
        assert base64.b64decode(address.removeprefix("data:image/png;base64,")).startswith(b"\x89PNG")


@pytest.mark.slow
def test_names_and_files_cannot_inject_markup():
    evil = '</script><script>alert("x")</script><img src=x onerror=alert(1)>'
    page = check_html(both_joints(evil))
    assert sorted(Page(page).tags) == sorted(Page(check_html(both_joints())).tags)
    assert evil in " ".join(Page(page).words)
    assert "&lt;script&gt;alert(" in page
    bare = check_html({key: replace(case, trace=None) for key, case in both_joints().items()})
    assert "<script" not in bare
    assert "±0.52 mm" in bare


def sentence(judgement: Judgement, cases: Any = None, **changes: Any) -> str:
    """All that is said of a made-up case, with the advice that its judgement leads to, and no more than three sentences
    before the details."""
    case = replace(fake_case(), judgement=judgement, **changes)
    faster, slower = advised(case.stage, judgement, case.unstable_bandwidths, None, 0.0)
    item, cases = ShownCase("given", "As given", "#000000", replace(case, faster=faster, slower=slower)), cases or {}
    says = verdict_sentence(item, {"given": case, **cases})
    assert len(re.findall(r"\.(?= [A-Z]|$)", says)) <= 3 + bool(case.unstable)
    return " ".join([says, *details_sentences(item, {"given": case, **cases})])


def after(fine: float | None, coarse: float | None) -> dict[str, Any]:
    """When a case settles to within 1 um and 10 um [s], at both ends alike."""
    times = {1e-6: fine, 1e-5: coarse}
    return {"settling_time": times, "in_the_end": times}


def growing(lower_gains: LowerGains, verdict: Verdict) -> Judgement:
    """Return a judgement for a force limit without anti-windup, with an attractor that was only observed."""
    if verdict == "settles":
        return settles(hunting=replace(fake_hunting(), lower_gains=lower_gains))
    swings = (Swing(8.9, 52.0, regular=True, swings=2),)
    hunting = replace(fake_hunting(reason="not closed", certain=False), observed=swings, lower_gains=lower_gains)
    return hunts(verdict=verdict, hunting=hunting, displacement=None, push=None, moves=None, observed=True)


Said = tuple[Judgement, dict[str, Any]]
PAIR = fake_cycle(symmetric=False, multiplier=1.0105)
REPELS = fake_hunting(fake_cycle(multiplier=-1.0112))
UNCERTAIN = fake_hunting(reason="no orbit could be closed", certain=False)
SURE, UNSURE = (Margin(1.2187, 9.7496, certain, 1.2248) for certain in (True, False))
BOTH: tuple[LoopState, ...] = ("sticks", "slides")


def ended(
    above: float | None, below: float | None = None, certain: bool = True, reserve: float = 0.01
) -> BandwidthWindow:
    """Return a range of bandwidths, as multiples of the stage's own."""
    first, last = (
        None if factor is None else AttractionEnd(factor, factor * (1 + way * reserve), certain)
        for factor, way in ((above, -1), (below, 1))
    )
    return BandwidthWindow(first, last)


def kicked(*ranges: tuple[float, float], unknown: int = 0) -> Judgement:
    """Return a judgement by which displacements within some of 0.01 to 100 mm hunt."""
    return hunts(displacement=Kick(ranges, (1e-5, 0.1), unknown=unknown))


def made_cases() -> dict[str, Said]:
    """Return judgements, and what else differs about their cases, by name.

    The edge of hunting lies at 9.75 Hz and the stage's own crossover at 8 Hz. No higher bandwidth is advised for a
    swing that grows beyond the force limit: such a loop is unstable (Hurwitz, docs/hunting.md).
    """
    free, locked = {"free": replace(fake_case(), judgement=settles())}, fake_stage(locked=True)
    none, away = Kick((), (1e-5, 0.1)), Kick(((6.22e-4, 0.03),), (3e-6, 0.03))
    transient = settles(
        verdict="transient", hunting=REPELS, settled_after=190.2, margin=Margin(0.975, 9.7496, True, 0.9842)
    )
    still = settles(verdict="transient", settled_after=None, followed=1e3)
    seen = hunts(hunting=fake_hunting(reason=NO_RETURN), margin=None, observed=True, lasting=1.04e-3, followed=1e3)
    some = hunts(verdict="bistable", push=none, moves=None, given_up=(CheckPart.STARTS,))
    restless = settles(verdict="transient", hunting=UNCERTAIN, settled_after=None)
    leaking, ramp, flat = fake_stage(), fake_stage(), fake_stage().flat()
    leaking.flat = lambda: {**flat, "controller.integral_leak": 0.05}
    ramp.flat = lambda: {**flat, "motion.velocity": 1e-3}
    coarse = {"settling_time": {1e-6: None, 1e-5: 2.0}, "stage": leaking}
    lower = AttractionEnd(0.505, 0.5004, True)
    given: dict[str, Judgement | Said] = {
        "hunts": hunts(),
        "hunts, unstable": (hunts(), {"unstable": BOTH}),
        "hunts, unstable while it slides": (hunts(), {"unstable": ("slides",)}),
        "hunts, free joint settles": (hunts(), {"stage": locked, "cases": free}),
        "hunts, joint is free": (hunts(), {"stage": fake_stage(locked=False), "cases": free}),
        "hunts, free joint is bistable": (
            hunts(),
            {"stage": locked, "cases": {"free": replace(fake_case(), judgement=hunts(verdict="bistable"))}},
        ),
        "hunts, free joint perhaps settles": (
            hunts(),
            {"stage": locked, "cases": {"free": replace(fake_case(), judgement=settles(hunting=UNCERTAIN))}},
        ),
        "hunts, no margin": (hunts(margin=None), {"stage": locked, "cases": free}),
        "hunts, gains": hunts(margin=Margin(1.22, None, True, 1.2315)),
        "hunts, observed": seen,
        "hunts, another cycle": hunts(hunting=fake_hunting(fake_cycle(), PAIR)),
        "hunts, of a whole period": hunts(hunting=fake_hunting(replace(PAIR, multiplier=-0.93, growth=np.nan))),
        "hunts, edge not certain": hunts(margin=UNSURE),
        "hunts, edge is near": hunts(margin=Margin(1.00001, 8.00008, True, 1.00002)),
        "hunts, again above": hunts(windows=(ended(5.0049),)),
        "hunts, perhaps again above": hunts(windows=(ended(5.0049, certain=False),)),
        "hunts, not below": hunts(lower=lower),
        "hunts, again closely below": hunts(lower=lower, windows=(ended(None, 0.45),)),
        "hunts, again soon above": hunts(margin=SURE, windows=(ended(1.3),)),
        "hunts, in a narrow range above": hunts(margin=SURE, windows=(ended(1.3, 1.302, False, 0.0),)),
        "hunts, in a range above": hunts(margin=SURE, windows=(ended(1.3, 1.32, False, 0.0),)),
        "hunts, seen at one value": hunts(windows=(ended(0.39685, 0.39685, False, 0.008),)),
        "hunts, loop unstable soon above": (hunts(), {"unstable_bandwidths": (ended(1.3),)}),
        "hunts, loop unstable at once": (hunts(), {"unstable_bandwidths": (ended(1.2),)}),
        "hunts, loop unstable below": (hunts(lower=lower), {"unstable_bandwidths": (ended(None, 0.502),)}),
        "hunts, bandwidths given up": hunts(given_up=(CheckPart.BANDWIDTHS,)),
        "hunts, bandwidths of no sure edge given up": hunts(given_up=(CheckPart.BANDWIDTHS,), margin=UNSURE),
        "hunts, lower ones given up": hunts(given_up=(CheckPart.LOWER_BANDWIDTHS,), margin=None),
        "hunts, no kick": kicked(),
        "hunts, every kick": kicked((1e-5, 0.1)),
        "hunts, some kicks": kicked((1e-5, 2e-3), (3e-3, 4e-3)),
        "hunts, many ranges of kicks": kicked(*((i * 1e-3, i * 1e-3 + 5e-4) for i in range(1, 8))),
        "hunts, kicks not determined": kicked(unknown=3),
        "hunts, kicks given up": kicked((1e-3, 2e-3), unknown=3),
        "hunts, without peaks": (hunts(), {"peaks": 0, "stage": fake_stage(duration=10.5)}),
        "hunts, ends before peaks count": (hunts(), {"peaks": 0, "stage": fake_stage(duration=10.0)}),
        "bistable": hunts(verdict="bistable"),
        "bistable, no kick starts it": hunts(verdict="bistable", displacement=none, push=none, moves=None),
        "bistable, kicks given up": some,
        "bistable, all kicks given up": replace(some, displacement=Kick((), (1e-5, 0.1), unknown=3)),
        "bistable, unmoved": (hunts(verdict="bistable"), {"unmoved": True, "largest_force": 2.44}),
        "hunts, grows": growing("unstable", "hunts"),
        "hunts, may grow": growing("unknown", "hunts"),
        "bistable, grows": growing("unstable", "bistable"),
        "bistable, may grow": growing("unknown", "bistable"),
        "bistable, may die out": growing("stable", "bistable"),
        "settles, may run away": growing("unstable", "settles"),
        "settles, runs away": replace(growing("unstable", "settles"), running_away=away),
        "settles, not known whether it may": growing("unknown", "settles"),
        "runs away": (settles(verdict="failed"), {"unstable": ("slides",), "runs_away": True}),
        "runs away, unstable": (settles(verdict="failed"), {"unstable": BOTH, "runs_away": True}),
        "transient": (transient, {"peak_to_peak": 6.9e-4, "period": 1.33, "peaks": 8}),
        "transient, at rest": (still, {"peak_to_peak": 1e-7}),
        "transient, unstable": (restless, {"unstable": BOTH}),
        "transient, uncertain": settles(verdict="transient", hunting=UNCERTAIN),
        "transient, runs away": (replace(still, followed=None, running_away=away), {"runs_away": True}),
        "transient, longer run given up": (replace(still, followed=None), {"peak_to_peak": 1e-7}),
        "transient, cannot hunt": (cannot_hunt("transient"), {"peak_to_peak": 0.383, "period": 6.36}),
        "settles": settles(),
        "settles, repels": settles(hunting=REPELS),
        "settles, no margin": settles(margin=None),
        "settles, gains": settles(margin=Margin(0.5, None, True, 0.5047)),
        "settles, edge to 0.3 %": settles(margin=Margin(0.6998, 5.598, True, 0.6998 * 1.0028)),
        "settles, edge not certain": settles(margin=replace(UNSURE, factor=0.91234, crossover=7.29872, quiet=0.92)),
        "settles, hunts above": settles(windows=(ended(3.93),)),
        "settles, loop unstable above": (settles(windows=(ended(3.93),)), {"unstable_bandwidths": (ended(3.893),)}),
        "settles, loop unstable below": (settles(), {"unstable_bandwidths": (ended(None, 0.6998),)}),
        "settles, cannot hunt": cannot_hunt(),
        "settles, coarsely": (settles(), after(None, 1.5)),
        "settles, band not reached": (settles(), {**after(None, None), "peak_to_peak": 7e-5}),
        "settles, finely at the return alone": (settles(), {"settling_time": {1e-6: None, 1e-5: 1.5}}),
        "settles, at the return alone": (settles(), {"settling_time": {1e-6: None, 1e-5: None}}),
        "settles, held off by a leak": (settles(), {**coarse, "offset": 7e-6, "in_the_end": {1e-6: None, 1e-5: 2.0}}),
        "settles, late in spite of a leak": (
            settles(),
            {**coarse, "offset": 2e-7, "in_the_end": {1e-6: 4.0, 1e-5: 2.0}},
        ),
        "settles, uncertain": settles(hunting=UNCERTAIN),
        "settles, unmoved": (settles(), {"unmoved": True, "largest_force": 2.9996}),
        "settles, never pushed": (settles(), {"unmoved": True, "largest_force": 0.0, **after(0.0, 0.0)}),
        "failed": (settles(verdict="failed"), {"solver": fake_solver("failed")}),
        "failed, the longer run": settles(verdict="failed"),
        **{
            f"slides, {lasts}, {sticks}": (
                settles(verdict="none"),
                {"stick_slip": StickSlipSpeeds(lasts, sticks, 1e-6, None, (), (1e-3, 1e-3), 0), "stage": ramp},
            )
            for lasts, sticks in ((True, True), (True, False), (False, False), (None, False))
        },
    }
    return {name: (one, {}) if isinstance(one, Judgement) else one for name, one in given.items()}


def tabled(judgement: Judgement, cases: Any = None, **changes: Any) -> dict[str, str | None]:
    """The rows of a case."""
    case = replace(fake_case(), judgement=judgement, **changes)
    item = ShownCase("given", "As given", "#000000", case)
    table = {name: texts[0] for name, texts in [*rows((item,)), *rows_behind((item,))]}
    assert case_document(case)["verdict_in_short"] == table["Verdict"]
    return table


def test_sentences_and_rows(snapshots: Snapshots) -> None:
    """Of most cases the rows are kept that differ from those of a stage that hunts, or settles."""
    texts, cases = {}, made_cases()
    usual = {name: tabled(cases[name][0]) for name in ("hunts", "settles")}
    for name, (judgement, changes) in cases.items():
        texts[name] = sentence(judgement, **changes)
        like = {} if name in usual else usual["hunts" if judgement.verdict in ("hunts", "bistable") else "settles"]
        table = tabled(judgement, **changes)
        texts[name] += "".join(f"\n    {row}: {text}" for row, text in table.items() if like.get(row, "none") != text)
    snapshots.check("check", "sentences", "\n".join(f"{name}: {text}" for name, text in texts.items()))


def test_what_a_check_leaves_open_for_its_work_goes_with_commands_that_go_on() -> None:
    for given_up in ((), (CheckPart.BANDWIDTHS,), (CheckPart.FRICTION,)):
        says = " ".join(answer({"given": replace(fake_case(), judgement=settles(given_up=given_up))}))
        assert all((f"friso {command}" in says) == bool(given_up) for command in ("boundary", "map", "simulate"))


def test_conclusion_names_what_the_joint_does(snapshots: Snapshots) -> None:
    hunting, settled = both_joints()["locked"], both_joints()["free"]
    bistable, failed = (replace(settled, judgement=hunts(verdict=word)) for word in ("bistable", "failed"))
    pairs = [(hunting, settled), (hunting, hunting), (hunting, bistable), (settled, bistable)]
    said = [str(conclusion({"locked": locked, "free": free})) for locked, free in pairs]
    snapshots.check("check", "conclusions", "\n".join(said))
    for none in ({"locked": settled, "free": settled}, {"given": hunting}, {"locked": hunting, "free": failed}):
        assert conclusion(none) is None


def uncertain(case: Any) -> Any:
    return replace(case, judgement=replace(case.judgement, hunting=replace(case.judgement.hunting, certain=False)))


@pytest.mark.parametrize(("locked", "free"), [("locked", "free"), ("free", "locked"), ("locked", "locked")])
def test_no_conclusion_from_a_case_that_is_not_certain(locked: str, free: str) -> None:
    cases = {"locked": both_joints()[locked], "free": both_joints()[free]}
    assert conclusion(cases)
    assert conclusion({**cases, "locked": uncertain(cases["locked"])}) is None
    assert conclusion({**cases, "free": uncertain(cases["free"])}) is None


@pytest.mark.slow
@given(st.floats(0.02, 50), st.floats(6e-4, 9e-3))
@example(1.00499 / 8, 5.085e-3)
def test_an_edge_lies_where_it_is_told(factor: float, reserve: float) -> None:
    """The stated range contains the known range, including rounding."""
    case = replace(fake_case(), judgement=settles())
    assert case.judgement.margin
    edge = factor * case.judgement.margin.crossover / case.judgement.margin.factor
    text = edge_text(case, AttractionEnd(factor, factor * (1 + reserve), True))
    value, unit, share = re.search(r"([\d.]+) (m?Hz) \(± ([\d.]+) %\)", text).groups()
    centre, bound = float(value) * (1e-3 if unit == "mHz" else 1.0), float(share) / 100
    for end in (1 - reserve, 1 + reserve):
        assert abs(edge * end / centre - 1) <= bound * (1 + 1e-6) + 2e-6


def test_a_table_leaves_out_rows_of_zeros_and_dashes() -> None:
    rows = [("Edge", ["–", "–"]), ("Cells", ["0", "–"]), ("Peaks", ["0", "2"]), ("Verdict", ["0 of 5", "–"])]
    assert [name for name, _ in AnswerBlock(rows=rows).rows] == ["Peaks", "Verdict"]


@pytest.mark.slow
def test_the_thesis_s_peaks_are_spoken_of_only_where_some_are_counted(rig: Stage) -> None:
    """A run of 6 s ends before any peak counts."""
    short = rig.replace({"joint.locked": True, "motion.duration": "6 s"})
    for stage, counted in ((short, False), (rig.replace({"joint.locked": True}), True)):
        page = friso.check(stage).files()["report.html"]
        assert ("higher than 0.1 mm" in page) is counted


def test_the_template_is_the_user_s_own(tmp_path: Path) -> None:
    assert not friso.load(friso.init(tmp_path / "mine.toml")).source
