"""Logs of moves: simulated machines whose truth is known, and the EMPS record with what it cannot show."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emps import emps_log
from machines import drawn, moves
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lsim

import friso
from friso.identification import moves as moves_analysis
from friso.identification.doubt import DOUBTS, FitCase, Quality, RaisedDoubt, RecordCase, leading_effect
from friso.identification.doubts import forces
from friso.identification.doubts import record as delay
from friso.identification.doubts.forces import PLAYS_TRIED
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import inverse_model, moved_in
from friso.identification.logs.assemble import integrated
from friso.identification.logs.log import Log
from friso.identification.moves import IdentifiedMoves, errors_of, identify_moves, simulated_log
from friso.identification.output_error import fit as fitting
from friso.identification.output_error.fit import (
    OutputErrorFit,
    everywhere,
    first_values,
    fit,
    mean_square,
    nearby,
    polished,
)
from friso.identification.output_error.identifiable import (
    IdentifiableFit,
    believed,
    bounds_as_much,
    with_force_settled,
    with_smoothness_settled,
)
from friso.identification.output_error.parameters import (
    BRISTLES,
    EXPONENT,
    HIGHEST_FRICTION_RATIO,
    MASS,
    RATIO,
    SHORTEST_BRISTLE_BEND,
    fit_parameters,
)
from friso.identification.output_error.problem import loop_problem, tracking
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.output_error.to_keys import estimates_of
from friso.identification.readings.common import record
from friso.identification.stage_file import made_up
from friso.intervals import NORMAL_COVERAGE
from friso.progress import silent

ROOT = Path(__file__).parents[1]
SMALL = OutputErrorSettings(
    points_of_a_profile=3,
    iterations_of_a_profile=1,
    starts_of_a_fit=256,
    starts_refined_first=10,
    starts_refined_further=3,
    starts_near_a_fit=31,
)
"""Sizes with which a fit takes seconds: coarser profiles are no narrower, and fewer starts do for quiet logs."""


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    with SMALL.in_use():
        yield


# --- known truth ---


Quick = tuple[dict[str, Any], Log, IdentifiedMoves]
"""The truth of a machine, its log, and what is identified from it."""


@pytest.fixture(scope="module")
def reported() -> list[tuple[float, str]]:
    """Return the list of progress reports of `quick`: share of the work done, and the present task."""
    return []


@pytest.fixture(scope="module")
def quick(reported: list[tuple[float, str]]) -> Quick:
    """A machine sampled at 2 ms, identified with its known controller."""
    machine = drawn(3, False)
    log = moves(machine)

    def progress(done: int, total: int, label: str, /) -> None:
        reported.append((done / total, label))

    return machine.flat, log, identify_moves(log, machine.guess.flat(), True, progress=progress)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_progress_moves_within_every_part_of_a_fit(reported: list[tuple[float, str]]) -> None:
    shares = [share for share, _ in reported]
    assert shares == sorted(shares)
    assert 0 <= shares[0] < shares[-1] <= 1
    assert all(label.startswith("moves: ") for _, label in reported)
    at = {label: [share for share, said in reported if said == label] for _, label in reported}
    assert all(len({*at[label]}) > 2 for label in at if "parameters" in label or "sliding" in label), at


@pytest.mark.slow
def test_intervals_hold_mass_and_friction(quick: Quick) -> None:
    """Slow moves are under the Stribeck effect: a fit without it must not put it into Coulomb friction."""
    truth, _, result = quick
    by_name = {estimate.name: estimate for estimate in result.estimates}
    for name in ("masses.cart", "friction.coulomb", "friction.viscous", "bias.cart"):
        item, true = by_name[name], truth[name]
        assert item.determined
        assert abs(item.value - true) < 1.5 * item.half_width, name  # half again: 5 intervals at once
        assert item.half_width < 0.15 * abs(true)
    assert by_name["friction.viscous_asymmetry"].value == pytest.approx(0, abs=0.1)
    assert by_name["friction.stribeck_exponent"].holds(truth["friction.stribeck_exponent"])
    static, level = by_name["friction.static"], truth["friction.static"]
    assert static.low < 1.1 * level
    assert static.high > 0.9 * level
    assert result.flat["friction.static"] == pytest.approx(level, rel=0.15)
    names, correlation = [item.name for item in result.correlated], result.correlation
    assert correlation.shape == (len(names), len(names))
    assert np.diag(correlation) == pytest.approx(np.ones(len(names)))
    assert np.abs(correlation).max() <= 1 + 1e-9
    assert correlation[names.index("friction.coulomb"), names.index("friction.viscous")] < -0.3


@pytest.mark.slow
def test_the_closed_loop_has_the_last_word_and_leaves_the_noise(quick: Quick) -> None:
    result, machine = quick[2], drawn(3, False)
    assert result.fit.problem.closed
    noise = np.hypot(machine.force_noise, machine.force_digit / 12**0.5)
    assert result.residual.rms == pytest.approx(noise, rel=0.05)
    assert result.errors.position < 1e-3


@pytest.mark.thorough
def test_a_stribeck_curve_of_another_exponent_is_told() -> None:
    """Exponent 1 (Tustin) under a stage file with exponent 2: the Stribeck velocity came out 57 to 110 % too large."""
    usual = drawn(3, False)
    machine = replace(usual, truth=usual.truth.replace({"friction.stribeck_exponent": 1}))
    result = identify_moves(moves(machine), usual.guess.flat(), True)
    by_name = {estimate.name: estimate for estimate in result.estimates}
    for name in ("friction.stribeck_exponent", "friction.stribeck_velocity", "friction.static"):
        assert by_name[name].holds(machine.flat[name]), name
    assert by_name["friction.stribeck_exponent"].high < 2


@pytest.mark.slow
def test_how_a_log_begins_does_not_count_in_the_loop(quick: Quick) -> None:
    """The initial velocity and bristle deflection of the simulated loop are unknown.

    A force in the first 20 ms turned a Stribeck velocity of 2.35 mm/s into 1.5 mm/s, with an interval that excluded the
    truth.
    """
    truth, log, _ = quick
    begun = truth["friction.coulomb"] * ((np.arange(len(log.time)) >= 3) & (log.time < 0.02))
    logs = (log, with_force(log, begun))
    left = [loop_problem(truth, one, one.longest, ()).residuals(np.zeros((1, 0))) for one in logs]
    assert np.array_equal(*left)


@pytest.mark.slow
def test_a_better_fit_on_a_profile_takes_the_place_of_the_fit(quick: Quick) -> None:
    """A loop fit of a stage that stuck and slipped had infinite variances, and nothing was reported."""
    best = quick[2].fit
    lost = replace(best, covariance=np.full_like(best.covariance, np.inf))
    assert bounds_as_much(best, lost)
    assert not bounds_as_much(lost, best)
    names = [parameter.name for parameter in best.problem.parameters]
    inner = best.inner.copy()
    inner[names.index(RATIO)] += 0.05
    off = replace(best, inner=inner, residual=best.problem.residuals(inner[None])[0])
    assert off.cost > 1.01 * best.cost
    core = {parameter.name for parameter in best.problem.parameters if parameter.core}
    assert believed(off, core, quick[2].covered, silent).fit.cost < 1.01 * best.cost


@pytest.mark.slow
def test_an_interval_reaches_as_far_up_as_that_of_the_logarithm(quick: Quick) -> None:
    best, covered = quick[2].fit, quick[2].covered
    names = frozenset(parameter.name for parameter in best.problem.parameters)
    for off in (0.02, 0.3):
        loose = replace(best, covariance=off**2 * np.eye(len(best.free)))
        estimates = {one.name: one for one in estimates_of(IdentifiableFit(loose, {}, names), covered)[0]}
        stiffness = estimates["friction.bristle_stiffness"]
        assert stiffness.high >= stiffness.value * np.exp(1.95 * off)
        assert stiffness.high < stiffness.value * (1 + 1.1 * np.expm1(2 * off))


@pytest.mark.slow
def test_pulses_of_force_are_predicted(quick: Quick) -> None:
    """A record of the same machine with pulses beside the controller: predicted with them, not without."""
    truth, log, result = quick
    pulses = np.zeros(len(log.time))
    for start in range(500, len(pulses) - 100, 600):
        pulses[start : start + 50] = 20 * truth["friction.coulomb"] * (-1) ** (start // 600)
    changed = replace(log, signals={**log.signals, "disturbance": pulses, "force": pulses})
    machine = drawn(3, False)
    full = loop_problem(machine.flat, changed, changed.segments[0], ()).record(np.zeros(0))
    pushed = replace(changed, signals={**changed.signals, "position": full.position, "force": full.force + pulses})
    predicted = simulated_log(result, machine.measured(pushed))
    assert predicted.part == pushed.segments[0]
    assert predicted.errors.force < 0.05
    assert predicted.errors.position < 5e-3
    assert 0 < predicted.apart < 0.05
    without = replace(pushed, signals={**pushed.signals, "disturbance": 0 * pulses})
    assert simulated_log(result, without).errors.force > 5 * predicted.errors.force


@pytest.mark.slow
def test_starts_stay_in_their_ranges(quick: Quick) -> None:
    result = quick[2].fit
    low, high = result.problem.bounds
    parameters, every = result.problem.parameters, tuple(range(len(result.inner)))
    for starts in (nearby(result), everywhere(result.problem, every, result.inner)):
        assert starts[0] == pytest.approx(result.inner)
        free = [i for i in result.free if not parameters[i].core]
        assert np.all((starts[:, free] >= low[free] - 1e-9) & (starts[:, free] <= high[free] + 1e-9))
        assert np.ptp(starts[:, result.free[0]]) > 0
    core = [i for i, parameter in enumerate(parameters) if parameter.core]
    around = everywhere(result.problem, every, result.inner)[:, core]
    kept = np.all(around == result.inner[core], axis=1)
    assert kept.mean() == pytest.approx(0.5, abs=0.01)  # where errors of mass and friction hide nothing
    above = np.mean(around[~kept] > around[~kept].mean(axis=0), axis=0)
    assert np.ptp(around[~kept], axis=0) == pytest.approx(np.ptp(around, axis=0), rel=0.1)
    assert above == pytest.approx(0.5, abs=0.05)


def test_without_noise_the_fit_ends_at_the_truth() -> None:
    """The inverse crime on purpose: the loop's own record is fitted from values that are 10 % off."""
    machine = drawn(3, False)
    log = cut(moves(machine, bare=True), slice(0, 2000))
    flat = {**machine.flat, "friction.viscous_asymmetry": 0.0}
    inverse = inverse_model(log)
    speed = float(np.abs(moved_in(log, log["position"], inverse.bandwidth).velocity).max())
    inputs = moves_analysis._problems(log, log.segments[0], flat, inverse, speed, True)[1]
    exact = replace(inputs, target=loop_problem(flat, log, log.segments[0], ()).record(np.zeros(0)).force)
    core = tuple(i for i, entry in enumerate(inputs.parameters) if entry.core)
    truth = {**flat, "static friction ratio": flat["friction.static"] / flat["friction.coulomb"]}
    first = first_values(inputs.parameters)
    for i, parameter in enumerate(inputs.parameters):
        if not parameter.core:
            first[i] = parameter.inner(truth.get(parameter.name))
    first[[item.name for item in inputs.parameters].index("mass")] += 0.1
    fitted = fit(exact, core, first[None])
    assert fitted.cost < 1e-6 * float(mean_square(exact.residuals(first[None]))[0])
    assert fitted.value("mass") == pytest.approx(flat["masses.cart"], rel=1e-3)
    assert fitted.value("friction.coulomb") == pytest.approx(flat["friction.coulomb"], rel=1e-3)


