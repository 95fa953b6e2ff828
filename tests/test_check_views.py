"""Test what a check shows: its figures, sentences, table and page, on made-up cases."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
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
from friso.questions.check.figures import check_figures, response_figure
from friso.questions.check.words import answer, conclusion, details_sentences, edge_text, verdict_sentence
from friso.shown import files, pages
from friso.shown.cases import COLOURS, ShownCase, shown_cases
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.drawable import drawable
from friso.shown.drawing.figure import Figure
from friso.shown.loop_words import UNSTABLE_AS_BUILT
from friso.shown.motion_words import stick_slip_sentences
from friso.shown.pages import made_with
from friso.version import VERSION

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
    colours = {
        (drawn.label.split(" ")[0], drawn.colour)
        for figure in figures.values()
        for panel in figure.panels
        for drawn in (*panel.series, *panel.markers)
        if drawn.label.startswith(("Locked", "Free"))
    }
    assert colours == {("Locked", COLOURS["locked"]), ("Free", COLOURS["free"])}
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
    assert case.trace is not None
    case.trace["force_i"][:] = 0.0
    assert [line.label for line in figure_of("shares", {"given": case}).panels[0].series] == ["P", "D", "total"]
    near, far = (fake_case(hunting=True, stage=fake_stage(force_limit=bound)) for bound in (6.0, 200.0))
    panel = figure_of("overview", {"given": near}).panels[1]
    assert panel.limits[0].values == (-6.0, 6.0)
    assert panel.y.limits is not None
    assert panel.y.limits[1] > 6.0
    assert figure_of("overview", {"given": far}).panels[1].limits == ()


def test_a_cart_that_rests_is_a_point():
    cases = both_joints() | {"free": fake_case(stage=fake_stage(locked=False), kind="hold")}
    panel = check_figures(cases)[-1].panels[0]
    assert [marker.label for marker in panel.markers] == ["Free (as given): at rest"]
    figures = check_figures({"given": fake_case(kind="hold")})
    panel = figures[-1].panels[0]
    assert (len(panel.series), len(panel.markers)) == (0, 1)
    panel = drawable(figures[0]).panels[0]
    assert panel.y.limits == pytest.approx((-1.0, 1.0))  # noise of the solver does not fill it
    assert panel.y.unit == "µm"
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
    assert "nothing is shaded" in figure.caption
    even = figure_of("return-map", both_joints())
    assert even.panels[0].bands
    assert "nothing is shaded" not in even.caption
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
    assert case.trace is not None
    ringing = np.array([4e-4, 4.2e-4, -1e-4, -3e-4, -2e-4, 1e-4])
    turns = {"turning_time": ("turning_point", np.arange(6.0) + 1), "turning_deviation": ("turning_point", ringing)}
    case = replace(case, trace=case.trace.drop_vars(list(turns)).assign(turns))
    motion = figure_of("return-map", {"given": case}).panels[0].series[2]
    assert motion.x == pytest.approx([4.2e-4, 3e-4, 3e-4, 1e-4])
    assert motion.y == pytest.approx([3e-4, 3e-4, 1e-4, 1e-4])


def test_cycles_that_attract_are_solid_and_others_dashed():
    both = fake_hunting(fake_cycle(), fake_cycle(symmetric=False, multiplier=1.02, apart=1e-4))
    cases = {"given": replace(fake_case(hunting=True), judgement=hunts(hunting=both))}
    attracts, repels = figure_of("return-map", cases).panels[0].markers
    assert (attracts.label, attracts.symbol, repels.label, repels.symbol) == ("attracts", "target", "repels", "cross")
    assert sorted(repels.x) == pytest.approx([4.7e-4, 5.7e-4])
    position, force, loop = figure_of("cycle", cases).panels
    assert [line.label for line in position.series] == ["attracts", "cart", "repels", "cart"]
    assert [line.dash for line in position.series] == ["solid", "solid", "dashed", "dashed"]
    assert [line.dash for line in force.series] == [line.dash for line in loop.series] == ["solid", "dashed"]
    for name in ("return-map", "cycle"):
        assert same(mpl_arrays(figure_of(name, cases)), plotly_arrays(figure_of(name, cases)))


def test_response_of_one_run():
    figure = response_figure(fake_trace())
    titles = ["Error", "Position", "Actuator force", "Joint deflection"]
    assert [panel.title for panel in figure.panels] == titles
    assert figure.subject == "Thesis rig"
    assert same(mpl_arrays(figure), plotly_arrays(figure))


# ---------------------------------------------------------------- report


@pytest.fixture(scope="module")
def page() -> str:
    """Return a page with its print images."""
    with patched({pages: {"image": files.image}}):
        return check_html(both_joints())


@pytest.mark.slow
def test_report_says_the_verdict_first_and_opens_offline(page):
    parsed = Page(page)
    text = " ".join(" ".join(parsed.words).split())
    locked, free = text.index("±0.52 mm every 1.63 s"), text.index("1 µm in 823 ms")
    assert locked < free < text.index("Counted peaks") < text.index('name = "Thesis rig"')
    assert conclusion(both_joints()) in text
    assert made_with().startswith(VERSION)  # then what other tests have registered
    assert made_with() in text
    assert "1e-06" in text
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


def sentence(judgement: Judgement, cases: Any = None, locked: bool | None = None, **changes: Any) -> str:
    """All that is said of a made-up case, with the advice that its judgement leads to, and no more than three sentences
    before the details."""
    case = replace(fake_case(stage=fake_stage(locked=locked)), judgement=judgement, **changes)
    faster, slower = advised(case.stage, judgement, case.unstable_bandwidths, None, 0.0)
    item, cases = ShownCase("given", "As given", "#000000", replace(case, faster=faster, slower=slower)), cases or {}
    says = verdict_sentence(item, {"given": case, **cases})
    assert len(re.findall(r"\.(?= [A-Z]|$)", says)) <= 3 + bool(case.unstable or case.unstable_as_built)
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


def said_by_name() -> dict[str, str]:
    """Return what is said about stages that differ in one respect, by name."""
    free = {"free": replace(fake_case(), judgement=settles())}
    none, away = Kick((), (1e-5, 0.1)), Kick(((6.22e-4, 0.03),), (3e-6, 0.03))
    repels = fake_hunting(fake_cycle(multiplier=-1.0112))
    uncertain = fake_hunting(reason="no orbit could be closed", certain=False)
    faster, slower = Margin(1.22, None, True, 1.2315), Margin(0.5, None, True, 0.5047)
    transient = settles(
        verdict="transient", hunting=repels, settled_after=190.2, margin=Margin(0.975, 9.7496, True, 0.9842)
    )
    still = settles(verdict="transient", settled_after=None, followed=1e3)
    seen = hunts(hunting=fake_hunting(reason=NO_RETURN), margin=None, observed=True, lasting=1.04e-3, followed=1e3)
    return {
        "hunts": sentence(hunts()),
        "hunts, unstable": sentence(hunts(), unstable=("sticks", "slides")),
        "hunts, free joint settles": sentence(hunts(), free, locked=True),
        "hunts, no margin": sentence(hunts(margin=None), free, locked=True),
        "hunts, gains": sentence(hunts(margin=faster)),
        "hunts, observed": sentence(seen),
        "bistable": sentence(hunts(verdict="bistable")),
        "bistable, no kick starts it": sentence(hunts(verdict="bistable", displacement=none, push=none, moves=None)),
        "hunts, grows": sentence(growing("unstable", "hunts")),
        "hunts, may grow": sentence(growing("unknown", "hunts")),
        "bistable, grows": sentence(growing("unstable", "bistable")),
        "bistable, may grow": sentence(growing("unknown", "bistable")),
        "bistable, may die out": sentence(growing("stable", "bistable")),
        "settles, may run away": sentence(growing("unstable", "settles")),
        "settles, runs away": sentence(replace(growing("unstable", "settles"), running_away=away)),
        "settles, not known whether it may": sentence(growing("unknown", "settles")),
        "runs away": sentence(settles(verdict="failed"), unstable=("slides",), runs_away=True),
        "transient": sentence(transient, peak_to_peak=6.9e-4, period=1.33),
        "transient, at rest": sentence(still, peak_to_peak=1e-7),
        "transient, runs away": sentence(replace(still, followed=None, runs_away=True, running_away=away)),
        "transient, longer run given up": sentence(replace(still, followed=None), peak_to_peak=1e-7),
        "transient, cannot hunt": sentence(cannot_hunt("transient"), peak_to_peak=0.383, period=6.36),
        "settles": sentence(settles()),
        "settles, no margin": sentence(settles(margin=None)),
        "settles, gains": sentence(settles(margin=slower)),
        "settles, cannot hunt": sentence(cannot_hunt()),
        "settles, coarsely": sentence(settles(), **after(None, 1.5)),
        "settles, band not reached": sentence(settles(), **after(None, None), peak_to_peak=7e-5),
        "settles, finely at the return alone": sentence(settles(), settling_time={1e-6: None, 1e-5: 1.5}),
        "settles, at the return alone": sentence(settles(), settling_time={1e-6: None, 1e-5: None}),
        "settles, uncertain": sentence(settles(hunting=uncertain)),
        "failed": sentence(settles(verdict="failed"), solver=fake_solver("failed")),
        "failed, the longer run": sentence(settles(verdict="failed")),
    }


def test_sentences(snapshots: Snapshots) -> None:
    """No higher bandwidth is advised for a swing that grows beyond the force limit: such a loop is unstable (Hurwitz,
    docs/hunting.md), and a faster one even more so. A loop that is unstable comes before what friction makes of it."""
    texts = said_by_name()
    assert len({*texts.values()}) == len(texts)
    snapshots.check("check", "sentences", "\n".join(f"{name}: {text}" for name, text in texts.items()))
    assert not any("Hz" in texts[name] for name in ("hunts, grows", "bistable, grows"))
    assert texts["hunts, unstable"].index("unstable") < texts["hunts, unstable"].index("±0.52 mm")


def test_freeing_the_joint_is_advised_only_where_the_free_joint_certainly_settles():
    free = {"free": replace(fake_case(), judgement=settles())}
    assert "joint" in sentence(hunts(), free, locked=True)
    assert "joint" not in sentence(hunts(), free, locked=False)
    for other in (hunts(verdict="bistable"), settles(hunting=fake_hunting(certain=False)), settles(verdict="failed")):
        assert "joint" not in sentence(hunts(), {"free": replace(fake_case(), judgement=other)}, locked=True)


def tabled(judgement: Judgement, **changes: Any) -> dict[str, str | None]:
    """The rows of a case."""
    item = ShownCase("given", "As given", "#000000", replace(fake_case(), judgement=judgement, **changes))
    return {name: texts[0] for name, texts in [*rows((item,)), *rows_behind((item,))]}


PAIR = fake_cycle(symmetric=False, multiplier=1.0105)
REPELS = fake_hunting(fake_cycle(multiplier=-1.0112))
UNCERTAIN = fake_hunting(reason="no orbit could be closed", certain=False)
AMPLITUDE, CONSTANT, MULTIPLIER = "Hunting cycle, amplitude", "Hunting cycle, time constant", "Hunting multiplier"
EDGE, TAKEN, PEAKS = "Edge of hunting", "Multiplier taken over", "Counted peaks"
WHOLE = hunts(hunting=fake_hunting(replace(PAIR, multiplier=-0.93, growth=np.nan)))
SURE, UNSURE = (Margin(1.2187, 9.7496, certain, 1.2248) for certain in (True, False))


UNDELAYED = settles(hunting=replace(fake_hunting(), certain=False, reason=UNSTABLE_AS_BUILT))
RESTLESS = settles(verdict="transient", hunting=UNCERTAIN, settled_after=None)
BOTH: tuple[LoopState, ...] = ("sticks", "slides")


@pytest.mark.parametrize(
    ("judgement", "changes", "words"),
    [
        (hunts(), {"unstable": BOTH}, "unstable; hunts"),
        (hunts(), {"unstable": ("slides",)}, "unstable while it slides; hunts"),
        (RESTLESS, {"unstable": BOTH}, "unstable"),
        (settles(verdict="failed"), {"unstable": BOTH, "runs_away": True}, "unstable; runs away"),
        (UNDELAYED, {"unstable_as_built": BOTH}, "unstable with its delay; without: settles"),
        (settles(hunting=UNCERTAIN), {"unstable_as_built": ("sticks",)}, "without: settles (not certain)"),
    ],
)
def test_sentence_table_and_document_agree_on_an_unstable_loop(judgement: Judgement, changes: Any, words: str) -> None:
    """The loop comes first everywhere; friction is not said to hunt, nor not to, where the loop decides."""
    case = replace(fake_case(), judgement=judgement, **changes)
    verdict = tabled(judgement, **changes)["Verdict"]
    assert verdict is not None
    assert words in verdict
    assert case_document(case)["verdict_in_short"] == verdict
    says = sentence(judgement, **changes)
    assert "unstable" in says
    assert ("hunt" in says.lower()) == (judgement.verdict == "hunts")


@pytest.mark.parametrize(
    ("lasts", "sticks", "words"),
    [
        (True, True, "sticks and slips"),
        (True, False, "swings about its reference"),
        (False, False, "slides smoothly"),
        (None, False, "no verdict"),
    ],
)
def test_sentence_and_table_agree_on_steady_sliding(lasts: bool | None, sticks: bool, words: str) -> None:
    speeds = StickSlipSpeeds(lasts, sticks, 1e-6, None, (), (1e-3, 1e-3), 0)
    assert words in str(tabled(settles(verdict="none"), stick_slip=speeds)["Verdict"])
    assert words in stick_slip_sentences(speeds, 1e-3)[0] or lasts is None


@pytest.mark.cases(first=10)
@pytest.mark.parametrize(
    ("judgement", "name", "words"),
    [
        (hunts(), "Verdict", "hunts"),
        (hunts(), AMPLITUDE, "±0.52 mm"),
        (hunts(), "Hunting cycle, period", "1.628 s"),
        (hunts(), CONSTANT, "11.4 s"),
        (hunts(), EDGE, "9.75 Hz (± 0.6 %)"),
        (hunts(), "Pushes that hunt", "23.1 to 73.4 mm/s"),
        (hunts(), "Moves that end in hunting", "87 % (80 to 92 %) of 128"),
        (hunts(), "Moves tried", "10.0 to 200 m/s² and acceleration time 3.00 to 60.0 ms"),
        (hunts(), MULTIPLIER, "-0.9312 (simulated: -0.9311)"),
        (hunts(), TAKEN, "half a period"),
        (hunts(hunting=fake_hunting(fake_cycle(), PAIR)), "Other hunting cycles", "asymmetric, ±0.52 mm, repels"),
        (settles(hunting=REPELS), AMPLITUDE, "±0.52 mm (repels)"),
        (settles(hunting=REPELS), MULTIPLIER, "-1.0112"),
        (settles(verdict="transient", hunting=REPELS), CONSTANT, None),  # of transients it is another
        (settles(hunting=UNCERTAIN), "Verdict", "settles (not certain)"),
        (WHOLE, CONSTANT, "22.4 s"),
        (WHOLE, TAKEN, "a whole period"),
        (hunts(margin=Margin(1.22, None, True, 1.2315)), EDGE, "1.22 times this bandwidth (± 1 %)"),
        (hunts(margin=UNSURE), EDGE, "9.749 Hz and 9.799 Hz (not certain)"),
        (settles(margin=Margin(0.6998, 5.598, True, 0.6998 * 1.0028)), EDGE, "5.598 Hz (± 0.3 %)"),
    ],
)
def test_rows_of_a_case(judgement: Judgement, name: str, words: str | None) -> None:
    row = tabled(judgement).get(name)
    assert row is None if words is None else words in (row or "")


@pytest.mark.parametrize(
    ("kick", "words"),
    [
        (hunts().displacement, "1.72 to 10.8 mm, 22.7 to 43.3 mm, from 59.3 mm on (tried: 0.0173 to 156 mm)"),
        (Kick((), (1e-5, 0.1)), "none from 0.0100 to 100 mm"),
        (Kick(((1e-5, 0.1),), (1e-5, 0.1)), "all that were tried, 0.0100 to 100 mm"),
        (Kick(((1e-5, 2e-3), (3e-3, 4e-3)), (1e-5, 0.1)), "up to 2.00 mm, 3.00 to 4.00 mm (tried"),
        (Kick(tuple((i * 1e-3, i * 1e-3 + 5e-4) for i in range(1, 8)), (1e-5, 0.1)), "4.50 mm, and 3 more ranges"),
        (Kick((), (1e-5, 0.1), unknown=3), "not determined"),
        (Kick(((1e-3, 2e-3),), (1e-5, 0.1), unknown=3), "1.00 to 2.00 mm (3 runs were given up)"),
    ],
)
def test_windows_of_kicks(kick: Kick, words: str) -> None:
    assert words in (tabled(hunts(displacement=kick))["Displacements that hunt"] or "")


@pytest.mark.parametrize(
    ("judgement", "peaks", "words"),
    [
        (hunts(), 0, "0 (the thesis counts peaks from 10 s on, if higher than 100 µm)"),
        (hunts(verdict="bistable"), 0, "0 (another motion hunts)"),
        (settles(verdict="transient"), 8, "8 (a long transient)"),
        (settles(), 0, "0"),
    ],
)
def test_a_peak_count_that_contradicts_the_verdict_is_explained(judgement: Judgement, peaks: int, words: str) -> None:
    assert tabled(judgement, peaks=peaks)[PEAKS] == words


def test_kicks_that_start_hunting_are_told_where_others_were_given_up() -> None:
    none = Kick((), (1e-5, 0.1), unknown=3)
    some = hunts(verdict="bistable", push=none, moves=None, given_up=(CheckPart.STARTS,))
    assert "1.72 mm" in sentence(some)
    assert "which ones do was not determined" in sentence(replace(some, displacement=none))


def test_what_a_search_left_open_depends_on_whether_the_edge_is_sure() -> None:
    sure = hunts(given_up=(CheckPart.BANDWIDTHS,))
    assert sure.margin is not None
    unsure = replace(sure, margin=replace(sure.margin, certain=False))
    assert "other bandwidths" in sentence(sure)
    assert "other bandwidths" not in sentence(unsure)
    everywhere = sentence(replace(sure, margin=None, given_up=(CheckPart.LOWER_BANDWIDTHS,)))
    assert "still possible at 10 times" in everywhere
    assert "lower bandwidths" in everywhere


def test_what_a_check_leaves_open_for_its_work_goes_with_commands_that_go_on() -> None:
    """No command is named where nothing was left open."""
    commands = ["friso boundary", "friso map", "friso simulate"]
    for given_up in ((), (CheckPart.BANDWIDTHS,), (CheckPart.FRICTION,)):
        says = " ".join(answer({"given": replace(fake_case(), judgement=settles(given_up=given_up))}))
        assert [command for command in commands if command in says] == (commands if given_up else [])


def test_no_peak_counts_in_a_run_that_ends_before() -> None:
    whole, short = (tabled(hunts(), peaks=0, stage=fake_stage(duration=end)) for end in (10.5, 10.0))
    assert (whole["Counted peaks"] or "").startswith("0 ")
    assert "Counted peaks" not in short


def test_conclusion_names_what_the_joint_does(snapshots):
    hunting, settled = both_joints()["locked"], both_joints()["free"]
    bistable, failed = (replace(settled, judgement=hunts(verdict=word)) for word in ("bistable", "failed"))
    named = {
        "stops": conclusion({"locked": hunting, "free": settled}),
        "does not stop": conclusion({"locked": hunting, "free": hunting}),
        "bistable": conclusion({"locked": hunting, "free": bistable}),
        "only free": conclusion({"locked": settled, "free": bistable}),
    }
    assert len({*named.values()}) == len(named)
    snapshots.check("check", "conclusions", "\n".join(f"{name}: {text}" for name, text in named.items()))
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


def test_an_uncertain_edge_is_told_as_an_interval_and_advice_lies_beyond_it() -> None:
    """8 Hz: something attracts at 9.7496 Hz, nothing at 9.7984 Hz; 1.2 times that is rounded upward."""
    for edge in (SURE, UNSURE):
        assert "crossover 11.8 Hz" in sentence(hunts(margin=edge))
        assert ("(not certain: hunting was found up to 9.749 Hz)" in sentence(hunts(margin=edge))) != edge.certain
    below = sentence(settles(margin=replace(UNSURE, factor=0.91234, crossover=7.29872, quiet=0.92)))
    assert "7.298 Hz" in below
    assert "7.360 Hz" in below
    near = sentence(hunts(margin=Margin(1.00001, 8.00008, True, 1.00002)))
    assert "0.00016 Hz" not in near
    assert "by 0 Hz" not in near
    assert "5.598 Hz (± 0.3 %)" in sentence(settles(margin=Margin(0.6998, 5.598, True, 0.6998 * 1.0028)))


def test_windows_are_told_beside_the_edge() -> None:
    """From 8 Hz, the stage hunts again above 40.0 Hz (± 1 %), and not below 4.04 Hz: 4 Hz settles, and 3.33 Hz is
    advised, 1/1.2 of it. Where it hunts again closely below, 4 Hz is advised. All are rounded down."""
    window, lower = AttractionEnd(5.0049, 4.96, True), AttractionEnd(0.505, 0.5004, True)
    assert "40.0 Hz" in sentence(hunts(windows=(BandwidthWindow(window, None),)))
    assert "crossover 3.33 Hz" in sentence(hunts(lower=lower))
    again = BandwidthWindow(None, AttractionEnd(0.45, 0.46, True))
    assert "crossover 4.00 Hz" in sentence(hunts(lower=lower, windows=(again,)))
    soon = BandwidthWindow(AttractionEnd(1.3, 1.29, True), None)  # 10.4 Hz: no room for a distance from the edge
    assert "crossover 9.80 Hz" in sentence(hunts(margin=SURE, windows=(soon,)))
    for low, high, to in ((1.3, 1.302, "11.8 Hz"), (1.3, 1.32, "9.80 Hz")):
        narrow = BandwidthWindow(AttractionEnd(low, low, False), AttractionEnd(high, high, False))
        says = sentence(hunts(margin=SURE, windows=(narrow,)))
        assert f"crossover {to}" in says
        assert ("within a range" in says) == (high == 1.302)
    one = BandwidthWindow(AttractionEnd(0.39685, 0.393, False), AttractionEnd(0.39685, 0.4, False))  # seen at one value
    says = sentence(hunts(windows=(one,)))
    assert "0 %" not in says.replace("10 %", "")
    assert "within a range of at most 1.8 % about" in says
    unsure = sentence(hunts(windows=(BandwidthWindow(replace(window, certain=False), None),)))
    assert "39.68 Hz" in unsure
    assert "40.04 Hz" in unsure


def test_where_the_loop_is_unstable_friction_is_not_said_to_make_the_stage_hunt() -> None:
    """From 8 Hz, the loop is unstable above 31.1 Hz; what attracts from 31.4 Hz (± 1 %) on is due to that."""
    hunting = BandwidthWindow(AttractionEnd(3.93, 3.89, True), None)
    lost = BandwidthWindow(AttractionEnd(3.893, 3.8929, True), None)
    says = sentence(settles(windows=(hunting,)), unstable_bandwidths=(lost,))
    assert "31.14 Hz" in says
    assert "31.4 Hz" not in says
    assert "31.4 Hz" in sentence(settles(windows=(hunting,)))
    below = BandwidthWindow(None, AttractionEnd(0.6998, 0.7064, True))
    assert sentence(settles(), unstable_bandwidths=(below,)).count("5.60 Hz") == 1  # not as the edge of hunting, too


def test_a_leak_is_told_only_where_it_holds_the_stage_off() -> None:
    """Beyond 1 um for good; a far end that is missed in time, or a swing, has another reason."""
    stage = fake_stage()
    stage.flat = lambda: {"controller.integral_leak": 0.05}
    coarse = {"settling_time": {1e-6: None, 1e-5: 2.0}}
    held = sentence(settles(), stage=stage, offset=7e-6, in_the_end={1e-6: None, 1e-5: 2.0}, **coarse)
    assert "rests 7.00 µm off its reference: the leak" in held
    far = sentence(settles(), stage=stage, offset=2e-7, in_the_end={1e-6: 4.0, 1e-5: 2.0}, **coarse)
    assert "leak" not in far
    assert "at the far end" in far


def test_no_bandwidth_is_advised_at_which_the_loop_is_unstable() -> None:
    """The edge of hunting lies at 9.75 Hz: with an unstable loop from 10.4 Hz on no distance is kept from it, and with
    one from 9.6 Hz on no bandwidth above it is advised."""
    soon, at_once = (BandwidthWindow(AttractionEnd(low, 0.999 * low, True), None) for low in (1.3, 1.2))
    says = sentence(hunts(), unstable_bandwidths=(soon,))
    assert "crossover 9.80 Hz" in says
    assert "just beyond" in says
    assert "crossover 9.80 Hz" not in sentence(hunts(), unstable_bandwidths=(at_once,))
    assert "crossover 11.8 Hz" in sentence(hunts())
    lower = AttractionEnd(0.5047, 0.5, True)
    below = BandwidthWindow(None, AttractionEnd(0.502, 0.5025, True))
    assert "crossover 3.33 Hz" in sentence(hunts(lower=lower))
    assert "crossover 3.33 Hz" not in sentence(hunts(lower=lower), unstable_bandwidths=(below,))


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


def test_a_motion_that_does_not_break_the_stage_away_says_so() -> None:
    for judgement in (settles(), hunts(verdict="bistable")):
        unmoved, moved = (sentence(judgement, unmoved=held, largest_force=2.44) for held in (True, False))
        assert "without breaking away (it exerts at most 2.44 N; break-away takes 3.00 N)" in unmoved
        assert "2.44 N" not in moved
    still = sentence(settles(), unmoved=True, largest_force=0.0, **after(0.0, 0.0))
    assert "ends within 1 µm of its reference without breaking away" in still
    assert "0 s" not in still
    hardly = sentence(settles(), unmoved=True, largest_force=2.9996)
    assert "(it exerts at most 2.9996 N; break-away takes 3.0000 N)" in hardly
    assert "no cycle attracts" not in sentence(settles(verdict="transient", hunting=UNCERTAIN))
