"""Isolator or firmware: the drawn machines, the seven options, their measures, statistics, tables and command."""

import json
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import friso_inside
from pages import Page
from patched import patched
from refusals import rows_of
from snapshots import Snapshots

from friso.engine.arrays import Status
from friso.equations.motion import Stand
from friso.equations.settings import SETTINGS, settings_named
from friso.equations.structure import structure
from friso.frequency import crossover
from friso.frequency.crossover import loop_bandwidth
from friso.frequency.margins import margins
from friso.frequency.members import limit_cases, member
from friso.frequency.settings import FrequencySettings
from friso.hunting.criteria import end_of_traces, outcomes, settling_of_traces
from friso.questions.compare.blocks import compare_document
from friso.questions.compare.figures import compare_figures
from friso.questions.compare.question import CompareAnswer
from friso.questions.compare.words import PAIRED, answer, brought, paired_rows, sentences, table_rows
from friso.remedies.machines import draw_fleet
from friso.shares import share
from friso.shown.drawing import matplotlib_renderer
from friso.shown.drawing.matplotlib_renderer import image
from friso.stage import Stage, load
from friso.stage.correlations import Correlations
from friso.stage.lists import element_keys
from friso.stage.tables import motor_mass
from friso.studies.compare import measures, study
from friso.studies.compare.machines import ELEMENTS, SPREADS, TOGETHER_BY, Machines, draw_machines
from friso.studies.compare.measures import difference, linear_loops, median, quantile_interval, staying_in_position
from friso.studies.compare.options import (
    DEADBAND_SHARE,
    MODEL_ERROR,
    OPTIONS,
    CompareOptions,
    Option,
    linear_flat,
    options,
)
from friso.studies.compare.study import Comparison, NeededBandwidth, OptionResult, compare
from friso.virtual_rig.run import RecordedRuns

EXAMPLE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"
COARSE = {"drive.sample_time": "250 us", "drive.delay": "250 us"}
"""A drive that costs a fifth, with the same equations: one sample of delay."""

QUICK = {study: {"FOLLOWED_MACHINES": 6, "LONGER_FACTOR": 3}}
COUNT = 20
GEARED = {"transmission.inertia": "1.5e-5 kg*m^2", "transmission.lead": "10 mm"}
RIGID = {"joint": None, "parasitic": None}


@pytest.fixture(scope="module")
def built() -> Stage:
    return load(EXAMPLE).replace(COARSE)


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    with FrequencySettings(crossover_steps=21, search_biases=3).in_use(), patched(QUICK):
        yield


@pytest.fixture(scope="module")
def machines(built: Stage) -> Machines:
    return draw_machines(built, Correlations(), 1000, 3)


@pytest.fixture(scope="module")
def every(machines: Machines) -> CompareOptions:
    return options(machines, 1e-6)


@pytest.fixture(scope="module")
def comparison(built: Stage) -> Comparison:
    return compare(built, COUNT, 1)


def drawn(stage: Stage, count: int = 20) -> Machines:
    return draw_machines(stage, Correlations(), count, 1)


def work_of(built: Stage, machines: Machines) -> Any:
    return study._Work(machines, study.own_motion(built), study._places(built), 1e-6, study.silent, 1)


def with_measures(result: OptionResult, **measured: Any) -> OptionResult:
    """Return the result of an option with other measures on all machines."""
    columns = {name: np.full(COUNT, value) for name, value in measured.items()}
    return replace(result, measures=replace(result.measures, **columns))


@pytest.fixture
def screw() -> Stage:
    """A stage whose friction is at the motor, which swings slowly."""
    return Stage(
        masses={"stage": "9 kg"},
        transmission={"mass": "6 kg", "stiffness": "60 N/um", "damping": "500 N*s/m", "backlash": "0 um"},
        encoder={"position": "load", "velocity": "load"},
        motor_friction={
            **{"model": "lugre", "static": "16 N", "coulomb": "8 N", "stribeck_velocity": "2 mm/s"},
            **{"stribeck_exponent": 2, "bristle_stiffness": "0.8 N/um", "bristle_damping": "1500 N*s/m"},
            "viscous": "12 N*s/m",
        },
        controller={"kind": "pid", "crossover": "6 Hz", "alpha": 0.1, "beta": 2},
        drive={"sample_time": "500 us", "delay": "0 us"},
        motion={"kind": "there_and_back", "acceleration": "8 m/s^2", "acceleration_time": "50 ms", "return_at": "1.5 s",
                "duration": "6 s"},
    )  # fmt: skip


