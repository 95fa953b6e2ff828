"""Linear systems from the declared equations: limit cases, the family behind them, against closed forms and twins."""

from collections.abc import Callable
from functools import cache
from typing import Any

import control
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.linalg import expm
from scipy.optimize import brentq
from variants import VARIANTS

import friso
from friso.equations.component import TIME
from friso.equations.model import REFERENCE, Model, assemble
from friso.equations.roles import Role
from friso.equations.structure import Structure, structure
from friso.frequency.bode import COMFORTABLE_MARGIN, bode, limits, settled_members
from friso.frequency.loops import closed_loop, open_loop, plant, poles, response
from friso.frequency.margins import (
    impedance,
    loops,
    margins,
    of_loop,
    plants,
    scan_stability,
    spectral_abscissa,
    with_resonances,
)
from friso.frequency.system import DriveTiming, Members, exponentials, family, level, limit_cases, member
from friso.stage import Stage

HZ = 2 * np.pi


def magnitude(system: control.StateSpace, output: str, frequency: float) -> float:
    """Return the magnitude of one output over the force on the stage."""
    row, column = system.output_labels.index(output), system.input_labels.index("force")
    return abs(system(2j * np.pi * frequency)[row, column])


def resonances(poles: np.ndarray) -> np.ndarray:
    """Frequencies [Hz] of the lightly damped ones, ascending."""
    light = poles[(poles.imag > 0) & (np.abs(poles.real) < 0.3 * poles.imag)]
    return np.sort(np.abs(light)) / HZ


# --- what the rig must do (issue 5, section 5) ---


def test_the_rig_has_its_resonances(rig: Stage) -> None:
    """Bristles and joint in a row hold a stuck cart at 11 Hz; a sliding one swings against the mass at its joint."""
    stiff = rig.replace({"friction.bristle_stiffness": "1e9 N/m", "joint.damping": "0 N*s/m", "parasitic": None})
    assert resonances(friso.linear(stiff, "stuck").poles())[0] == pytest.approx(np.sqrt(2400 / 0.5) / HZ, rel=1e-5)
    assert resonances(friso.linear(rig, "stuck").poles())[0] == pytest.approx(11.03, rel=0.02)
    system = friso.linear(rig, "sliding")
    alone = control.ss(system.A, system.B[:, :1], system.C[:1], 0)
    assert resonances(control.zeros(alone))[0] == pytest.approx(7.12, rel=1e-3)
    assert resonances(system.poles())[0] == pytest.approx(13.12, rel=1e-3)
    assert system(5j)[2] == pytest.approx(system(5j)[0] - system(5j)[1])


@pytest.mark.parametrize(
    ("changed", "case", "series", "joint"),
    [
        ({}, "stuck", False, 2400.0),
        ({}, "stuck-touched", False, 2400 + 2e7),
        ({}, "stuck-touched", True, 2400 * 2e7 / (2400 + 2e7)),
        ({"joint.stroke": "0 mm"}, "stuck-touched", True, 2400 * 2e7 / (2400 + 2e7)),
    ],
)
def test_low_frequency_stiffness_is_both_springs_in_a_row(
    rig: Stage, changed: dict, case: str, series: bool, joint: float
) -> None:
    system = friso.linear(rig.replace(changed), case, series=series)
    assert 1 / magnitude(system, "stage", 1e-3) == pytest.approx(joint * 1e5 / (joint + 1e5), rel=1e-6)


@pytest.mark.parametrize(("case", "frequency", "mass"), [("stuck", 60, 0.5), ("sliding", 60, 0.5), ("sliding", 1, 1.7)])
def test_mass_lines(rig: Stage, case: str, frequency: float, mass: float) -> None:
    result = 1 / (magnitude(friso.linear(rig, case), "stage", frequency) * (HZ * frequency) ** 2)
    assert result == pytest.approx(mass, rel=0.05)


# --- the equations ---


