"""The variational equations: as symbols, and as derivatives of the flow against differences of simulated runs.

Saltation at a kink: Leine, Nijmeijer 2004, doi:10.1007/978-3-540-44398-8, chapter 7.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest
import sympy as sp
from cycles import by_gains, flow, flow_by_differences
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from variants import VARIANTS

import friso
from friso.engine.arrays import STATISTICS
from friso.equations.component import TIME, Kink
from friso.equations.model import PREFIX, REFERENCE, Model, assemble, variational
from friso.equations.structure import structure
from friso.hunting import Ensemble
from friso.stage import Stage

STEADY = settings(max_examples=40)
"""Settings that draw the same examples each time: a motion that only grazes a kink has no derivative."""

FINE = 1e-11
"""Relative tolerance of the runs with their deviations; the runs that are subtracted have a tenth of it."""

STEPS = (1e-3, 1e-4, 1e-5, 1e-6)
"""Steps of the differences, in units of the states' magnitudes; see `off`."""

CLOSE = 3e-6
"""Share to which derivatives agree with differences; a tenth of it is observed, mostly noise of the differences."""

RIGID, LIMITED = "rigid", "rigid, van Dijk, limit"
LOCKED_RIG, FREE_RIG = "locked, parasitic", "free, parasitic"


def held(chosen: str | Stage, **changes: float) -> Ensemble:
    """A stage, or a variant, with its reference at 0 and some numbers changed (a point in a key is written `__`)."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    flat = VARIANTS[chosen].flat() if isinstance(chosen, str) else chosen.flat()
    return Ensemble.held(flat | keys, 1)


def moving(stages: Ensemble, place: float, speed: float, **others: float) -> np.ndarray:
    """Return a state in which all masses are displaced and move as one.

    Place, speed and integrator are in units of the length and the rate of hunting, other states in SI units.
    """
    length, rate = float(stages.length[0]), float(stages.number("rate")[0])
    sizes = {"filtered_error": -place * length, "bristle_deflection": 5e-6 * np.sign(speed), "integral": 0.0}
    sizes |= dict.fromkeys(("position", "cart_position", "parasitic_position"), place * length)
    sizes |= dict.fromkeys(("velocity", "cart_velocity", "parasitic_velocity"), speed * length * rate)
    sizes |= others
    sizes["integral"] *= length / rate
    return np.array([sizes[name] for name in stages.kernel.states])


def off(stages: Ensemble, start: np.ndarray, time: float, flows: np.ndarray) -> np.ndarray:
    """Return the error of each column of a derivative, relative to its norm or to a tenth if that is larger.

    Each column is compared at its best step: differences suffer from curvature at large steps, and at small ones from
    the noise of the runs, which is largest where one run meets one kink more or less than its neighbours.
    """
    gaps = [np.linalg.norm(flows - flow_by_differences(stages, start, time, step), axis=0) for step in STEPS]
    return np.min(gaps, axis=0) / np.maximum(np.linalg.norm(flows, axis=0), 0.1)


def velocities(stages: Ensemble, start: np.ndarray, time: float) -> np.ndarray:
    """Velocity [m/s] of what the friction acts on, over time."""
    results = stages.run(start[None], np.array([time]), FINE, interval=time / 1000)
    names = stages.kernel.states
    return results.samples[0][:, names.index("cart_velocity" if "cart_velocity" in names else "velocity")]


@pytest.mark.slow
@STEADY
@given(
    crossover=st.floats(2, 15),
    place=st.floats(-2, 2),
    speed=st.floats(0.03, 3),
    integral=st.floats(-1, 1),
    bristles=st.floats(-1e-5, 1.5e-5),
    time=st.floats(0.1, 20),
)
def test_flow_of_a_rigid_mass(
    crossover: float, place: float, speed: float, integral: float, bristles: float, time: float
) -> None:
    """Sliding, stopping, sticking and breaking away, from anywhere; time in units of 1/(natural frequency)."""
    stages = held(RIGID, controller__crossover=crossover)
    start = moving(stages, place, speed, integral=integral, bristle_deflection=bristles)
    after = time / float(stages.number("rate")[0])
    assert np.all(off(stages, start, after, flow(stages, start, after)) < CLOSE)


CASES = [
    (name, time, crosses)
    for name, times in (
        (RIGID, ((0.03, False), (2.6, True))),
        (LOCKED_RIG, ((0.02, False), (0.3, True), (1.1, True))),
        (FREE_RIG, ((0.02, False), (0.3, True), (1.1, True))),
    )
    for time, crosses in times
]


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(("name", "time", "crosses"), CASES)
def test_flow_with_and_without_reversal(name: str, time: float, crosses: bool) -> None:
    """Each structure runs up to its first reversal and past several.

    The parasitic mode rings; no limiter is touched.
    """
    far = {"joint__stroke": 0.1} if name == FREE_RIG else {}
    stages = held(name, **far)
    start = moving(stages, -0.6, 0.5, integral=0.2)
    assert np.any(velocities(stages, start, time) < 0) == crosses
    assert np.all(off(stages, start, time, flow(stages, start, time)) < CLOSE)


@pytest.mark.parametrize("time", [0.02, 0.05, 0.1, 0.3, 0.5])
def test_flow_at_the_force_limit(time: float) -> None:
    """The stage starts 10 mm off at the full force of 6 N, with the integrator at rest and later running.

    After 0.04 s the force is below its limit.
    """
    stages = held(by_gains(8, "6 N"))
    start = moving(stages, -0.01 / float(stages.length[0]), 0.3)
    surfaces = stages.kernel.module.surfaces(start[:, None], 0.0, np.zeros(3), stages.values)
    beyond = [name for name, surface in zip(stages.kernel.kinks, surfaces, strict=True) if surface[0] > 0]
    assert beyond == ["forward", "force_upper", "rest_upper", "winding_up"]
    assert np.all(off(stages, start, time, flow(stages, start, time)) < CLOSE)


class Bounce:
    """The stage of the free rig flies into its limiter and leaves it again, once, within a millisecond."""

    def __init__(self) -> None:
        self.stages = held(FREE_RIG)
        stage, cart = 0.95e-3, 0.0
        others = {"position": stage, "parasitic_position": stage, "cart_position": cart, "filtered_error": 0.0}
        others |= {"velocity": 0.25, "parasitic_velocity": 0.25, "cart_velocity": 0.05, "bristle_deflection": 1e-5}
        self.start = moving(self.stages, 0.0, 0.0, **others)
        self.touches, self.leaves = self.crossing(1e-4, 3e-4), self.crossing(4e-4, 8e-4)

    def after(self, time: float) -> np.ndarray:
        return self.stages.run(self.start[None], np.array([time]), FINE).ends[0]

    def beyond(self, time: float) -> float:
        """How far the limiter is compressed [m]."""
        state = self.after(time)
        return state[self.place("position")] - state[self.place("cart_position")] - 1e-3

    def crossing(self, low: float, high: float) -> float:
        return brentq(self.beyond, low, high, xtol=1e-14)

    def place(self, name: str) -> int:
        return self.stages.kernel.states.index(name)

    def between(self, start: float, end: float) -> np.ndarray:
        """The flow's derivative between two times of the motion, in which no limiter is touched or left."""
        return flow(self.stages, self.after(start), end - start)

    def saltation(self, time: float) -> np.ndarray:
        """The saltation matrix by hand, from the rates on both sides of the limiter's surface."""
        near = 1e-11
        states = np.stack([self.after(time - near), self.after(time + near)])
        before, behind = self.stages.take(np.zeros(2, np.int64)).rates(states)
        normal = np.zeros(self.start.size)
        normal[[self.place("position"), self.place("cart_position")]] = 1.0, -1.0
        result = np.eye(self.start.size) + np.outer(behind - before, normal) / (normal @ before)
        return result * self.stages.scales[0] / self.stages.scales[0][:, None]