@pytest.mark.parametrize("duration", ["6 s", "3.4 s"])
def test_a_swing_slower_than_the_run_is_a_swing(screw: Stage, duration: str) -> None:
    """Most machines swing by a millimetre every 3 s, as a run of a minute shows."""
    stage, long = (screw.replace({"motion.duration": one}) for one in (duration, "60 s"))
    work, at_length = (work_of(one, drawn(one)) for one in (stage, long))
    option = Option(OPTIONS["as-is"], stage)
    measures = work.runs(option, 0)
    assert not measures.swings.any()
    expected = at_length.runs(replace(option, stage=long), 0).swings
    assert np.count_nonzero(expected) > 10
    assert np.array_equal(work.with_slow_swings(option, measures).swings, expected)


@pytest.mark.parametrize("changes", [{}, {"transmission.mass": None, **GEARED}])
def test_machines_spread_at_the_motor_as_at_the_guide(screw: Stage, changes: dict[str, Any]) -> None:
    stage = screw.replace(changes)
    keys, flat = draw_machines(stage, Correlations(), 1000, 3).keys, stage.flat()
    both = keys["motor_friction.static"], keys["motor_friction.coulomb"]
    assert np.corrcoef(both)[0, 1] == pytest.approx(TOGETHER_BY, abs=0.05)
    for key, spread in SPREADS.items():
        if key.startswith(("motor_friction.", "transmission.")) and flat.get(key):
            within = np.abs(keys[key] / flat[key] - 1) <= spread / 100
            assert np.mean(within) == pytest.approx(0.95, abs=0.02), key
    fleet = draw_fleet(stage, Correlations(), 20, 3).laid_over(stage, {}, 1)
    for one in (draw_machines(stage, Correlations(), 20, 3).flat(stage, {}), fleet):
        assert np.ptp(one["transmission.mass"]) > 0
        if changes:
            np.testing.assert_allclose(one["transmission.mass"], motor_mass(one))


def test_a_feedforward_compensates_the_motor_s_friction(screw: Stage) -> None:
    machines = drawn(screw)
    (option,) = (one for one in options(machines, 1e-6).options if one.kind.name == "feedforward")
    ahead = option.changes["drive.feedforward_coulomb"] / machines.keys["motor_friction.coulomb"]
    assert np.abs(ahead - 1) == pytest.approx(MODEL_ERROR)


def test_machines_spread_by_default(machines: Machines, built: Stage) -> None:
    flat = built.flat()
    assert {*machines.keys} == {*SPREADS.keys() & flat.keys(), "rail.seed"}
    for key, spread in SPREADS.items() & machines.spreads.items():
        within = np.abs(machines.keys[key] / flat[key] - 1) <= spread / 100
        assert np.mean(within) == pytest.approx(0.95, abs=0.01), key
        assert np.mean(machines.keys[key]) == pytest.approx(flat[key], rel=0.01)
    levels = np.corrcoef(machines.keys["friction.static"], machines.keys["friction.coulomb"])
    assert levels[0, 1] == pytest.approx(TOGETHER_BY, abs=0.02)
    assert np.abs(np.mean(machines.signs)) < 0.1
    assert {*machines.signs.tolist()} == {-1.0, 1.0}
    scrambling = np.random.default_rng(3).random(machines.count) < 0.5  # signs have random numbers of their own
    for other in (scrambling, *(machines.keys[key] for key in machines.spreads)):
        assert abs(np.corrcoef(machines.signs, other)[0, 1]) < 0.1
    again, another = (draw_machines(built, Correlations(), 1000, seed) for seed in (3, 4))
    assert all(np.array_equal(again.keys[key], values) for key, values in machines.keys.items())
    assert np.array_equal(again.signs, machines.signs)
    assert not np.array_equal(another.keys["friction.static"], machines.keys["friction.static"])
    assert len({*machines.keys["rail.seed"].tolist()}) == len({*machines.seeds.tolist()}) == 1000


def test_presliding_of_every_law_is_drawn() -> None:
    """Elements share one factor; the deflection at which bristles slip stays below that of sliding.

    It excludes no draw: Coulomb friction is drawn as with LuGre.
    """
    elements = load(EXAMPLE.with_name("thesis_rig_gms.toml"))
    gms = draw_machines(elements, Correlations(), 200, 3)
    for array in (array for array in ELEMENTS if array.startswith("friction.")):
        ratios = [gms.keys[key] / elements.flat()[key] for key in element_keys(elements.flat(), array)]
        assert len(ratios) == 4
        assert np.ptp(ratios, axis=0).max() < 1e-6
        assert np.std(ratios[0]) == pytest.approx(0.25, abs=0.03)
    assert "friction.attraction" in gms.spreads
    bristles = load(EXAMPLE.with_name("thesis_rig_elasto_plastic.toml"))
    drawn, lugre = (draw_machines(stage, Correlations(), 1000, 3) for stage in (bristles, load(EXAMPLE)))
    coulomb, stiffness = drawn.keys["friction.coulomb"], drawn.keys["friction.bristle_stiffness"]
    share = drawn.keys["friction.breakaway_deflection"] * stiffness / coulomb
    assert not drawn.sample.broken  # what is left out is beyond the bound of one key, not against the rule
    assert np.std(coulomb) == pytest.approx(np.std(lugre.keys["friction.coulomb"]), rel=0.05)
    assert (share.min() > 0, share.max() < 1) == (True, True)
    assert np.median(share) == pytest.approx(0.7, abs=0.01)
    assert np.std(share) > 0.03


