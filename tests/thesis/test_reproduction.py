"""The reproduction of the thesis: its studies as data, its judges on maps made to hold and to fail, its page."""

import json
import re
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass, replace
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, cast, get_type_hints

import numpy as np
import pytest
import xarray as xr
from inside import friso_inside
from made_maps import Cells, made
from patched import patched
from rig_evidence import HUNTS, grid, loops, moves, rail_runs, standstill, traces
from rig_evidence import cycles as rail_cycles
from snapshots import Snapshots

import friso
from friso.cli.app import COMMANDS
from friso.equations.motion import size
from friso.hunting import find_margin
from friso.interface.output_folder import UNFINISHED
from friso.intervals import share
from friso.studies.study import _DECISIVE
from friso_thesis.questions.reproduce.document import reproduce_document
from friso_thesis.questions.reproduce.figures import reproduction_figures
from friso_thesis.questions.reproduce.page import COLOURS, reproduce_files, reproduce_html
from friso_thesis.questions.reproduce.questions import QUESTIONS
from friso_thesis.questions.reproduce.summary import summary_sheet
from friso_thesis.studies import kept_work
from friso_thesis.studies.kept_work import keep_arrays, kept_arrays
from friso_thesis.studies.rig.experiments import RIG_EXPERIMENTS
from friso_thesis.studies.rig.moves_on_rails import RailRuns, distance
from friso_thesis.studies.thesis import experiments
from friso_thesis.studies.thesis.as_built import _prescribed, rig_with_drive
from friso_thesis.studies.thesis.claims import (
    _JUDGES,
    BESIDE,
    Evidence,
    Finding,
    Part,
    Response,
    beside,
    by_attraction,
    by_peak_count,
    claims,
    judges,
    registered,
)
from friso_thesis.studies.thesis.cycles import Edge, Surveyed, map_cycles, survey
from friso_thesis.studies.thesis.evidence import RESPONSES
from friso_thesis.studies.thesis.judges import design_rules
from friso_thesis.studies.thesis.judges.identified_in_time import force_swings
from friso_thesis.studies.thesis.judges.rig_hunting import judged_move, judged_standstill
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE
from friso_thesis.studies.thesis.kept import SOURCES, Kept, put_together, taken_apart
from friso_thesis.studies.thesis.laws import conclusions_by_law
from friso_thesis.studies.thesis.maps import begins, ends, free_square, sizes, trend, verdict_table
from friso_thesis.studies.thesis.plausible import PARTS, _in_space, plausible
from friso_thesis.studies.thesis.reading import OTHERWISE, OWN, others_of, read_as, reading, words_read
from friso_thesis.studies.thesis.reproduce import Reproduction, _changed, reproduce
from friso_thesis.studies.thesis.space import FORCE_NOISE, OPEN, baseline, draw, enters
from friso_thesis.studies.thesis.studies import STUDIES, rig_gains, thesis_rig
from friso_thesis.studies.thesis.verdicts import verdict

ROOT = Path(__file__).parents[2]


def module(name: str) -> Any:
    return import_module(f"friso_thesis.studies.thesis.{name}")


REPRODUCE = module("reproduce")


TABLE_3 = {
    "path": {"motion.acceleration": (0, 150), "motion.acceleration_time": (0, 0.15)},
    "system": {"controller.crossover": (1, 40), "mass": (0.1, 5.1)},
    "friction": {"friction.static": (0, 4.9), "friction.coulomb": (0, 4.9)},
    "control": {"controller.alpha": (0.1, 0.3), "controller.beta": (1, 3)},
    "isolator-stiffness": {"joint.stiffness": (0.5e3, 15e3), "joint.stroke": (0, 1e-3)},
    "isolator-damping": {"joint.limiter_damping": (1e-2, 1e4), "joint.stroke": (1e-5, 1e-2)},
    "isolator-masses": {"masses.cart": (0.5, 3), "masses.stage": (0.1, 1)},
    "isolator-friction": {"friction.static": (0, 4.9), "friction.coulomb": (0, 4.9)},
    "isolator-crossover": {"controller.crossover": (1, 16), "joint.stroke": (0, 1e-3)},
    "isolator-crossover-soft": {"controller.crossover": (1, 16), "joint.stroke": (0, 1e-3)},
}
"""Typed from the thesis's Table 3, in SI units (crossovers in Hz)."""


@pytest.fixture(scope="module", autouse=True)
def made_rig() -> Iterator[None]:
    """The experiments on the rig as built take longer than all else: their evidence is made up here."""
    made = {
        experiments.BUILT: loops(),
        experiments.MOVES: moves((HUNTS, 0, 0, 0)),
        experiments.GRID: grid(1, 1, 0),
        experiments.ON_RAILS: rail_cycles(),
        experiments.TRACES: traces(),
    }
    runs = {
        name: lambda stage, mechanism=item: mechanism
        for name, item in {**made, experiments.STANDSTILL: standstill()}.items()
    }
    experiments._experiment.cache_clear()  # invented results are cached like real ones, here and after this file
    with patched({experiments: {"_RUNS": {**experiments._RUNS, **runs}}}):
        yield
    experiments._experiment.cache_clear()


@pytest.fixture(scope="module")
def thorough_study() -> Reproduction:
    """Return a complete reproduction on maps of 5 x 5 cells, with two joint draws of equal size.

    Its verdicts mean little, but every part is there.
    """
    with patched(
        {
            module("plausible"): {"MAP_POINTS": 5, "ANALYSED_PART": 9},
            REPRODUCE: {"JUDGED_POINTS": 5},
        }
    ):
        return reproduce(points=5, with_cycles=False, draws=2)


# --- the data ---------------------------------------------------------------------------------------------------------