def cut(log: Log, part: slice) -> Log:
    signals = {role: values[part] for role, values in log.signals.items()}
    time = log.time[part]
    return replace(log, time=time, signals=signals, segments=(slice(0, len(time)),))


def with_force(log: Log, force: np.ndarray) -> Log:
    """A log with a force more than its own."""
    return replace(log, signals={**log.signals, "force": log["force"] + force})


def followed(log: Log, flat: dict[str, Any], count: int = 2500) -> OutputErrorFit:
    """A stage that follows the first moves of a log, fitted from its truth."""
    truth = _at_truth(log, flat, slice(0, count))
    return polished(truth.problem, truth.free, truth.inner)


def _at_truth(log: Log, flat: dict[str, Any], part: slice, bandwidth: float = 20.0) -> OutputErrorFit:
    """A stage that follows a part of a log, with the true numbers, and a covariance that is next to nothing."""
    levels = {"mass": flat["masses.cart"], "offset": -flat["bias.cart"]}
    levels |= {name: flat[f"friction.{name}"] for name in ("coulomb", "viscous")}
    top = flat["motion.acceleration"] * flat["motion.acceleration_time"]
    parameters = fit_parameters(flat, levels, top, float(np.ptp(log["position"])), True)
    first = first_values(parameters)
    first[[one.name for one in parameters].index(RATIO)] = flat["friction.static"] / flat["friction.coulomb"]
    problem, count = tracking(flat, log, part, parameters, bandwidth), len(parameters)
    return OutputErrorFit(problem, first, tuple(range(count)), 1e-12 * np.eye(count), np.zeros(len(problem.target)))