def test_machines_as_uncertain_as_the_file(built: Stage) -> None:
    labels = {"friction.static": "3 N +/- 0.1 N", "joint.stroke": "0.9 mm .. 1 mm", "masses.cart": "1.2 kg +/- 1e-6 %"}
    held = {"controller.crossover": "8 Hz +/- 1 Hz", "drive.delay": "200 us .. 300 us"}
    machines = draw_machines(built.replace(labels | held), Correlations(), 200, 3)
    assert {*machines.from_file} == {*labels}
    assert np.std(machines.keys["friction.static"]) == pytest.approx(0.051, rel=0.05)
    assert machines.keys["masses.cart"] == pytest.approx(1.2, rel=1e-7)
    assert not {*held} & {*machines.keys}
    assert all(key in machines.notes[0] for key in held)
    assert machines.changes(machines.stage, {})["controller.tuned_mass"] == 1.7


def test_a_drive_without_a_clock_gets_one(built: Stage) -> None:
    machines = drawn(built.replace({"drive": None, "rail": None}))
    assert machines.stage.flat()["drive.sample_time"] == 50e-6
    assert any("50 us" in note for note in machines.notes)


def test_the_seven_options(every: CompareOptions, machines: Machines) -> None:
    stages = {option.letter: option.stage.flat() for option in every.options}
    assert "".join(stages) == "abcdefg"
    assert [letter for letter, flat in stages.items() if not flat["joint.locked"]] == ["c", "g"]
    assert stages["d"]["drive.integrator_deadband"] == pytest.approx(DEADBAND_SHARE * 1e-6)
    assert [letter for letter, flat in stages.items() if flat["drive.integrator_reset"]] == ["e"]
    ahead = every.options[5].changes
    assert {*ahead} == {"drive.feedforward_coulomb", "drive.feedforward_viscous"}
    for key in ("coulomb", "viscous"):
        off = ahead[f"drive.feedforward_{key}"] / machines.keys[f"friction.{key}"]
        assert off == pytest.approx(1 + MODEL_ERROR * machines.signs)


@pytest.mark.parametrize("letter", ["b", "g"])
def test_faster_up_to_the_margin(every: CompareOptions, letter: str) -> None:
    option = next(item for item in every.options if item.letter == letter)
    assert option.factor > 1.2
    assert option.stage.flat()["controller.crossover"] == pytest.approx(8 * option.factor)
    own = linear_flat(option.stage, option.stage.flat())
    margin = crossover.settled_margin(own)
    assert margin == pytest.approx(crossover.COMFORTABLE_MARGIN, abs=0.01)
    beyond = crossover.settled_margin({**own, "controller.crossover": 1.1 * own["controller.crossover"]})
    assert beyond < margin - 0.01


def test_margins_of_many_are_those_of_each(every: CompareOptions, machines: Machines) -> None:
    option = every.options[2]
    loops = linear_loops(option.stage, linear_flat(option.stage, machines.flat(option.stage, {})), machines.count)
    for number in (0, int(np.where(loops.stable, loops.margin, np.inf).argmin())):
        own = {key: float(values[number]) for key, values in machines.keys.items()}
        flat = linear_flat(option.stage, option.stage.flat(own | {"controller.tuned_mass": 1.7}))
        exact = min(margins(flat, one).modulus_margin for one in limit_cases(flat).values())
        assert loops.margin[number] == pytest.approx(exact, abs=1e-3)


GAINS = {"kind": "pid", "kp": "3000 N/m", "ki": "10000 N/(m*s)", "kd": "80 N*s/m", "tau": "2 ms"}
FORCES = (
    "masses.cart", "masses.stage", "parasitic.mass", "friction.static", "friction.coulomb", "friction.viscous",
    "friction.bristle_stiffness", "friction.bristle_damping", "joint.stiffness", "joint.damping",
    "joint.limiter_stiffness", "joint.limiter_damping",
)  # fmt: skip
"""Keys in newtons per something: a motor of less force does to the loop what a plant does that has more of all."""