@pytest.mark.cases(first=3, slow=16)
@pytest.mark.parametrize("name", [name for name in VARIANTS if "load-dependent" not in name])
def test_closed_loop_is_the_jacobian_of_the_whole_model(name: str) -> None:
    """Plant and controller put together against the Jacobian of the assembled equations, bristles and all.

    Of friction that follows the drive's force, the linear systems have what it is without another load.
    """
    flat = VARIANTS[name].flat()
    for one in limit_cases(flat).values():
        whole = np.linalg.eigvals(jacobian(flat, one))
        parts = np.linalg.eigvals(closed_loop(flat, one).a[0])
        model, _ = derived(structure(flat))
        # where a stuck cart got stuck, or the force of an element that slips; that of GMS is drawn to its level
        stay = one.stuck[0] or flat["friction.model"] == "maxwell_slip"
        extra = len(whole) - len(parts)
        assert extra == (sum(state.role == Role.BRISTLE for state in model.states) if stay else 0)
        for pole in parts:
            assert np.abs(whole - pole).min() < 1e-7 * np.abs(whole).max()
        if extra:
            assert np.abs(whole).min() < 1e-9 * np.abs(whole).max()


TURNS = {"sine": lambda turns: np.sin(2 * np.pi * turns)}


@cache
def derived(form: Structure) -> tuple[Model, Callable[..., Any]]:
    """The equations of stages of a structure, and the Jacobian of their right-hand side, by SymPy."""
    model = assemble(form)
    rates = sp.Matrix(model.rhs)
    arguments = [*model.symbols, TIME, *REFERENCE, *(kink.beyond for kink in model.kinks), *model.parameters]
    return model, sp.lambdify(arguments, rates.jacobian(model.symbols).tolist(), [TURNS, "math"], cse=True)


def jacobian(flat: dict, one: Members) -> np.ndarray:
    """Return the Jacobian of the right-hand side of a stage with its controller, at a given state."""
    model, derivatives = derived(structure(flat))
    speed = float(one.speed[0])
    here = {symbol: speed if str(symbol).endswith("velocity") else 0.0 for symbol in model.symbols}
    here |= dict.fromkeys((TIME, *REFERENCE), 0.0)  # it stands
    modes = {"forward": 1.0, "stroke_ahead": float(one.touched[0]), "contact_ahead": 1.0}
    modes |= dict.fromkeys(("plastic_ahead", "slipping_ahead"), float(speed > 0))
    modes |= {switch.name: float(not one.stuck[0]) for switch in model.switches}
    here |= {kink.beyond: modes.get(kink.name, 0.0) for kink in model.kinks}
    numbers = {key: flat.get(str(key), np.nan) for key in model.parameters}  # the motion plays no part
    bristles = [state for state in model.states if state.role == Role.BRISTLE]
    for state in reversed(bristles) if speed else ():  # what bends depends on what ages, and not the other way
        z, rate = state.symbol, state.derivative
        most = 1e-3 if state.unit == "m" else 1e3
        here[z] = steady(rate.subs(numbers).subs({s: v for s, v in here.items() if s != z}), z, most)
    return np.array(derivatives(*here.values(), *numbers.values()), dtype=float)


def steady(rate: sp.Expr, z: sp.Symbol, most: float) -> float:
    """The value up to `most` at which the rate of a friction state is 0 in a motion ahead; 0 where any is."""
    return brentq(sp.lambdify(z, rate), 1e-9, most, xtol=1e-20) if rate.has(z) else 0.0


@pytest.mark.parametrize("share", [-0.9, 0.0, 0.5, 0.99])
def test_stuck_under_a_bias_force(rig: Stage, share: float) -> None:
    """(1 - F_d/F_s)(sigma_1 s + sigma_0) over the displacement (Astrom, Canudas de Wit 2008), and viscous friction."""
    s = 1j * np.geomspace(0.1, 1e4, 20)
    result = impedance(rig.flat(), member(bias=share * 3.0), s)[0] * s
    assert result == pytest.approx((1 - share) * (1e5 + np.sqrt(1e5) * s) + 0.5 * s, rel=1e-12)