def test_the_studies_are_those_of_table_3() -> None:
    """Ranges, scales, stiffness and lock; the marker is the rig."""
    ranges = {name: {span.key: (span.low, span.high) for span in study.spans} for name, study in STUDIES.items()}
    assert ranges == TABLE_3
    stages = {name: study.stage().flat() for name, study in STUDIES.items()}
    assert {name for name, flat in stages.items() if flat["joint.stiffness"] == 1e3} == {"isolator-crossover-soft"}
    locked = {name for name, flat in stages.items() if flat["joint.locked"]}
    assert locked == {"path", "system", "friction", "control"}
    for name, study in STUDIES.items():
        assert {span.log for span in study.spans} == {name == "isolator-damping"}
        assert study.marker.keys() == ranges[name].keys()
        flat = {key: {**stages[name], "mass": 1.7}[key] for key in study.marker}
        assert study.marker == pytest.approx(flat, rel=1e-12)


def test_the_packaged_rigs_are_the_examples() -> None:
    """The real rig has the rails of `friso rig`, so their shares are those on the page."""
    packaged = files("friso_thesis.studies.thesis").joinpath("thesis_rig.toml").read_text(encoding="utf-8")
    assert packaged == (ROOT / "examples" / "thesis_rig.toml").read_text(encoding="utf-8")
    assert thesis_rig() == friso.loads(packaged)
    assert rig_with_drive(thesis_rig()).flat() == friso.load(ROOT / "examples" / "thesis_drive.toml").flat()


def test_the_noise_of_fig_28_is_an_unstated_value(snapshots: Snapshots) -> None:
    """Peaks grow with the noise: a tenth of the printed ones meet the thesis with ten times the noise of rounding."""
    small = standstill(1e-8, 1e-7)
    assert judged_standstill(small).pattern == (False, True, True)
    assert judged_standstill(small, 10.0).pattern == (True, True, True)
    between = judged_standstill(small, 10**0.5)  # between two noises, in logarithms
    snapshots.check("reproduce", "between two noises", "\n".join(part.number for part in between.parts))
    evidence = Evidence({}, {}, identified=cast(Any, SimpleNamespace(standstill=small)), force_noise=10.0)
    assert registered()["F28"].judge(evidence).judgement == "holds"
    assert baseline().values[FORCE_NOISE] == 1.0


def test_open_values_are_drawn_from_their_ranges() -> None:
    for value in OPEN:
        assert value.low < value.high
        assert value.low <= value.baseline <= value.high
        assert value.only_in in experiments.EXPERIMENTS or any(value.touches(study) for study in STUDIES.values())
        for scale in ("even", "log")[: 1 + (value.low > 0)]:
            ends = [replace(value, scale=scale).at(share) for share in (0.0, 1.0)]
            assert ends == pytest.approx([value.low, value.high])


def test_joint_draws_are_stages_that_change_everything_at_once() -> None:
    """The draws do not depend on their number and are within the ranges; friso's own choice is the rig."""
    rig = thesis_rig()
    flat, own = rig.flat(), rig.replace(baseline().changes).flat()
    assert {key: value for key, value in own.items() if isinstance(value, float)} == pytest.approx(
        {key: value for key, value in flat.items() if isinstance(value, float)}, rel=1e-12
    )
    values = [draw(number).values for number in range(40)]
    assert draw(7) == draw(7)
    for value in OPEN:
        drawn = np.array([one[value.name] for one in values])
        assert np.ptp(drawn) > (value.high - value.low) / 2
        assert value.low <= drawn.min() <= drawn.max() <= value.high
    for number in range(8):
        one = draw(number)
        for study in STUDIES.values():
            study.stage(one.changes)
        flat = rig.replace(one.changes).flat()
        assert size(flat) == pytest.approx(one.values["distance"])
        assert flat["masses.cart"] + flat["masses.stage"] == pytest.approx(one.values["mass"])


# --- reading maps -----------------------------------------------------------------------------------------------------