@pytest.mark.parametrize("controller", [{}, {"controller": GAINS}], ids=["tuned", "gains"])
def test_the_motor_is_part_of_the_loop(built: Stage, controller: dict[str, Any]) -> None:
    stage = built.replace(controller).variants()["free"]
    flat, ratio = stage.flat(), 0.68
    own, weak, heavy = (
        linear_loops(stage, linear_flat(stage, {**flat, **changed}), 1)
        for changed in ({}, {"drive.motor_constant_ratio": ratio}, {key: flat[key] / ratio for key in FORCES})
    )
    assert own.stable.all()
    assert weak.stable.all()
    assert weak.margin == pytest.approx(heavy.margin, rel=1e-6)
    assert abs(weak.margin[0] - own.margin[0]) > 0.02


def test_a_weak_motor_leaves_room_for_bandwidth(built: Stage) -> None:
    rigid = built.replace(RIGID)
    expected, other = (
        options(drawn(stage), 1e-6) for stage in (rigid, rigid.replace({"drive.motor_constant_ratio": 0.8}))
    )
    assert other.options[1].factor > 1.02 * expected.options[1].factor


def test_unstable_loops_are_told(machines: Machines, every: CompareOptions) -> None:
    fast = every.options[0].stage.replace({"controller.crossover": "390 Hz"})
    loops = linear_loops(fast, linear_flat(fast, machines.flat(fast, {})), machines.count)
    assert not loops.stable.any()
    assert not loops.margin.any()
    assert not margins(linear_flat(fast, fast.flat()), member(1.6)).stable


PROPORTIONAL = {"controller": {"kind": "pid", "kp": "2000 N/m", "kd": "60 N*s/m", "tau": "2 ms"}}


@pytest.mark.parametrize(
    ("changed", "left_out", "name"),
    [
        ({}, "cg", "no joint"),
        (PROPORTIONAL, "decg", "no integral action"),
        ({"friction": {"model": "none"}, "rail": None}, "cfg", "no friction"),
        ({"controller.crossover": "90 Hz"}, "bcg", "no room above"),
    ],
)
def test_what_an_option_lacks_is_said(
    built: Stage, snapshots: Snapshots, changed: dict[str, Any], left_out: str, name: str
) -> None:
    choices = options(drawn(built.replace(RIGID | changed)), 1e-6)
    assert {*choices.left_out} == {*left_out} == {*"abcdefg"} - {option.letter for option in choices.options}
    first = {"no integral action": "de", "no friction": "f"}.get(name, left_out[0])
    snapshots.check("compare", name, "\n".join(choices.left_out[letter] for letter in first))
    if changed is PROPORTIONAL:
        faster = choices.options[1]
        assert faster.stage.flat()["controller.kp"] == pytest.approx(2000 * faster.factor**2)


TIME = np.arange(0, 20, 0.01)
frequencies, sizes = st.floats(0.25, 5.0), st.floats(1e-5, 1e-2)


def words(deviation: np.ndarray, within: float) -> list[str]:
    """Return the outcomes of runs."""
    return outcomes(end_of_traces(TIME, deviation, within), within).tolist()


@settings(max_examples=40)
@given(frequencies, sizes, st.floats(0.05, 2.0), st.floats(-1e-3, 1e-3))
def test_what_goes_to_and_fro_swings(frequency: float, size: float, within: float, offset: float) -> None:
    swing = offset + size * np.sin(2 * np.pi * frequency * TIME)[None]
    assert words(swing, within * 1e-6) == ["swings"]
    assert words(swing, 1.1 * size) != ["swings"]


@settings(max_examples=40)
@given(frequencies, sizes, st.floats(1.0, 5.0), st.floats(-1e-3, 1e-3))
def test_what_dies_out_or_creeps_does_not(frequency: float, size: float, decay: float, offset: float) -> None:
    dying = size * np.exp(-TIME / decay) * np.cos(2 * np.pi * frequency * TIME)
    creeping = offset - size * TIME
    assert "swings" not in words(np.array([dying, creeping, offset + 0 * TIME]), 1e-6)


@settings(max_examples=40)
@given(st.floats(0.01, 15.0), st.floats(0.1, 100.0), st.floats(0.0, 4.0))
def test_settling_time_of_a_step(until: float, factor: float, corner: float) -> None:
    deviation = factor * np.where(until > TIME, 1.0, 0.5)[None]
    expected = max(TIME[until <= TIME][0] - corner, 0.0)
    place = [Stand(corner, TIME[-1])]
    assert settling_of_traces(place, TIME, deviation, 0.7 * factor)[0] == pytest.approx(expected)
    assert settling_of_traces(place, TIME, -deviation, 2.0 * factor)[0] == 0
    assert settling_of_traces(place, TIME, deviation, 0.4 * factor)[0] == np.inf
    assert settling_of_traces(place, TIME, np.full((1, len(TIME)), np.nan), factor)[0] == np.inf