@pytest.mark.parametrize("speed", [1e-5, 1e-3, 1.6e-3, 0.1])
def test_sliding_friction_has_the_slope_of_the_stribeck_curve(rig: Stage, speed: float) -> None:
    ratio = speed / 1.6e-3
    slope = -2 * (3 - 1) * ratio / 1.6e-3 * np.exp(-(ratio**2)) + 0.5
    assert impedance(rig.flat(), member(speed), np.array([1e-7j]))[0, 0].real == pytest.approx(slope, rel=1e-6)


def test_an_asymmetric_law_breaks_away_at_two_levels(rig: Stage) -> None:
    flat = rig.replace({"friction.asymmetry": 0.2}).flat()
    assert [level(flat, forward) for forward in (True, False)] == pytest.approx([3.6, 2.4])
    assert {*family(flat).forward.tolist()} == {True, False}


def test_a_law_that_creeps_bears_no_bias() -> None:
    assert not family(VARIANTS["rigid, Stribeck 3"].flat()).bias.any()


# --- fast path against slow twin ---


@pytest.mark.cases(first=5, slow=27)
@pytest.mark.parametrize("name", VARIANTS)
def test_family_at_once_against_one_system_after_the_other(name: str) -> None:
    flat = VARIANTS[name].flat()
    members = family(flat, 5, 7)
    omega = np.geomspace(1e-3, 1e5, 41)
    fast, fast_loops = plants(flat, members, omega), loops(flat, members, omega)
    abscissa = spectral_abscissa(flat, members)
    for k in range(len(members)):
        one = members[k]
        system = plant(flat, one).take(("force",), ("stage",))
        assert fast[k] == pytest.approx(system.at(1j * omega)[0, :, 0, 0], rel=1e-6)
        assert fast_loops[k] == pytest.approx(open_loop(flat, one).at(1j * omega)[0, :, 0, 0], rel=1e-6)
        slow = np.linalg.eigvals(closed_loop(flat, one).a[0])
        assert abscissa[k] == pytest.approx(slow.real.max(), abs=1e-9 * np.abs(slow).max())


LIGHT = {
    "friction.bristle_damping": "1 N*s/m",
    "friction.bristle_stiffness": "2e6 N/m",
    "friction.viscous": "0.01 N*s/m",
    "joint.damping": "0.01 N*s/m",
    "joint.locked": True,
    "controller.crossover": "4 Hz",
}
"""A stage whose bristles hardly damp: its closed-loop resonances are sharp, and move with the bias force."""


@pytest.mark.cases(slow=2)
@pytest.mark.parametrize("drive", [{}, {"drive.sample_time": "1 ms"}, {"drive.delay": "0.3 ms"}])
@pytest.mark.parametrize("stage", [{}, LIGHT])
def test_scan_finds_what_exact_margins_find(rig: Stage, stage: dict, drive: dict) -> None:
    flat = rig.replace({**stage, **drive}).flat()
    members = family(flat, 11, 5)
    scanned = scan_stability(flat, members)
    exact = [margins(flat, members[k]) for k in range(len(members))]
    assert scanned.stable.tolist() == [item.stable for item in exact]
    distance = np.array([entry.modulus_margin for entry in exact])
    stable = scanned.stable
    assert scanned.distance[stable] == pytest.approx(distance[stable], rel=0.03)
    assert scanned.distance[scanned.worst(stable)] == pytest.approx(np.nanmin(distance), rel=1e-6)


def test_exponentials() -> None:
    matrices = np.random.default_rng(0).normal(size=(30, 6, 6)) * np.geomspace(1e-3, 10, 30)[:, None, None]
    expected = np.array([expm(matrice) for matrice in matrices])
    scale = np.abs(expected).max(axis=(1, 2))
    assert np.all(np.abs(exponentials(matrices) - expected).max(axis=(1, 2)) < 1e-10 * scale)


# --- margins, by definition ---

DRIVES = (
    {},
    {"drive.delay": "0.2 ms"},
    {"drive.sample_time": "50 us"},
    {"drive.sample_time": "0.2 ms", "drive.delay": "0.3 ms"},
)

