"""The steps of the design method, each by a second way."""

from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from book import BOOK

import friso
from friso.design_method.method import NoDesign, leaves
from friso.design_method.prepare import prepared, with_leaves
from friso.design_method.requirements import (
    MODEL_RESERVE,
    PARASITIC,
    Candidate,
    LeafTask,
    chosen,
    confirmed,
    evaluate_geometries,
    front,
    relaxed_requirements,
    requirements,
)
from friso.design_method.settings import DesignSettings
from friso.design_method.spec import Geometry, Sheet, Spec, box, load_spec, mechanisms, sheets, sizes_of
from friso.design_method.verification import (
    VERIFIED_RTOL,
    MachineOutcomes,
    Modal,
    Population,
    choose_controller,
    comfortable_below,
    corners,
    dampings,
    edges_over,
    move_machines,
    rigid,
    verification,
)
from friso.equations.bandwidth import least_breakaway
from friso.frequency.bode import limits, settled_margin
from friso.hunting import find_margin
from friso.hunting.measures import measured_run
from friso.leaf_springs import beams as beams_module
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import BeamFailure
from friso.leaf_springs.closed_forms import closed_form_model
from friso.leaf_springs.mechanism import Evaluation, Mechanism
from friso.stage import Stage

EXAMPLES = Path(__file__).parent.parent / "examples"
SPEC = load_spec(EXAMPLES / "specs" / "thesis.toml")


@pytest.fixture(scope="module")
def base() -> Stage:
    """The thesis rig, prepared for leaf springs."""
    return prepared(friso.load(EXAMPLES / "thesis_rig.toml"), SPEC)


@pytest.fixture(scope="module")
def task(base: Stage) -> LeafTask:
    return LeafTask(SPEC, 1e-3, 48.0, 1.0, base.flat())


@pytest.fixture(scope="module")
def candidates(task: LeafTask) -> list[Candidate]:
    return front(task)


def loaded(**force: str) -> Spec:
    """The example with another load."""
    kept = ("machine", "friction", "masses", "moves", "position", "leaves")
    return Spec(**{**SPEC.as_written(), "load": force, **{name: getattr(SPEC, name) for name in kept}})


LEAVES = Geometry(60e-3, 18e-3, 50e-3, Sheet(2.0, 0.3e-3, "stainless 1.4310"))


@pytest.fixture(scope="module")
def guided(base: Stage) -> Stage:
    """The stage on leaf springs."""
    return with_leaves(base, LEAVES, 1e-3)


# --- leaf springs -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_front_is_a_front(task: LeafTask, candidates: list[Candidate]) -> None:
    """No candidate is beaten in both objectives, all meet the requirements, no random geometry is 10 % better."""
    stiffness, frequency = (
        np.array([getattr(candidate, name) for candidate in candidates]) for name in ("stiffness", "frequency")
    )
    assert np.all(np.diff(stiffness) >= 0)
    assert np.all(np.diff(frequency) >= -1e-9 * frequency[:-1])
    wanted = [requirement for requirement in requirements(task) if requirement.name != PARASITIC]
    geometries = [candidate.geometry for candidate in candidates]
    result = evaluate_geometries(task, wanted, sizes_of(geometries), [item.sheet for item in geometries])
    assert np.all(result.excess <= 1 + 1e-9)
    low, high = box(SPEC)
    rng, bought = np.random.default_rng(0), sheets(SPEC)
    sizes = low + (high - low) * rng.random((20_000, 3))
    tried_ = evaluate_geometries(task, wanted, sizes, [bought[k] for k in rng.integers(len(bought), size=len(sizes))])
    allowed = np.all(tried_.excess <= 1, axis=1)
    assert allowed.any()
    better = np.interp(tried_.stiffness[allowed] * 1.1, stiffness, frequency, left=np.inf)
    assert not np.any(tried_.frequency[allowed] > better * 1.1)


@pytest.mark.slow
def test_better_than_the_thesis_in_both(task: LeafTask, candidates: list[Candidate]) -> None:
    """At the thesis's own specification the method beats 70 x 45 x 0.35 mm in stiffness and parasitic frequency."""
    thesis = Geometry(70e-3, 45e-3, 60e-3, Sheet(2.0, 0.35e-3, "stainless 1.4310"))
    own = closed_form_model(mechanisms(task.flat, sizes_of([thesis]), [thesis.sheet]).member(0), 1e-3)
    choice = chosen(replace(task, crossover=40.0), candidates)
    assert choice.beams.drive[0] <= own.drive[0]
    assert choice.frequency >= own.interfering.frequency
    assert 1.1 * choice.beams.forces[-1] <= 1.0  # the cart stays where it is with the least static friction
    assert np.all(choice.excess <= 1)