def test_there_and_back_the_longer_time_of_both_ends_counts() -> None:
    """The time is infinite if the stage is outside the band when the reference returns, even if it never left."""
    there, back = Stand(1.0, 6.0), Stand(8.0, TIME[-1])
    late = np.where((TIME < 4.0) | ((TIME > 6.5) & (TIME < 8.5)), 1.0, 0.0)[None]
    never_there = np.where(TIME < 8.0, 1.0, 0.0)[None]
    assert settling_of_traces([there, back], TIME, late, 0.5)[0] == pytest.approx(3.0, abs=1e-2)
    assert settling_of_traces([back], TIME, late, 0.5)[0] == pytest.approx(0.5, abs=1e-2)
    assert settling_of_traces([there, back], TIME, never_there, 0.5)[0] == np.inf
    assert settling_of_traces([back], TIME, never_there, 0.5)[0] == 0


@settings(max_examples=40)
@given(st.lists(st.floats(-1e3, 1e3) | st.just(np.inf), min_size=20, max_size=200))
def test_medians_with_infinite_values(values: list[float]) -> None:
    result, array = median(np.array(values)), np.array(values)
    assert result.low <= result.value <= result.high
    assert np.mean(array <= result.value) >= 0.5
    assert np.mean(array >= result.value) >= 0.5
    assert median(np.append(array, np.nan)) == result
    assert {result.low, result.high} <= {*values}


def test_intervals_hold() -> None:
    """The slowest have ranks by the binomial distribution; fewer than 72 bound no twentieth from above."""
    rng = np.random.default_rng(5)
    expected = [median(np.exp(rng.standard_normal(50))) for _ in range(2000)]
    assert 0.95 - 0.015 < np.mean([item.low <= 1 <= item.high for item in expected]) < 0.985
    ranks = {1: (-np.inf, np.inf), 40: (35, np.inf), 71: (63, np.inf), 72: (64, 72), 100: (90, 100)}
    for count, interval in ranks.items():
        assert quantile_interval(np.arange(1.0, count + 1), 0.95) == interval
    held = []
    for _ in range(2000):
        common, own = rng.random(60), rng.random(60)
        pair = difference((common < 0.3) & (own < 0.5), common < 0.3)
        held.append(pair.low <= -0.15 <= pair.high)
    assert 0.93 < np.mean(held) <= 1


def test_differences_are_paired_and_failed_runs_count_either_way() -> None:
    before = np.arange(100) < 40
    better = difference(before & (np.arange(100) >= 20), before)
    assert better.value == pytest.approx(-0.2)
    assert better.high < 0
    back = difference(before, before & (np.arange(100) >= 20))
    assert (back.value, back.low, back.high) == pytest.approx((0.2, -better.high, -better.low))
    assert difference(before, before).value == 0
    flags, done = np.arange(100) < 10, np.arange(100) < 90
    assert share(flags, done).probability == pytest.approx(10 / 90)
    assert share(flags, done).low == share(flags, np.ones(100, bool)).low
    assert share(flags, done).high == share(np.arange(100) < 20, np.ones(100, bool)).high


def test_the_isolator_and_bandwidth_stop_what_swings(comparison: Comparison) -> None:
    """Thesis, Sec. 4.3: the locked rig hunts at 8 Hz and not above 15 Hz; the isolated one does not at 8 Hz."""
    results = {result.letter: result for result in comparison.results}
    assert results["a"].swinging.probability > 0.2
    assert results["b"].option.stage.flat()["controller.crossover"] > 15
    for letter in "bcg":
        assert results[letter].rests
        assert results[letter].in_position_count == COUNT
        assert results[letter].swinging.probability == 0
        assert comparison.paired(results[letter]).swinging.high < 0
        assert results[letter].settling.high < results["a"].settling.high
    assert results["b"].margin.value < results["a"].margin.value


def test_an_integrator_that_starts_anew_does_not_stay(built: Stage, comparison: Comparison) -> None:
    """Without its integral the stage breaks away again, so slowly that only the longer run shows it: which is not run
    where too few machines are in position before.

    Options share their machines: one that changes nothing comes out the same, to the last digit.
    """
    base, reset = comparison.results[0], comparison.results[4]
    assert reset.swinging.probability < base.swinging.probability
    assert not reset.rests
    assert reset.settled.probability < 0.5
    assert not reset.later.done.size
    work = work_of(built, comparison.machines)
    later = work.longer(reset.option)
    assert share(later.stays, later.done).high < 0.9
    again = work.runs(replace(base.option, kind=OPTIONS["feedforward"]), 0)
    assert np.array_equal(again.in_position, base.measures.in_position)
    assert np.array_equal(again.force, base.measures.force)
    assert not np.array_equal(comparison.results[5].measures.force, base.measures.force)


def test_hardly_any_friction_never_swings(built: Stage) -> None:
    ideal = {"friction.static": "1 mN +/- 1e-6 %", "friction.coulomb": "1 mN +/- 1e-6 %"}
    machines = drawn(built.replace(ideal))
    for name, variant in (("as-is", "locked"), ("isolator", "free")):
        runs = work_of(built, machines).runs(Option(OPTIONS[name], machines.stage.variants()[variant]), 0)
        assert runs.done.all()
        assert not runs.swings.any()
        assert np.isfinite(runs.settling).all()


