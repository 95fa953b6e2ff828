"""Linear systems from the declared equations: limit cases, the family behind them, against closed forms and twins."""

import control
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from variants import VARIANTS

import friso
from friso.equations.model import assemble
from friso.equations.structure import structure
from friso.frequency.bode import bode
from friso.frequency.crossover import WANTED, limits, settled_members
from friso.frequency.family import grid, impedance, loops, plants, scan, spectral_abscissa
from friso.frequency.friction import level
from friso.frequency.loops import Drive, closed_loop, closed_poles, exponentials, open_loop, sampled_open_loop
from friso.frequency.margins import loop_response, margins
from friso.frequency.members import Members, family, limit_cases, member
from friso.frequency.parts import mechanics, plant
from friso.frequency.stiffness import in_row, sensitivity
from friso.stage import Stage, StageError

HZ = 2 * np.pi


def magnitude(system: control.StateSpace, output: str, frequency: float) -> float:
    """Of one output over the force on the stage."""
    row, column = system.output_labels.index(output), system.input_labels.index("force")
    return abs(system(2j * np.pi * frequency)[row, column])


def resonances(poles: np.ndarray) -> np.ndarray:
    """Frequencies [Hz] of the lightly damped ones, ascending."""
    light = poles[(poles.imag > 0) & (np.abs(poles.real) < 0.3 * poles.imag)]
    return np.sort(np.abs(light)) / HZ


# --- what the rig must do (issue 5, section 5) ---


def test_stuck_cart_swings_at_eleven_hertz(rig: Stage) -> None:
    stiff = rig.replace({"friction.bristle_stiffness": "1e9 N/m", "joint.damping": "0 N*s/m", "parasitic": None})
    assert resonances(friso.linear(stiff, "stuck").poles())[0] == pytest.approx(np.sqrt(2400 / 0.5) / HZ, rel=1e-5)
    assert resonances(friso.linear(rig, "stuck").poles())[0] == pytest.approx(11.03, rel=0.02)  # bristles in a row


def test_sliding_cart_has_a_pair(rig: Stage) -> None:
    system = friso.linear(rig, "sliding")
    alone = control.ss(system.A, system.B[:, :1], system.C[:1], 0)
    assert resonances(control.zeros(alone))[0] == pytest.approx(7.12, rel=1e-3)
    assert resonances(system.poles())[0] == pytest.approx(13.12, rel=1e-3)


def test_low_frequency_stiffness_is_both_springs_in_a_row(rig: Stage) -> None:
    stuck = friso.linear(rig, "stuck")
    assert 1 / magnitude(stuck, "stage", 1e-3) == pytest.approx(in_row(2400, 1e5), rel=1e-6)
    touched = friso.linear(rig, "stuck-touched")
    assert 1 / magnitude(touched, "stage", 1e-3) == pytest.approx(in_row(2400 + 2e7, 1e5), rel=1e-6)
    printed = friso.linear(rig, "stuck-touched", series=True)
    assert 1 / magnitude(printed, "stage", 1e-3) == pytest.approx(in_row(in_row(2400, 2e7), 1e5), rel=1e-6)


@pytest.mark.parametrize(("case", "frequency", "mass"), [("stuck", 60, 0.5), ("sliding", 60, 0.5), ("sliding", 1, 1.7)])
def test_mass_lines(rig: Stage, case: str, frequency: float, mass: float) -> None:
    found = 1 / (magnitude(friso.linear(rig, case), "stage", frequency) * (HZ * frequency) ** 2)
    assert found == pytest.approx(mass, rel=0.05)


def test_joint_deflection_is_the_difference(rig: Stage) -> None:
    at = friso.linear(rig, "sliding")(5j)
    assert at[2] == pytest.approx(at[0] - at[1])


# --- the equations ---


@pytest.mark.parametrize("name", VARIANTS)
def test_closed_loop_is_the_jacobian_of_the_whole_model(name: str) -> None:
    """Plant and controller put together against the Jacobian of the assembled equations, bristles and all."""
    flat = VARIANTS[name].flat()
    for one in limit_cases(flat).values():
        whole = np.linalg.eigvals(jacobian(flat, one))
        parts = np.linalg.eigvals(closed_loop(flat, one).a[0])
        extra = len(whole) - len(parts)  # the place where a stuck cart got stuck
        assert extra == int(one.stuck[0] and "bristle_deflection" in map(str, assemble(structure(flat)).symbols))
        for pole in parts:
            assert np.abs(whole - pole).min() < 1e-7 * np.abs(whole).max()
        if extra:
            assert np.abs(whole).min() < 1e-9 * np.abs(whole).max()