def test_requirements_by_the_evaluation(task: LeafTask) -> None:
    """The requirements, written for arrays, against the figures of one mechanism."""
    geometry = Geometry(60e-3, 20e-3, 50e-3, Sheet(2.0, 0.3e-3, "stainless 1.4310"))
    item = mechanisms(task.flat, sizes_of([geometry]), [geometry.sheet]).member(0)
    result = closed_form_model(item, task.stroke)
    excess = {requirement.keys[0].key: float(requirement.excess(item)) for requirement in requirements(task)}
    weight = 9.80665 * 0.525  # of the heaviest stage
    assert excess["friction.static"] == pytest.approx(1.1 * 1.1 * result.forces[-1])
    bent, twisted = 195e9 * 20e-3 * 0.3e-3**3 / 12, 75e9 * 20e-3 * 0.3e-3**3 / 3
    across = 1 / (2 * 9.23 * np.sqrt(bent * twisted) / 60e-3**2)  # J of a strip; 1 % less for its finite width
    assert excess["safety.buckling"] == pytest.approx(
        MODEL_RESERVE * 3 * ((5 + weight) / result.buckling + across), rel=0.01
    )
    assert excess["safety.parasitic"] == pytest.approx(480 / result.interfering.frequency, rel=1e-6)
    # a force across the leaf ends turns the stage about z: each leaf is a cantilever (by the stiffness of the stage)
    moved = np.linalg.solve(closed_forms.stage_stiffness(item), [0, 1, 0, 0, 0, 0])
    root = -(closed_forms.stage_stiffness(replace(item, leaves=1.0)) @ moved)[5] + 60e-3 * 0.5
    assert root == pytest.approx(0.5 * 60e-3, rel=1e-6)
    stress = 1.5 * (root * 10e-3 / (0.3e-3 * 20e-3**3 / 12) + (5 + weight) / 2 / (20e-3 * 0.3e-3))
    assert excess["safety.fatigue"] == pytest.approx(MODEL_RESERVE * 1.3 * (1 / result.fatigue_margin + stress / 1.3e9))
    assert excess["safety.strength"] == pytest.approx(MODEL_RESERVE * 1.5 * (result.clamp_stress + stress) / 1.3e9)