def test_a_run_that_fails_does_not_swing(comparison: Comparison) -> None:
    result = with_measures(comparison.results[0], outcome="failed", settling=np.nan)
    assert (result.failed, result.swinging.low, result.swinging.high) == (COUNT, 0, 1)
    assert np.isnan(result.swinging.probability)
    assert not result.rests


def test_words_follow_the_numbers(comparison: Comparison, snapshots: Snapshots) -> None:
    def options(*letters: str) -> Comparison:
        return replace(comparison, results=tuple(comparison.results["abcdefg".index(letter)] for letter in letters))

    lines = brought(comparison)
    assert {*lines} <= {*sentences(comparison)}
    for result in comparison.results[1:]:
        assert any(f"({result.letter})" in line for line in lines) is result.rests
    assert f" {int(comparison.results[0].measures.swings.sum())} of {COUNT} " in answer(comparison)[1]
    assert [named(options(*letters)) for letters in ("abcg", "acdg", "abd", "adef")] == ["bcg", "cg", "b", ""]
    snapshots.check("compare", "none rests", " ".join(answer(options(*"adef"))))
    assert [label[0] for label, _ in table_rows(comparison)] == [*"abcdefg"]


def named(comparison: Comparison) -> str:
    """The options that the recommendation names."""
    if not any(result.rests for result in comparison.results):
        return ""
    return "".join(letter for letter in "abcdefg" if f"({letter})" in sentences(comparison)[0])


@pytest.fixture
def made_up(every: CompareOptions, machines: Machines) -> Comparison:
    """Options a and c on 20 machines: c is in position 12 times sooner, 3 later, and 5 never with either."""
    still, count = np.ones(COUNT, bool), COUNT
    settling = {"a": np.full(count, 5.0), "c": np.repeat([2.0, 7.0, np.inf], [12, 3, 5])}
    settling["a"][15:] = np.inf
    rms = {"a": np.full(count, 2e-9), "c": np.full(count, 1e-9)}
    results = tuple(
        OptionResult(
            every.options["abc".index(letter)],
            measures.MachineMeasures(
                np.full(count, "rests"), np.zeros(count, int), settling[letter], rms[letter], np.ones(count)
            ),
            measures.Later(still, still),
            measures.LoopRobustness(still, np.full(count, 0.6)),
        )
        for letter in "ac"
    )
    few = replace(machines, seeds=machines.seeds[:count], signs=machines.signs[:count])
    return Comparison(few, every, results, 1e-6, 3, tuple(study._missing(few.stage)))


FLOOR = {"floor": {"frequency": ["1 Hz", "100 Hz"], "acceleration": ["1e-5 m/s^2/Hz^0.5", "1e-5 m/s^2/Hz^0.5"]}}


def _shaken(comparison: Comparison) -> Comparison:
    stage = comparison.stage.replace(FLOOR)
    return replace(comparison, machines=replace(comparison.machines, stage=stage), notes=tuple(study._missing(stage)))


def test_sooner_later_and_alike(made_up: Comparison) -> None:
    pair = made_up.paired(made_up.results[1])
    assert [item.probability for item in (pair.sooner, pair.later, pair.alike)] == [0.6, 0.15, 0.25]
    assert [text.split(" (")[0] for text in paired_rows(made_up)[0][1][1:4]] == ["60.0 %", "15.0 %", "25.0 %"]
    assert compare_document(made_up)["options"]["c"]["against_a"]["later"]["probability"] == 0.15


def test_how_many_machines_miss_the_far_end_is_told(made_up: Comparison) -> None:
    """The machines rest at the end, but not while the reference stands at the far end.

    Such machines do not settle in time.
    """
    for time, missed in ((2.0, False), (np.inf, True)):
        result = with_measures(made_up.results[0], settling=time)
        said = " ".join(sentences(replace(made_up, results=(result,))))
        assert ("At the far end, before the reference returns, 0 %" in said) == missed
        assert ("to come to rest in the end" in said) == missed


def test_standstill_is_compared_on_a_floor_only(made_up: Comparison) -> None:
    quiet = replace(made_up, results=tuple(with_measures(result, settling=1.0) for result in made_up.results))
    for item, ratios, compared in ((quiet, [], False), (_shaken(quiet), ["0.5 (0.5 to 0.5)"], True)):
        said = sentences(item)
        assert ("1.00 nm RMS" in " ".join(said)) == compared
        assert ("[floor]" in said[-1]) != compared
        assert paired_rows(item)[0][1][len(PAIRED) :] == ratios
        assert [panel.title == "Standstill" for panel in compare_figures(item)[0].panels][2:] == [True] * compared
        document, text = compare_document(item), Page(str(CompareAnswer(item).files()["compare.html"])).text
        rms = document["options"]["c"]["against_a"]["in_position_rms"]
        assert (document["standstill_compared"], rms is not None) == (compared, compared)
        assert any("no [floor]" in note for note in document["notes"]) is not compared
        assert ("no [floor]" in text) is not compared


