"""Generalised Maxwell-slip friction: elements that stick or slip, against references written by hand."""

import numpy as np
import pytest
from variants import MICRO_DAMPING, VARIANTS, gains, gms, release, stage, van_dijk

import friso
from benchmarks.by_hand import X, Z, by_hand
from friso.equations.friction.laws import GeneralisedMaxwellSlip, polygon
from friso.frequency.loops import plant
from friso.frequency.system import member
from friso.hunting import Ensemble, find_cycles
from friso.studies.laws import measure_friction
from friso_thesis.studies.describing.function import describing

STIFFNESS, SHARE = np.array([5e4, 3e4, 2e4]), np.array([0.2, 0.3, 0.5])

FLAT_CURVE = gms(static="2 N", coulomb="2 N", viscous="0 N*s/m")
"""Elements whose strength does not depend on the speed."""

HELD = stage(release("80 um", "1 s"), friction=FLAT_CURVE, controller=gains(3000, 400000, 5, 1e-3))
"""Released with a loop that hardly damps: it rings on its elements, while the integrator moves where it rings about."""

SLIDES = stage(release("1 mm", "0.1 s"), friction=FLAT_CURVE, controller=gains(30000, 1000, 20, 1e-3))
"""Swings so far that everything slips on each way."""

HUNTS = stage(
    release("1 mm", "1 s"), friction=gms(damping=MICRO_DAMPING, attraction="160 N/s"), controller=van_dijk("5 Hz")
)


LIMIT = 2 * SHARE / STIFFNESS
"""Deflections [m] at which elements of `FLAT_CURVE` slip."""


def virgin(way: np.ndarray) -> np.ndarray:
    """Force [N] of such elements after a way [m] from rest without load."""
    return np.sum(STIFFNESS * np.minimum(way[..., None], LIMIT), axis=-1)


def imposed(displacement: np.ndarray) -> np.ndarray:
    """Deflections [m], (n, elements), along a displacement [m] that is monotone between its n points, from rest."""
    deflections = [np.zeros(len(LIMIT))]
    for moved in np.diff(displacement):
        deflections.append(np.clip(deflections[-1] + moved, -LIMIT, LIMIT))
    return np.array(deflections)


@pytest.mark.slow
def test_inner_loops_close_to_rounding() -> None:
    """If the level does not depend on speed, each deflection is that of a spring that slips at its strength.

    The path has loops within loops, each forgotten once it has closed.
    """
    response = friso.simulate(HELD, 1e-10, 2e-5)
    reference = np.interp(response.turning_time, response.time, response.reference)
    times = np.concatenate([response.time, response.turning_time])
    positions = np.concatenate([response.position, response.turning_deviation + reference])
    order = np.argsort(times, kind="stable")
    exact = imposed(positions[order])[order < response.sizes["time"]]
    ours = np.stack([response[f"deflection_{n}"].values for n in (1, 2, 3)], axis=1)
    assert len(response.turning_time) > 20
    assert np.max(np.abs(ours - exact)) < 1e-9 * LIMIT.max()
    assert np.max(np.abs(response.friction_force.values - exact @ STIFFNESS)) < 1e-9 * 2
    slips = np.stack([response[f"slip_{n}"].values for n in (1, 2, 3)], axis=1)
    assert slips.any(axis=0)[0]
    assert not slips.all()


def test_masing_s_rule() -> None:
    """From a turn with all elements slipping, the force follows the virgin curve at twice its size."""
    response = friso.simulate(SLIDES, 1e-10, 2e-6)
    (first, second), positions = response.turning_time.values[:2], response.position.values
    branch = np.flatnonzero((response.time.values > first) & (response.time.values < second))
    turn = float(response.turning_deviation[0])
    side = np.sign(positions[branch[-1]] - turn)
    expected = -side * 2 + side * 2 * virgin(np.abs(positions[branch] - turn) / 2)
    assert np.ptp(positions[branch]) > 4 * LIMIT.max()
    assert np.max(np.abs(response.friction_force.values[branch] - expected)) < 1e-8 * 2


@pytest.mark.slow
def test_a_loop_against_scipy_with_events() -> None:
    """The first slips and sticks of a stage on a falling curve: how many, and where the stage is then."""
    equations = by_hand(HUNTS.flat())
    times, states, slips, *_ = equations.followed(equations.start(4e-3), 0.2, 1e-11)
    assert len(times) > 5
    response = friso.simulate(HUNTS.replace({"motion.displacement": "4 mm", "motion.duration": "200 ms"}), 1e-11, 1e-6)
    ours = np.stack([response[f"slip_{n}"].values for n in (1, 2, 3)], axis=1)
    moments = response.time.values[1:][np.any(np.diff(ours, axis=0) != 0, axis=1)]
    changed = times[1:][np.any(np.diff(slips, axis=0) != 0, axis=1)]
    assert len(moments) == len(np.unique(np.round(changed, 6)))
    assert moments == pytest.approx(np.unique(np.round(changed, 6)), abs=2e-6)
    assert response.position.values[-1] == pytest.approx(states[-1, X], rel=1e-7)
    deflections = np.stack([response[f"deflection_{n}"].values[-1] for n in (1, 2, 3)])
    assert deflections == pytest.approx(states[-1, Z:], rel=1e-6)
    assert np.array_equal(ours[-1], slips[-1])


