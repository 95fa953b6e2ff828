"""Drives with a clock: against a twin in plain Python, against the continuous loop, and in any lane."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import pytest
import sympy as sp
from compiled import in_all
from plain_axis import DRAG, KI, KP, MASS, TIME, plain_axis
from scipy import signal
from scipy.linalg import expm

from friso.engine import simd_math
from friso.engine.arrays import Results, Status, Tables
from friso.engine.batch import RunOptions, options_of, prepare, run_batch, simulate
from friso.engine.kernel import Kernel, empty_results, kernel
from friso.equations.as_built import NEUTRAL, AsBuilt, _command
from friso.equations.blocks import Loop
from friso.equations.component import Held, key, state
from friso.equations.controllers.pid import Terms
from friso.equations.sampled import sampled_controller
from friso.equations.structure import ControllerForm
from friso.stage import Stage

KD, LIMIT = 60.0, 9.0
DIGIT, NOISE, LAG, RATIO = 1e-5, 3e-6, 150.0, 0.9
MOTION = {"kind": "there_and_back", "acceleration": "4 m/s^2", "return_at": "0.2 s", "duration": "0.4 s"}
DELAYS = (0.0, 0.1, 0.4, 0.9, 2.0, 2.3, 2.6, 2.95)
Flat = dict[str, Any]


def axis(**changes: str) -> Stage:
    return plain_axis(KD, LIMIT, {**MOTION, "acceleration_time": "30 ms"}).replace(changes)


def keys(stage: Stage, delay: float = 0.0, **changes: Any) -> Flat:
    """The flat keys of a stage whose drive waits `delay` samples."""
    drive = {"sample_time": TIME, "late": (delay - int(delay)) * TIME, "delay": delay * TIME, "seed": 1.0}
    drive |= {"current_bandwidth": LAG, "velocity_samples": 2.0, **changes}
    return {**NEUTRAL, **stage.flat(), **{f"drive.{name}": value for name, value in drive.items()}}


FLAT_TABLES = Tables(np.ones((1, 3, 2)), np.array([[0.0, 1.0]]), np.zeros((1, 2, 2)), np.ones(1))

SPACING, GRID, POINTS = 2e-3, 0.5e-3, 9
"""Spacing of the tables over time [s] and over position [m], from -1 mm, and their points; the position exceeds both
ends."""


def surroundings() -> Tables:
    """A motor whose constant changes along the way, a force that is injected and a floor that shakes."""
    time = np.arange(201) * SPACING
    places = np.ones((1, 3, POINTS))
    places[0, 2] = 1 + 0.2 * np.cos(np.arange(POINTS))
    times = np.array([[3 * np.sin(40 * time), 0.2 * np.cos(90 * time)]])
    return Tables(places, np.array([[-1e-3, 1 / GRID]]), times, np.array([1 / SPACING]))


def run(
    flat: Mapping[str, Any], runs: int = 1, tables: Tables = FLAT_TABLES, every: int = 1, **options: Any
) -> tuple[Kernel, Results]:
    shape = kernel(AsBuilt.of({name: np.ravel(value)[0] for name, value in flat.items()}))
    threads = options.pop("threads", None)
    chosen = RunOptions(**{"rtol": 1e-11, "interval": every * TIME, **options})
    batch = prepare(shape, flat, runs, chosen)._replace(tables=tables)
    results = empty_results(runs, 1, round(0.4 / chosen.interval) + 1, shape.sample_size)
    run_batch(shape, batch, options_of(chosen), results, threads)
    return shape, results


def deviate(B):
    B[2] = simd_math.gaussian(B[0], B[1])


def noise(seeds: Any, ticks: Any) -> np.ndarray:
    seeds, ticks = np.broadcast_arrays(np.asarray(seeds, float), np.asarray(ticks, float))
    rows = np.stack([seeds.ravel(), ticks.ravel(), np.empty(seeds.size)])
    return in_all(deviate, rows)[2].reshape(seeds.shape)


def sampled(shape: Kernel, results: Results, name: str) -> np.ndarray:
    """The samples of a held number or of a state of a run."""
    if name in shape.held:
        return results.samples[0, :, len(shape.full_state) + shape.held.index(name)]
    return results.samples[0, :, shape.full_state.index(name)]


def mixed(z: int) -> int:
    """SplitMix64 in Python's whole numbers."""
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
    return z ^ (z >> 31)


