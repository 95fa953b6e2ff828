"""A vertical axis: its weight is a constant force, which the actuator carries before anything moves."""

import numpy as np
import pytest

import friso
from friso.hunting import displacements_that_hunt, hunting, pushes_that_hunt
from friso.stage import Stage
from friso.virtual_rig.run import run as run_on_rig
from friso.virtual_rig.task import MoveTask

WEIGHT = 20.0
CONTROLLERS = {
    "pid": {"kind": "pid", "crossover": "20 Hz", "alpha": 0.1, "beta": 2},
    "pd": {"kind": "pid", "kp": "20 N/mm", "kd": "300 N*s/m", "tau": "1 ms"},
    "cascade": {"kind": "cascade", "kv": "30 1/s", "kp": "250 N*s/m", "velocity_integral_time": "20 ms"},
    "adrc": {"kind": "adrc", "bandwidth": "10 Hz", "observer_ratio": 5},
    "transfer function": {"kind": "transfer_function", "numerator": [2e5, 2.4e7, 2.4e8], "denominator": [1, 400, 0]},
}
AS_BUILT = {"sample_time": "100 us", "delay": "100 us"}


def axis(controller: dict, weight: float = WEIGHT, **tables: dict) -> Stage:
    """The thesis's rig as a rigid vertical axis that counts upwards, held at its reference."""
    rig = friso.load(friso.example("thesis_rig"))
    hold = {"joint": None, "parasitic": None, "motion": {"kind": "hold", "duration": "1 s"}}
    return rig.replace({**hold, "bias": {"stage": f"{-weight} N"}, "controller": controller, **tables})


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("drive", [{}, {"drive": AS_BUILT}], ids=["continuous", "as built"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_held_axis_stays_where_it_is(name: str, drive: dict) -> None:
    """Without an integral the weight is carried by the error."""
    run = friso.simulate(axis(CONTROLLERS[name], **drive)).data
    assert run.position.values == pytest.approx(-WEIGHT / 20e3 if name == "pd" else 0.0, rel=1e-6, abs=1e-9)
    assert run.force.values == pytest.approx(WEIGHT, rel=1e-6)


def test_a_weight_changes_nothing_of_a_move() -> None:
    """The integral carries it, and everything else is as on a level axis."""
    move = {"kind": "there_and_back", "acceleration": "10 m/s^2", "acceleration_time": "30 ms"}
    move |= {"return_at": "1 s", "duration": "2 s"}
    level, vertical = (friso.simulate(axis(CONTROLLERS["pid"], weight, motion=move)).data for weight in (0.0, WEIGHT))
    assert np.abs(vertical.position - level.position).max() < 1e-7
    assert (vertical.force - level.force).values == pytest.approx(WEIGHT, rel=1e-3)


# --- from rest: one definition for every start ------------------------------------------------------------------------

FREE = {"locked": False, "stiffness": "2.4 N/mm", "damping": "0.5 N*s/m", "stroke": "1 mm"}
FREE |= {"limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}
LOCKED = {"locked": True, "limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}
SCREW = {"mass": "0.5 kg", "stiffness": "20 N/um", "damping": "100 N*s/m"}
BIASES = {
    "weight of both": {"cart": "-12 N", "stage": "-5 N"},
    "bias on the cart": {"cart": "2 N"},
    "preload between them": {"cart": "2 N", "stage": "-2 N"},
}
DRIVES = pytest.mark.parametrize("drive", [{}, {"drive": {"sample_time": "100 us", "delay": "130 us"}}])


@pytest.mark.cases(first=3)
@DRIVES
@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize(
    "structure",
    [
        {"joint": FREE},
        {"joint": LOCKED},
        {"joint": {**FREE, "stroke": "0 mm"}},
        {"joint": FREE, "parasitic": {"frequency": "300 Hz", "mass": "0.25 kg", "damping_ratio": 0.01}},
    ],
    ids=["free", "locked", "touching", "parasitic"],
)
def test_a_joint_is_deflected_from_the_start(structure: dict, bias: str, drive: dict) -> None:
    """5 mm of sag are stopped by the limiter at 1 mm; nothing moves, and friction bears nothing."""
    run = friso.simulate(axis(CONTROLLERS["pid"]).replace({**structure, "bias": BIASES[bias], **drive})).data
    for name in ("position", "cart_position", "joint_deflection"):
        assert np.ptp(run[name].to_numpy()) < 1e-12
    own = float(BIASES[bias]["cart"].split()[0])
    assert run.joint_force.values == pytest.approx(-own, rel=1e-9)
    assert np.abs(run.friction_force).max() < 1e-9


@pytest.mark.cases(first=2)
@DRIVES
@pytest.mark.parametrize("velocity", ["load", "motor"])
@pytest.mark.parametrize("position", ["load", "motor"])
@pytest.mark.parametrize("backlash", [{}, {"backlash": "20 um"}], ids=["tight", "with backlash"])
def test_a_transmission_is_on_its_flank_from_the_start(
    backlash: dict, position: str, velocity: str, drive: dict
) -> None:
    cascade = axis(CONTROLLERS["cascade"]).replace({
        "transmission": {**SCREW, **backlash},
        "encoder": {"position": position, "velocity": velocity},
        **drive,
    })  # fmt: skip
    run = friso.simulate(cascade).data
    assert np.ptp(run.position.to_numpy()) < 1e-12
    assert run.position[0] == 0
    assert run.force.values == pytest.approx(WEIGHT, rel=1e-9)
    assert run.transmission_deflection.values == pytest.approx(WEIGHT / 20e6 + 1e-5 * bool(backlash), rel=1e-6)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("drive", [{}, {"drive": {**AS_BUILT, "motor_constant_ratio": 0.8}}])
def test_a_release_is_a_step_of_the_reference_that_the_derivative_does_not_see(drive: dict) -> None:
    """At a displacement the controller has carried the weight, in continuous time and sampled."""
    controller = {**CONTROLLERS["pd"], "ki": "100 N/(mm*s)", "derivative_on": "measurement"}
    stage = axis({**controller, "anti_windup": "clamp", "force_limit": "200 N"}, **drive)
    release = {"kind": "release", "displacement": "2 mm", "duration": "1 s"}
    step = {"kind": "step", "size": "-2 mm", "duration": "1 s"}
    released, stepped = (friso.simulate(stage.replace({"motion": motion})).data for motion in (release, step))
    late = 2 if drive else 0  # a step comes one sample after the start, and acts one later
    here, there = released.position.to_numpy(), stepped.position.to_numpy()
    assert here[: len(here) - late] == pytest.approx(there[late:] + 2e-3, abs=1e-6 if drive else 1e-8)
    assert released.force[0] == pytest.approx(WEIGHT - 20e3 * 2e-3 * (0.8 if drive else 1.0), rel=1e-3)


def test_a_cable_is_carried_from_the_start() -> None:
    """With the drive as built, a stage that stands off the place where its cable is relaxed does not move."""
    stage = axis(CONTROLLERS["pid"], drive=AS_BUILT).replace({"cable": {"stiffness": "1 N/mm"}})
    task = MoveTask(np.array([[0.0, 0.02, 0.0, 0.0]]), 0.5)
    (run,) = run_on_rig(stage, task, [1], 1e-3)
    assert np.ptp(run.true["position"]) < 1e-9
    assert run.logged["force"] == pytest.approx(WEIGHT + 20.0, rel=1e-6)


@pytest.mark.slow
def test_pushes_hunt_alike_with_a_weight_and_without() -> None:
    """The integral carries the weight before the push, as before a displacement; a level axis is the same."""
    kicks = []
    for weight in (0.0, WEIGHT):
        stage = axis(CONTROLLERS["pid"] | {"crossover": "8 Hz"}, weight)
        target = hunting(stage).target
        assert target is not None
        kicks.append((pushes_that_hunt(stage, target), displacements_that_hunt(stage, target)))
    for level, vertical in zip(*kicks, strict=True):
        ends = np.ravel(level.towards(1.0))
        assert len(ends) >= 6
        for side in (1.0, -1.0):
            assert np.ravel(vertical.towards(side)) == pytest.approx(ends, rel=0.02)