@pytest.fixture(scope="module")
def bounce() -> Bounce:
    return Bounce()


@pytest.mark.parametrize("time", [0.5e-3, 1e-3])
def test_flow_into_the_limiter_and_out_of_it(bounce: Bounce, time: float) -> None:
    """Touching and leaving a damped limiter the force jumps: in contact after 0.5 ms, free again after 1 ms."""
    assert bounce.touches < 0.5e-3 < bounce.leaves < 1e-3
    assert np.all(off(bounce.stages, bounce.start, time, flow(bounce.stages, bounce.start, time)) < CLOSE)


@pytest.mark.parametrize("time", [0.5e-3, 1e-3])
def test_deviations_jump_at_the_limiter_by_the_saltation_matrix(bounce: Bounce, time: float) -> None:
    """Put together from pieces without a contact inside and saltation matrices by hand, the derivative is the same but
    for the 2 ns left out, some 1e-4 of it; without those matrices it is off by percents, as differences tell."""
    gap = 1e-9
    ends = [end for end in (bounce.touches, bounce.leaves) if end < time]
    times = [0.0, *(end + side for end in ends for side in (-gap, gap)), time]
    pieced = without = np.eye(bounce.start.size)
    for k, piece in enumerate(bounce.between(*times[k : k + 2]) for k in range(0, len(times), 2)):
        pieced, without = piece @ pieced, piece @ without
        pieced = bounce.saltation(ends[k]) @ pieced if k < len(ends) else pieced
    whole = flow(bounce.stages, bounce.start, time)
    scale = np.linalg.norm(whole, axis=0)
    assert np.all(np.linalg.norm(pieced - whole, axis=0) < 3e-4 * scale)
    assert np.max(off(bounce.stages, bounce.start, time, without)) > 0.01