def test_machines_that_rest_where_they_begin_are_drawn(made_up: Comparison) -> None:
    """The RMS error of such a machine is 0, which a logarithmic axis cannot show: matplotlib warned."""
    shaken = _shaken(made_up)
    still = replace(shaken, results=tuple(with_measures(result, in_position=0.0) for result in shaken.results))
    (drawn,) = compare_figures(still)
    assert image(drawn, "png")  # warnings are errors here
    assert [figure.panels[-1].y.log for figure in (drawn, *compare_figures(shaken))] == [False, True]


@pytest.mark.parametrize(("changed", "said"), [({}, True), ({"cable": None}, False)])
def test_the_cable_is_said_to_be_left_out(built: Stage, changed: dict[str, None], said: bool) -> None:
    assert any("cable" in note for note in study._missing(built.replace(changed))) == said


def settled_by_hand(comparison: Comparison) -> Comparison:
    """The comparison with evenly spread settling times, forces and errors. A stage that hunts for a while before it
    settles does so at another time after one other bit, so that processors differ in the quantiles of few machines."""
    results = []
    for place, result in enumerate(comparison.results, 1):
        spread = {}
        for name, unit in {"settling": 0.3, "in_position": 1e-9, "force": 5.0}.items():
            values = getattr(result.measures, name)
            spread[name] = np.where(np.isfinite(values), place * np.geomspace(0.9 * unit, 1.1 * unit, COUNT), values)
        results.append(with_measures(result, **spread))
    return replace(comparison, results=tuple(results))


WRITTEN = {*(f"compare.{ending}" for ending in ("html", "pdf", "png", "svg"))}


def test_command_writes_page_and_figures(
    tmp_path: Path, comparison: Comparison, monkeypatch: pytest.MonkeyPatch, snapshots: Snapshots
) -> None:
    monkeypatch.setattr(study, "compare", lambda *inputs: settled_by_hand(comparison))
    done = friso_inside(tmp_path, "compare", EXAMPLE, "--out", "out", "--json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert [*document["options"]] == [*"abcdefg"]
    for option in document["options"].values():
        assert option["swings"]["low"] <= option["swings"]["probability"] <= option["swings"]["high"]
    assert document["options"]["d"]["settling_time_s"]["high"] is None
    assert {item.name for item in (tmp_path / "out").iterdir()} == WRITTEN
    page = Page((tmp_path / "out" / "compare.html").read_text(encoding="utf-8"))
    assert [tag for tag in page.tags if tag in ("table", "figure")] == ["figure", "table", "table"]
    snapshots.check("compare", "page", page.lines)
    snapshots.check("compare", "run", friso_inside(tmp_path, "compare", EXAMPLE, "--details").stdout)


@pytest.mark.parametrize("times", [0, 1, 2])
def test_ctrl_c_while_figures_are_drawn_waits_for_the_files(
    tmp_path: Path, comparison: Comparison, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """Minutes of work are not lost for the seconds of a drawing; a second Ctrl-C does not wait.

    Interrupted before, it leaves nothing.
    """
    real, signals = matplotlib_renderer.image, iter([signal.SIGINT] * times)

    def compared(*arguments: object) -> Comparison:
        if not times:
            raise KeyboardInterrupt
        return comparison

    def drawn(*arguments: Any, **options: Any) -> Any:
        if number := next(signals, None):
            signal.raise_signal(number)
        return real(*arguments, **options)

    monkeypatch.setattr(study, "compare", compared)
    monkeypatch.setattr(matplotlib_renderer, "image", drawn)
    assert friso_inside(tmp_path, "compare", EXAMPLE, "--out", "out").returncode == 130
    assert {item.name for item in tmp_path.rglob("*.*")} <= WRITTEN
    assert {item.name for item in tmp_path.rglob("*.*")} == WRITTEN or times != 1


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--machines", 19),
        ("--seed", -1),
        ("--within", "0 um"),
        ("--within", 1),
        ("--set", 'motion={kind="ramp", velocity="1 mm/s", duration="2 s"}'),
        ("--set", 'motion.duration="8 s"'),
        ("--set", 'drive.sample_time="20 ms"'),
        ("--also", "leek"),
    ],
)
def test_bad_input(tmp_path: Path, option: str, value: object) -> None:
    done = friso_inside(tmp_path, "compare", EXAMPLE, option, value)
    assert (done.returncode, done.stdout) == (2, "")
    assert rows_of(done.stderr)