def test_maps_are_read_by_their_ends_trends_and_free_squares() -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0])
    hunts = np.array([[1, 1, 0, 0], [1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=bool)
    assert ends(values, hunts).tolist() == [2.5, 3.5, 1.0, 4.0]
    assert begins(values, hunts).tolist() == [1.0, 1.0, 4.0, 1.5]
    left = np.array([[100, 100, 100], [100, 100, 100], [0.1, 1e-12, 0.0], [0.1, 1e-12, 0.0]])
    assert ends(values, left > 1, left).tolist() == pytest.approx([2 + 2 / 3, 2.5, 2.5])  # gone at once: anywhere there
    trends = [trend(values, y) for y in (values**3, -values, np.ones(4))] + [trend(values[:2], values[:2])]
    assert trends == pytest.approx([1, -1, np.nan, np.nan], nan_ok=True)
    square = np.ones((10, 10), dtype=bool)
    square[2:5, 3:6] = False
    valid = np.ones_like(square)
    assert free_square(square, valid) == pytest.approx(0.09)
    valid[3, 4] = False
    assert free_square(square, valid) == pytest.approx(1 / 99)


# --- judges on made maps ----------------------------------------------------------------------------------------------


def cell(peaks: int = 6, amplitude: float = 0.5e-3, period: float = 1.6) -> Response:
    values = {"peaks": peaks, "peak_to_peak": 2 * amplitude, "period": period}
    return Response(by_peak_count(xr.Dataset({**values, "outcome": "swings" if peaks else "rests"})), xr.Dataset())


def sticks(time: float, integral: float) -> Response:
    """Sticks of `time` [s] between slips of 0.1 s, in turn to both sides, the integral's share as given."""
    t = np.arange(0, 20, 1e-3)
    phase = t % (time + 0.1)
    way = np.where((t // (time + 0.1)) % 2 == 0, 1.0, -1.0)
    slow = phase < time
    force = way * np.where(slow, phase / time * 4, 1.0)
    trace = {"cart_velocity": np.where(slow, 1e-4, 0.1) * way, "force": force, "friction_force": force}
    variables = {name: ("time", values) for name, values in {**trace, "force_i": integral * force}.items()}
    return Response(cell().cell, xr.Dataset(variables, coords={"time": t}))


def friction_map(inner: Cells) -> Cells:
    """Invalid where the thesis's model is none, else `inner` of static and Coulomb friction."""
    return lambda s, c: np.where((c > s) | (c == 0) | (s == 0), -1, inner(s, c))


def crossover_pair(stiff: float, soft: float, name: str = "isolator-crossover") -> dict[str, xr.Dataset]:
    """Limits that fall to the given ones [Hz] up to a stroke of 0.2 mm and stay there."""

    def below(limit: float) -> Cells:
        return lambda f, s: 3 * (f < np.maximum(limit, 12 - (12 - limit) * s / 2e-4))

    return {name: made(name, below(stiff)), f"{name}-soft": made(f"{name}-soft", below(soft))}


F15B_MAPS = "isolator-friction", "friction"

Case = tuple[dict[str, xr.Dataset], dict[str, Response]]


def on(name: str, count: Cells, **cells: Response) -> Case:
    """Evidence of one map."""
    return {name: made(name, count)}, cells


def of_friction(free: Cells, locked: Cells) -> Case:
    """Evidence of both maps of friction."""
    return {name: made(name, friction_map(count)) for name, count in zip(F15B_MAPS, (free, locked), strict=True)}, {}


def wide_gap(static: np.ndarray, coulomb: np.ndarray) -> Any:
    return 6 * (static - coulomb > 1)


def checkered(a: np.ndarray, t: np.ndarray) -> Any:
    cells = (np.round(a / 7.5) + np.round(t / 7.5e-3)).astype(int)
    return 6 * ((a * t > 0) & ((a * t > 3) | (cells % 2 == 0)))


HOLDS: Mapping[str, Case] = {
    "F5": ({}, {"locked": cell()}),
    "F11A": on("path", checkered),
    "F11B": on("system", lambda f, m: 4 * (f < 20 / np.sqrt(m / 0.1) + 2)),
    "F12A": on("friction", friction_map(lambda s, c: np.where(s - c > 0.9, np.round(3 * (s - c)), 0))),
    "F12B": on("control", lambda a, b: np.round(40 * a + 12 / b)),
    "F13": ({}, {WIDE: sticks(0.6, 0.5), NARROW: sticks(0.9, 0.7)}),
    "F14A": on("isolator-stiffness", lambda k, s: 6 * ((k * s > 5) | (k > 13e3) | (s == 0)), locked=cell()),
    "F14B": on("isolator-damping", lambda d, s: 6 * (s < np.where(d > 10, 1e-4, 3e-5)), locked=cell()),
    "F15A": on("isolator-masses", lambda c, s: 3 * ((c < 0.6) & (s < 0.15))),
    "F15B": of_friction(lambda s, c: 0 * s * c, wide_gap),
    "F16A": (crossover_pair(6, 5), {}),
    "F16B": (crossover_pair(6, 4.5), {}),
}

FAILS: Mapping[str, Case] = {
    "F5": ({}, {"locked": cell(0, 1e-9, np.nan)}),
    "F11A": on("path", lambda a, t: 6 * ((a < 40) & (t < 0.05))),
    "F11B": on("system", lambda f, m: 4 * (f < 5 + 7 * m)),
    "F12A": on("friction", friction_map(lambda s, c: np.where(s > 0.2, np.round(20 - 3 * (s - c)), 0))),
    "F12B": on("control", lambda a, b: np.where(a < 0.2, np.round(10 - 20 * a + b), 0)),
    "F13": ({}, {WIDE: sticks(0.9, 0.7), NARROW: sticks(0.6, 0.5)}),
    "F14A": on("isolator-stiffness", lambda k, s: 2 * (k > 20e6 * s), locked=cell()),
    "F14B": on("isolator-damping", lambda d, s: 6 * (s < 1e-3), locked=cell()),
    "F15A": on("isolator-masses", lambda c, s: 3 * (c / s > 4)),
    "F15B": of_friction(wide_gap, wide_gap),
    "F16A": on("isolator-crossover", lambda f, s: 3 * (f < 20 * (1 - s / 1.2e-3))),
    "F16B": (crossover_pair(6, 7.5), {}),
}


@pytest.mark.parametrize("claim", sorted(HOLDS.keys() | FAILS.keys()))
def test_judges_recognise_what_holds_and_what_does_not(claim: str, snapshots: Snapshots) -> None:
    judge = registered()[claim].judge
    holds, fails = judge(Evidence(*HOLDS[claim])), judge(Evidence(*FAILS[claim]))
    assert holds.judgement == "holds"
    snapshots.check("reproduce", f"numbers of {claim}", "\n".join(part.number for part in (*holds.parts, *fails.parts)))
    assert fails.judgement in ("differs", "holds in part"), fails
    assert len([part for part in fails.parts if not part.holds]) >= min(2, len(fails.parts) - 1), fails


def test_a_limit_is_lower_by_more_than_what_is_the_same_and_one_peak_moves() -> None:
    judged = [registered()["F16B"].judge(Evidence(crossover_pair(6, soft), {})).judgement for soft in (5.8, 4.4)]
    assert judged == ["differs", "holds"]
    assert registered()["F5"].judge(Evidence({}, {"locked": cell(1)})).parts[0].holds
    assert by_peak_count(made("control", lambda a, b: 1 + 0 * a * b))["keeps_moving"].all()


def test_f14b_names_the_stripe_and_its_dampings(snapshots: Snapshots) -> None:
    """A band of longer strokes that keeps moving, above strokes at which the stage rests, is reported separately."""
    striped = made("isolator-damping", lambda d, s: 6 * ((s < 1e-4) | ((d > 50) & (s > 2e-4) & (s < 4e-4))))
    judge = registered()["F14B"].judge
    part = judge(Evidence({"isolator-damping": striped}, {"locked": cell()})).parts[0]
    snapshots.check("reproduce", "a stripe", part.number)


def test_f21_tells_how_the_force_itself_oscillates(thorough_study: Reproduction) -> None:
    """F21 states the force's own oscillation.

    In the mean at each place, oscillations that do not repeat average out.
    """
    assert thorough_study.experiments is not None
    for run in thorough_study.experiments.constant_speed:
        for part, swing in zip(run.log.segments, force_swings(run), strict=True):
            force = run.log["force"][part][len(run.log["force"][part]) // 10 :]
            assert swing == pytest.approx(np.sqrt(np.mean(force**2) / np.mean(force) ** 2 - 1), abs=1e-6)
    free, _ = thorough_study.experiments.constant_speed
    assert min(force_swings(free)) > 0.4


def test_a_verdict_that_another_reading_turns_says_so() -> None:
    """“Large” damping, “about” 0.1 mm, “few” cells: each is read to either side of friso's own reading."""
    only_beyond = {"isolator-damping": made("isolator-damping", lambda d, s: 6 * (s < np.where(d > 1700, 1e-4, 1e-3)))}
    rare = {name: made(name, friction_map(lambda s, c: 6 * ((s > 4.6) & (c < 1.2)))) for name in F15B_MAPS}
    for claim, evidence, read, becomes in (
        ("F14B", Evidence(only_beyond, {"locked": cell()}), "“large” as 1000 N s/m and more", "holds"),
        ("F15B", Evidence(rare, {}), "“few” as at most 2 %", "differs"),
    ):
        judge = registered()[claim].judge
        findings = {}
        for name, other in OTHERWISE.items():
            with read_as(other):
                findings[name] = judge(evidence)
        own = judge(evidence)
        assert own.judgement != becomes
        item = verdict(claims()[0], "1", own, readings=findings)
        assert item.reread[read].judgement == becomes
        assert all(other.pattern != own.pattern for other in item.reread.values())
    assert reading() == OWN


@pytest.mark.parametrize("claim", ["F5", "F14B", "F16A"])
def test_only_words_that_a_judge_reads_are_read_otherwise(claim: str) -> None:
    """A changed reading of a word that a judge does not use does not change its finding."""
    judge, evidence = registered()[claim].judge, Evidence(*HOLDS[claim])
    with words_read() as words:
        own = judge(evidence)
    others = others_of(words)
    assert (not words) == (not others)
    for name in OTHERWISE.keys() - others.keys():
        with read_as(OTHERWISE[name]):
            assert judge(evidence) == own, name


# --- verdicts ---------------------------------------------------------------------------------------------------------


def finding(*holds: bool) -> Finding:
    return Finding(tuple(Part(f"criterion {i}", hold, f"number {i}") for i, hold in enumerate(holds)))


YES, NO = Part("b", True, "2"), Part("c", False, "3")
OPEN_PART = Part("a", True, "1", undecided=BESIDE)
OWN_PART = Part("friso finds what it entered", True, "1", self_test=True)
BEYOND = Part("beyond", False, "1", beyond="Simulation cannot decide this. More.")


@pytest.mark.parametrize(
    ("parts", "judgement"),
    [
        ((YES, YES), "holds"),
        ((YES, NO), "holds in part"),
        ((NO, NO), "differs"),
        ((OPEN_PART, YES), "not decided yet"),
        ((OPEN_PART, NO), "not decided yet"),
        ((OPEN_PART, YES, NO), "holds in part"),
        ((BEYOND,), "cannot be decided"),
        ((BEYOND, YES), "holds"),
        ((NO, OWN_PART), "differs"),
        ((YES, replace(OWN_PART, holds=False)), "holds"),
    ],
)
def test_judgements_of_parts(parts: tuple[Part, ...], judgement: str) -> None:
    """What a criterion beside its threshold could turn is open; parts beyond simulation and self-tests do not count."""
    assert Finding(parts).judgement == judgement


def test_draws_that_are_open_decide_nothing(snapshots: Snapshots) -> None:
    """A claim that too few draws decide is not decided enough; a draw in which no criterion fails is undecided if one
    is open."""

    def space_of(*draws: Finding) -> Any:
        return _in_space(registered()["S41"], [(draw(k), one) for k, one in enumerate(draws)], {})

    holds, fails, open_ = Finding((YES,)), Finding((OPEN_PART, NO)), Finding((OPEN_PART,))
    said = []
    for count, word in ((0, "not decided enough"), (6, "not decided enough"), (7, "holds")):
        item = verdict(claims()[0], "", holds, space=space_of(*[holds] * count, *[open_] * (51 - count)))
        assert item.judgement == word
        said.append(item.dependence)
    turned = verdict(claims()[0], "", holds, others={"a grid": Finding((NO,))}, undrawn="the rail")
    snapshots.check("reproduce", "dependence", "\n".join([*said, turned.dependence]))
    assert verdict(claims()[0], "", open_, space=space_of(*[holds] * 16)).judgement == "not decided yet"
    assert verdict(claims()[0], "", fails, space=space_of(*[holds] * 16)).judgement == "depends"
    space = space_of(holds, open_, Finding((NO,)))
    assert (space.count, space.undecided, space.misses) == (1, 1, 1)
    assert space.holds == share(np.array([True, False]), np.ones(2, bool), 0.05 / 3)  # three looks
    assert space_of(Finding((NO, OPEN_PART))).misses == 1


def test_a_number_beside_its_threshold_is_undecided() -> None:
    assert beside(0.17, [0.15], 0.03) == BESIDE
    assert beside(0.19, [0.15], 0.03) == ""
    assert judged_move(moves((HUNTS, HUNTS, 0, 0))).pattern == (None, True)  # 2 of 4 rails, half of them asked for


def test_the_count_judges_and_what_attracts_stands_beside() -> None:
    item = verdict(claims()[0], "1", finding(True, True), finding(True, False))
    assert item.judgement == "holds"
    assert item.attracts.judgement == "holds in part"


def test_the_interval_of_the_share_decides_the_word(thorough_study: Reproduction) -> None:
    """One rule for all claims, with intervals that hold at three looks together."""
    space = next(item.space for item in thorough_study.verdicts if item.space and item.space.draws == 2)

    def of_draws(held: int, draws: int) -> Any:
        flags = np.arange(draws) < held
        decided = share(flags, np.ones(draws, bool), 0.05 / 3)
        return replace(space, seeds=space.seeds[:1] * draws, failures={}, undecided=0, count=held, holds=decided)

    def judged(holds: bool, held: int, draws: int, undrawn: str = "") -> str:
        item = verdict(claims()[0], "5", finding(holds), None, of_draws(held, draws), undrawn=undrawn)
        assert item.robust == (item.judgement == "differs" and not held and not undrawn)
        return item.judgement

    assert judged(True, 44, 48) == "holds"
    assert judged(True, 18, 48) == "depends"
    assert judged(True, 21, 34) == "depends"  # 44 to 78 %
    assert judged(False, 1, 48) == "differs"
    assert judged(False, 4, 48) == "differs"
    assert judged(False, 5, 48) == "not decided enough"  # 3 to 26 %
    assert judged(False, 7, 16) == "depends"
    assert judged(False, 2, 16) == "not decided enough"  # 2 to 38 %: rare, or not
    assert judged(True, 2, 16) == "depends"
    assert judged(True, 6, 7) == "not decided enough"  # 42 to 99.6 %: in most, or not
    assert judged(False, 0, 17) == "differs"
    assert judged(False, 0, 16) == "not decided enough"
    assert judged(False, 0, 17, "the rail") == "differs"
    assert verdict(claims()[0], "5", finding(False)).judgement == "differs"


def test_another_method_is_mentioned_where_it_turns_a_part() -> None:
    others = {"a grid": finding(True), "a tolerance": finding(False)}
    judged = verdict(claims()[0], "5", finding(False), others=others)
    assert judged.turned.keys() == {"a grid"}


def test_limits_do_not_depend_on_the_number_of_points() -> None:
    """The crossover at which the swing falls below what counts, read from maps of 11 to 81 values per axis; cells alone
    would be off by up to half of one, 1.95 Hz at 11."""

    def limit(points: int) -> float:
        runs = made("system", lambda f, m: 3 * (f < 17.3) + 0 * m, points=points)
        swing = 1e-4 * 10 ** ((17.3 - runs["controller.crossover"]) / 4)
        moving, size = _read(by_peak_count(runs.assign(peak_to_peak=swing + 0 * runs["peaks"])))
        return float(ends(runs["controller.crossover"].values, moving, size)[0])

    def _read(runs: xr.Dataset) -> tuple[np.ndarray, Any]:
        axes = ("controller.crossover", "mass")
        return verdict_table(runs, *axes)[2], sizes(runs, *axes)

    assert [limit(points) for points in (11, 21, 41, 81)] == pytest.approx([17.3] * 4, abs=1e-9)


def test_one_cell_with_one_peak_is_told_as_such() -> None:
    """F11B: the highest crossover with a counted peak is one cell, which is at rest by the end of its run."""
    runs = made("system", lambda f, m: 4 * (f < 9) + 1 * ((f > 19) & (f < 21) & (m < 0.2)))
    assert (runs["peaks"] == 1).sum() == 1
    still = runs.assign(outcome=runs["outcome"].where(runs["peaks"] != 1, "rests"))
    part = registered()["F11B"].judge(Evidence({"system": by_peak_count(still)}, {})).parts[0]
    assert part.holds


def test_trends_are_judged_over_all_cells_too() -> None:
    """F12B: a trend over the cells that keep moving that is none over all of them does not hold."""
    control = made("control", lambda a, b: np.where((a + 0.1 * b) % 0.05 < 0.025, np.round(40 * a + 12 / b), 0))
    parts = registered()["F12B"].judge(Evidence({"control": control}, {})).parts
    assert not parts[0].holds
    assert not parts[1].holds


def test_the_locked_limit_is_that_of_the_mass_of_the_abstract() -> None:
    """D1: 15 Hz belongs to 2.5 kg, not to the 1.7 kg weighed."""
    runs = {"system": made("system", lambda f, m: 4 * (f < 27 - 6.9 * m), points=81)}
    limits = [design_rules.locked_limit(Evidence(runs, {}), mass) for mass in (1.7, 2.5)]
    assert limits == pytest.approx([15.3, 9.75], abs=0.5)


def test_paths_longer_than_the_rig_do_not_decide_alone() -> None:
    """F11A: a block at rest among the paths that fit 160 mm is reported; with as long at constant speed as
    accelerating, fewer fit."""

    def part(count: Cells, **changes: float) -> Part:
        rig = thesis_rig().replace({f"motion.{key}": value for key, value in changes.items()})
        return registered()["F11A"].judge(Evidence(*on("path", count), rig=rig)).parts[1]

    block = part(lambda a, t: 6 * (a * t**2 > 0.16))
    assert not block.holds
    shares = [part(lambda a, t: 6 + 0 * a * t, **more).number.split(" %")[0] for more in ({}, {"cruise_ratio": 1.0})]
    assert float(shares[0]) > float(shares[1])


def test_the_rig_moves_as_prescribed_whatever_is_drawn() -> None:
    """Fig. 24 to 27: 100 mm at 100 m/s^2."""
    for number in range(4):
        machine = _prescribed(thesis_rig().replace(draw(number).changes))
        assert distance(machine) == pytest.approx(0.1)
        assert machine.flat()["motion.acceleration"] == 100


def test_claims_asked_for_have_a_page_and_conclusions_of_their_own() -> None:
    """Under the thesis's own law alone: the others take long."""
    asked = reproduce(only=["E1", "S35"], points=3, with_cycles=False, draws=0)
    document = reproduce_document(asked)
    judged = {entry["id"] for entry in document["claims"]}
    assert judged == {"E1", "S35"}
    assert {entry["judgement"] for entry in document["claims"]} == {"holds"}
    written = {claim for claim in ("E1", "S35", "F5") if f"| {claim} |" in str(reproduce_files(asked)["claims.md"])}
    assert written == judged
    with patched({module("laws"): {"kept_laws": lambda rig: ((None,), {})}}):
        by_law = conclusions_by_law(asked)
    assert [item.claim.id for item in by_law.conclusions] == ["E1"]


def test_every_open_question_has_a_command_and_its_file() -> None:
    for question in QUESTIONS:
        program, name, *others = question.command.split()
        assert re.search(r"\d", question.answer())
        assert (program, name in COMMANDS, (ROOT / others[-1]).exists()) == ("friso", True, True)
        assert others[0] in RIG_EXPERIMENTS or name != "rig"


def test_the_gains_of_the_design_method_are_those_of_the_stage() -> None:
    """Eq. 8 by hand: k_p of 1.7 kg at 8 Hz, alpha 0.1, beta 2."""
    omega = 2 * np.pi * 8
    assert rig_gains(1.7)[0] == pytest.approx(1.5 * 1.7 * omega**2 / 10**0.5)


def test_values_that_do_not_enter_are_not_ranked() -> None:
    needs = {claim: entry.needs for claim, entry in registered().items()}
    entering = {claim: {v.name for v in OPEN if enters(v, own, RESPONSES, PARTS)} for claim, own in needs.items()}
    path = {"acceleration", "distance", "cruise over acceleration time"}
    assert entering["F28"] == {value.name for value in OPEN} - path
    every = {value.name for value in OPEN} - {FORCE_NOISE}
    control = {"alpha", "beta", "low-pass on the derivative alone"}
    assert entering["E1"] == entering["F7"] == every - control - path
    assert entering["F8"] == every - path
    assert entering["F24"] == entering["F26"] == every - path
    joint = {"joint damping", "limiter cannot pull"}
    assert entering["F27"] == every - path - joint
    assert entering["F12B"] == every - {"alpha", "beta"} - joint
    assert entering["F11A"] == every - {"acceleration", "distance"} - joint
    assert entering["F16B"] == every - {"stroke"}
    assert entering["S35"] == set()


# --- the whole --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_zero_rows_have_their_meaning() -> None:
    result = reproduce(["path", "friction", "isolator-stiffness"], points=3, with_cycles=False, draws=0).maps
    still = result["path"]
    for key in ("motion.acceleration", "motion.acceleration_time"):
        assert still[key].values[0] == 0
        assert set(still.outcome.sel({key: 0.0}).values) == {"rests"}
        assert (still.largest_force.sel({key: 0.0}) == 0).all()
    friction = result["friction"]
    for key in ("friction.static", "friction.coulomb"):
        assert set(friction.outcome.sel({key: 0.0}).values) == {"invalid"}
    assert all(
        "friction." in text for text in friction.status.where(friction.outcome == "invalid", "friction.").values.flat
    )
    assert np.isnan(friction.peaks.sel({"friction.coulomb": 0.0})).all()
    none = result["isolator-stiffness"].sel({"joint.stroke": 0.0})
    assert none.keeps_moving.all()
    assert set(none.outcome.values) == {"swings"}


def runs_of(peaks: list[float], sizes: list[float], words: list[str]) -> xr.Dataset:
    return by_peak_count(xr.Dataset({"peaks": ("x", peaks), "peak_to_peak": ("x", sizes), "outcome": ("x", words)}))


def test_runs_read_by_what_attracts() -> None:
    """A cell with an uncertain attractor is left out; the frequency of a cycle is known if a move ended in it."""
    runs = runs_of([5.0, 3.0, 0.0, 2.0], [1e-3] * 4, ["swings", "rests", "rests", "swings"])
    flags = np.array([True, False, True, True]), np.array([True, True, True, False])
    read = by_attraction(runs, *flags, np.full(4, np.inf))
    assert read.keeps_moving.values.tolist() == [True, False, True, False]
    assert read["outcome"].values.tolist() == ["swings", "rests", "rests", "failed"]
    assert read["count"].values[[0, 1]].tolist() == [5.0, 0.0]
    assert np.isnan(read["count"].values[2])


def test_limits_of_attraction_lie_on_the_curves() -> None:
    """A limit between two cells lies on the curve between them; without a curve, it lies halfway."""
    runs = made("system", lambda f, m: 3 * (f < 20) + 0 * m, points=14)
    axes = tuple(runs.dims)
    crossover, mass = (runs[name].values for name in axes)
    curve = Edge(np.array([18.0, 21.0]), mass[[0, -1]])
    attracts = crossover[:, None] < 18 + 3 * (mass - mass[0])[None, :] / np.ptp(mass)
    surveyed = Surveyed(runs, attracts, np.ones(attracts.shape, bool))
    for edges, precise in (((curve,), 0.02), ((), 1.5)):
        read = surveyed.attracted(edges)
        _, _, moving, _ = verdict_table(read, *axes)
        limits = ends(crossover, moving, sizes(read, *axes))
        assert np.abs(limits - np.interp(mass, mass[[0, -1]], curve.x)).max() <= precise


def test_a_part_of_the_studies_covers_its_claims_only() -> None:
    steps: list[tuple[int, int, str]] = []
    reproduction = reproduce(
        ["control"], points=3, progress=lambda *step: steps.append(step), with_cycles=False, draws=0
    )
    judged = {item.claim.id for item in reproduction.verdicts if item.finding}
    missing = STUDIES.keys() - {"control"}
    assert judged == {claim for claim, entry in registered().items() if not entry.needs & missing}
    assert judged >= {"F5", "F12B", "F13", "E1", "S35", "F17", "F24"}
    (reason,) = {entry.reason for entry in reproduction.verdicts if entry.claim.id == "F11A"}
    assert reason == "not computed in this run: path"
    assert [step[0] for step in steps] == sorted(step[0] for step in steps)
    assert steps[-1][0] == steps[-1][1]


def test_one_claim_needs_its_own_evidence_alone_and_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    """Evidence from before the interruption is not computed again; the verdict is that of an uninterrupted run."""
    orders: dict[str, Any] = {"only": ["f15b"], "points": 3, "with_cycles": False, "draws": 2}
    kept = Kept(tmp_path / "kept")

    def stop(done: int, total: int, label: str) -> None:
        if label.startswith("draw 1"):
            raise KeyboardInterrupt

    with patched({module("plausible"): {"MAP_POINTS": 3}, REPRODUCE: {"JUDGED_POINTS": 3}}):
        with pytest.raises(KeyboardInterrupt):
            reproduce(**orders, kept=kept, progress=stop)
        before = {file: file.stat().st_mtime_ns for file in (tmp_path / "kept").iterdir()}
        assert kept.count == len(before) >= 5  # two maps at two tolerances, and a draw; beside it another may be done
        resumed = reproduce(**orders, kept=kept)
        assert all(file.stat().st_mtime_ns == time for file, time in before.items())
        assert kept.count == 6  # the other draw
        whole = reproduce(**orders)
    assert reproduce_document(resumed) == reproduce_document(whole)
    assert resumed.maps.keys() == {"friction", "isolator-friction"}
    assert (resumed.linear, resumed.experiments) == (None, None)
    assert [item.claim.id for item in resumed.verdicts if item.finding] == ["F15B"]
    kept.clear()
    assert kept.count == 0


def test_few_points_are_shown_and_not_judged_on() -> None:
    """Whatever is asked for, claims are judged on maps of as many values as decide: the headline is the same."""
    orders: dict[str, Any] = {"only": ["F15B"], "with_cycles": False, "draws": 0}
    with patched({REPRODUCE: {"JUDGED_POINTS": 7}}):
        coarse, enough = (reproduce(**orders, points=points) for points in (3, 7))
    assert {name: runs.sizes for name, runs in coarse.judged.items()} == {n: r.sizes for n, r in enough.maps.items()}
    assert all(set(runs.sizes.values()) == {3} for runs in coarse.maps.values())
    first, second = (reproduce_document(item) for item in (coarse, enough))
    assert first["claims"] == second["claims"]
    assert (first["points"], first["points_judged"], second["points_judged"]) == (3, 7, 7)


def test_results_are_kept_whole(tmp_path: Path) -> None:
    """Every kind of result is read back as it was written: words in arrays of objects, as runs have them, as texts."""
    kept, experiment, runs = Kept(tmp_path), experiments.Experiments(thesis_rig()), rail_runs([3, 0])
    kept.result(("runs",), RailRuns, lambda: replace(runs, outcome=runs.outcome.astype(object)))
    assert_same(kept.result(("runs",), RailRuns, lambda: pytest.fail("they were kept")), runs)
    for name in (*experiments.EXPERIMENTS, experiments.TRACES):
        kind, result = get_type_hints(experiments.Experiments)[name], getattr(experiment, name)
        kept.result((name,), kind, lambda made=result: made)
        assert_same(kept.result((name,), kind, lambda: pytest.fail("it was kept")), result)
    arrays, kind = (
        taken_apart(getattr(experiment, experiments.GRID)),
        get_type_hints(experiments.Experiments)[experiments.GRID],
    )
    for wrong in ({**arrays, "tree": np.array("[1]")}, {"tree": arrays["tree"]}, {"tree": np.array("[")}):
        with pytest.raises((ValueError, TypeError, KeyError)):
            put_together(kind, wrong)
    assert kept.count == len(experiments.EXPERIMENTS) + 2


def assert_same(again: Any, made: Any) -> None:
    """Alike in types, fields, keys and arrays; numbers of NumPy come back as Python's."""
    made = made.item() if isinstance(made, np.generic) else made
    assert type(again) is type(made)
    if isinstance(made, np.ndarray):
        assert again.dtype == made.dtype
        np.testing.assert_array_equal(again, made, strict=True)
    elif is_dataclass(made):
        assert_same(vars(again), vars(made))
    elif isinstance(made, Mapping):
        assert [*again] == [*made]
        assert_same((*again, *again.values()), (*made, *made.values()))
    elif isinstance(made, tuple):
        for pair in zip(again, made, strict=True):
            assert_same(*pair)
    else:
        assert again == made or (again != again and made != made)


def test_what_is_kept_depends_on_all_sources_it_was_computed_with() -> None:
    """Every part of friso that these parts import is one of them, or decides on no number."""
    package = files("friso")
    parts = {*SOURCES, *_DECISIVE}
    undecisive = {"errors", "escapes", "platform", "progress", "questions", "registry", "settings", "shown", "version"}
    folders = [Path(str(package / part)) for part in parts if ".py" not in part and ".toml" not in part]
    texts = [file.read_text("utf-8") for folder in folders for file in folder.rglob("*.py")]
    imported = {name for text in texts for name in re.findall(r"^ *from friso\.(\w+)", text, re.MULTILINE)}
    of_friso = {part.partition(".")[0].partition("/")[0] for part in parts if not part.startswith("..")}
    assert imported - undecisive == of_friso & imported


def test_a_draw_that_decides_nothing_says_why() -> None:
    def stopped(*_: Any) -> Any:
        raise ValueError("the loop stops")

    with patched({module("plausible"): {"MAP_POINTS": 3, "counted": stopped}}):
        space = plausible({"F15B": registered()["F15B"]}, {"F15B": finding(True)}, 1).claims["F15B"]
    assert (space.undecided, space.count, space.failures) == (1, 0, {0: "ValueError: the loop stops"})


def test_the_summary_has_every_text_whole_on_one_sheet() -> None:
    space, item = SimpleNamespace(count=12, draws=48), SimpleNamespace
    verdicts: Any = [item(claim=one, judgement="holds in part", finding=finding(True), space=space) for one in claims()]
    texts = {text.get_text().replace("\n", " ") for text in summary_sheet(verdicts, "Conclusion.", COLOURS).texts}
    assert {one.text for one in claims()} <= texts


def test_document_has_every_claim(thorough_study: Reproduction) -> None:
    document = reproduce_document(thorough_study)
    assert [entry["id"] for entry in document["claims"]] == [claim.id for claim in claims()]
    for entry in document["claims"]:
        covered = entry["judgement"] != "not yet covered"
        assert bool(entry["figure"] and entry["number"] and entry["criterion"]) == bool(entry["parts"]) == covered
        undecided = any(part["undecided"] for part in entry["parts"])  # or no draw decides it
        plain = ("holds", "depends", "not decided enough", "cannot be decided")
        assert entry["reason"] or undecided or entry["judgement"] in plain
        if entry["space"]:
            assert 0 <= entry["space"]["share"]["low"] <= entry["space"]["share"]["high"] <= 1
    contents = reproduce_files(thorough_study)
    shown = {item.claim.id for item in thorough_study.verdicts if item.finding}
    assert [name for name in shown if f'id="claim-{name}"' not in str(contents["reproduction.html"])] == []
    assert len([name for name in contents if name.startswith("figures/")]) == 2 * len(
        reproduction_figures(thorough_study)
    )


@pytest.mark.thorough
def test_the_command_writes_its_numbers(
    thorough_study: Reproduction, tmp_path: Path, snapshots: Snapshots, undrawn: None
) -> None:
    """The command runs in this process, which has cached the linear analysis of `thorough_study`, the longest part."""
    assert friso_inside(tmp_path, "reproduce", "masses", "--points", "5").returncode == 2
    given = ("isolator-masses", "--points", "5", "--draws", "0", "--out", "rep", "--details")
    assert friso_inside(tmp_path, "reproduce", *given).returncode == 0
    assert not (tmp_path / "rep" / UNFINISHED).exists()
    written = json.loads((tmp_path / "rep" / "claims.json").read_text("utf-8"))["claims"]
    numbers = [f"{one['id']}, {one['judgement']}: {one['number']}" for one in written if one["parts"]]
    snapshots.check("reproduce", "numbers", "\n".join(numbers))


def test_fig_14b_at_both_tolerances(thorough_study: Reproduction) -> None:
    """A count that is unknown at both does not differ."""
    assert [runs.attrs["rtol"] for runs in thorough_study.tolerances.values()] == [1e-4, 1e-8]
    loose, tight = thorough_study.tolerances.values()
    assert thorough_study.changed[0] == pytest.approx(float((loose.keeps_moving != tight.keeps_moving).mean()))
    assert thorough_study.changed[1] == pytest.approx(float((loose["count"] != tight["count"]).mean()))
    loose = made("isolator-damping", lambda d, s: np.where(s < 1e-4, -1, 2 * (s < 1e-3)), points=5)
    assert np.isnan(loose["count"]).any()
    assert _changed({1e-4: loose, 1e-8: loose.copy()}) == (0.0, 0.0)
    other = loose.assign(count=loose["count"].fillna(1.0))
    assert _changed({1e-4: loose, 1e-8: other})[1] == pytest.approx(float(np.isnan(loose["count"]).mean()))
    document = reproduce_document(replace(thorough_study, tolerances={1e-4: loose, 1e-8: loose.copy()}))
    assert document["figure_14b"]["rtol"] == [1e-8, 1e-4]


def test_a_new_judge_needs_no_change_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """The finding of a decorated function stands in page and document, escaped."""
    monkeypatch.delitem(_JUDGES, "F28")
    try:

        @judges("F28", figure="28")
        def settled(evidence: Evidence) -> Finding:
            return Finding((Part("<b>criterion</b> & more", False, "10.5 <i>Hz</i>", "<script>alert(1)</script>"),))

        for claim, why in (("F28", "one already"), ("F99", "expected a claim")):
            with pytest.raises(ValueError, match=why):
                judges(claim, figure="28")
        reproduction = reproduce([], points=3, draws=0)
    finally:
        _JUDGES.pop("F28", None)
    (entry,) = (claim for claim in reproduce_document(reproduction)["claims"] if claim["id"] == "F28")
    assert (entry["judgement"], entry["number"]) == ("differs", "10.5 <i>Hz</i>")
    page = reproduce_html(reproduction)
    assert "&lt;b&gt;criterion&lt;/b&gt; &amp; more" in page
    assert "<script>alert(1)" not in page


@pytest.mark.thorough
def test_the_edge_of_hunting_behind_a_map(thorough_study: Reproduction) -> None:
    """Crossover and mass, locked: the flip of the rig's 1.7 kg lies at 9.75 Hz, on the drawn curve as in the check; the
    cells compared add up; the page shows curve and table."""
    study = STUDIES["system"]
    with patched({module("cycles"): {"CURVE_NODES": 5}}):
        cycles_ = map_cycles(
            study,
            thorough_study.maps["system"],
            survey(thorough_study.maps["system"].isel(dict.fromkeys(STUDIES["system"].marker, slice(None, None, 2)))),
        )
    counted = cycles_.comparison
    assert counted.cells == 9
    assert counted.both + counted.neither + counted.counted_only + counted.attracted_only + counted.unknown == 9
    (curve,) = cycles_.edges
    crossover = np.interp(1.7, curve.y, curve.x)
    edge = find_margin(study.stage(), attracting=True)
    assert crossover == pytest.approx(edge.crossover, rel=0.02)
    shown = replace(thorough_study, cycles={"system": cycles_})
    assert reproduce_document(shown)["cycles"]["system"]["cells"] == 9
    labels = {line.label for panel in reproduction_figures(shown)["11"].panels for line in panel.series}
    assert "edge of hunting" in labels


def unreadable_archive(stream: BinaryIO) -> None:
    """An archive with the header of an array that ends within a bracket, of which NumPy raises a TokenError."""
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("peaks.npy", b"\x93NUMPY\x01\x00\x0a\x00{'descr': \n")


def test_kept_arrays_are_whole_and_no_larger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays that are damaged, of another file, or with too much in them are not taken."""
    file, arrays = tmp_path / "0.npz", {"peaks": np.ones(5), "outcome": np.full(5, "rests")}
    keep_arrays(file, arrays)
    whole = kept_arrays(file)
    assert {name: values.tolist() for name, values in whole.items()} == {
        name: values.tolist() for name, values in arrays.items()
    }
    content = file.read_bytes()
    for place in range(len(content)):
        file.write_bytes(content[:place] + bytes([content[place] ^ 8]) + content[place + 1 :])
        assert kept_arrays(file) is None
    (tmp_path / "1.npz").write_bytes(content)
    assert kept_arrays(tmp_path / "1.npz") is None
    with monkeypatch.context() as patch:  # what others write, with a sound digest
        patch.setattr(np, "savez_compressed", unreadable_archive)
        keep_arrays(file, {})
    assert kept_arrays(file) is None
    keep_arrays(file, {**arrays, "more": np.zeros(10**6)})
    monkeypatch.setattr(kept_work, "MOST_EXPANDED", 10**6)
    monkeypatch.setattr(np, "load", lambda *arguments, **named: pytest.fail("it was expanded"))
    assert kept_arrays(file) is None