def jacobian(flat: dict, one: Members) -> np.ndarray:
    """Of the right-hand side of a stage with its controller, by SymPy, at a state that is put in by hand."""
    model = assemble(structure(flat))
    speed = float(one.speed[0])
    here = {symbol: speed if str(symbol).endswith("velocity") else 0.0 for symbol in model.symbols}
    modes = {"forward": 1.0, "stroke_ahead": float(one.touched[0])}
    here |= {kink.beyond: modes.get(kink.name, 0.0) for kink in model.kinks}
    rates = {str(each.symbol): each.derivative for each in model.states}
    numbers = {key: flat[str(key)] for key in sp.Matrix(model.rhs).free_symbols if str(key) in flat}
    if "bristle_deflection" in rates:
        z = sp.Symbol("bristle_deflection", real=True)
        rate = rates["bristle_deflection"].subs(numbers).subs({s: v for s, v in here.items() if s != z})
        here[z] = sp.solve(rate, z)[0] if speed else 0.0
    matrix = sp.Matrix(model.rhs).jacobian(model.symbols).subs(numbers).subs(here)
    return np.array(matrix.evalf(), dtype=float)


@pytest.mark.parametrize("share", [-0.9, 0.0, 0.5, 0.99])
def test_stuck_under_a_bias_force(rig: Stage, share: float) -> None:
    """(1 - F_d/F_s)(sigma_1 s + sigma_0) over the displacement (Astrom, Canudas de Wit 2008), and viscous friction."""
    s = 1j * np.geomspace(0.1, 1e4, 20)
    found = impedance(rig.flat(), member(bias=share * 3.0), s)[0] * s
    assert found == pytest.approx((1 - share) * (1e5 + np.sqrt(1e5) * s) + 0.5 * s, rel=1e-12)


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


@pytest.mark.parametrize("name", VARIANTS)
def test_family_at_once_against_one_system_after_the_other(name: str) -> None:
    flat = VARIANTS[name].flat()
    members = family(flat, 5, 7)
    omega = grid(flat)
    omega = omega[(omega > 1e-2) & (omega < 1e5)][::7]
    fast, fast_loops = plants(flat, members, omega), loops(flat, members, omega)
    abscissa = spectral_abscissa(flat, members)
    for k in range(len(members)):
        one = members[k]
        system = plant(flat, one).take(("force",), ("stage",))
        assert fast[k] == pytest.approx(system.at(1j * omega)[0, :, 0, 0], rel=1e-6)
        assert fast_loops[k] == pytest.approx(open_loop(flat, one).at(1j * omega)[0, :, 0, 0], rel=1e-6)
        poles = np.linalg.eigvals(closed_loop(flat, one).a[0])
        assert abscissa[k] == pytest.approx(poles.real.max(), abs=1e-9 * np.abs(poles).max())


def test_scan_finds_what_exact_margins_find(rig: Stage) -> None:
    members = family(rig.flat(), 9, 9)
    found = scan(rig.flat(), members)
    for k in range(len(members)):
        exact = margins(rig.flat(), members[k])
        assert bool(found.stable[k]) == exact.stable
        if exact.stable:
            assert found.distance[k] == pytest.approx(exact.modulus_margin, rel=0.01, abs=1e-4)


def test_exponentials() -> None:
    matrices = np.random.default_rng(0).normal(size=(30, 6, 6)) * np.geomspace(1e-3, 10, 30)[:, None, None]
    expected = np.array([expm(each) for each in matrices])
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.abs(exponentials(matrices) - expected).max(where=scale > 0, initial=0) < 1e-9 * scale.max()


# --- margins, by definition ---

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