stages = st.fixed_dictionaries(
    {
        "controller.crossover": st.floats(2, 60).map(lambda f: f"{f!r} Hz"),
        "controller.tuned_mass": st.floats(0.4, 4).map(lambda m: f"{m!r} kg"),
        "controller.alpha": st.floats(0.05, 0.3),
        "controller.beta": st.floats(1, 4),
        "joint.stiffness": st.floats(500, 2e4).map(lambda k: f"{k!r} N/m"),
        "masses.cart": st.floats(0.3, 3).map(lambda m: f"{m!r} kg"),
    }
)
CASES = ("stuck", "sliding", "stuck-touched", "sliding-touched")


def growing(flat: dict, one: Members) -> int:
    """Return the number of closed-loop poles in the right half-plane, with the exact delay.

    It is how often 1 + L turns round 0 along a line just right of the imaginary axis (Nyquist), in continuous time.
    """
    exact_poles = poles(flat, one, DriveTiming(0.0, 0.0))
    aside = 1e-3 * np.abs(exact_poles.closed).min()
    resonant = np.abs(np.concatenate([exact_poles.closed[0], exact_poles.cut[0]]).imag)
    near = (resonant[resonant > 0][:, None] * (1 + np.linspace(-0.05, 0.05, 401))).ravel()
    omega = np.unique(np.concatenate([aside * np.geomspace(1e-3, 1e13, 20_001), near, [0.0]]))
    seen = 1 + response(flat, one, DriveTiming.of(flat))(omega - 1j * aside)
    turned = np.angle(seen[1:] / seen[:-1]).sum()
    return int((exact_poles.cut.real > aside).sum()) - round(turned / np.pi)


@pytest.mark.slow
@given(stages, st.sampled_from(CASES), st.sampled_from(DRIVES))
@settings(max_examples=15)
def test_margins_take_the_loop_to_the_edge(rig: Stage, changes: dict, case: str, drive_keys: dict) -> None:
    flat = rig.replace({**changes, **drive_keys}).flat()
    one = limit_cases(flat)[case]
    loop_margins = margins(flat, one)
    loop, drive = open_loop(flat, one), DriveTiming.of(flat)
    at = response(flat, one, drive)
    if not drive.sample_time:
        assert growing(flat, one) == np.count_nonzero(loop_margins.poles.real > 0)
    if not loop_margins.stable:
        return
    for gain in (loop_margins.gain_margin, loop_margins.gain_reduction):
        if 0 < gain < np.inf and not drive.sample_time and not drive.delay:
            moved = np.linalg.eigvals(loop.a[0] - gain * loop.b[0] @ loop.c[0])
            assert np.abs(moved.real / np.abs(moved)).min() < 1e-6
    crossed = at(HZ * np.array(loop_margins.crossovers)) if loop_margins.crossovers else np.ones(0, complex)
    assert np.abs(crossed) == pytest.approx(1, rel=1e-6)
    if np.isfinite(loop_margins.phase_margin):
        turn = np.exp(1j * np.radians(loop_margins.phase_margin))
        assert min(np.abs(1 + crossed * turn).min(), np.abs(1 + crossed / turn).min()) < 1e-6
    if np.isfinite(loop_margins.delay_margin):
        late = np.exp(-1j * HZ * np.array(loop_margins.crossovers) * loop_margins.delay_margin)
        assert np.abs(1 + crossed * late).min() < 1e-6
    everywhere = np.abs(1 + at(np.geomspace(1e-3, min(1e6, drive.highest), 20001)))
    assert loop_margins.modulus_margin <= everywhere.min() * (1 + 1e-9)
    assert np.abs(1 + at(np.array([HZ * loop_margins.closest])))[0] == pytest.approx(loop_margins.modulus_margin)