TWO_MASSES, FRICTION = (2.0, 1.0), (5.0, 10.0)
"""Masses [kg] of a motor and of a load on a coupling; Coulomb [N] and viscous friction [N s/m] of the motor."""


def on_a_coupling(rate: float, behind: bool) -> Log:
    """Moves there and back of the motor, a load on a coupling of natural frequency `rate` [Hz] after it, and the
    position of the motor, or of the load `behind` the coupling; 50 mN of noise on the force."""
    step, omega = 1e-3, 2 * np.pi * rate
    time = np.arange(4000) * step
    corners = np.array([0.0, 0.06, 0.29, 0.35])
    tops = ((0.2, 0.5), (0.7, -0.5), (1.2, 0.25), (1.7, -0.25), (2.2, 0.5), (2.7, -0.5))
    velocity = np.sum([np.interp(time, start + corners, [0, top, top, 0]) for start, top in tops], axis=0)
    velocity = np.convolve(velocity, np.hanning(81) / np.hanning(81).sum(), "same")
    acceleration = np.gradient(velocity, step)
    swinging = [[0.0, 1.0], [-(omega**2), -0.04 * omega]]
    both = (swinging, [[0.0], [-1.0]], [[1.0, 0.0], swinging[1]], [[0.0], [-1.0]])
    bent, further = lsim(both, acceleration, time)[1].T
    force = sum(TWO_MASSES) * acceleration + TWO_MASSES[1] * further
    force += FRICTION[0] * np.tanh(velocity / 1e-3) + FRICTION[1] * velocity
    force += 0.05 * np.random.default_rng(3).standard_normal(len(time))
    position = cumulative_trapezoid(velocity, dx=step, initial=0.0) + behind * bent
    return record("on a coupling", step, position=position, force=force)