@given(stages, st.sampled_from(CASES))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_margins_take_the_loop_to_the_edge(rig: Stage, changes: dict, case: str) -> None:
    flat = rig.replace(changes).flat()
    one = limit_cases(flat)[case]
    found = margins(flat, one)
    loop = open_loop(flat, one)
    _, response = loop_response(flat, one)
    if not found.stable:
        assert np.linalg.eigvals(closed_loop(flat, one).a[0]).real.max() >= 0
        return
    for gain in (found.gain_margin, found.gain_reduction):
        if 0 < gain < np.inf:
            poles = np.linalg.eigvals(loop.a[0] - gain * loop.b[0] @ loop.c[0] / (1 + gain * loop.d[0]))
            swinging = poles[np.abs(poles.imag) > 1e-3]
            assert np.abs(swinging.real / np.abs(swinging)).min() < 1e-6
    crossed = response(HZ * np.array(found.crossovers)) if found.crossovers else np.ones(0, complex)
    assert np.abs(crossed) == pytest.approx(1, rel=1e-6)
    if np.isfinite(found.phase_margin):
        turn = np.exp(1j * np.radians(found.phase_margin))
        assert min(np.abs(1 + crossed * turn).min(), np.abs(1 + crossed / turn).min()) < 1e-6
    if np.isfinite(found.delay_margin):
        late = np.exp(-1j * HZ * np.array(found.crossovers) * found.delay_margin)
        assert np.abs(1 + crossed * late).min() < 1e-6
    everywhere = np.abs(1 + response(np.geomspace(1e-3, 1e6, 20001)))
    assert found.modulus_margin <= everywhere.min() * (1 + 1e-9)
    assert np.abs(1 + response(np.array([HZ * found.closest])))[0] == pytest.approx(found.modulus_margin)


@pytest.mark.parametrize("case", CASES)
def test_margins_against_python_control(rig: Stage, case: str) -> None:
    found = margins(rig.flat(), limit_cases(rig.flat())[case])
    gain, phase, distance, *_ = control.stability_margins(friso.linear(rig, case, "open"), returnall=True)
    assert found.phase_margin == pytest.approx(np.abs(phase).min(), rel=1e-4)
    assert found.modulus_margin == pytest.approx(distance.min(), rel=1e-3)
    reductions = gain[(gain < 1) & (gain > 1e-6)]
    assert found.gain_reduction == pytest.approx(reductions.max(initial=0), rel=1e-4)


@pytest.mark.parametrize(("alpha", "phase", "peak"), [(0.1, 46.0, 1.37), (0.2, 29.4, 1.99)])
def test_van_dijk_on_a_bare_mass(alpha: float, phase: float, peak: float) -> None:
    found = friso.tuning(8.0, alpha, 2.0, 1.7)
    assert found.margins.phase_margin == pytest.approx(phase, abs=0.05)
    assert found.margins.peak_sensitivity == pytest.approx(peak, abs=0.005)
    assert 1.005 < found.true_crossover / 8 < 1.08
    assert found.tau_z / found.tau_p == pytest.approx(1 / alpha)
    assert found.k_p == pytest.approx(1.7 * (8 * HZ) ** 2 * np.sqrt(alpha))


def test_tuning_depends_on_crossover_and_mass_by_scale_alone() -> None:
    one, other = friso.tuning(5.0, 0.15, 2.5, 1.0), friso.tuning(50.0, 0.15, 2.5, 7.0)
    assert other.margins.phase_margin == pytest.approx(one.margins.phase_margin)
    assert other.true_crossover == pytest.approx(10 * one.true_crossover)


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
    found = sampled_open_loop(flat, one, Drive.of(flat)).at(z)[0, :, 0, 0]
    assert found == pytest.approx(held * compensated, rel=1e-4)


def test_sampling_ever_faster_is_continuous(rig: Stage) -> None:
    """Poles of the sampled loop go to those of the continuous one with the sample time: half a sample of delay."""
    flat, one = rig.flat(), limit_cases(rig.flat())["sliding"]
    exact = closed_poles(flat, one, Drive(0.0, 0.0))[0]
    slow = exact[np.abs(exact) < 2000]
    steps = np.array([4e-5, 2e-5, 1e-5])
    off = [max(np.abs(closed_poles(flat, one, Drive(step, 0.0))[0] - pole).min() for pole in slow) for step in steps]
    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx(1, abs=0.1)


def test_a_delay_is_lag(rig: Stage) -> None:
    """At its delay margin a loop is on the edge, by the rational stand-in for the delay too."""
    flat, one = rig.flat(), limit_cases(rig.flat())["sliding"]
    margin = margins(flat, one).delay_margin
    early, late = (margins({**flat, "drive.delay": share * margin}, one).stable for share in (0.999, 1.001))
    assert (early, late) == (True, False)