@pytest.mark.parametrize(("gain", "turns"), [(0.5, 0.5045), (0.1, 0.5304), (1.5, 0.998)])
def test_the_delay_margin_of_a_loop_that_leads(gain: float, turns: float) -> None:
    """L = gain s^2/(s^2 + 2 zeta s + 1) leads by up to half a turn: delay takes it to -1 by more than half a turn, and
    at the crossover that it takes least time for."""
    zeta = 0.01

    def loop(omega: np.ndarray) -> np.ndarray:
        return -gain * omega**2 / (1 - omega**2 + 2j * zeta * omega)

    damping = 2 - 4 * zeta**2
    squares = np.roots([1 - gain**2, -damping, 1.0])  # |L| = 1
    crossed = np.sqrt(squares[squares > 0].real)
    lag = np.mod(np.pi + np.angle(loop(crossed)), 2 * np.pi)  # from L down to -1
    poles = np.roots([1 + gain, 2 * zeta, 1]).astype(complex)
    omega = with_resonances(np.geomspace(1e-3, 1e3, 1000), [poles, np.roots([1, 2 * zeta, 1]).astype(complex)])
    result = of_loop(loop, poles, float(poles.real.max()), omega, np.zeros(0, complex))
    assert HZ * np.array(result.crossovers) == pytest.approx(np.sort(crossed), rel=1e-9)
    assert result.delay_margin == pytest.approx((lag / crossed).min(), rel=1e-9)
    assert lag[np.argmin(lag / crossed)] / (2 * np.pi) == pytest.approx(turns, abs=0.003)


@pytest.mark.parametrize("case", CASES)
def test_margins_against_python_control(rig: Stage, case: str) -> None:
    loop_margins = margins(rig.flat(), limit_cases(rig.flat())[case])
    gain, phase, distance, *_ = control.stability_margins(friso.linear(rig, case, "open"), returnall=True)
    assert loop_margins.phase_margin == pytest.approx(np.abs(phase).min(), rel=1e-4)
    assert loop_margins.modulus_margin == pytest.approx(distance.min(), rel=1e-3)
    reductions = gain[(gain < 1) & (gain > 1e-6)]
    assert loop_margins.gain_reduction == pytest.approx(reductions.max(initial=0), rel=1e-4)


@pytest.mark.parametrize(("alpha", "phase", "peak"), [(0.1, 46.0, 1.37), (0.2, 29.4, 1.99)])
def test_van_dijk_on_a_bare_mass(alpha: float, phase: float, peak: float) -> None:
    result = friso.tuning(8.0, alpha, 2.0, 1.7)
    assert result.margins.phase_margin == pytest.approx(phase, abs=0.05)
    assert result.margins.peak_sensitivity == pytest.approx(peak, abs=0.005)
    assert 1.005 < result.true_crossover / 8 < 1.08
    assert result.tau_z / result.tau_p == pytest.approx(1 / alpha)
    assert result.k_p == pytest.approx(1.7 * (8 * HZ) ** 2 * np.sqrt(alpha))


# --- the drive ---


def test_a_sampled_loop_is_the_sum_of_its_aliases(rig: Stage) -> None:
    """L of the discrete system against hold, delay and plant at all frequencies that sampling folds together."""
    step, delay = 1e-3, 1.4e-3
    flat = {**rig.flat(), "drive.sample_time": step, "drive.delay": delay}
    one = limit_cases(flat)["sliding"]
    omega = HZ * np.array([3.0, 40.0, 220.0, 460.0])
    folded = omega[:, None] + HZ / step * np.arange(-400, 401)
    s = 1j * folded
    bare = plant(flat, one).take(("force",), ("stage",)).at(s.ravel())[0, :, 0, 0].reshape(s.shape)
    held = (bare * (1 - np.exp(-s * step)) / s * np.exp(-s * delay)).sum(axis=1) / step
    answer = friso.linear(rig, "sliding", "controller")
    z = np.exp(1j * omega * step)
    bilinear = 2 / step * (z - 1) / (z + 1)
    compensated = -np.array([answer(w)[0, answer.input_labels.index("stage")] for w in bilinear])
    result = response(flat, one, DriveTiming.of(flat))(omega)
    assert result == pytest.approx(held * compensated, rel=1e-4)