@cache
def declared(name: str) -> tuple[Model, Model]:
    """The equations of a variant, and those with the deviations."""
    model = assemble(structure(VARIANTS[name].flat()))
    return model, variational(model)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("name", [RIGID, LIMITED, LOCKED_RIG, FREE_RIG, "touching"])
def test_deviations_follow_the_linearised_equations(name: str) -> None:
    """After the states come as many deviations; their rates are the Jacobian times them."""
    model, whole = declared(name)
    n = len(model.states)
    assert whole.states[:n] == model.states
    small = [state.symbol for state in whole.states[n:]]
    assert [str(symbol) for symbol in small] == [f"{PREFIX}{symbol}" for symbol in model.symbols]
    expected = sp.Matrix(model.rhs).jacobian(sp.Matrix(model.symbols)) * sp.Matrix(small)
    assert sp.expand(sp.Matrix([state.derivative for state in whole.states[n:]]) - expected) == sp.zeros(n, 1)


@pytest.mark.parametrize("time", [0.03, 2.6])
def test_a_run_is_the_same_with_deviations_and_without(time: float) -> None:
    """Deviations do not influence the steps; rounding differs, since common terms are computed once."""
    stages = held(RIGID)
    start = moving(stages, -0.6, 0.5, integral=0.2)
    alone = stages.run(start[None], np.array([time]), FINE)
    beside = stages.run(np.concatenate([start, start])[None], np.array([time]), FINE, variational=True)
    assert np.all(np.abs(beside.ends[0, : start.size] - alone.ends[0]) < 1e-9 * stages.scales[0])
    attempted = STATISTICS.index("attempted")
    assert beside.statistics[0, attempted] == pytest.approx(alone.statistics[0, attempted], abs=2)


def parameters(name: str, model: Model) -> list[float]:
    flat = VARIANTS[name].flat() | {"motion.size": 1.0}
    return [float(flat[str(symbol)]) for symbol in model.parameters]


@dataclass(frozen=True)
class Meeting:
    """States with deviations on the surface of a kink, and by how much they jump there when it is crossed."""

    states: dict[str, float]
    jumps: dict[str, float]


@cache
def numeric(name: str, kink: Kink | None = None) -> Callable[..., list[float]]:
    """Return a function for the surfaces of all kinks of a variant, or for the jumps of the states at one kink.

    Its arguments are states, sides, held values, time, reference and parameters.
    """
    _, whole = declared(name)
    symbols = [whole.symbols, [item.beyond for item in whole.kinks], TIME, REFERENCE, whole.parameters]
    surfaces = [entry.surface for entry in whole.kinks]
    return sp.lambdify(symbols, surfaces if kink is None else [*whole.jumps[kink].values()])


