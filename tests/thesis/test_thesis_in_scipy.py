"""Eight claims of the thesis computed again in plain NumPy and SciPy, without friso's equations or engine, and beside
what friso finds."""

import re

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.ode23s import ATOL, LARGEST, RTOL, ode23s, parameters
from friso.engine.batch import simulate
from friso_thesis.studies.thesis.claims import Evidence, Finding, by_peak_count, registered
from friso_thesis.studies.thesis.evidence import run_response
from friso_thesis.studies.thesis.linear import Linear, analysed
from friso_thesis.studies.thesis.studies import LOCKED, thesis_rig

CART, STAGE, JOINT, DAMPING = 1.2, 0.5, 2.4e3, 0.5
"""Masses [kg], stiffness [N/m] and damping [N s/m] of the joint (Sec. 3.5, 4.2.1; the damping is friso's choice)."""

SIGMA_0, SIGMA_1, SIGMA_2, STRIBECK, STATIC, COULOMB = 1e5, 1e5**0.5, 0.5, 1.6e-3, 3.0, 1.0
"""Table 2."""


@pytest.fixture(scope="module")
def linear() -> Linear:
    return analysed(thesis_rig())


def judged_by(claim: str, linear: Linear | None = None) -> Finding:
    return registered()[claim].judge(Evidence({}, {}, linear))


def gains(crossover: float, mass: float, alpha: float = 0.1, beta: float = 2.0) -> tuple[float, float, float, float]:
    """k_p, tau_z, tau_i, tau_p by Eq. 8."""
    omega = 2 * np.pi * crossover
    lead = np.sqrt(1 / alpha)
    tau_z = lead / omega
    return mass * omega**2 / lead, tau_z, beta * tau_z, 1 / (omega * lead)


def controller(s: complex, crossover: float, mass: float) -> complex:
    """Eq. 7."""
    k_p, tau_z, tau_i, tau_p = gains(crossover, mass)
    return k_p * ((1 + tau_z / tau_i) + 1 / (tau_i * s) + tau_z * s) / (tau_p * s + 1)


def test_e1_the_derivative_of_the_series_stiffness() -> None:
    k_f, k_j, step = 1e5, JOINT, 1.0
    series = [(k_f + d) * k_j / (k_f + d + k_j) for d in (-step, step)]
    eta = k_j / k_f
    assert (series[1] - series[0]) / (2 * step) == pytest.approx((eta / (1 + eta)) ** 2, rel=1e-6)
    assert judged_by("E1", analysed(thesis_rig())).judgement == "holds"


def test_f7_f18_the_modes_of_the_free_joint(linear: Linear) -> None:
    """Two masses on the joint, the cart stuck on its bristles or sliding."""
    for ground, name in ((SIGMA_0, "stuck"), (0.0, "sliding")):
        stiffness = np.array([[ground + JOINT, -JOINT], [-JOINT, JOINT]])
        modes = np.linalg.eigvalsh(stiffness / np.sqrt(np.outer([CART, STAGE], [CART, STAGE])))
        first = np.sqrt(modes[modes > 1.0].min()) / (2 * np.pi)
        assert linear.plants[name].first == pytest.approx(first, rel=5e-3)
        assert 10 < first < 13.5
    assert judged_by("F18", linear).parts[0].holds


@pytest.mark.parametrize("setting", [8.0, 48.0])
def test_f22_the_locked_loop_crosses_where_it_is_tuned(linear: Linear, setting: float) -> None:
    mass = CART + STAGE

    def excess(f: float) -> float:
        s = 2j * np.pi * f
        return float(np.log(abs(controller(s, setting, mass) / (mass * s**2 + SIGMA_2 * s))))

    crossing = brentq(excess, setting / 3, 3 * setting)
    own = linear.locked.margins[setting]["sliding"].crossovers
    assert min(abs(np.log(f / crossing)) for f in own) < 0.02
    assert crossing == pytest.approx(setting, rel=0.02)


def test_f23_the_free_loop_tuned_to_8_hz_crosses_above_20(linear: Linear) -> None:
    def excess(f: float) -> float:
        s = 2j * np.pi * f
        spring = JOINT + DAMPING * s
        cart, stage = CART * s**2 + SIGMA_2 * s + spring, STAGE * s**2 + spring
        return float(np.log(abs(controller(s, 8.0, CART + STAGE) * cart / (cart * stage - spring**2))))

    crossing = brentq(excess, 18.0, 40.0)
    own = linear.free.margins[8.0]["sliding"].crossovers
    assert min(abs(np.log(f / crossing)) for f in own) < 0.02


def test_s35_the_leaves_as_two_clamped_beams() -> None:
    """Stiffness, first mode, stress at 1 mm, of leaves 70 x 45 x 0.35 mm of 200 GPa."""
    young, length, width, thickness, deflection = 200e9, 70e-3, 45e-3, 0.35e-3, 1e-3
    stiffness = 2 * 12 * young * width * thickness**3 / 12 / length**3
    first = np.sqrt(stiffness / STAGE) / (2 * np.pi)
    stress = 3 * young * thickness * deflection / length**2
    low, high = map(float, re.findall(r"([\d.]+) to ([\d.]+) N/m", judged_by("S35").parts[0].number)[0])
    assert 0.95 * low < stiffness < high
    assert first == pytest.approx(11, rel=0.05)
    assert stress < 50e6