def rigid(log: Log) -> tuple[OutputErrorFit, float]:
    """The fit of a rigid mass that slides to a log, and the bandwidth [Hz] of its motion."""
    inverse = inverse_model(log)
    levels = {name: max(inverse.value(name), 1e-3) for name in ("mass", "coulomb", "viscous", "offset")}
    flat = {**made_up(log, inverse).flat(), "bias.cart": 1e-3}
    parameters = fit_parameters(flat, levels, 0.5, float(np.ptp(log["position"])), True)
    problem = tracking(flat, log, slice(0, len(log.time)), parameters, inverse.bandwidth)
    names = [parameter.name for parameter in parameters]
    free = tuple(names.index(name) for name in (MASS, "friction.coulomb", "friction.viscous", "bias.cart"))
    return polished(problem, free, first_values(parameters)), inverse.bandwidth


WELL = Quality(noise=0.05, left=0.05, noise_left=0.05, inverse_error=0.1, whole_error=0.1)
"""The quality of a fit that lacks nothing."""


def fit_case(log: Log, fitted: OutputErrorFit, bandwidth: float, led: bool = True) -> FitCase:
    """A fit to a log whose motion is of a bandwidth [Hz]."""
    velocity = np.gradient(log["position"], log.sample_time)[log.longest]
    inverse = inverse_model(log, bandwidth)
    case = FitCase(log, inverse, flat=fitted.problem.flat, fit=fitted, quality=WELL, velocity=velocity)
    return replace(case, leading=leading_effect(case)) if led else case