def test_sampling_ever_faster_is_continuous(rig: Stage) -> None:
    """Poles of the sampled loop approach those of the continuous one: half a sample of delay."""
    flat, one = rig.flat(), limit_cases(rig.flat())["sliding"]
    exact = poles(flat, one, DriveTiming(0.0, 0.0)).in_s[0]
    slow = exact[np.abs(exact) < 2000]
    steps = np.array([4e-5, 2e-5, 1e-5])
    off = [
        max(np.abs(poles(flat, one, DriveTiming(step, 0.0)).in_s[0] - pole).min() for pole in slow) for step in steps
    ]
    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx(1, abs=0.1)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    ("delay", "crossover", "growth"), [("2 ms", 12, 0.910), ("5 ms", 20, 0.366), ("1 ms", 12, -0.271)]
)
def test_a_long_delay_and_a_sharp_mode(rig: Stage, delay: str, crossover: float, growth: float) -> None:
    """Rightmost roots of 1 + L(s) exp(-s delay), found by Newton's method: one rational function of order 4 for the
    delay has the wrong sign here."""
    sharp = {"joint.locked": True, "joint.limiter_damping": "1 N*s/m", "parasitic.damping_ratio": 0.001}
    changed = rig.replace({**sharp, "drive.delay": delay, "controller.crossover": f"{crossover} Hz"})
    loop_margins = margins(changed.flat(), limit_cases(changed.flat())["sliding"])
    assert loop_margins.abscissa == pytest.approx(growth, abs=0.005)


@pytest.mark.slow
def test_a_delay_is_lag(rig: Stage) -> None:
    """At its delay margin a loop is on the edge of stability, also with the rational approximation."""
    flat, one = rig.flat(), limit_cases(rig.flat())["sliding"]
    margin = margins(flat, one).delay_margin
    early, late = (margins({**flat, "drive.delay": share * margin}, one).stable for share in (0.999, 1.001))
    assert (early, late) == (True, False)


# --- degenerate loops ---


@pytest.mark.cases(first=8, slow=140)
@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("drive", DRIVES)
def test_every_kind_of_stage_with_every_drive(name: str, drive: dict) -> None:
    changed = VARIANTS[name].replace(drive)
    flat = changed.flat()
    for case, one in limit_cases(flat).items():
        loop_margins = margins(flat, one)
        if not drive:
            assert growing(flat, one) == np.count_nonzero(loop_margins.poles.real > 1e-6), case
        if loop_margins.stable:
            assert 0 < loop_margins.modulus_margin < 1.01
            assert loop_margins.gain_margin == np.inf or loop_margins.gain_margin < 1e8
            assert loop_margins.gain_reduction == 0 or loop_margins.gain_reduction > 1e-6


def by_gains(rig: Stage, **gains: str) -> Stage:
    """The rig with a controller by these gains."""
    tables = rig.as_written() | {"controller": {"kind": "pid", "derivative_on": "measurement", **gains}}
    return Stage(**tables)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize(
    "drive", [DriveTiming(0.0, 2e-4), DriveTiming(0.0, 5e-3), DriveTiming(1e-4, 1e-4), DriveTiming(1e-3, 1.5e-3)]
)
@pytest.mark.parametrize("turn", [1e-10, 1e-8, 1e-5, 1e-4])
def test_slow_poles_are_where_the_loop_is_minus_1(rig: Stage, turn: float, drive: DriveTiming) -> None:
    """If stuck, an integral acts on a spring.

    Its pole, with a given phase in the delay, must neither be lost in the rounding of the fast poles nor be taken
    without delay.
    """
    rigid = by_gains(rig, kp="0 N/m", ki="1 N/(m*s)").replace({"joint.locked": True, "parasitic": None})
    one = limit_cases(rigid.flat())["stuck"]
    speed = 1e-3 * abs(response(rigid.flat(), one, DriveTiming(0.0, 0.0))(np.array([1e-3]))[0])
    slow = turn / drive.delay
    flat = {**rigid.flat(), "controller.ki": slow / speed}
    at = response(flat, one, drive)
    exact = brentq(lambda s: 1 + at(np.array([-1j * s]))[0].real, -1.1 * slow, -0.9 * slow, xtol=1e-12 * slow)
    assert poles(flat, one, drive).abscissa[0] == pytest.approx(exact, rel=3e-6)


