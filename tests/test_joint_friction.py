"""Friction of joints: static friction that grows with the time at rest, and friction that grows with the drive's force.

Limits, formulas by hand, and what is said of hunting beside long runs of the equations by hand.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from variants import HOLD, dwell, elasto_plastic, gains, load_dependent, lugre, release, rolling, stage, van_dijk

import friso
from benchmarks import by_hand as plain
from friso.engine.batch import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.imposed import Dragged
from friso.hunting import Ensemble, HuntingDoubt, find_cycles
from friso.hunting import hunting as hunting_of
from friso.stage import Stage
from friso.stage.tables import friction_law

PD = gains(kp=2000.0, kd=50.0, extra='derivative_on = "measurement"')


def machine(friction: str, crossover: str = "3 Hz", displacement: str = "1 mm") -> Stage:
    return stage(release(displacement, "1 s"), friction=friction, controller=van_dijk(crossover))


def drag_force(friction: str, place: np.ndarray, sample_time: float) -> np.ndarray:
    """Return the mean force [N] between the samples of a place [m] at which a body is held, from rest."""
    flat = stage(HOLD, friction=friction, controller=gains(1.0)).flat()
    law = flat["friction.model"]
    shape = kernel(Dragged(law, friction_law(law).variant(flat)))
    inputs = Inputs(place, np.zeros(len(place)), sample_time)
    starts = np.zeros((1, shape.initial_size))
    starts[:, shape.velocity] = inputs.velocity[0]
    (run,) = run_driven(shape, {**flat, "motion.duration": 1.0}, 1, inputs, starts, 1e-9)
    return np.diff(run.states[0, :, -1]) / sample_time


@pytest.mark.parametrize("rest", [5.0, 20.0, 80.0])
def test_static_friction_grows_with_the_time_at_rest_as_kato_has_it(rest: float) -> None:
    """A body slides fast, rests, and is pulled: the peak is F_s - (F_s - F_c) exp(-t/T), with T = 20 s."""
    dt, fast, slow = 5e-3, 0.2, 0.05e-3  # slow: a thirtieth of the Stribeck velocity
    rates = np.concatenate([np.full(400, fast), np.zeros(round(rest / dt)), np.full(600, slow)])
    force = drag_force(dwell("20 s"), np.concatenate([[0.0], np.cumsum(rates * dt)]), dt)
    pulled = force[-600:]
    since = rest + (np.argmax(pulled) + 0.5) * dt
    assert pulled.max() - 0.5 * slow == pytest.approx(
        3.0 - 2.0 * np.exp(-since / 20), rel=0.02
    )  # bristles follow within 0.3 s


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("law", [dwell("1 us"), load_dependent(0.0)], ids=["no dwell", "no load"])
def test_in_the_limit_the_laws_are_lugre(law: str) -> None:
    """After a dwell time of a microsecond, and without a share of the drive's force."""
    both = [find_cycles(Ensemble.held(machine(friction).flat(), 1)) for friction in (law, lugre(2))]
    assert all(one.closed[0] for one in both)
    assert both[0].amplitude[0] == pytest.approx(both[1].amplitude[0], rel=1e-4)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    "law",
    [load_dependent(0.2), dwell("0.3 s"), elasto_plastic(), rolling()],
    ids=["load", "dwell", "plastic", "rolling"],
)
def test_cycles_against_runs_and_equations_by_hand(law: str) -> None:
    chosen = machine(law)
    stages = Ensemble.held(chosen.flat(), 1)
    cycles = find_cycles(stages)
    assert cycles.closed[0], cycles.reasons[0]
    period, amplitude = float(cycles.period[0]), float(cycles.amplitude[0])
    long = friso.simulate(chosen.replace({"motion.duration": "200 s"}), 1e-8, 1.0)
    late = long.turning_deviation.values[long.turning_time.values > 200 - 2 * period]
    assert np.ptp(late) / 2 == pytest.approx(amplitude, rel=1e-5)
    names = stages.kernel.states
    rates = plain.rates({**chosen.flat(), "motion.kind": "hold"}, names)
    scale, start = stages.scales[0], cycles.states[0]
    half = solve_ivp(rates, (0, period / 2), start, "Radau", rtol=1e-7, atol=1e-9 * scale)
    expected = np.array([value if name == "lack" else -value for name, value in zip(names, start, strict=True)])
    assert np.max(np.abs(half.y[:, -1] - expected) / scale) < 1e-4


@pytest.mark.parametrize(
    ("law", "crossover", "hunts"),
    [
        (dwell("50 ms"), "6 Hz", True),
        (dwell("0.5 s"), "12 Hz", False),
        (dwell("5 s"), "3 Hz", True),
        (load_dependent(0.3), "3 Hz", True),
        (load_dependent(0.3), "25 Hz", False),
    ],
)
def test_what_is_said_of_hunting_is_what_runs_from_many_places_do(law: str, crossover: str, hunts: bool) -> None:
    said = hunting_of(machine(law, crossover))
    swings = []
    for place in ("0.1 mm", "0.5 mm", "3 mm"):
        long = friso.simulate(machine(law, crossover, place).replace({"motion.duration": "100 s"}), 1e-6, 1.0)
        late = long.turning_deviation.values[long.turning_time.values > 80]
        swings.append(np.ptp(late) / 2 if late.size else 0.0)
    assert bool(said.attracting) == hunts == (max(swings) > 1e-6)
    if hunts:
        assert min(abs(one.amplitude / max(swings) - 1) for one in said.attracting) < 1e-3


def test_without_an_integral_nothing_is_sure_of_friction_that_follows_the_drive() -> None:
    proportional = stage(release(), friction=load_dependent(0.3), controller=PD)
    said = hunting_of(proportional)
    assert (said.certain, said.reason) == (False, HuntingDoubt.LOAD)
    assert hunting_of(stage(release(), friction=lugre(2), controller=PD)).certain


def test_the_virgin_curve_under_its_own_load_is_that_of_a_slow_drag() -> None:
    place = np.linspace(0.0, 300e-6, 601)
    force = drag_force(load_dependent(0.3), place, 0.05)  # at 10 um/s
    shown = friction_law("load_dependent").shown(machine(load_dependent(0.3)).flat())
    by_formula = np.interp((place[1:] + place[:-1]) / 2, shown.displacement, shown.force)
    assert np.abs(force - by_formula).max() < 0.01 * shown.levels.static