def mass_off(fitted: OutputErrorFit) -> float:
    """The logarithm of a fitted mass over the true one."""
    return float(np.log(fitted.value(MASS) / sum(TWO_MASSES)))


def reach(doubt: RaisedDoubt) -> np.ndarray:
    """The half widths of a doubt's intervals of mass and friction, as logarithms."""
    return NORMAL_COVERAGE * np.sqrt(np.diag(doubt.fit.covariance))


@pytest.fixture(scope="module")
def sound() -> Log:
    """Moves without a coupling."""
    return on_a_coupling(1e4, False)


@pytest.mark.slow
def test_no_effect_is_seen_where_there_is_none(sound: Log) -> None:
    case = fit_case(sound, *rigid(sound))
    assert case.leading is None
    finders = (forces.find_coupling, forces.find_load_friction, delay.find_delay)
    assert not [raised for find in finders for raised in find(case)]
    assert not [*DOUBTS["force-digits"].find(RecordCase(sound, inverse_model(sound)))]


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("behind", [False, True], ids=["position of the motor", "position of the load"])
@pytest.mark.parametrize("rate", [25.0, 40.0])
def test_an_interval_of_the_mass_holds_the_truth_where_a_coupling_moves_the_fit(rate: float, behind: bool) -> None:
    """The mass is too large where a load swings behind the measured position, and too small where that is behind."""
    log = on_a_coupling(rate, behind)
    fitted, bandwidth = rigid(log)
    off = mass_off(fitted)
    assert (off < 0) == behind
    assert abs(off) > NORMAL_COVERAGE * np.sqrt(fitted.covariance[0, 0])
    case = fit_case(log, fitted, bandwidth)
    (unspoilt,) = forces.find_coupling(case)
    (spoiled,) = forces.find_coupling(replace(case, quality=replace(WELL, spoilt=True), leading=None))
    assert reach(unspoilt)[0] > 1.5 * abs(off)
    assert unspoilt.size == pytest.approx(off, rel=0.3)
    assert {*unspoilt.refuses} == {*spoiled.refuses} == {*BRISTLES}
    assert not spoiled.words  # a cause that has been named makes such a force too


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_friction_that_grows_with_the_force_of_the_motor_is_named(share: float, sound: Log) -> None:
    """A mass seems heavier driven than braked; intervals of mass and friction reach over it."""
    way = np.tanh(np.gradient(sound["position"], sound.sample_time) / 1e-3)
    against = np.sign(sound["force"]) * way * share
    log = with_force(sound, sound["force"] * against / (1 - against))
    fitted, bandwidth = rigid(log)
    (doubt,) = forces.find_load_friction(fit_case(log, fitted, bandwidth))
    assert doubt.size == pytest.approx(share, rel=0.3)
    assert abs(mass_off(fitted)) < reach(doubt)[0]
    assert not [*forces.find_load_friction(replace(fit_case(log, fitted, bandwidth), leading=None))]


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("effect", ["cogging", "friction-by-place", "drifting-delay", "play"])
def test_an_effect_outside_the_model_is_named_and_allowed_for(effect: str, sound: Log) -> None:
    """The right effect of those that the model leaves out comes first."""
    position, time, step = sound["position"], sound.time, sound.sample_time
    velocity = np.gradient(position, step)
    way, acceleration = np.tanh(velocity / 1e-3), np.gradient(velocity, step)
    coulomb, mass, width = FRICTION[0], sum(TWO_MASSES), 5e-5
    late = 0.004 * time / time[-1]
    (speed,) = forces.loose_loads(position, velocity, step, np.array([width]), np.zeros(1))
    loose = np.diff(speed, prepend=speed[0]) / step
    force, truth = {
        "cogging": (0.15 * coulomb * np.sin(2 * np.pi * position / 0.02), 0.3 * coulomb),
        "friction-by-place": (0.3 * coulomb * way * np.cos(2 * np.pi * position / 0.1), 0.6 * coulomb),
        "drifting-delay": (np.interp(time + late, time, sound["force"]) - sound["force"], 0.004),
        "play": (0.4 * mass * (loose - acceleration), width),
    }[effect]
    log = with_force(sound, force)
    fitted, bandwidth = rigid(log)
    case = fit_case(log, fitted, bandwidth)
    assert case.leading.doubt == effect
    (doubt,) = DOUBTS[effect].find(case)
    assert abs(doubt.size) == pytest.approx(truth, rel=0.3)
    assert {*doubt.refuses} == {*BRISTLES}
    assert abs(mass_off(fitted)) < reach(doubt)[0]
    if effect == "play":  # as wide as any that is tried, it is something slower
        tried = replace(case.leading.tried, label=max(PLAYS_TRIED))
        (nameless,) = forces.find_play(replace(case, leading=replace(case.leading, tried=tried)))
        assert not nameless.words
        assert not nameless.explains
        assert nameless.fit is not None