def test_crossover_has_to_be_below_half_the_sampling_frequency(rig: Stage) -> None:
    with pytest.raises(StageError, match="a crossover below half the sampling frequency"):
        rig.replace({"drive.sample_time": "50 ms", "controller.crossover": "10 Hz"})


# --- how fast the controller may be ---


@pytest.mark.parametrize("locked", [True, False])
def test_limits_are_where_the_margins_say(rig: Stage, locked: bool) -> None:
    drive = {"drive.sample_time": "50 us", "drive.delay": "100 us", "joint.locked": locked}
    flat = rig.replace(drive).flat()
    found = limits(flat)
    edge = found.highest_stable
    assert edge is not None
    members = settled_members(flat)
    for share, stable in ((0.999, True), (1.001, False)):
        moved = {**flat, "controller.crossover": share * edge}
        assert bool((spectral_abscissa(moved, members) < 0).all()) == stable
    for low, high in found.comfortable:
        for end in (low, high):
            if not np.isclose(end, found.searched).any():
                at = {**flat, "controller.crossover": end}
                least = min(margins(at, members[k]).modulus_margin for k in range(len(members)))
                assert least == pytest.approx(WANTED, rel=0.01)


def test_the_stribeck_range_is_unstable_and_told(rig: Stage) -> None:
    found = bode(rig)
    assert not found.stable
    for each in found.unstable:
        for speed, stable in ((0.99 * each.low, True), (1.01 * each.low, False), (0.99 * each.high, False)):
            assert (spectral_abscissa(rig.flat(), member(speed, touched=each.touched))[0] < 0) == stable
    worst, known = found.worst
    assert not known.stable
    assert found.unstable[0].low < worst.speed[0] < found.unstable[0].high


def test_a_stage_without_friction_has_one_case() -> None:
    found = bode(VARIANTS["rigid, no friction section"])
    assert [*found.cases] == ["given"]
    assert found.stable
    assert found.worst[1].modulus_margin == pytest.approx(found.cases["given"].margins.modulus_margin)


def test_mechanics_without_friction_is_a_chain(rig: Stage) -> None:
    """At low frequency all masses move as one."""
    flat = rig.flat()
    at = mechanics(flat, np.array([False, True])).at(np.array([0.01j]))
    assert -1 / at[..., 0, 0].real / 0.01**2 == pytest.approx(1.7, rel=1e-3)


# --- Equations 1 and 2 ---


def test_two_springs_in_a_row_and_their_sensitivity() -> None:
    k_f, k_j = sp.symbols("k_f k_j", positive=True)
    derived = sp.solve(sp.Symbol("F") / k_f + sp.Symbol("F") / k_j - sp.Symbol("F") / sp.Symbol("k"), sp.Symbol("k"))
    assert sp.simplify(derived[0] - in_row(k_f, k_j)) == 0
    assert sp.simplify(sp.diff(in_row(k_f, k_j), k_f) - sensitivity(k_f, k_j)) == 0


# --- the public function ---


def test_linear_names_what_it_has(rig: Stage) -> None:
    closed = friso.linear(rig, part="closed")
    assert closed.input_labels == ["force", "disturbance on cart", "reference", "sensor noise"]
    assert closed.output_labels == ["stage", "cart", "joint deflection", "force"]
    assert "integral" in closed.state_labels
    assert friso.linear(rig, friso.member(speed=1e-3), "plant").nstates == 7
    rigid = friso.linear(VARIANTS["rigid, no friction section"])
    assert rigid.output_labels == ["stage", "cart"]


def test_closed_loop_follows_its_reference(rig: Stage) -> None:
    closed = friso.linear(rig, "sliding", "closed")
    at = closed(1e-4j)
    assert at[0, closed.input_labels.index("reference")] == pytest.approx(1, abs=1e-6)
    assert at[0, closed.input_labels.index("sensor noise")] == pytest.approx(-1, abs=1e-6)
    assert abs(at[0, closed.input_labels.index("disturbance on cart")]) < 1e-6


@pytest.mark.parametrize(
    ("argument", "match"), [({"case": "slidin"}, "one of stuck, sliding"), ({"part": "loop"}, "plant")]
)
def test_linear_tells_what_there_is(rig: Stage, argument: dict, match: str) -> None:
    with pytest.raises(StageError, match=match):
        friso.linear(rig, **argument)