def meeting(name: str, kink: Kink, crossed: bool, rng: np.random.Generator) -> Meeting:
    """A state drawn at random, one of its numbers then chosen to lie on the surface; `crossed` if met from beyond."""
    flat = VARIANTS[name].flat()
    _, whole = declared(name)
    surfaces, jumps = numeric(name), numeric(name, kink)
    size = flat.get("joint.stroke", 1e-2)
    states, sides = size * rng.normal(size=len(whole.symbols)), np.zeros(len(whole.kinks))
    number = whole.kinks.index(kink)
    held = (0.0, (0.0, 0.0, 0.0), parameters(name, whole))
    met = next(k for k, symbol in enumerate(whole.symbols) if sp.diff(kink.surface, symbol) != 0)
    for _ in range(3):  # the surface is linear in the state: once would do but for rounding
        slope = float(sp.diff(kink.surface, whole.symbols[met]).subs(dict(zip(whole.parameters, held[2], strict=True))))
        states[met] -= surfaces(states, sides, *held)[number] / slope
    sides = (np.array(surfaces(states, sides, *held)) > 0).astype(float)
    sides[number] = crossed
    result = jumps(states, sides, *held)
    values = zip(map(str, whole.symbols), map(float, states), strict=True)
    return Meeting(dict(values), dict(zip(map(str, whole.jumps[kink]), map(float, result), strict=True)))


@pytest.mark.cases(first=6, slow=14)
@pytest.mark.parametrize("name", VARIANTS)
def test_deviations_jump_at_a_limiter_alone(name: str) -> None:
    """No friction law's rates jump at v = 0, nor a controller's at its limit.

    Those of a damped limiter do, and those of modes with memory may. The jumps declared at the ends of the
    anti-windup's band are zero wherever they are met.
    """
    model, whole = declared(name)
    limiters = {kink for kink in model.kinks if kink.name.startswith("stroke_")}
    jumping = set(whole.jumps) - set(model.switches)
    bands = {kink for kink in model.kinks if kink.name.startswith("rest_")}
    assert limiters <= jumping <= limiters | bands
    rng = np.random.default_rng(0)
    for kink, crossed in product(jumping - limiters, (False, True)):
        point = meeting(name, kink, crossed, rng)
        size = max(abs(point.states[str(x)]) for x in whole.jumps[kink])
        assert list(point.jumps.values()) == pytest.approx([0.0], abs=1e-9 * size)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(("side", "leaves"), list(product(("ahead", "behind"), (False, True))))
def test_jump_at_a_limiter_by_hand(side: str, leaves: bool) -> None:
    """The force of its damper, d_l times a speed, is shared over that speed: whatever it is, the velocities deviate by
    d_l/m times how far the deviation goes into the limiter; they get it back where it is left."""
    _, whole = declared(FREE_RIG)
    kink = next(item for item in whole.kinks if item.name == f"stroke_{side}")
    point = meeting(FREE_RIG, kink, leaves, np.random.default_rng(1))
    into = point.states["small_position"] - point.states["small_cart_position"]
    inputs = 100.0 * into * (-1 if leaves else 1)
    assert point.jumps == pytest.approx(
        {"small_velocity": -inputs / 0.25, "small_cart_velocity": inputs / 1.2}, rel=1e-6
    )


@pytest.mark.slow
def test_a_kink_whose_surface_is_level_at_a_trial_point_has_a_jump() -> None:
    """Two windows and a cascade: the surface of one does not depend there on the symbol that it is linear in."""
    stage = friso.load(friso.example("thesis_rig")).replace(
        {
            "parasitic": None,
            "friction": {**STRIBECK, "regularisation_velocity": "10 um/s"},
            "controller": {
                "kind": "cascade", "kv": "60 1/s", "kp": "500 N*s/m", "position_integral_time": "50 ms",
                "integral_deadband": "1 um", "standstill_window": "5 um", "standstill_factor": 0.5,
                "stiction_push": "1 N", "stiction_push_window": "2 um", "force_limit": "200 N",
                "anti_windup": "back_calculation", "anti_windup_time": "50 ms",
                "filters": [{"kind": "low_pass", "path": "feedback", "frequency": "1 kHz"}],
            },
            "motion": {"kind": "hold", "duration": "20 s"},
        }
    )  # fmt: skip
    assert variational(assemble(structure(stage.flat()))).jumps


STRIBECK = {
    "model": "stribeck", "static": "3 N", "coulomb": "1 N", "stribeck_velocity": "1.6 mm/s", "stribeck_exponent": 2.0,
    "viscous": "0.5 N*s/m",
}  # fmt: skip