@pytest.mark.slow
def test_an_integrated_velocity_shows_a_step_test() -> None:
    """Noise of the velocity adds up in the position, but causes no wrong bandwidth, missing model or backlash."""
    step, force = 1e-3, np.repeat([0.0, 9.0, 0.0, -9.0, 0.0, 7.0, 0.0, -12.0], 1000)
    velocity, speed = np.zeros(len(force)), 0.0
    for k in range(1, len(force)):
        for _ in range(10):
            free = speed + step / 10 * (force[k - 1] - 12 * speed) / 3
            speed = np.sign(free) * max(abs(free) - step / 10 * 5 / 3, 0.0)
        velocity[k] = speed
    velocity += 1e-3 * np.random.default_rng(3).standard_normal(len(force))
    time = step * np.arange(len(force))
    signals = {"velocity": velocity, "force": force, "position": integrated(velocity, step, [slice(0, len(force))])}
    log = Log("steps", time, step, signals, (slice(0, len(force)),), is_integrated=True)
    inverse = inverse_model(log)
    assert inverse.bandwidth < 30
    with OutputErrorSettings().in_use():
        moves_of_log = identify_moves(log, made_up(log, inverse).flat(), False)
    determined = {estimate.name: estimate for estimate in moves_of_log.estimates if estimate.determined}
    for name, truth in (("masses.cart", 3.0), ("friction.coulomb", 5.0), ("friction.viscous", 12.0)):
        assert determined[name].low < truth < determined[name].high
        assert determined[name].high - determined[name].low < 0.2 * truth
    assert not moves_of_log.quality.doubts


def test_first_estimates_are_told_before_the_whole_model_is_fitted(sound: Log) -> None:
    said = {}

    def tell(name: str, estimates: Sequence[Estimate]) -> None:
        said[name] = {estimate.name: estimate for estimate in estimates}
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        identify_moves(sound, made_up(sound, inverse_model(sound)).flat(), False, tell=tell)
    assert said[sound.name]["mass"].low < sum(TWO_MASSES) < said[sound.name]["mass"].high


def test_a_force_in_coarse_digits_is_told(sound: Log) -> None:
    digit = 0.4 * FRICTION[0]
    log = replace(sound, signals={**sound.signals, "force": np.round(sound["force"] / digit) * digit})
    (doubt,) = DOUBTS["force-digits"].find(RecordCase(log, inverse_model(log)))
    assert doubt.size == pytest.approx(digit)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("late", [1, 3, -2])
def test_an_interval_of_friction_holds_the_truth_where_a_delay_moves_the_fit(late: int, sound: Log) -> None:
    """A force that acts some samples after it was logged, or before."""
    log = replace(sound, signals={**sound.signals, "force": np.roll(sound["force"], -late)})
    fitted, bandwidth = rigid(log)
    case = fit_case(log, fitted, bandwidth)
    (finding,) = delay.find_delay(case)
    assert finding.size == pytest.approx(late * log.sample_time, rel=0.2)
    names = [fitted.problem.parameters[number].name for number in fitted.free]
    off = [np.log(fitted.value(name) / true) for name, true in zip(names[1:3], FRICTION, strict=True)]
    assert (reach(finding)[1:3] > np.abs(off)).all()
    (spoiled,) = delay.find_delay(replace(case, quality=replace(WELL, spoilt=True), leading=None))
    assert not spoiled.words


