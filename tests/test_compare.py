"""Isolator or firmware: stage files on the same drawn machines, their measures, words, tables and command."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from book import BOOK
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import friso_inside
from pages import Page
from snapshots import Snapshots

import friso
from friso.design_method.prepare import isolated
from friso.equations.motion import Stand
from friso.errors import InputError
from friso.frequency.margins import margins
from friso.frequency.settings import FrequencySettings
from friso.frequency.system import limit_cases, member
from friso.hunting.criteria import settling_of_traces
from friso.intervals import quantile_interval, share
from friso.questions.compare.blocks import compare_document, rows, sentences
from friso.remedies import comparison as study
from friso.remedies import machines as drawing
from friso.remedies import method
from friso.remedies.catalogue import BANDWIDTH, linear_flat, linear_loops
from friso.remedies.comparison import FASTER, ISOLATOR, LOCKED, Compared, Comparison, MachineMeasures, compare
from friso.remedies.machines import ELEMENTS, SPREADS, TOGETHER_BY, Machines, draw_common, draw_fleet, draw_machines
from friso.stage import Stage, element_keys, load
from friso.stage.controllers import as_tuned
from friso.stage.correlations import Correlations
from friso.stage.tables import motor_mass

EXAMPLE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"
RIG = EXAMPLE.with_name("thesis_rig.toml")
COARSE = {"drive.sample_time": "250 us", "drive.delay": "250 us"}
"""A drive that costs a fifth, with the same equations: one sample of delay."""

COUNT = 20
GEARED = {"transmission.inertia": "1.5e-5 kg*m^2", "transmission.lead": "10 mm"}


@pytest.fixture(scope="module")
def built() -> Stage:
    return load(EXAMPLE).replace(COARSE)


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    with FrequencySettings(crossover_steps=21, search_biases=3).in_use():
        yield


@pytest.fixture(scope="module")
def machines(built: Stage) -> Machines:
    return draw_machines(built, Correlations(), 1000, 3)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    """The rig with its joint locked, as fast as friso tune makes it, and on its joint."""
    rig = load(RIG)
    locked = rig.replace({"joint.locked": True})
    faster = locked.replace({"controller.crossover": "17.24 Hz"})
    return compare({LOCKED: locked, FASTER: faster, ISOLATOR: rig}, COUNT, 1)


def common(*stages: Stage, count: int = 200) -> list[dict[str, Any]]:
    """The keys of machines that are laid over stages."""
    fleet, _ = draw_common(stages, [Correlations() for _ in stages], count, 1)
    return [fleet.drawn(stage) for stage in stages]


def with_measures(result: Compared, **measured: Any) -> Compared:
    """Return the result of a stage with other measures on all machines."""
    columns = {name: np.broadcast_to(value, (COUNT,)) for name, value in measured.items()}
    return replace(result, measures=replace(result.measures, **columns))


@pytest.fixture
def screw() -> Stage:
    """A stage whose friction is at the motor, which swings slowly."""
    return BOOK["screw that swings slowly"]


@pytest.mark.parametrize("duration", ["6 s", "3.4 s"])
def test_a_swing_slower_than_the_run_is_a_swing(screw: Stage, duration: str) -> None:
    """Most machines swing by a millimetre every 3 s, as a run of a minute shows."""
    stage, long = (screw.replace({"motion.duration": one}) for one in (duration, "60 s"))
    fleet, _ = draw_common([stage], [Correlations()], COUNT, 1)
    work = study._Work(fleet, 1, 1e-6, True)
    alone, at_length = (MachineMeasures.joined([*work.runs(one, np.arange(COUNT), 1)]) for one in (stage, long))
    assert "swings" not in alone.outcome
    assert np.count_nonzero(at_length.outcome == "swings") > 10
    swings = work.with_slow_swings(stage, alone).outcome == "swings"
    assert np.array_equal(swings, at_length.outcome == "swings")


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
    for one in (stage.flat(draw_machines(stage, Correlations(), 20, 3).keys), fleet):
        assert np.ptp(one["transmission.mass"]) > 0
        if changes:
            np.testing.assert_allclose(one["transmission.mass"], motor_mass(one))


def test_machines_spread_by_default(machines: Machines, built: Stage) -> None:
    flat = built.flat()
    assert {*machines.keys} == {*SPREADS.keys() & flat.keys()}
    for key, spread in SPREADS.items() & machines.spreads.items():
        within = np.abs(machines.keys[key] / flat[key] - 1) <= spread / 100
        assert np.mean(within) == pytest.approx(0.95, abs=0.01), key
        assert np.mean(machines.keys[key]) == pytest.approx(flat[key], rel=0.01)
    levels = np.corrcoef(machines.keys["friction.static"], machines.keys["friction.coulomb"])
    assert levels[0, 1] == pytest.approx(TOGETHER_BY, abs=0.02)
    again, another = (draw_machines(built, Correlations(), 1000, seed) for seed in (3, 4))
    assert all(np.array_equal(again.keys[key], values) for key, values in machines.keys.items())
    assert not np.array_equal(another.keys["friction.static"], machines.keys["friction.static"])
    assert len({*common(built)[0]["rail.seed"].tolist()}) == 200


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
    both, told = draw_common([built, built.replace(held)], [Correlations()] * 2, 20, 1)
    assert {*told} == {*held}
    assert not {*held} & {*both.drawn(built.replace(held))}


def test_the_same_machines_are_laid_over_all_stages(built: Stage) -> None:
    """What files state differently stays different, by the same factor on each machine; only a joint is new."""
    heavy = built.replace({"masses.stage": "1 kg", "friction.static": "4 N", "motion.duration": "30 s"})
    one, other = common(built, heavy)
    assert {*one} == {*other}
    for key in one:
        ratio = heavy.flat()[key] / built.flat()[key]
        np.testing.assert_allclose(other[key], ratio * one[key], err_msg=key)
    rigid = built.replace({"joint": None, "parasitic": None, "masses.cart": None, "masses.stage": "1.7 kg"})
    free = isolated(rigid)
    stiff, alone, beside = (common(*stages) for stages in ((rigid, free), (rigid,), (rigid, heavy, free)))
    assert np.ptp(stiff[1]["joint.stiffness"]) > 0
    for key, values in alone[0].items():
        assert np.array_equal(values, stiff[0][key]), key
        assert np.array_equal(values, beside[0][key]), key
    assert {**stiff[1]}.keys() == {**beside[2]}.keys()
    whole = stiff[0]["masses.stage"] / 1.7
    for part in ("masses.cart", "masses.stage"):
        np.testing.assert_allclose(stiff[1][part] / free.flat()[part], whole)


def test_a_joint_of_leaf_springs_is_laid_over_as_they_make_it() -> None:
    """Its stiffness and mode follow from the springs; that of a plain joint beside it varies."""
    leaves = load(EXAMPLE.with_name("thesis_leaves.toml"))
    for stages in ((leaves,), (load(RIG), leaves)):
        drawn = common(*stages)[-1]
        assert leaves.flat(drawn)["joint.stiffness"] == pytest.approx(leaves.flat()["joint.stiffness"])
        assert np.ptp(drawn["friction.static"]) > 0


def test_spreads_are_those_of_the_first_file_that_states_them(built: Stage) -> None:
    exact = built.replace({"friction.coulomb": "1 N +/- 0.001 %"})
    for stages in ((exact, built), (built, exact)):
        one, other = common(*stages)
        assert np.array_equal(one["friction.coulomb"], other["friction.coulomb"])
        assert (np.ptp(one["friction.coulomb"]) < 1e-3) == (stages[0] is exact)


def test_a_machine_that_one_file_does_not_allow_is_replaced(built: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """With so little static friction, a quarter of the draws would make it less than Coulomb friction."""
    low = built.replace({"friction.static": "1.15 N"})
    one, other = common(built, low)
    assert len(one["friction.static"]) == 200
    assert (other["friction.static"] >= other["friction.coulomb"]).all()
    monkeypatch.setattr(drawing, "MOST_REDRAWN", 1)
    with pytest.raises(InputError, match="allowed in all"):
        common(built, low)


def flat_of(stage: Stage, machines: Machines) -> dict[str, Any]:
    """The keys of machines, whose controller is tuned for the stage."""
    return linear_flat(stage, stage.flat({**as_tuned(stage.flat()), **machines.keys}))


@pytest.mark.slow
def test_margins_of_many_are_those_of_each(built: Stage, machines: Machines) -> None:
    stage = built.variants()["free"]
    loops = linear_loops(stage, flat_of(stage, machines), 1000)
    for number in (0, int(np.where(loops.stable, loops.margin, np.inf).argmin())):
        own = {key: float(values[number]) for key, values in machines.keys.items()}
        flat = linear_flat(stage, stage.flat(own | {"controller.tuned_mass": 1.7}))
        exact = min(margins(flat, one).modulus_margin for one in limit_cases(flat).values())
        assert loops.margin[number] == pytest.approx(exact, abs=1e-3)


GAINS = {"kind": "pid", "kp": "3000 N/m", "ki": "10000 N/(m*s)", "kd": "80 N*s/m", "tau": "2 ms"}
FORCES = (
    "masses.cart", "masses.stage", "parasitic.mass", "friction.static", "friction.coulomb", "friction.viscous",
    "friction.bristle_stiffness", "friction.bristle_damping", "joint.stiffness", "joint.damping",
    "joint.limiter_stiffness", "joint.limiter_damping",
)  # fmt: skip
"""Keys in newtons per something: a motor of less force does to the loop what a plant does that has more of all."""


@pytest.mark.cases(first=1)
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


def test_unstable_loops_are_told(built: Stage, machines: Machines) -> None:
    fast = built.replace({"joint.locked": True, "controller.crossover": "390 Hz"})
    loops = linear_loops(fast, flat_of(fast, machines), 1000)
    assert not loops.stable.any()
    assert not loops.margin.any()
    assert not margins(linear_flat(fast, fast.flat()), member(1.6)).stable


TIME = np.arange(0, 20, 0.01)
frequencies, sizes = st.floats(0.25, 5.0), st.floats(1e-5, 1e-2)


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


@pytest.mark.slow
def test_intervals_hold() -> None:
    """The slowest have ranks by the binomial distribution; fewer than 72 bound no twentieth from above."""
    rng = np.random.default_rng(5)
    held = [study.Quantile.of(np.exp(rng.standard_normal(200))) for _ in range(2000)]
    true = np.exp(1.6448536)
    assert 0.95 - 0.015 < np.mean([one.low <= true <= one.high for one in held]) < 0.985
    ranks = {1: (-np.inf, np.inf), 40: (35, np.inf), 71: (63, np.inf), 72: (64, 72), 100: (90, 100)}
    for count, interval in ranks.items():
        assert quantile_interval(np.arange(1.0, count + 1), 0.95) == interval
    few = np.append(np.ones(94), np.full(6, np.inf))
    assert study.Quantile.of(few).value == np.inf
    assert study.Quantile.of(few[1:]).value == np.inf
    assert study.Quantile.of(few[:99]).value == np.inf
    assert study.Quantile.of(few[:98]).value == 1


def test_failed_runs_count_either_way() -> None:
    flags, done = np.arange(100) < 10, np.arange(100) < 90
    assert share(flags, done).probability == pytest.approx(10 / 90)
    assert share(flags, done).low == share(flags, np.ones(100, bool)).low
    assert share(flags, done).high == share(np.arange(100) < 20, np.ones(100, bool)).high


@pytest.mark.slow
def test_the_isolator_and_bandwidth_stop_what_swings(comparison: Comparison) -> None:
    locked, faster, free = comparison.results
    assert locked.swinging.low > 0.4
    for result in (faster, free):
        assert result.swinging.probability == 0
        assert result.settled == COUNT
    assert not comparison.as_built
    assert comparison.ranked == (faster, free, locked)
    assert faster.settling.value < free.settling.value < np.inf == locked.settling.value
    assert faster.force.value > locked.force.value
    assert locked.error.value > 1e-4 > 1e-8 > faster.error.value


def test_a_run_as_built_is_that_of_friso_simulate(built: Stage) -> None:
    """With the machines of the file, without noise: the same outcome, settling time, force and error."""
    ideal = {"drive.encoder_noise": None, "drive.relative_noise": None, "rail": None}
    stage = built.replace(ideal)
    fleet, _ = draw_common([stage], [Correlations()], COUNT, 1)
    own = replace(fleet, ratios={key: np.ones(COUNT) for key in fleet.ratios}, shifts={})
    (measured,) = study._Work(own, 1, 1e-6, True).runs(stage, np.arange(2), 1)
    run = friso.simulate(stage).measures
    assert measured.outcome.tolist() == 2 * run.outcome.tolist()
    expected = run.settling_time[0], run.largest_force, np.abs(run.offset) + run.peak_to_peak / 2
    for column, value in zip((measured.settling, measured.force, measured.error), expected, strict=True):
        np.testing.assert_allclose(column, 2 * value.tolist(), rtol=1e-6)


def test_a_drive_without_a_clock_gets_one_beside_one_with(built: Stage) -> None:
    plain = built.replace({"drive": None, "rail": None, "cable": None})
    both = compare({"built": built.replace(SHORT), "plain": plain.replace(SHORT)}, COUNT, 1)
    assert both.as_built
    assert ["plain" in note and "50 us" in note for note in both.notes] == [True]
    assert not compare({"plain": plain}, COUNT, 1).as_built


SHORT = {"motion.return_at": "0.3 s", "motion.duration": "0.8 s"}


@pytest.mark.slow
def test_with_one_file_it_tries_what_tune_writes() -> None:
    """The bandwidth that friso tune finds with the joint locked, and the file's own joint; or tune's isolator."""
    rig = load(RIG)
    stages, notes = study.with_remedies(rig, 1e-6, 1, Correlations())
    assert [*stages] == [LOCKED, FASTER, ISOLATOR]
    assert not notes
    tuned = method.tune(stages[LOCKED], chosen=[BANDWIDTH]).outcomes[0].stage
    assert stages[FASTER] == tuned
    assert stages[ISOLATOR] == rig


@pytest.mark.parametrize(
    ("files", "names", "columns"),
    [
        (("a", "b"), (), ["a", "b"]),
        (("a", "b", "c"), ("x", "yy", "z"), ["x", "yy"]),
        (("a", "c", "b"), (), ["a", "b"]),
        (("a", "folder/a"), (), ["folder/a.toml"]),
    ],
)
def test_columns_are_the_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: tuple[str, ...], names: tuple[str, ...], columns: list[str]
) -> None:
    """By name or as called; the same stage stands once, under the longer name."""
    rig = load(RIG)
    (tmp_path / "folder").mkdir()
    for name, stage in {"a": rig, "b": rig.replace({"joint.locked": True}), "c": rig, "folder/a": rig}.items():
        (tmp_path / f"{name}.toml").write_text(stage.to_toml(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    asked: list[dict[str, Stage]] = []
    monkeypatch.setattr(study, "compare", lambda stages, *_: asked.append(stages))
    friso.compare([f"{name}.toml" for name in files], names=names or None)
    assert [*asked[0]] == columns


def settled_by_hand(comparison: Comparison) -> Comparison:
    """The comparison with evenly spread settling times, forces and errors. A stage that hunts for a while before it
    settles does so at another time after one other bit, so that processors differ in the quantiles of few machines."""
    results = []
    for place, result in enumerate(comparison.results, 1):
        spread = {}
        for name, unit in {"settling": 0.3, "error": 1e-6, "force": 5.0}.items():
            values = getattr(result.measures, name)
            spread[name] = np.where(np.isfinite(values), place * np.geomspace(0.9 * unit, 1.1 * unit, COUNT), values)
        results.append(with_measures(result, **spread))
    return replace(comparison, results=tuple(results))


WRITTEN = {*(f"compare.{ending}" for ending in ("html", "pdf", "png", "svg"))}


@pytest.fixture
def found(comparison: Comparison, monkeypatch: pytest.MonkeyPatch) -> Comparison:
    """The comparison, as the command finds it without work."""
    by_hand = settled_by_hand(comparison)
    monkeypatch.setattr(study, "with_remedies", lambda *inputs: ({}, ()))
    monkeypatch.setattr(study, "compare", lambda *inputs: by_hand)
    return by_hand


@pytest.mark.slow
def test_command_writes_page_and_figures(
    tmp_path: Path, found: Comparison, monkeypatch: pytest.MonkeyPatch, snapshots: Snapshots
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    done = friso_inside(tmp_path, "compare", EXAMPLE, "--out", "out", "--json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert [*document["stages"]] == [result.name for result in found.results]
    for stage in document["stages"].values():
        assert stage["swings"]["low"] <= stage["swings"]["probability"] <= stage["swings"]["high"]
    assert document["stages"][LOCKED]["settling_time_s"]["value"] is None
    assert {item.name for item in (tmp_path / "out").iterdir()} == WRITTEN
    page = Page((tmp_path / "out" / "compare.html").read_text(encoding="utf-8"))
    assert [tag for tag in page.tags if tag in ("table", "figure")] == ["figure", "table"]
    snapshots.check("compare", "page", page.lines)
    snapshots.check("compare", "run", friso_inside(tmp_path, "compare", EXAMPLE, "--details").stdout)


@pytest.mark.slow
def test_words_follow_the_numbers(comparison: Comparison, snapshots: Snapshots) -> None:
    """Isolator or firmware: the answer names the best of the other kind, not the second best controller."""
    locked, faster, free = comparison.results
    second, slow = replace(with_measures(faster, settling=0.2), name="gains"), with_measures(free, settling=4.0)
    late = with_measures(free, settling=np.where(np.arange(COUNT) < 3, np.inf, 2.0))
    told: dict[str, tuple[Compared, ...]] = {
        "both settle": (locked, with_measures(faster, settling=0.1), slow),
        "one settles": (locked, slow),
        "none settles": (locked, late),
        "one file": (replace(late, name="stage.toml"),),
        "best of each kind": (locked, second, with_measures(faster, settling=0.1), slow),
    }
    for name, results in told.items():
        snapshots.check("compare", name, "\n".join(sentences(replace(comparison, results=results))))
    left = replace(comparison, results=(locked,), not_run=(FASTER, ISOLATOR))
    snapshots.check("compare", "interrupted", "\n".join(sentences(left)))
    assert compare_document(left)["interrupted"]
    assert [len(cells) for _, cells in rows(comparison)] == 5 * [3]


def test_ctrl_c_keeps_the_stages_that_were_run() -> None:
    """Before the first stage has run there is nothing to keep."""

    def interrupted(at: str) -> Comparison:
        def progress(done: int, total: int, label: str) -> None:
            if label == at:
                raise KeyboardInterrupt

        return compare(dict.fromkeys("abc", load(RIG)), COUNT, 1, progress=progress)

    cut = interrupted("b")
    assert ([result.name for result in cut.results], cut.not_run) == (["a"], ("b", "c"))
    with pytest.raises(KeyboardInterrupt):
        interrupted("a")