@pytest.mark.cases(slow=3)
@pytest.mark.parametrize("drive", DRIVES)
def test_a_position_that_is_not_controlled_is_on_the_edge(rig: Stage, drive: dict) -> None:
    for locked in (True, False):
        changed = by_gains(rig, kd="50 N*s/m").replace({"joint.locked": locked, **drive})
        loop_margins = margins(changed.flat(), limit_cases(changed.flat())["sliding"])
        assert (loop_margins.stable, loop_margins.on_the_edge) == (False, True)
        assert limits(changed.flat()).stable == ()


def test_a_proportional_loop_may_lose_all_its_gain(rig: Stage) -> None:
    air = by_gains(rig, kp="1 N/mm", kd="50 N*s/m").replace({"friction": None, "parasitic": None})
    loop_margins = margins(air.flat(), limit_cases(air.flat())["sliding"])
    assert (loop_margins.stable, loop_margins.gain_reduction, loop_margins.gain_margin) == (True, 0, np.inf)


def test_a_slow_loop_has_its_crossover_with_any_delay(rig: Stage) -> None:
    """The gains in the stage file's description: stuck, the loop crosses 0 dB at 6.4e-6 Hz."""
    slow = by_gains(rig, kp="3 N/m", ki="4 N/(m*s)", kd="6 N*s/m").replace({"joint.locked": True})
    for drive in DRIVES:
        flat = slow.replace(drive).flat()
        loop_margins = margins(flat, limit_cases(flat)["stuck"])
        assert loop_margins.crossovers == pytest.approx([6.4e-6], rel=0.01)
        assert loop_margins.phase_margin == pytest.approx(90, abs=0.1)


def test_bias_forces_are_those_that_a_stuck_cart_bears(rig: Stage) -> None:
    members = family(rig.replace({"friction.asymmetry": 0.5}).flat())
    for forward, (least, most) in {True: (-1.5, 4.5), False: (-4.5, 1.5)}.items():
        bias = members.bias[members.stuck & (members.forward == forward)]
        assert (bias.min(), bias.max()) == pytest.approx((least, most), rel=2e-3)


# --- how fast the controller may be ---


@pytest.mark.slow
@pytest.mark.parametrize("locked", [True, False])
def test_limits_are_where_the_margins_say(rig: Stage, locked: bool) -> None:
    drive = {"drive.sample_time": "50 us", "drive.delay": "100 us", "joint.locked": locked}
    flat = rig.replace(drive).flat()
    loop_limits = limits(flat)
    edge = loop_limits.highest_stable
    assert edge is not None
    assert not loop_limits.open_ended
    members = settled_members(flat)
    for share, stable in ((0.999, True), (1.001, False)):
        moved = {**flat, "controller.crossover": share * edge}
        assert bool((spectral_abscissa(moved, members) < 0).all()) == stable
    for low, high in loop_limits.comfortable:
        for end in (low, high):
            if not np.isclose(end, loop_limits.searched).any():
                at = {**flat, "controller.crossover": end}
                least = min(margins(at, members[k]).modulus_margin for k in range(len(members)))
                assert least == pytest.approx(COMFORTABLE_MARGIN, rel=0.01)


def test_the_stribeck_range_is_unstable_and_told(rig: Stage) -> None:
    result = bode(rig)
    assert not result.stable
    for item in result.unstable:
        for speed, stable in ((0.99 * item.low, True), (1.01 * item.low, False), (0.99 * item.high, False)):
            assert (spectral_abscissa(rig.flat(), member(speed, touched=item.touched))[0] < 0) == stable
    worst, expected, _ = result.worst
    assert not expected.stable
    assert result.unstable[0].low < worst.speed[0] < result.unstable[0].high