def test_the_fit_tells_whether_the_force_of_a_log_is_held() -> None:
    """The force of a continuous controller is not held between samples, whatever is assumed at first."""
    machine = drawn(3, False)
    log = moves(machine, bare=True)
    as_held = followed(log, {**machine.flat, "drive.sample_time": log.sample_time}, 1250)
    assert as_held.problem.inputs.held
    settled = with_force_settled(as_held, np.inf)
    assert not settled.problem.inputs.held
    assert all(not inputs.held for inputs in settled.problem.unsettled)
    assert settled.cost < as_held.cost


@pytest.mark.slow
def test_a_position_is_smoothed_no_more_than_the_fit_bears() -> None:
    """Smoothing blurs break-aways: the exponent of a stage that sticks and slips came out at 1.85 for 2, without any
    noise."""
    machine = drawn(2603, False)
    log = moves(machine, bare=True)
    truth = _at_truth(log, {**machine.flat, EXPONENT: 1.999}, slice(6000, len(log.time)), 7.2)
    smooth = polished(truth.problem, truth.free, truth.inner)
    settled = with_smoothness_settled(smooth)
    assert settled.cost < smooth.cost / 2
    off = [abs(fit.value(EXPONENT) - 2.0) for fit in (smooth, settled)]
    assert off[0] > 0.1
    assert off[1] < off[0] / 2


def test_an_interval_holds_what_inputs_that_a_log_allows_as_well_make_of_it() -> None:
    """An interval reaches as far as the results from all inputs that the log allows equally well.

    One of these inputs is the true one: an interval of half the distance would never contain the truth.
    """
    moved = [np.array([1.0, 0.0]), np.array([0.0, 3.0])]
    wider = fitting._reaching_over(np.diag([0.25, 0.0]), moved)
    assert NORMAL_COVERAGE * np.sqrt(np.diag(wider)) == pytest.approx([0.5 * NORMAL_COVERAGE + 1.0, 3.0])


def test_static_friction_of_one_direction_is_named_and_intervals_reach_further() -> None:
    machine = drawn(3, False)
    log, velocity = moves(machine, bare=True), machine.flat["friction.stribeck_velocity"]
    speed = np.gradient(log["position"], log.sample_time)
    more = 0.3 * machine.flat["friction.coulomb"] * np.exp(-((speed / velocity) ** 2))
    both = followed(log := with_force(log, more * (speed > 0)), machine.flat, len(log.time))
    case = fit_case(log, both, 20.0)
    (apart,) = forces.find_friction_by_direction(case)
    wider = apart.fit
    assert case.leading.tried.label == 1
    assert apart.spoils
    assert wider.inner == pytest.approx(both.inner)
    assert np.all(np.diag(wider.covariance) >= np.diag(both.covariance) * (1 - 1e-9))


# --- the record of the EMPS benchmark ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def axis() -> friso.Stage:
    stage = friso.load(ROOT / "examples" / "emps_axis.toml")
    return stage.replace({"drive.sample_time": "1 ms", "drive.velocity_samples": 2.0})