@pytest.mark.slow
def test_a_geometry_at_which_beams_fail_is_marked(
    task: LeafTask, candidates: list[Candidate], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The search goes on without it."""
    from friso.design_method import requirements as choice_module

    calls = []

    def sometimes(mechanism: object, stroke: float) -> object:
        calls.append(mechanism)
        if len(calls) % 2:
            raise BeamFailure("The beams gave up.")
        return beams_module.beams(mechanism, stroke)  # type: ignore[arg-type]

    monkeypatch.setattr(choice_module, "beams", sometimes)
    result = list(confirmed(task, candidates))
    assert {item.failure for item in result} == {"", "The beams gave up."}
    assert all(np.isnan(entry.frequency) == bool(entry.failure) for entry in result)
    calls.clear()
    choice = chosen(replace(task, crossover=35.0), candidates)
    assert "The beams gave up." in choice.passed_over


@pytest.mark.thorough
def test_relaxed_alone_a_requirement_lets_leaves_do(base: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stated relaxation is enough, and a tenth less is not."""
    with DesignSettings(front_generations=60, relaxed_generations=60).in_use():
        task = LeafTask(loaded(force_x="200 N"), 1e-3, 0.0, 1.0, base.flat())
        assert not front(task)
        result = {relaxation.key: relaxation for relaxation in relaxed_requirements(task)}
        assert {"load.force_x", "friction.static"} <= result.keys()
        for share, enough in ((1.02, True), (0.9, False)):
            friction = 1 + (result["friction.static"].needed - 1) * share
            assert bool(front(replace(task, friction=friction))) == enough
        lighter = result["load.force_x"].needed
        assert front(replace(task, spec=loaded(force_x=f"{lighter * 0.97:.6g} N")))
        assert not front(replace(task, spec=loaded(force_x=f"{lighter * 1.1:.6g} N")))


def test_no_leaves_no_design(base: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    with DesignSettings(relaxed_generations=5).in_use(), pytest.raises(NoDesign, match="no leaf springs"):
        leaves(loaded(force_x="500 N"), base.flat(), 1.0)


# --- hunting and the controller ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_edges_are_those_that_check_finds(base: Stage) -> None:
    """Two machines without isolator, against the margin of `friso check`; the lower edge to half a step."""
    static, coulomb = np.array([3.0, 2.0]), np.array([1.0, 0.8])
    several = Population({"friction.static": static, "friction.coulomb": coulomb}, 2)
    edges = edges_over(rigid(base.flat()), several, 2.0, 40.0, 10)
    whole = friso.load(EXAMPLES / "thesis_rig.toml").replace({"joint": None, "parasitic": None})
    for k in range(2):
        stage = whole.with_numbers({**several.of(k), "controller.crossover": 5.0})
        edge = find_margin(stage, attracting=True)
        assert edges.edges[k] == pytest.approx(
            edge.crossover, rel=0.02 if k == edges.worst else (40 / 2) ** (1 / 18) - 1
        )
    assert edges.highest == edges.edges.max()


@pytest.mark.slow
def test_corners_hunt_as_long_as_anything_attracts() -> None:
    """The symmetric cycle of this stage repels from 11.97 Hz on; beside it one that is not attracts up to 13.03 Hz, as
    simulations at 1e-7 and 1e-9 show."""
    one = Population({"masses.cart": np.array([2.6276])}, 1)
    edges = edges_over(BOOK["creeping"].flat(), one, 12.1, 20.0, 8)
    assert edges.edges[0] == pytest.approx(13.03, rel=0.01)
    assert edges.unknown == 0


def test_corners_in_which_large_motions_may_run_away_are_not_certain() -> None:
    limit = {"joint": None, "parasitic": None, "controller.force_limit": "500 kN", "controller.anti_windup": "none"}
    limited = friso.load(EXAMPLES / "thesis_rig.toml").replace(limit)
    one = Population({"friction.static": np.array([3.0])}, 1)
    edges = edges_over(limited.flat(), one, 20.0, 40.0, 2)
    assert (edges.hunts, edges.unknown) == (False, 1)


def test_a_stage_that_never_hunts_has_no_edge(base: Stage) -> None:
    """Almost no gap: no cycle attracts anywhere, and none is searched for between."""
    part = Population({"friction.coulomb": np.array([2.999, 2.998])}, 2)
    edges = edges_over(rigid(base.flat()), part, 4.0, 40.0, 3)
    assert not edges.hunts
    assert edges.highest == 4.0


def test_modes_count_in_the_margin(guided: Stage) -> None:
    """With the single mode of the equations, the margin equals theirs.

    If actuator and sensor move against each other, the loop is unstable, as the poles of the state space show.
    """
    stage = guided.replace({"controller.crossover": "40 Hz"})
    result = beams_module.beams(Mechanism.of(stage.flat()), 1e-3)
    assert Modal.of(stage.flat(), result).margin(np.array([40.0]))[0] == pytest.approx(
        settled_margin(stage.flat()), rel=0.01
    )
    opposite = stage.replace({"flexure.actuation_y": "30 mm", "flexure.sensor_y": "-30 mm"})
    against = beams_module.beams(Mechanism.of(opposite.flat()), 1e-3)
    modal = Modal.of(opposite.flat(), against)
    for crossover in (20.0, 40.0):
        tuned = opposite.replace({"controller.crossover": f"{crossover} Hz"})
        assert (modal.margin(np.array([crossover]))[0] > 0) == (rightmost(tuned, against) < 0)
    assert modal.margin(np.array([40.0]))[0] == 0


def rightmost(stage: Stage, leaves_: Evaluation) -> float:
    """Real part [1/s] of the rightmost closed-loop pole with all modes, over the stuck and the sliding cart."""
    flat = stage.flat()
    bare = stage.replace({"flexure": None, "joint.stiffness": f"{float(flat['joint.stiffness'])!r} N/m"})
    tuned = friso.tuning(*(flat[f"controller.{name}"] for name in ("crossover", "alpha", "beta", "tuned_mass")))
    zeros = np.array([tuned.tau_z, 1 + tuned.tau_z / tuned.tau_i, 1 / tuned.tau_i])
    controller = control.tf2ss(control.tf(tuned.k_p * zeros, [tuned.tau_p, 1, 0]))
    result = []
    for state in ("stuck", "sliding"):
        plant = friso.linear(bare, state)["stage", "force"]
        for mode in leaves_.modes[1:]:
            omega = 2 * np.pi * mode.frequency
            swing = [[0, 1], [-(omega**2), -2 * 0.01 * omega]]
            plant = plant + control.ss(swing, [[0], [1]], [[mode.actuator * mode.sensor, 0]], [[0]])
        result.append(control.feedback(plant * controller, 1).poles().real.max())
    return max(result)


@pytest.mark.slow
def test_the_crossover_is_comfortable_and_damping_helps(guided: Stage) -> None:
    stage = guided.replace({"controller.crossover": "40 Hz"})
    ranges = limits(stage.flat()).comfortable
    assert comfortable_below(ranges, 43.0) == pytest.approx(43.0)
    assert comfortable_below(ranges, 20.0) < 12.0  # type: ignore[operator]  # a gap: the joint is hardly damped
    leaves = beams_module.beams(Mechanism.of(stage.flat()), 1e-3)
    modal, crossovers = Modal.of(stage.flat(), leaves), np.geomspace(1, 400, 7)
    together = modal.margin(crossovers).tolist()
    assert together == [float(modal.margin(crossover)[0]) for crossover in crossovers]
    assert min(together) < 0.5 < max(together)
    least = corners(SPEC, stage.flat())
    assert np.min(least_breakaway(least.over(stage.flat()))) == 1.0
    expected = choose_controller(stage, leaves, least)
    assert expected.margin == pytest.approx(settled_margin(stage.flat()), rel=0.01)
    assert expected.margin >= 0.5
    worth = expected.damping.worth
    assert expected.damping.margins[worth] >= 0.95 * expected.damping.margins.max()
    assert np.all(np.diff(dampings(stage.flat())) > 0)
    assert expected.gains.k_p == pytest.approx(1.7 * (2 * np.pi * 40) ** 2 / np.sqrt(10), rel=1e-6)


# --- verification -----------------------------------------------------------------------------------------------------


def test_tried_moves_agree_with_runs_of_their_own(base: Stage) -> None:
    """At 8 Hz the locked rig hunts and the free one settles, in the time of a run at equal tolerance.

    The limiter scatters that time by some per cent from one tolerance to the next, and with the last bits of a
    processor's arithmetic.
    """
    rig = friso.load(EXAMPLES / "thesis_rig.toml")
    flat = rig.flat()
    for held, hunts in ((True, True), (False, False)):
        result = move_machines({**flat, "joint.locked": held}, 1, 1e-6)
        assert result.tried == 1
        assert (result.words[0] == "swings") == hunts
    both_ends = {"joint.locked": False, "motion.return_at": "15.06 s", "motion.duration": "30.12 s"}
    within, _ = measured_run(rig.replace(both_ends), VERIFIED_RTOL).settling_time
    assert result.settling[0] == pytest.approx(within[0], rel=0.02)


def test_verification_counts_and_its_worst_is_reproduced(guided: Stage) -> None:
    reported: list[tuple[int, int]] = []

    def report(done: int, total: int, label: str) -> None:
        reported.append((done, total))

    with DesignSettings(verified_moves=200).in_use():
        outcomes = verification(guided.replace({"controller.crossover": "9 Hz"}), SPEC, 0.3, report)
    ends = [total for done, total in reported if done == total]
    assert ends[0] == 200
    assert outcomes.locked.missed <= ends[-1] < 200  # the long runs of those that are not at rest report, too
    assert outcomes.free.tried == outcomes.locked.tried == 200
    assert outcomes.free.missed == 0
    assert outcomes.locked.missed >= outcomes.locked.swinging > 20
    low, high = outcomes.free.interval
    assert low == 0
    assert high == pytest.approx(1 - 0.025 ** (1 / 200), rel=1e-6)  # Clopper and Pearson for none of 200
    worst = outcomes.free.worst
    again = move_machines({**outcomes.worst.flat(), "joint.locked": False}, 1, float(SPEC.position.window))
    assert again.settling[0] == pytest.approx(outcomes.free.settling[worst], rel=1e-3)


def test_an_outcome_ranks_what_does_not_rest_before_slow_settling() -> None:
    result = MachineOutcomes(
        np.array(["rests", "swings", "creeps", "rests"], dtype=object),
        np.array([0.1, np.nan, np.nan, 3.0]),
        np.array([0, 1e-3, 2e-3, 0]),
    )
    assert result.worst == 2
    assert (result.missed, result.swinging) == (2, 1)
    assert result.slower_than(0.05) == np.inf
    assert replace(result, words=np.full(4, "rests"), settling=np.array([0.1, 0.2, 0.3, 3.0])).worst == 3