def test_s341_s352_the_forces() -> None:
    """k_j S_j against the friction of Table 2 and that measured; what 200 N accelerate, and what 100 m/s^2 take."""
    still = xr.Dataset(
        {name: (("joint.stiffness", "joint.stroke"), value) for name, value in STILL.items()},
        coords={"joint.stiffness": [500.0, 15e3], "joint.stroke": [0.0, 1e-3]},
    )
    table_2, measured, _ = registered()["S341"].judge(Evidence({"isolator-stiffness": by_peak_count(still)}, {})).parts
    force = float(table_2.number.split(" N")[0])
    assert force == pytest.approx(JOINT * 1e-3)
    assert table_2.holds == (JOINT * 1e-3 < STATIC)
    assert measured.holds == (JOINT * 1e-3 < 1.0)
    finding = judged_by("S352")
    reached = re.findall(r"([\d.]+) g with ([\d.]+) kg", finding.parts[0].number)
    assert [float(mass) for _, mass in reached] == [CART + STAGE, 2.5]
    for g, mass in reached:
        assert float(g) == pytest.approx(200 / float(mass) / 9.81, rel=0.01)
    assert finding.table is not None
    for mass, needed, _ in finding.table.rows:
        assert float(needed.split()[0]) == pytest.approx(100 * float(mass.split()[0]))


STILL = {"peaks": np.zeros((2, 2)), "peak_to_peak": np.zeros((2, 2)), "outcome": np.full((2, 2), "rests")}


@pytest.mark.slow
def test_f5_the_locked_rig_hunts() -> None:
    """One mass with LuGre friction under the controller of Eq. 7, moved 90 mm there and back, swings afterwards.

    The mass still swings eight seconds after its return, as friso's locked rig does, which has a stiff contact between
    its masses.
    """
    mass = CART + STAGE
    k_p, tau_z, tau_i, tau_p = gains(8.0, mass)
    acceleration, time, back = 100.0, 0.03, 5.0
    corners = np.array([0.0, time, 2 * time, back, back + time, back + 2 * time])

    def reference(t: float) -> tuple[float, float]:
        x = v = 0.0
        for start, stop, sign in zip(corners[[0, 1, 3, 4]], corners[[1, 2, 4, 5]], (1, -1, -1, 1), strict=True):
            full, part = stop - start, np.clip(t - start, 0.0, stop - start)
            x += v * part + sign * acceleration * part**2 / 2
            v += sign * acceleration * part
            if part < full:
                return x, v
            if stop in corners[[2, 5]] and t > stop:
                continue
        return x, v

    def slope(t: float, state: np.ndarray) -> list[float]:
        x, v, z, integral, lag = state
        r, r_v = reference(t)
        e = r - x
        # the filter 1/(tau_p s + 1) acts on all of the controller: its input is integrated, its output is the force
        unfiltered = k_p * ((1 + tau_z / tau_i) * e + integral / tau_i + tau_z * (r_v - v))
        g = COULOMB + (STATIC - COULOMB) * np.exp(-((v / STRIBECK) ** 2))
        z_rate = v - SIGMA_0 * abs(v) / g * z
        friction = SIGMA_0 * z + SIGMA_1 * z_rate + SIGMA_2 * v
        return [v, (lag - friction) / mass, z_rate, e, (unfiltered - lag) / tau_p]

    state, swings, instants = np.zeros(5), [], []
    for start, stop in zip(corners, [*corners[1:], 16.0], strict=True):
        run = solve_ivp(slope, (start, stop), state, "LSODA", rtol=1e-6, atol=1e-10, max_step=0.05)
        assert run.success
        state = run.y[:, -1]
        swings, instants = [*swings, *run.y[0]], [*instants, *run.t]
    late = np.array(swings)[np.array(instants) > 12]
    amplitude = np.ptp(late) / 2
    response = run_response(LOCKED, {}, 1e-6)
    assert amplitude == pytest.approx(float(response.cell["peak_to_peak"]) / 2, rel=0.15)
    assert 1e-4 < amplitude < 3.2e-3


@pytest.mark.slow
def test_s323_the_solver_of_the_thesis_follows_a_move_as_friso_does() -> None:
    """ode23s and the equations of the rig by hand, out of the limiters and back onto them."""
    end, sample = 0.1, 1e-3
    position, steps, _ = ode23s.py_func(parameters(thesis_rig().flat()), end, RTOL, ATOL, LARGEST, sample)
    own = simulate(thesis_rig(), sample_time=sample)["position"].values[: len(position)]
    assert steps >= end / LARGEST
    assert position == pytest.approx(own, abs=1e-4)
    assert own.max() > 0.09