@pytest.fixture(scope="module")
def emps(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return emps_log(tmp_path_factory.mktemp("emps"))


@pytest.fixture(scope="module")
def identified(emps: Log, axis: friso.Stage) -> IdentifiedMoves:
    return identify_moves(emps, axis.flat(), True, 20.0)


PUBLISHED = {"position": 0.0138, "velocity": 0.229, "acceleration": 8.60, "force": 5.848}
"""Relative errors of closed-loop simulation [%]."""


@pytest.mark.thorough
def test_emps_in_closed_loop_and_half_of_it_predicted(identified: IdentifiedMoves, emps: Log) -> None:
    """The stage predicts the second half of the record, simulated on its own."""
    assert identified.fit.problem.closed
    latter = simulated_log(identified, cut(emps, slice(len(emps.time) // 2, None))).errors
    for name, percent in PUBLISHED.items():
        assert 100 * getattr(identified.errors, name) < percent, name
        assert 100 * getattr(latter, name) < percent, name


@pytest.mark.thorough
def test_emps_fits_better_than_the_inverse_model(identified: IdentifiedMoves, emps: Log, axis: friso.Stage) -> None:
    inverse = identified.inverse
    flat = axis.flat() | {"masses.cart": inverse.value("mass"), "friction.viscous": inverse.value("viscous")}
    flat |= dict.fromkeys(("friction.static", "friction.coulomb"), inverse.value("coulomb"))
    flat |= {"bias.cart": -inverse.value("offset"), "friction.viscous_asymmetry": 0.0}
    plain = loop_problem(flat, emps, identified.part, ()).record(np.zeros(0))
    assert identified.errors.force < errors_of(emps, identified.part, plain, 20.0).force


@pytest.mark.thorough
def test_emps_shows_mass_and_sliding_friction_alone(identified: IdentifiedMoves) -> None:
    by_name = {estimate.name: estimate for estimate in identified.estimates}
    for name in ("friction.static", "friction.stribeck_velocity", *BRISTLES):
        assert not by_name[name].determined, name
        assert by_name[name].low < by_name[name].high
    coulomb, static = by_name["friction.coulomb"], by_name["friction.static"]
    assert re.search(r"between 0\.0\d+ and 41\.5 mm/s", static.reason)
    assert coulomb.low - 1e-9 < static.low < coulomb.value  # Coulomb friction may be less than its value as well
    highest = HIGHEST_FRICTION_RATIO
    assert highest * coulomb.value < static.high < 1.02 * highest * coulomb.high
    # all that is believed of bristles, and not what the fit makes of them
    assert coulomb.value / by_name[BRISTLES[0]].high < 2 * SHORTEST_BRISTLE_BEND
    mass = by_name["masses.cart"]
    assert mass.determined
    assert mass.value == pytest.approx(95.1089, rel=5e-3)
    assert coulomb.value == pytest.approx(20.3935, rel=0.05)


def on_bristles(rate: float, step: float, seconds: float) -> Log:
    """A sine of some rate [Hz] of a mass whose friction turns over 20 um after each reversal; 20 mN of noise."""
    time = np.arange(round(seconds / step)) * step
    omega = 2 * np.pi * rate
    position, velocity = 0.05 * np.sin(omega * time), 0.05 * omega * np.cos(omega * time)
    friction, bent = np.empty(len(time)), 0.0
    for k, speed in enumerate(velocity):
        bent = (bent + step * speed) / (1 + step * abs(speed) / 2e-5)
        friction[k] = FRICTION[0] * bent / 2e-5 + FRICTION[1] * speed
    force = sum(TWO_MASSES) * np.gradient(velocity, step) + friction
    force += 0.02 * np.random.default_rng(5).standard_normal(len(time))
    return record("on bristles", step, position=position, force=force)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("rate", "step"), [(0.5, 2e-3), (0.2, 2e-3), (0.1, 4e-3), (0.05, 2e-3)])
def test_what_friction_does_at_the_reversals_of_a_sine_is_no_delay_and_no_coupling(rate: float, step: float) -> None:
    """Delays of 4 to 100 ms were named, and a coupling that changed the mass infinitely."""
    case = fit_case(log := on_bristles(rate, step, 20.0), *rigid(log), led=False)
    assert not "".join(one.words for find in (delay.find_delay, forces.find_coupling) for one in find(case))


@pytest.mark.parametrize("jitter", [0.0, 2e-4])
@pytest.mark.parametrize(("amplitude", "raised"), [(20e-6, True), (2e-3, False)])
def test_a_coarse_position_is_coarse_on_an_evened_clock_too(jitter: float, amplitude: float, raised: bool) -> None:
    """Interpolation to an even clock makes steps of nanometres of steps of a micrometre."""
    time, random = 1e-3 * np.arange(4000), np.random.default_rng(1)
    at = time + jitter * (random.random(time.size) - 0.5)
    position = np.interp(time, at, 1e-6 * np.round(amplitude * np.sin(np.pi * at) / 1e-6))
    push = np.sign(np.cos(np.pi * time)) - 500 * amplitude * np.pi**2 * np.sin(np.pi * time)
    log = record("moves", 1e-3, position=position, force=push)
    doubts = [*DOUBTS["position-digits"].find(RecordCase(log, inverse_model(log)))]
    assert [doubt.size for doubt in doubts] == pytest.approx([1e-6] * raised)
