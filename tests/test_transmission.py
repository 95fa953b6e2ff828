"""A screw or belt between motor and load, with encoders on either side: against models written by hand."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import friso
from benchmarks.by_hand import XF, X, by_hand
from friso.equations.bandwidth import faster
from friso.equations.controllers.pid import numbers
from friso.equations.structure import structure
from friso.frequency.bode import limits, settled_members
from friso.frequency.loops import plant, response
from friso.frequency.margins import loops, spectral_abscissa
from friso.frequency.system import DriveTiming, Members, limit_cases, member
from friso.hunting import Decline, Ensemble, Feeding, cannot_hunt, hunting, unstable
from friso.hunting.feeding import feeding
from friso.hunting.settings import CheckSettings
from friso.questions.check.words import feeding_sentences
from friso.stage import Stage
from friso.stage.plausible import idle_encoder
from friso.virtual_rig.run import run
from friso.virtual_rig.task import own_motion

LUGRE = {
    "model": "lugre",
    "static": "12 N",
    "coulomb": "8 N",
    "stribeck_velocity": "3 mm/s",
    "stribeck_exponent": 2,
    "bristle_stiffness": "2e6 N/m",
    "bristle_damping": "1e3 N*s/m",
    "viscous": "50 N*s/m",
}
AT_MOTOR = {**LUGRE, "static": "30 N", "coulomb": "20 N", "stribeck_velocity": "2 mm/s", "bristle_stiffness": "1e7 N/m"}
SCREW = {
    "inertia": "1.2e-4 kg*m^2",
    "lead": "10 mm",
    "stiffness": "50 N/um",
    "damping": "4e3 N*s/m",
    "backlash": "20 um",
}
BY_RATE = {"kind": "pid", "kp": "2e5 N/m", "kd": "8e3 N*s/m", "ki": "2e6 N/(m*s)", "derivative_on": "measurement"}
USUAL = {"kind": "pid", "crossover": "15 Hz", "alpha": 0.1, "beta": 2}
BELT = {"mass": "40 kg", "stiffness": "2.5 N/um", "damping": "440 N*s/m", "backlash": "20 um"}


def machine(**tables: object) -> Stage:
    usual = {
        "masses": {"stage": "20 kg"},
        "friction": LUGRE,
        "motor_friction": AT_MOTOR,
        "transmission": SCREW,
        "encoder": {"position": "load", "velocity": "load"},
        "controller": USUAL,
        "motion": {"kind": "step", "size": "1 mm", "duration": "0.5 s"},
    }
    return Stage(**{name: table for name, table in {**usual, **tables}.items() if table is not None})


@pytest.fixture(scope="module")
def backlash_alone() -> Stage:
    controller = {"kind": "pid", "crossover": "10 Hz", "alpha": 0.1, "beta": 2}
    return machine(transmission=BELT, friction=None, motor_friction=None, controller=controller)


def test_it_is_read_and_written() -> None:
    stage = machine()
    assert friso.loads(stage.to_toml()) == stage
    flat = stage.flat()
    assert flat["transmission.mass"] == pytest.approx(1.2e-4 * (2 * np.pi / 0.01) ** 2)
    assert flat["controller.tuned_mass"] == pytest.approx(20 + flat["transmission.mass"])
    assert not structure(stage.replace({"transmission.backlash": None}).flat()).plays
    transmission = {"inertia": "1.2e-4 kg*m^2", "ratio": 20, "stiffness": "2e4 N*m/rad", "damping": "20 N*m*s/rad"}
    turntable = Stage(
        axis={"kind": "rotary"},
        masses={"stage": "0.5 kg*m^2"},
        transmission=transmission,
        encoder={"position": "load", "velocity": "motor"},
        controller={"kind": "pid", "kp": "2e3 N*m/rad"},
        motion={"kind": "step", "size": "1 deg", "duration": "1 s"},
    )
    assert turntable.flat()["transmission.mass"] == pytest.approx(1.2e-4 * 400)


def test_an_encoder_that_no_controller_reads_is_named() -> None:
    """An encoder is not named if the controller uses a velocity, or if both encoders are on one side."""
    sides = {"position": "load", "velocity": "motor"}
    cascade = {"kind": "cascade", "kv": "40 1/s", "kp": "4e3 N*s/m"}
    for controller, idle in ((USUAL, 1), ({**BY_RATE, "kd": "0 N*s/m"}, 1), (BY_RATE, 0), (cascade, 0)):
        assert len([*idle_encoder(machine(encoder=sides, controller=controller))]) == idle
    assert not [*idle_encoder(machine())]


NOTCH = {"kind": "notch", "frequency": "200 Hz", "width": "80 Hz", "depth": 0.8}
LOW_PASS = {"kind": "low_pass", "path": "feedback", "frequency": "300 Hz"}
LOOPS = {"kind": "cascade", "kv": "40 1/s", "kp": "8e3 N*s/m", "velocity_integral_time": "20 ms"}


@pytest.mark.cases(slow=1)
@pytest.mark.parametrize(
    "stage",
    [
        machine(),
        machine(controller={**LOOPS, "filters": [NOTCH, LOW_PASS]}, encoder={"position": "load", "velocity": "motor"}),
    ],
    ids=["PID on the load", "cascade on both encoders"],
)
def test_traces_of_load_and_motor_against_equations_by_hand(stage: Stage) -> None:
    response, equations = friso.simulate(stage, rtol=1e-9, sample_time=2e-3), by_hand(stage.flat())
    load, motor = equations.run(equations.start(), response.time.values, 1e-11)[:, [X, XF]].T
    assert np.ptp(motor - load) > stage.flat()["transmission.backlash"]
    assert np.abs(response["position"].values - load).max() < 2e-9
    assert np.abs(response["motor_position"].values - motor).max() < 2e-9


def test_linear_cases_are_on_a_flank() -> None:
    stage = machine()
    flat = stage.flat()
    load, motor = flat["masses.stage"], flat["transmission.mass"]
    k, d = flat["transmission.stiffness"], flat["transmission.damping"]
    stuck = plant(flat, limit_cases(flat)["stuck"])
    k_load, d_load = flat["friction.bristle_stiffness"], flat["friction.bristle_damping"] + flat["friction.viscous"]
    k_motor = flat["motor_friction.bristle_stiffness"]
    d_motor = flat["motor_friction.bristle_damping"] + flat["motor_friction.viscous"]
    a = np.array(
        [
            [0, 1, 0, 0],
            [-(k + k_load) / load, -(d + d_load) / load, k / load, d / load],
            [0, 0, 0, 1],
            [k / motor, d / motor, -(k + k_motor) / motor, -(d + d_motor) / motor],
        ]
    )
    assert np.allclose(np.sort_complex(np.linalg.eigvals(stuck.a[0])), np.sort_complex(np.linalg.eigvals(a)), rtol=1e-6)
    at_load = stuck.take(("force",), ("stage",)).at(np.array([30j]))[0, 0, 0, 0]
    at_motor = plant(stage.replace({"encoder.position": "motor"}).flat(), member()).take(("force",), ("stage",))
    inverse = np.linalg.inv(30j * np.eye(4) - a)[:, 3] / motor
    assert at_load == pytest.approx(inverse[0], rel=1e-6)
    assert at_motor.at(np.array([30j]))[0, 0, 0, 0] == pytest.approx(inverse[2], rel=1e-6)


def described(stage: Stage, harmonics: int) -> tuple[float, float]:
    """Return amplitude of the load [m] and period [s] by the describing function of the play.

    The odd harmonics of the deflection balance those of the force on the flanks, where the damper acts beside the
    spring.
    """
    flat, (k_p, tau_z, tau_i, tau_p) = stage.flat(), numbers(stage.flat()).values()
    load, motor, half = flat["masses.stage"], flat["transmission.mass"], flat["transmission.backlash"] / 2
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = a[5, 4] = 1
    a[3] = k_p / motor * np.array([-tau_z / tau_p, 0, 0, 0, 1 + tau_z / tau_i - tau_z / tau_p, 1 / tau_i])
    a[4, [0, 4]] = -1 / tau_p
    push = np.array([0, 1 / load, 0, -1 / motor, 0, 0])
    orders, angle = 2 * np.arange(harmonics) + 1, np.arange(8192) * 2 * np.pi / 8192
    waves = np.exp(1j * np.outer(orders, angle))

    def moved(omega: float, force: np.ndarray) -> np.ndarray:
        """Complex amplitudes of load and motor, shape (2, harmonics)."""
        systems = 1j * omega * orders[:, None, None] * np.eye(6) - a
        return np.linalg.solve(systems, push[:, None] * np.ones((harmonics, 1, 1)))[:, [0, 2], 0].T * force

    def exerted(omega: float, deflection: np.ndarray) -> np.ndarray:
        gap, rate = np.real(deflection @ waves), np.real((1j * orders * omega * deflection) @ waves)
        on_flank = flat["transmission.stiffness"] * (gap - np.sign(gap) * half) + flat["transmission.damping"] * rate
        return 2 / angle.size * (np.conj(waves) @ np.where(np.abs(gap) > half, on_flank, 0.0))

    def cycle(unknown: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Angular frequency [rad/s], deflections [m], and motions of load and motor [m]."""
        omega, some = 100 * unknown[0], unknown.size // 2
        deflection = np.zeros(harmonics, complex)
        deflection[:some] = half * (unknown[1::2] + 1j * np.append(0.0, unknown[2::2]))
        return omega, deflection, moved(omega, exerted(omega, deflection))

    def left_over(unknown: np.ndarray) -> np.ndarray:
        _, deflection, (of_load, of_motor) = cycle(unknown)
        left = ((of_motor - of_load - deflection) / deflection[0].real)[: unknown.size // 2]
        return np.append(left.real, left.imag)

    solution = np.array([3.0, 1.5])
    for some in range(1, harmonics + 1):  # steps that cross samples: the damper makes the force jump
        begin = np.append(solution, np.zeros(2 * some - solution.size))
        solution = least_squares(left_over, begin, x_scale="jac", xtol=1e-12, ftol=1e-12, diff_step=1e-3).x
    assert np.abs(left_over(solution)).max() < 2e-3
    omega, _, (of_load, _) = cycle(solution)
    return np.ptp(np.real(of_load @ waves)) / 2, 2 * np.pi / omega


@pytest.mark.slow
def test_an_integrator_across_a_backlash_hunts_without_friction(backlash_alone: Stage) -> None:
    """Shooting, long simulation and the describing function of its harmonics find the same cycle.

    The describing function of the first harmonic alone is an approximation.
    """
    assert not cannot_hunt(backlash_alone)
    assert not unstable(backlash_alone)
    (cycle,) = hunting(backlash_alone).attracting
    long = friso.simulate(backlash_alone.replace({"motion.duration": "6 s"}), rtol=1e-8, sample_time=1e-2)
    times, turns = (long[name].values[-41:] for name in ("turning_time", "turning_deviation"))
    assert cycle.symmetric
    assert cycle.amplitude == pytest.approx(np.ptp(turns) / 2, rel=1e-4)
    assert cycle.period == pytest.approx((times[-1] - times[0]) / 20, rel=1e-4)
    for harmonics, within in ((1, 0.05), (3, 2e-3)):
        amplitude, period = described(backlash_alone, harmonics)
        assert cycle.amplitude == pytest.approx(amplitude, rel=within)
        assert cycle.period == pytest.approx(period, rel=within)


def test_without_backlash_and_friction_nothing_hunts(backlash_alone: Stage) -> None:
    assert cannot_hunt(backlash_alone.replace({"transmission.backlash": "0 um"}))


def test_a_backlash_that_hunts_without_friction_feeds_it(backlash_alone: Stage) -> None:
    """All motions shrink in proportion to the backlash, so no small share of it ends them."""
    result = feeding(backlash_alone)
    assert (result.friction, result.backlash.needed, result.backlash.gone) == (None, True, 0.0)
    assert "backlash" in " ".join(feeding_sentences(result))


@pytest.mark.slow
@pytest.mark.parametrize(("share", "certain"), [(0.01, True), (0.001, False)])
def test_what_feeds_it_is_computed(share: float, certain: bool) -> None:
    """A belt with backlash and little friction still swings without friction, and rests with less backlash.

    If the backlash is so small that swings may be below the search's resolution, the answer is not certain.
    """
    keys = {"kind": "pid", "crossover": "10 Hz", "alpha": 0.1, "beta": 2}
    little = {**LUGRE, "static": "3 N", "coulomb": "2 N"}
    with CheckSettings(feeding_shares=(share,)).in_use():
        result = feeding(machine(transmission=BELT, friction=little, motor_friction=None, controller=keys))
    assert result == Feeding(Decline(share, None, True), Decline(1.0, share, certain))


@pytest.mark.parametrize(("position", "velocity"), [("load", "motor"), ("motor", "motor")])
def test_a_drive_as_built_reads_its_encoders(position: str, velocity: str) -> None:
    """Sampled fast, it moves as in continuous time, where each encoder is on its side."""
    move = {"acceleration": "2 m/s^2", "acceleration_time": "10 ms", "return_at": "60 ms", "duration": "0.12 s"}
    motion = {"kind": "there_and_back", **move}
    sides = {"position": position, "velocity": velocity}
    stage = machine(encoder=sides, controller=BY_RATE, motion=motion)
    fast = stage.replace({"drive": {"sample_time": "20 us"}})
    (recorded,) = run(fast, own_motion(fast), [1], 1e-3)
    smooth = friso.simulate(stage, 1e-7, 1e-3)["position"].values
    others = machine(encoder={**sides, "velocity": "load"}, controller=BY_RATE, motion=motion)
    other = friso.simulate(others, 1e-7, 1e-3)["position"].values
    count = min(smooth.size, recorded.true["position"].shape[1])
    error = np.abs(recorded.true["position"][0, :count] - smooth[:count]).max()
    assert error < 2e-6
    assert np.abs(other[:count] - smooth[:count]).max() > 5 * error, "the side makes no difference"


@pytest.mark.slow
def test_bode_across_a_transmission() -> None:
    """Loops of all states with encoders on both sides, sampled: as they are one by one; the fastest controller."""
    drive = {"sample_time": "100 us", "delay": "100 us"}
    stage = machine(encoder={"position": "load", "velocity": "motor"}, drive=drive, controller=BY_RATE)
    flat, omega = stage.flat(), np.geomspace(1.0, 300.0, 7)
    every = limit_cases(flat).values()
    together = loops(flat, Members.joined([*every]), omega)
    one_by_one = [response(flat, case, DriveTiming.of(flat))(omega) for case in every]
    assert together == pytest.approx(np.array(one_by_one), rel=0.03)  # but for the aliases of the plant
    highest = limits(flat).highest_stable
    edge = [spectral_abscissa(faster(flat, highest * f), settled_members(flat)).max() for f in (0.99, 1.01)]
    assert edge[0] < 0 < edge[1]


def test_steady_friction_is_that_of_both_sides() -> None:
    """The search for small cycles asks for it: the Stribeck curves of guide and motor, forward and back."""
    flat, speeds = machine().flat(), np.array([-3e-3, -1e-4, 1e-4, 3e-3])
    expected = np.zeros(4)
    for table in ("friction", "motor_friction"):
        static, coulomb, at, viscous = (
            flat[f"{table}.{name}"] for name in ("static", "coulomb", "stribeck_velocity", "viscous")
        )
        expected += np.sign(speeds) * (coulomb + (static - coulomb) * np.exp(-((speeds / at) ** 2))) + viscous * speeds
    assert Ensemble.held(flat, 4).steady_friction(speeds) == pytest.approx(expected, rel=1e-12)


def test_the_isolator_stands_on_the_load_side() -> None:
    """Motor, screw, stage, joint and cart in a row, the actuator acting on the stage and the bearing on the cart: poles
    and answers of a model by hand."""
    joint = {"stiffness": "0.4 N/um", "damping": "30 N*s/m", "stroke": "1 mm", "limiter_stiffness": "50 N/um",
             "limiter_damping": "100 N*s/m"}  # fmt: skip
    stage = machine(
        masses={"cart": "12 kg", "stage": "8 kg"}, joint=joint, friction=None, motor_friction=None,
        transmission={**SCREW, "backlash": "0 um"}, controller=BY_RATE)  # fmt: skip
    flat = stage.flat()
    masses = np.array([flat["transmission.mass"], 8.0, 12.0])
    springs = np.array([flat["transmission.stiffness"], flat["joint.stiffness"]])
    dampers = np.array([flat["transmission.damping"], flat["joint.damping"]])
    between = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    k, d = (between.T @ np.diag(values) @ between for values in (springs, dampers))
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-k / masses[:, None], -d / masses[:, None]]])
    system = plant(flat, next(iter(limit_cases(flat).values())))
    s = 2j * np.pi * np.array([3.0, 30.0, 300.0])
    for encoder, body in (("load", 1), ("motor", 0)):
        seen = plant(stage.replace({"encoder.position": encoder}).flat(), next(iter(limit_cases(flat).values())))
        ours = seen.take(("force",), ("stage",)).at(s)[0, :, 0, 0]
        theirs = [np.linalg.solve(w * np.eye(6) - a, np.eye(6)[3] / masses[0])[body] for w in s]
        assert ours == pytest.approx(np.array(theirs), rel=1e-9)
    moving = np.sort_complex(np.linalg.eigvals(system.a[0]))
    assert moving[np.abs(moving) > 1] == pytest.approx(
        np.sort_complex(np.linalg.eigvals(a))[np.abs(np.sort_complex(np.linalg.eigvals(a))) > 1], rel=1e-6
    )