def test_an_element_bent_against_the_motion_goes_on_sticking() -> None:
    """Read by abs(F_i), it would be at its level at once, as the speed after the turn makes that fall below it."""
    bent, fast = 0.9 * SHARE * 3.0, -5e-3
    assert np.all(np.abs(bent) > SHARE * (1 + 2 * np.exp(-((fast / 1.6e-3) ** 2))))
    stages = Ensemble.held(HUNTS.flat(), 1)
    names = list(stages.kernel.states)
    state = np.zeros((1, len(names)))
    state[0, names.index("velocity")] = fast
    for n in range(3):
        state[0, names.index(f"deflection_{n + 1}")] = bent[n] / STIFFNESS[n]
    rates = stages.rates(state)[0]
    equations, at = by_hand(HUNTS.flat()), [names.index(f"deflection_{n}") for n in (1, 2, 3)]
    assert rates[at].tolist() == equations.rate(0.0, equations.state(names, state[0]))[Z:].tolist() == [fast] * 3


@pytest.mark.slow
def test_the_cycle_against_simulation_and_scipy_with_events() -> None:
    stages = Ensemble.held(HUNTS.flat(), 1)
    cycles = find_cycles(stages)
    assert cycles.closed[0], cycles.reasons[0]
    ends = []
    for rtol in (1e-7, 1e-9):
        long = friso.simulate(HUNTS.replace({"motion.duration": "60 s"}), rtol)
        late = long.turning_deviation.values[long.turning_time.values > 60 - 2 * cycles.period[0]]
        ends.append(np.ptp(late) / 2)
    assert ends == pytest.approx([cycles.amplitude[0]] * 2, rel=1e-4)
    equations, names = by_hand(HUNTS.flat()), stages.kernel.states
    start = equations.state(names, cycles.states[0])
    _, states, slips, *_ = equations.followed(start, cycles.period[0] / 2, 1e-10)
    assert np.any(slips)
    at = equations.places(["position", "velocity", "filtered_error", "integral"])
    assert states[-1][at] == pytest.approx(-start[at], abs=1e-5 * cycles.amplitude[0])
    assert abs(cycles.multiplier[0]) < 1


def test_describing_function_of_elements() -> None:
    """Each element has k (theta - sin(2 theta)/2)/pi + i 4 k L (1 - L/A)/(pi A), cos(theta) = 1 - 2 L/A; k below L."""
    amplitudes, limits = np.array([2e-6, 1e-5, 3e-5, 1e-3]), LIMIT
    table = describing(HELD, amplitudes, [3.0])
    assert set(np.ravel(table.status)) == {"done"}
    expected = np.zeros(len(amplitudes), complex)
    for k, limit in zip(STIFFNESS, limits, strict=True):
        slips = amplitudes > limit
        share = np.where(slips, limit / amplitudes, 1.0)
        theta = np.arccos(1 - 2 * share)
        expected += np.where(slips, k * (theta - np.sin(2 * theta) / 2) / np.pi, k)
        expected += np.where(slips, 4j * k * share * (1 - share) / np.pi, 0)
    assert np.abs(table.stiffness.values[:, 0] / expected - 1) == pytest.approx(0, abs=1e-7)


def test_small_motions_in_the_present_mode() -> None:
    """Stuck, on all elements and their damping; sliding, on the attraction of each."""
    flat = HUNTS.flat()
    stuck, sliding = plant(flat, member()), plant(flat, member(1e-3))
    assert stuck.a[0, 1, 0] == pytest.approx(-STIFFNESS.sum() / 1.7, rel=1e-12)
    assert stuck.a[0, 1, 1] == pytest.approx(-(310 + 0.5) / 1.7, rel=1e-12)
    level = 1 + 2 * np.exp(-((1 / 1.6) ** 2))
    decay = [-sliding.a[0, z, z] for z, name in enumerate(sliding.states) if name.startswith("deflection")]
    assert decay == pytest.approx([160 / level] * 3, rel=1e-12)


def test_it_may_give_energy_back_where_friction_falls() -> None:
    """GMS elements return energy that they store without displacement while a slip slows down."""
    flat = HUNTS.flat()
    assert "static = coulomb" in GeneralisedMaxwellSlip.active(flat)
    assert not GeneralisedMaxwellSlip.active(HELD.flat())
    gained = float((SHARE**2 * (3.0**2 - 1.0**2) / (2 * STIFFNESS)).sum())
    assert f"{gained:.3g} J" in GeneralisedMaxwellSlip.active(flat)


def test_many_elements_come_near_a_smooth_curve() -> None:
    """The error falls with the square of their number."""
    curve = measure_friction(VARIANTS["rigid"].flat())
    off = []
    for count in (4, 8, 16, 32):
        stiffness, slips = polygon(curve, count)
        assert stiffness.sum() == pytest.approx(curve.stiffness, rel=1e-12)
        assert (stiffness * slips).sum() == pytest.approx(curve.levels.static, rel=1e-9)
        off.append(curve.misfit(np.minimum(stiffness * curve.displacement[:, None], stiffness * slips).sum(axis=1)))
    orders = np.log2(np.divide(off[:-1], off[1:]))
    assert orders == pytest.approx(2.0, abs=0.25)