def test_a_stage_without_friction_has_one_case() -> None:
    result = bode(VARIANTS["rigid, no friction section"])
    assert [*result.cases] == ["given"]
    assert result.stable
    assert result.worst[1].modulus_margin == pytest.approx(result.cases["given"].margins.modulus_margin)


# --- Equations 1 and 2 ---


# --- the public function ---


def test_linear_names_what_it_has_and_follows_its_reference(rig: Stage) -> None:
    closed = friso.linear(rig, "sliding", "closed")
    assert closed.input_labels == ["force", "disturbance on cart", "reference", "sensor noise"]
    assert closed.output_labels == ["stage", "cart", "joint deflection", "force"]
    assert "integral" in closed.state_labels
    assert closed(1e-4j)[0, 1:] == pytest.approx([0, 1, -1], abs=1e-6)
    assert friso.linear(rig, friso.member(speed=1e-3), "plant").nstates == 7
    rigid = friso.linear(VARIANTS["rigid, no friction section"])
    assert rigid.output_labels == ["stage", "cart"]


@pytest.mark.parametrize("case", [friso.member(bias=5.0), family(VARIANTS["rigid"].flat()), friso.member(touched=True)])
def test_a_case_that_a_stage_cannot_be_in_is_refused(rig: Stage, case: Members) -> None:
    with refused("case"):
        friso.linear(rig.replace({"joint.locked": True}), case)


GAINS = {"kp": (0.6374e6, "N/m"), "ki": (136.5e6, "N/(m*s)"), "kd": (428.4, "N*s/m")}
FRICTION = {
    **{"static": "6 N", "coulomb": "4.2 N", "stribeck_velocity": "0.3 mm/s", "stribeck_exponent": 1},
    **{"viscous": "30 N*s/m", "bristle_stiffness": "20 N/um", "bristle_damping": "800 N*s/m"},
}


def fast_stage(factor: float = 1.0, **settings: Any) -> Stage:
    """A fast stage whose gains are multiplied by a factor, with settings against friction."""
    gains = {name: f"{factor * value} {unit}" for name, (value, unit) in GAINS.items()}
    return Stage(
        masses={"stage": "0.35 kg"},
        friction={"model": "lugre", **FRICTION},
        controller={"kind": "pid", "derivative_on": "measurement", **gains, **settings},
        drive={"sample_time": "50 us", "delay": "50 us"},
        motion={"kind": "hold", "duration": "1 s"},
    )


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("factor", [2.7, 0.1])
@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (lambda factor: {"standstill_window": "3 um", "standstill_factor": factor}, "standstill"),
        (lambda factor: {"moving_factor": factor}, "moves"),
        (lambda factor: {"schedule_error": ["1 um", "1 mm"], "schedule_factor": [factor, 1.0]}, "times"),
    ],
)
def test_the_worst_gains_count(settings: Callable[[float], dict[str, Any]], name: str, factor: float) -> None:
    """Margins and limits are those of the loop with each set of gains written out, whichever is the worse."""
    plain, changed, both = fast_stage(), fast_stage(factor), fast_stage(**settings(factor))
    alone, expected = [bode(stage) for stage in (plain, changed)], bode(both)
    for one in ("highest_stable", "highest_comfortable"):
        least = min(getattr(result.limits["given"], one) for result in alone)
        assert getattr(expected.limits["given"], one) == pytest.approx(least, rel=1e-3)
    bad = [one.abscissa if not one.stable else -one.modulus_margin for one in (result.settled[1] for result in alone)]
    _, worst, gains = expected.settled
    assert (-worst.modulus_margin if worst.stable else worst.abscissa) == pytest.approx(max(bad), rel=1e-6)
    assert (name in gains) == (bad[1] > bad[0])
    speeds = [[one.low, one.high] for result in alone for one in result.unstable]
    np.testing.assert_allclose([[one.low, one.high] for one in expected.unstable], speeds, rtol=1e-3)
    assert expected.stable == all(result.stable for result in alone)