def test_noise_is_that_of_plain_python() -> None:
    """Box and Muller from the upper 40 and the lower 24 of 64 mixed bits."""
    golden, of_one = 0x9E3779B97F4A7C15, 0x4330000000000000  # the bits of 2^52
    rng = np.random.default_rng(5)
    for seed, tick in [(0, 0), *rng.integers(0, 2**50, (300, 2)).tolist()]:
        bits = mixed((mixed((of_one + seed) * golden % 2**64) + (of_one + tick) * golden) % 2**64)
        first, second = ((bits >> 24) + 0.5) / 2**40, ((bits % 2**24) * 2**16 + 0.5) / 2**40
        expected = np.sqrt(-2 * np.log(first)) * np.sin(2 * np.pi * (abs(second - 0.5) - 0.25))
        assert noise(seed, tick) == pytest.approx(expected, abs=1e-10)


@dataclass
class Twin:
    """The drive and its mass, sample by sample: moved exactly while the command, floor and motor constant are held."""

    stage: Stage
    delay: float

    def _reference(self, t: float) -> float:
        ramp, back = (self.stage.flat()[f"motion.{name}"] for name in ("acceleration_time", "return_at"))

        def stroke(t: float) -> float:
            up, down = min(max(t, 0.0), ramp), min(max(t - ramp, 0.0), ramp)
            return 2.0 * up**2 + 4.0 * ramp * down - 2.0 * down**2

        return stroke(t) - stroke(t - back)

    def run(self, tables: Tables, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """Position, velocity and the motor's force at each sample, and the command computed from it."""
        late = (self.delay - int(self.delay)) * TIME
        parts = self._moving(late), self._moving(TIME - late)
        x, commands, past, integral = np.zeros(3), [0.0] * int(self.delay), [0.0, 0.0], 0.0
        floor, constant, moved = *self._located(tables, 0, 0.0), []
        acting = 0.0
        for n in range(samples):
            reading = DIGIT * np.round((x[0] + NOISE * float(noise(1, n))) / DIGIT)
            error = self._reference(n * TIME) - reading
            extra = np.interp(n * TIME, np.arange(201) * SPACING, tables.times[0, 0])
            demand = KP * error - KD * (reading - past[1]) / (2 * TIME) + extra
            command = demand + KI * (integral + TIME * error)
            winding = (command > LIMIT and error > 0) or (command < -LIMIT and error < 0)
            integral = integral if winding else integral + TIME * error
            commands.append(float(np.clip(demand + KI * integral, -LIMIT, LIMIT)))
            past = [reading, past[0]]
            moved.append(x)
            x = self._move(parts[0], x, constant * acting, floor)
            floor, constant = self._located(tables, n, x[0])
            acting = commands[n]
            x = self._move(parts[1], x, constant * acting, floor)
        return np.array(moved), np.array(commands[int(self.delay) :])

    @staticmethod
    def _located(tables: Tables, n: int, place: float) -> tuple[float, float]:
        floor = np.interp(n * TIME, np.arange(201) * SPACING, tables.times[0, 1])
        return float(floor), RATIO * float(np.interp(place, -1e-3 + GRID * np.arange(POINTS), tables.places[0, 2]))

    @staticmethod
    def _moving(time: float) -> np.ndarray:
        """Position, velocity and force, under a held demand and floor."""
        omega = 2 * np.pi * LAG
        rows = [[0, 1, 0, 0, 0], [0, -DRAG / MASS, 1 / MASS, 0, -1], [0, 0, -omega, omega, 0], [0] * 5, [0] * 5]
        return expm(np.array(rows) * time)

    @staticmethod
    def _move(by: np.ndarray, x: np.ndarray, demand: float, floor: float) -> np.ndarray:
        return (by @ [*x, demand, floor])[:3]


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("ramp", ["30 ms", "30.37 ms"], ids=["corner on a sample", "corner between samples"])
@pytest.mark.parametrize("delay", DELAYS)
def test_drive_is_that_of_plain_python(delay: float, ramp: str) -> None:
    """Encoder, controller, limit, queue, current loop, motor, floor, and an injected force."""
    stage, tables = axis(**{"motion.acceleration_time": ramp}), surroundings()
    digital = {"encoder_resolution": DIGIT, "encoder_noise": NOISE, "motor_constant_ratio": RATIO}
    shape, results = run(keys(stage, delay, **digital), tables=tables)
    assert results.statuses[0] == Status.DONE
    states, commands = Twin(stage, delay).run(tables, 400)
    assert np.abs(commands).max() == LIMIT  # the limit is met, and left again
    assert np.mean(np.abs(commands) == LIMIT) < 0.4
    assert sampled(shape, results, "commanded")[:400] == pytest.approx(commands[:400], abs=1e-6)
    for column, name in enumerate(("position", "velocity", "motor_force")):
        assert sampled(shape, results, name)[:400] == pytest.approx(states[:, column], abs=1e-7, rel=1e-7)


def test_delays_act_in_turn() -> None:
    """Every whole sample of delay lets the first force come a sample later; the first sample asks for none."""
    forces = [sampled(*run(keys(axis(), delay)), "motor_force") for delay in DELAYS]
    assert [int(np.argmax(np.abs(force) > 1e-9)) for force in forces] == [2 + int(delay) for delay in DELAYS]


def test_the_continuous_loop_is_approached_in_the_first_order() -> None:
    """The error falls with the sample time, and with the lag of the current loop, a share of it."""
    stage = axis(**{"controller.force_limit": "1 MN"})
    exact = simulate(stage, 1e-10, 0.01)
    times, errors = TIME / 2.0 ** np.arange(5), []
    for time in times:
        flat = keys(stage, sample_time=time, current_bandwidth=0.5 / time)
        positions = sampled(*run(flat, every=round(0.01 / TIME), rtol=1e-9), "position")[:40]
        errors.append(float(np.abs(positions - exact.position.values[:40]).max()))
    slope = np.polyfit(np.log(times[1:]), np.log(errors[1:]), 1)[0]
    assert slope == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("every", [2, 5, 40])
@pytest.mark.parametrize("delay", [0.0, 2.6])
def test_samples_are_noted_at_their_instants(every: int, delay: float) -> None:
    """With every so many samples of the drive, numbers equal those with all samples."""
    flat = keys(axis(), delay, encoder_noise=NOISE)
    every_one, part = (run(flat, every=n)[1].samples[0] for n in (1, every))
    assert np.array_equal(part[:-1], every_one[:-1:every])
    assert not np.isnan(part[:-1]).any()


def test_tables_between_their_points() -> None:
    """A table that is a straight line is one, whether its points are far apart or closer than samples."""
    still = {"controller.kp": 1e-9, "controller.ki": 1e-9, "controller.kd": 1e-9}
    for count in (2, 5, 401, 3001):
        line = np.zeros((1, 2, count))
        line[0, 0] = np.linspace(-4.0, 6.0, count)
        tables = FLAT_TABLES._replace(times=line, per_second=np.array([(count - 1) / 0.4]))
        force = sampled(*run(keys(axis()) | still, tables=tables), "commanded")[:400]
        assert force == pytest.approx(-4.0 + 10.0 * np.arange(400) * TIME / 0.4, abs=1e-9)


def test_any_lane_and_any_number_of_threads() -> None:
    """A run is the same, bit for bit, alone or among others, in any order."""
    runs = 19
    rng = np.random.default_rng(3)
    flat = keys(axis(), 2.0, encoder_noise=NOISE) | {
        "drive.seed": np.arange(runs) + 1.0,
        "controller.kp": rng.uniform(1e3, 6e3, runs),
        "motion.return_at": rng.uniform(0.1, 0.3, runs),
    }
    tables = surroundings()
    times = tables.times * rng.uniform(0, 1, (runs, 1, 1))
    single_thread = run(flat, runs, tables._replace(times=times), threads=1)[1]
    assert np.all(single_thread.statuses == Status.DONE)
    assert len({tuple(row) for row in single_thread.ends}) == runs
    order = rng.permutation(runs)
    shuffled = {key: value[order] if np.ndim(value) else value for key, value in flat.items()}
    several = run(shuffled, runs, tables._replace(times=times[order]), threads=3)[1]
    assert np.array_equal(several.samples, single_thread.samples[order], equal_nan=True)
    for j in (0, 7, 18):
        alone = {key: value[j] if np.ndim(value) else value for key, value in flat.items()}
        lane = run(alone, 1, tables._replace(times=times[j : j + 1]))[1]
        assert np.array_equal(lane.samples[0], single_thread.samples[j], equal_nan=True)
        assert np.array_equal(lane.statistics[0], single_thread.statistics[j], equal_nan=True)


def test_a_loop_that_diverges_keeps_its_samples() -> None:
    """A proportional gain far beyond what the sample time allows, beside a run that is sound."""
    gains = {"controller.kp": np.array([KP, 1e8]), "controller.force_limit": 1e15}
    _, results = run(keys(axis()) | gains, 2, rtol=1e-6)
    assert list(results.statuses) == [Status.DONE, Status.DIVERGED]
    ended = results.statistics[1, 7]
    assert TIME < ended < 0.39
    last = int(ended / TIME * (1 + 1e-9))
    assert not np.isnan(results.samples[1, :last]).any()
    assert np.isnan(results.samples[1, last + 1 :]).all()
    assert not np.isnan(results.samples[0, :-1]).any()


def test_what_is_not_watched_is_not_a_number() -> None:
    """A run with a clock has its largest force, steps and end; extremes and exits are for its samples to tell."""
    shape, results = run(keys(axis()))
    statistics = results.statistics[0]
    assert np.isnan(statistics[1:5]).all()
    assert statistics[7] == pytest.approx(0.4)
    assert statistics[0] == pytest.approx(np.nanmax(np.abs(sampled(shape, results, "motor_force"))), rel=1e-3)


# --- the controller's expressions, beside plain Python and SciPy ------------------------------------------------------

TUNED = {"controller.crossover": 10.0, "controller.alpha": 0.1, "controller.beta": 2.0, "controller.tuned_mass": MASS}
TAU = 3e-3


@cache
def stepping(command: sp.Expr, held: tuple[Held, ...]) -> tuple[list[str], Callable[..., list[float]]]:
    """A sample as a function of numbers with these names; a deviate is the sine of the sum of its arguments."""
    expressions = [command, *(state.update for state in held)]
    names = sorted({str(symbol) for expression in expressions for symbol in expression.free_symbols})
    plain = {
        "gaussian": lambda seed, tick: np.sin(seed + tick),
        "quantised": rounded,
        "clipped": lambda x, end: np.clip(x, -end, end),
    }
    return names, sp.lambdify([key(name) for name in names], expressions, [plain, "math"], cse=True)


def iterated(command: sp.Expr, held: tuple[Held, ...], flat: Flat, inputs: Mapping[str, np.ndarray]) -> Flat:
    """Return the commanded and held numbers at every sample, all starting at 0."""
    names, step = stepping(command, held)
    labels = [str(state.symbol) for state in held]
    rows, last = [], [0.0] * len(labels)
    for values in zip(*inputs.values(), strict=True):
        numbers = {**flat, **dict(zip(labels, last, strict=True)), **dict(zip(inputs, values, strict=True))}
        rows.append(step(*(numbers[name] for name in names)))
        last = rows[-1][1:]
    return dict(zip(["commanded", *labels], np.array(rows).T, strict=True))


def rounded(value: float, digit: float) -> float:
    return digit * round(value / digit) if digit else value


def bilinear(upper: list[float], lower: list[float], values: np.ndarray) -> np.ndarray:
    """The answer of a transfer function, given by its polynomials in s, discretised by SciPy."""
    discrete: Any = signal.cont2discrete((upper, lower), TIME, method="bilinear")
    answer: Any = signal.lfilter(np.ravel(discrete[0]), discrete[1], values)
    return answer


def van_dijk() -> tuple[float, float, float, float]:
    """Eq. 8: gain k_p, time constants tau_z, tau_i and tau_p."""
    omega, alpha, beta, mass = 2 * np.pi * TUNED["controller.crossover"], *list(TUNED.values())[1:]
    tau_z = np.sqrt(1 / alpha) / omega
    return mass * omega**2 / np.sqrt(1 / alpha), tau_z, beta * tau_z, 1 / (omega * np.sqrt(1 / alpha))


SEEN = Loop(*(sp.Symbol(name, real=True) for name in ("error", "position", "velocity", "speed")))


def test_eq_7_is_its_bilinear_transform() -> None:
    """The whole controller, its low-pass and the integral of what that lets through (a trapezoid)."""
    k_p, tau_z, tau_i, tau_p = van_dijk()
    error = np.random.default_rng(4).normal(0, 1e-3, 300)
    command, held = sampled_controller(ControllerForm("pid", "VanDijk", None, integral=True), SEEN, 1)
    outputs = iterated(command, held, keys(axis()) | TUNED, {"error": error})
    force = bilinear([k_p * tau_z * tau_i, k_p * (tau_z + tau_i), k_p], [tau_i * tau_p, tau_i, 0.0], error)
    assert outputs["commanded"] == pytest.approx(force, rel=1e-9, abs=1e-9)
    passed = bilinear([1.0], [tau_p, 1.0], error)
    assert outputs["low_passed_error"] == pytest.approx(passed, abs=1e-14)
    assert outputs["integral"] == pytest.approx(bilinear([1.0], [1.0, 0.0], passed), abs=1e-14)


@pytest.mark.parametrize("derivative_on", ["error", "measurement"])
def test_eq_6_with_a_filter_is_its_bilinear_transform(derivative_on: Literal["error", "measurement"]) -> None:
    """The integral is the exception: it is a sum."""
    error, position = np.random.default_rng(5).normal(0, 1e-3, (2, 300))
    command, held = sampled_controller(
        ControllerForm("pid", "PidGains", Terms(True, True, derivative_on), integral=True), SEEN, 1
    )
    inputs = {"error": error, "position": position}
    outputs = iterated(command, held, keys(axis()) | {"controller.tau": TAU}, inputs)
    rate = bilinear([KD, 0.0], [TAU, 1.0], error if derivative_on == "error" else -position)
    assert outputs["commanded"] == pytest.approx(KP * error + KI * TIME * np.cumsum(error) + rate, rel=1e-9, abs=1e-9)


def shares(flat: Flat, error: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Force [N] without the integral, whose gain is next and what samples add to it [m s] last."""
    if "controller.crossover" not in flat:
        past = np.concatenate([[0.0, 0.0], reading[:-2]])
        return KP * error - KD * (reading - past) / (2 * TIME), KI, TIME * error
    k_p, tau_z, tau_i, tau_p = van_dijk()
    passed = bilinear([1.0], [tau_p, 1.0], error)
    lead = bilinear([k_p * tau_z, k_p * (1 + tau_z / tau_i)], [tau_p, 1.0], error)
    return lead, k_p / tau_i, TIME / 2 * (passed + np.concatenate([[0.0], passed[:-1]]))


def plain_drive(flat: Flat, inputs: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Commands [N] and integrals [m s] of the drive: encoder, feedforward, deadband, reset, limit."""
    drive = {name.removeprefix("drive."): value for name, value in flat.items() if name.startswith("drive.")}
    noise = drive["encoder_noise"] * np.sin(drive["seed"] + inputs["tick"])
    reading = np.array([rounded(item, drive["encoder_resolution"]) for item in inputs["seen"] + noise])
    error, speed = inputs["reference"] - reading, inputs["speed"]
    demand, gain, added = shares(flat, error, reading)
    demand = demand + drive["feedforward_mass"] * inputs["reference.acceleration"] + inputs["injected_force"]
    demand += drive["feedforward_viscous"] * speed + drive["feedforward_coulomb"] * np.sign(speed)
    integral, last, commands, integrals = 0.0, 0.0, [], []
    anti_windup = flat.get("controller.anti_windup", "clamp")
    for n, now in enumerate(error):
        wanted = demand[n] + gain * (integral + added[n])
        further = abs(wanted) > LIMIT and wanted * added[n] > 0
        if drive["integrator_reset"] and now * last < 0:
            integral = added[n]
        elif abs(now) >= drive["integrator_deadband"] and not (anti_windup == "clamp" and further):
            integral += added[n]
            if anti_windup == "back_calculation":
                cut = np.clip(wanted, -LIMIT, LIMIT) - wanted
                integral += TIME / flat["controller.anti_windup_time"] * cut / gain
        last = now or last
        integrals.append(integral)
        commands.append(np.clip(demand[n] + gain * integral, -LIMIT, LIMIT))
    return np.array(commands), np.array(integrals)


def motions() -> dict[str, np.ndarray]:
    """About a reference: back and forth, farther and nearer, such that the limit is met and zero is crossed."""
    time = TIME * np.arange(500)
    seen = 2e-3 * np.sin(50 * time) * np.cos(9 * time) + 1e-3 * np.sin(7 * time)
    speed = np.where(time < 0.2, 0.05, np.where(time < 0.3, 0.0, -0.02))
    reference = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) * TIME
    moving = {"reference": reference, "speed": speed, "reference.acceleration": 2 * np.cos(20 * time)}
    return {"seen": reference + seen, **moving, "injected_force": np.sin(70 * time), "tick": np.arange(500.0)}


@cache
def commanded(form: AsBuilt) -> tuple[sp.Expr, tuple[Held, ...]]:
    """Return the command and held numbers of a drive, as functions of a reference and its speed."""
    position = state("position")
    error, acceleration = sp.Symbol("reference", real=True) - position, sp.Symbol("reference.acceleration", real=True)
    seen = Loop(error, position, state("velocity"), SEEN.reference_velocity, acceleration)
    return _command(form, seen)[1:]


FEATURES: Mapping[str, Flat] = {
    "encoder": {"encoder_resolution": 2e-4, "encoder_noise": 1e-4},
    "mass": {"feedforward_mass": 1.5},
    "friction": {"feedforward_coulomb": 1.2, "feedforward_viscous": 20.0},
    "deadband": {"integrator_deadband": 7e-4},
    "reset": {"integrator_reset": 1.0},
}
DRIVES = {**FEATURES, "all": {name: value for feature in FEATURES.values() for name, value in feature.items()}}
WINDUP = {"controller.anti_windup_time": 5 * TIME}
LIMITED = {how: {**WINDUP, "controller.anti_windup": how} for how in ("none", "back_calculation")}


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("tuned", [{}, TUNED], ids=["eq 6", "eq 7"])
@pytest.mark.parametrize("feature", ["plain", *DRIVES, *LIMITED])
def test_command_is_that_of_plain_python(feature: str, tuned: Flat) -> None:
    """Features are tested one by one and together; each makes a difference, and the limit is reached.

    At the limit of the force the integrator winds up, or unwinds in proportion to the excess, or rests.
    """
    flat, inputs = keys(axis(), **DRIVES.get(feature, {})) | tuned | LIMITED.get(feature, {}), motions()
    result = iterated(*commanded(AsBuilt.of(flat)), flat, inputs)
    commands, integrals = plain_drive(flat, inputs)
    assert result["commanded"] == pytest.approx(commands, abs=1e-9)
    assert result["integral"] == pytest.approx(integrals, abs=1e-12)
    assert 0.02 < np.mean(np.abs(commands) == LIMIT) < 0.7
    without = plain_drive(keys(axis()) | tuned, inputs)[0]
    assert (np.abs(commands - without).max() > 0.01) == (feature != "plain")


def settled(error: list[float], **drive: float) -> np.ndarray:
    """The integral over its gain's time step [m], beside errors [m] from a reference of 0, far from the limit."""
    values = np.array(error)
    nothing = dict.fromkeys(("reference", "speed", "reference.acceleration", "injected_force", "tick"), 0 * values)
    flat = keys(axis(), **drive)
    return iterated(*commanded(AsBuilt.of(flat)), flat, {**nothing, "seen": -values})["integral"] / TIME


def test_the_integrator_rests_and_restarts() -> None:
    """Below its deadband it keeps its value; where the error changes sign, at once or via zeros, it restarts."""
    micro = 1e-6
    rests = settled([5 * micro, 2 * micro, -2 * micro, 4 * micro, -3 * micro], integrator_deadband=3 * micro)
    assert rests / micro == pytest.approx([5, 5, 5, 9, 6])
    errors = [5 * micro, 2 * micro, 0.0, -3 * micro, -micro, 0.0, 0.0, -micro, 4 * micro]
    assert settled(errors, integrator_reset=1.0) / micro == pytest.approx([5, 7, 7, -3, -4, -4, -4, -5, 4])
    assert settled(errors) / micro == pytest.approx([5, 7, 7, 4, 3, 3, 3, 2, 6])