@pytest.mark.parametrize("name", SETTINGS)
def test_a_setting_against_friction_is_one_that_the_stage_can_have(name: str) -> None:
    """Sized for the machine: keys that are read again, and words with the numbers."""
    stage = load(EXAMPLE)
    (setting,) = settings_named((name,))
    numbers = setting.numbers(stage.flat(), 1e-6)
    chosen = stage.with_numbers(numbers)
    assert {key: chosen.flat()[key] for key in numbers} == pytest.approx(numbers)
    assert structure(chosen.flat()) != structure(stage.flat())
    assert OPTIONS[name].says == setting.says
    assert OPTIONS[name].letter == "hijklm"[[*SETTINGS].index(name)]


def test_a_limit_of_the_bandwidth_holds_for_faster_controllers(machines: Machines) -> None:
    """The limit holds for the 0 dB crossing, with and without joint; below the present crossover none is faster."""
    tried = {option.kind.name: option for option in options(machines, 1e-6, bandwidth_limit=30.0).options}
    free = {option.kind.name: option for option in options(machines, 1e-6).options}
    for name in ("faster", "isolator-faster"):
        assert loop_bandwidth(tried[name].stage) == pytest.approx(30.0, rel=0.02)
        assert loop_bandwidth(tried[name].stage) <= 30.0 * 1.001
        assert loop_bandwidth(free[name].stage) > 30.0
    assert "below the present bandwidth" in options(machines, 1e-6, bandwidth_limit=5.0).left_out["b"]


def test_the_conclusion_turns_at_a_bandwidth(comparison: Comparison) -> None:
    """If more machines rest at each higher bandwidth, it is the first from which enough do."""
    needed = NeededBandwidth(np.array([10.0, 12.0, 14.0, 16.0]), np.array([0.5, 1.0, 0.9, 1.0]), 2.0 ** np.arange(4))
    assert (needed.turning(0.99), needed.turning(0.4), needed.turning(1.1)) == (3, 0, None)
    base = with_measures(comparison.results[0], settling=np.inf)
    hunting = replace(comparison, results=(base,))
    line = answer(replace(hunting, needed=needed))[-1]
    assert "from a bandwidth of 16.0 Hz on" in line
    (faster,) = (result for result in comparison.results if result.letter == "b")
    assert faster.rests
    quick = replace(faster, option=replace(faster.option, factor=2.0))
    line = answer(replace(hunting, results=(base, quick), needed=needed))[-1]
    assert "at a bandwidth of 12.0 Hz" in line  # as built, it brings the machines to rest there
    assert "not at all higher ones" in line
    none = answer(replace(hunting, needed=replace(needed, shares=needed.shares * 0.5)))[-1]
    assert "does not bring 99 % of the machines to rest at any bandwidth up to 16.0 Hz" in none
    assert comparison.needed is not None
    assert np.diff(comparison.needed.bandwidths).min() > 0
    assert comparison.needed.shares[-1] > comparison.needed.shares[0]


def test_ctrl_c_keeps_the_options_that_were_run(built: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """The conclusion covers these options alone, and says so; before the first there is nothing to keep."""
    ran = []

    def runs(work: study._Work, option: Option, before: int) -> measures.MachineMeasures:
        ran.append(option.letter)
        if len(ran) == most:
            raise KeyboardInterrupt
        never, nothing = np.full(COUNT, np.inf), np.zeros(COUNT)
        return measures.MachineMeasures(np.full(COUNT, "swings"), nothing, never, nothing + 1, nothing + 1)

    monkeypatch.setattr(study._Work, "runs", runs)
    most = 3
    cut = compare(built, COUNT, 1)
    assert [result.letter for result in cut.results] == ["a", "b"]
    assert [option.letter for option in cut.not_run] == ["c", "d", "e", "f", "g"]
    assert any(
        line.startswith("Interrupted") and all(f"({letter})" in line for letter in "cdefg") for line in sentences(cut)
    )
    assert any(line.startswith("None of these options brings") for line in sentences(cut))
    assert compare_document(cut)["interrupted"]
    ran, most = [], 1
    with pytest.raises(KeyboardInterrupt):
        compare(built, COUNT, 1)


def test_a_machine_stays_in_position_about_its_reference() -> None:
    """Runs at their reference, beside it, and about zero, where the reference is not."""
    reference = np.full((3, 2000), 1e-3)
    position = np.array([1e-3 + 1e-7 * np.sin(np.arange(2000) / 50), np.full(2000, 1.1e-3), np.full(2000, -1e-3)])
    recorded = RecordedRuns(
        np.arange(3),
        1e-3,
        {"reference": reference, "position": position},
        {"position": position},
        np.full(3, Status.DONE),
    )
    assert staying_in_position(recorded, 1e-5).stays.tolist() == [True, False, False]
