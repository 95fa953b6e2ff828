"""Test hunting cycles against references.md, section 2, simulations, symmetry and scaling.

The multipliers of references.md belong to the half-cycle return map; those of the rigid mass come from shooting at
1e-12.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from variants import LOCKED, PARASITIC, VARIANTS, free, lugre, release, stage, van_dijk

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import faster
from friso.equations.structure import structure
from friso.hunting import (
    CYCLE_RTOL,
    Cycle,
    Ensemble,
    Hunting,
    check_given,
    find_cycles,
    find_swings,
    hunting,
    judge_many,
)
from friso.stage import Stage
from friso.studies.sweep import sweep

TIGHT = 1e-11
"""Relative tolerance of a result that counts as exact."""

BRISTLES = 3 / 1e5
"""Deflection [m] at which the bristles slip: static friction over their stiffness."""


def rigid(crossover: float, **changes: Any) -> Stage:
    """The rigid mass of 1.7 kg; the point in a key is written `__`."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    return VARIANTS["rigid"].replace({"controller.crossover": f"{crossover} Hz"} | keys)


def rig(crossover: float, joint: str) -> Stage:
    """The thesis's rig."""
    control = van_dijk(f"{crossover} Hz")
    return stage(release(), friction=lugre(2), joint=joint, parasitic=PARASITIC, controller=control)


@cache
def hunting_of(chosen: Stage, rtol: float = CYCLE_RTOL) -> Hunting:
    return hunting(chosen, rtol)


def only(chosen: Stage, rtol: float = CYCLE_RTOL) -> Cycle:
    """The one cycle there is."""
    (cycle,) = hunting_of(chosen, rtol).cycles
    return cycle


def test_reference_cycle_of_a_rigid_mass() -> None:
    """T 3.15031069 s, A 2.0166608 mm, multiplier -0.8172509, the others below 1e-13: to all digits given."""
    cycle = only(rigid(4), TIGHT)
    assert cycle.symmetric
    assert cycle.attracts
    assert cycle.period == pytest.approx(3.15031069, abs=0.6e-8)
    assert cycle.amplitude == pytest.approx(2.0166608e-3, abs=0.6e-10)
    assert cycle.multiplier == pytest.approx(-0.8172509, abs=0.6e-7)
    assert np.all(np.abs(cycle.multipliers[1:]) < 1e-13)
    assert cycle.time_constant == pytest.approx(3.15031069 / 2 / -np.log(0.8172509), rel=1e-6)


RIGS = [  # fitted to simulated turning points (multipliers are good to one or two percent), and computed
    (4, LOCKED, (2.016, -0.82), (2.016549, -0.81745)),
    (6, LOCKED, (0.904, -0.875), (0.903977, -0.86981)),
    (8, LOCKED, (0.520, -0.935), (0.520247, -0.93119)),
    (3, free(), (4.28, -0.82), (4.286370, -0.83273)),
    (5, free(), (1.99, -0.96), (1.990576, -0.95382)),
]


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("crossover", "joint", "fitted", "computed"), RIGS)
def test_cycles_of_the_rig(
    crossover: float, joint: str, fitted: tuple[float, float], computed: tuple[float, float]
) -> None:
    """Amplitudes [mm] and multipliers. What was computed holds to the digits written: maps and verdicts rest on it.

    At the usual tolerance, 1e-9, the slope where a limiter chatters is off by 8e-5; with 161 runs it differs by 6e-5.
    """
    cycle = only(rig(crossover, joint), rtol=TIGHT)
    assert cycle.symmetric
    assert cycle.attracts
    assert 1e3 * cycle.amplitude == pytest.approx(fitted[0], rel=3e-3)
    assert cycle.multiplier == pytest.approx(fitted[1], rel=0.01 if joint == LOCKED else 0.02)
    assert 1e3 * cycle.amplitude == pytest.approx(computed[0], abs=1e-6)
    assert cycle.multiplier == pytest.approx(computed[1], abs=2e-5)


def only_symmetric(survey: Hunting) -> Cycle:
    (cycle,) = (item for item in survey.cycles if item.symmetric)
    return cycle


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("crossover", "multiplier"), [(8.6, 2.28), (9, 1.324), (9.6, 1.0358)])
def test_asymmetric_pair_between_its_fold_and_the_flip(crossover: float, multiplier: float) -> None:
    """Between 8.47 and 9.77 Hz an unstable pair of cycles beside the symmetric one, which it meets at the flip: it
    bounds what the symmetric one attracts. Its multiplier is of a whole period, its turns differ."""
    result = hunting_of(rigid(crossover))
    beside = next(cycle for cycle in result.cycles if not cycle.symmetric)
    assert beside.multiplier == pytest.approx(multiplier, rel=1e-3)
    assert not beside.attracts
    assert np.isreal(beside.multipliers[0])
    assert np.all(np.abs(beside.multipliers[1:]) < 1e-9)
    turns = np.sort([float(beside.trace.position.max()), -float(beside.trace.position.min())])
    symmetric = only_symmetric(result)
    assert symmetric.attracts
    assert turns[0] < 0.97 * symmetric.amplitude
    assert turns[1] > 1.03 * symmetric.amplitude


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("crossover", [4, 8.3, 9.9, 12])
def test_no_asymmetric_pair_elsewhere(crossover: float) -> None:
    assert [cycle.symmetric for cycle in hunting_of(rigid(crossover)).cycles] == [True]


def test_unstable_cycle_above_the_flip_and_none_at_17_hz() -> None:
    """The cycle outlives the flip: at 12 Hz with a multiplier of -1.1335, until no swing returns as far at 17 Hz."""
    cycle = only(rigid(12))
    assert cycle.symmetric
    assert not cycle.attracts
    assert cycle.multiplier == pytest.approx(-1.1335, rel=1e-4)
    assert cycle.time_constant == pytest.approx(cycle.period / 2 / np.log(1.1335), rel=1e-3)
    none = hunting_of(rigid(17))
    assert none.cycles == ()
    assert none.certain
    assert np.all(none.returns.returns < none.returns.distances)


CONVERGING = [
    *(rigid(crossover) for crossover in (4, 9, 12)),
    *(rig(crossover, LOCKED) for crossover in (4, 8)),
    *(rig(crossover, free()) for crossover in (3, 5)),
]


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("chosen", CONVERGING)
def test_results_do_not_depend_on_the_tolerance(chosen: Stage) -> None:
    """From rtol 1e-9 to 1e-11, period and amplitude agree to 1e-6, and the deciding multiplier to 1e-4.

    In the free rig at 3 Hz they agree to 1e-7, elsewhere to 1e-8.
    """
    for rough, fine in zip(hunting_of(chosen).cycles, hunting_of(chosen, TIGHT).cycles, strict=True):
        assert rough.period == pytest.approx(fine.period, rel=1e-6)
        assert rough.amplitude == pytest.approx(fine.amplitude, rel=1e-6)
        assert rough.multiplier == pytest.approx(fine.multiplier, rel=1e-4)
        assert rough.residual < 1e-8


def test_orbits_are_closed_at_a_rough_tolerance_too() -> None:
    """However rough the runs, Newton's method goes on until the orbit counts as closed."""
    stages = Ensemble.held(faster(rigid(4).flat(), np.geomspace(0.5, 1.1, 40)), 40)
    assert find_cycles(stages, 1e-5).closed.all()


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-5, 1e-6])
def test_a_chattering_limiter_needs_no_finer_tolerance(rtol: float) -> None:
    assert only(rig(5, free()), rtol=rtol).multiplier == pytest.approx(-0.95382, abs=2e-3)


def test_a_chattering_limiter_has_a_slope_but_no_smooth_flow() -> None:
    """At 5 Hz the Floquet multiplier converges too, but belongs to a much shorter stretch than the cycle.

    Over 1 % of the amplitude the return map is straighter and flatter. At 3 Hz the limiter is touched some thirty times
    a swing; the Floquet multiplier depends on the tolerance by percents, and only the slope means anything.
    """
    for crossover, depends in ((5, 1e-5), (3, 0.2)):
        rough, fine = only(rig(crossover, free())), only(rig(crossover, free()), TIGHT)
        assert rough.multiplier == rough.slope
        assert rough.multipliers[0].real == pytest.approx(fine.multipliers[0].real, rel=depends)
        assert abs(rough.multipliers[0]) > abs(rough.slope) + 0.005
        assert rough.growth == pytest.approx(rough.slope, rel=0.01)


def machine(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a rigid machine: masses, friction and controller from ranges around the thesis's."""
    cart, table, static = rng.uniform(0.5, 3), rng.uniform(0.2, 2), rng.uniform(1, 6)
    return {
        "masses.cart": f"{cart!r} kg",
        "masses.stage": f"{table!r} kg",
        "friction.static": f"{static!r} N",
        "friction.coulomb": f"{static * rng.uniform(0.2, 0.7)!r} N",
        "friction.stribeck_velocity": f"{rng.uniform(0.5, 5)!r} mm/s",
        "friction.viscous": f"{rng.uniform(0, 3)!r} N*s/m",
        "controller.crossover": f"{10 ** rng.uniform(0.3, 1.1)!r} Hz",
        "controller.alpha": rng.uniform(0.05, 0.2),
        "controller.beta": rng.uniform(1.5, 4),
        "controller.tuned_mass": f"{(cart + table) * rng.uniform(0.9, 1.1)!r} kg",
    }


@cache
def machines() -> list[Stage]:
    """Ten of them; of these eight have a cycle."""
    rng = np.random.default_rng(2)
    return [VARIANTS["rigid"].replace(machine(rng)) for _ in range(10)]


@pytest.mark.slow
def test_multipliers_of_machines_drawn_at_random() -> None:
    """Floquet multiplier, slope of the simulated return map, and growth beside the cycle are equal.

    The slope is taken over 1 % of the amplitude, hence 1 %; it agrees to some 1e-5.
    """
    cycles = [only_symmetric(hunting_of(item)) for item in machines() if hunting_of(item).cycles]
    judged = [cycle for cycle in cycles if abs(cycle.multiplier) < 2]
    assert len(judged) >= 6
    for cycle in judged:
        assert cycle.slope == pytest.approx(cycle.multiplier, rel=0.01)
        assert cycle.growth == pytest.approx(cycle.multiplier, rel=0.01)
        assert cycle.multiplier == cycle.multipliers[0].real
        assert -2 < cycle.multiplier < 0


def last_swing(chosen: Stage, displacements: np.ndarray, duration: float, last: float) -> np.ndarray:
    """Half of peak to peak [m] over the `last` seconds after releases, shape (displacements,)."""
    count = displacements.size
    flat = chosen.flat() | {"motion.displacement": displacements, "motion.duration": duration}
    options = RunOptions(rtol=1e-6, window=1 - last / duration, record_from=duration)
    (runs,) = run_chunks(kernel(structure(chosen.flat())), flat, count, options)
    assert np.all(runs.results.statuses == Status.DONE)
    return (runs.statistic("deviation_max") - runs.statistic("deviation_min")) / 2


SYMMETRIC = [
    *((rigid(crossover), 3e-5) for crossover in (4, 8, 12)),
    (rig(8, LOCKED), 3e-5),
    (rig(4, free()), 3e-4),
]


@pytest.mark.cases(first=3)
@pytest.mark.parametrize(("chosen", "share"), SYMMETRIC)
def test_trace_of_a_symmetric_cycle(chosen: Stage, share: float) -> None:
    """x(t + T/2) = -x(t) for whatever moves, to a share of its range: followed at rtol 1e-8, the stage breaks away some
    1e-8 of the period early or late, and then everything moves fast, forces in a limiter fastest. The last sample is
    the first again, since then it sticks."""
    cycle = only(chosen)
    assert cycle.trace.time.size == 2001
    for name, signal in moving_parts(cycle.trace).items():
        assert np.max(np.abs(signal[:1001] + signal[1000:])) < share * np.ptp(signal), name
        assert abs(signal[-1] - signal[0]) < 1e-6 * np.ptp(signal), name
    assert float(np.max(np.abs(cycle.trace.position))) == pytest.approx(cycle.amplitude, rel=1e-4)
    assert float(cycle.trace.time[-1]) == pytest.approx(cycle.period, rel=1e-12)


def moving_parts(trace: xr.Dataset) -> dict[str, np.ndarray]:
    """Return the traces without that of the reference, which stays at zero."""
    assert np.all(trace.reference == 0)
    return {str(name): signal.to_numpy() for name, signal in trace.items() if name != "reference"}


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(
    "chosen",
    [
        rigid(9),
        rigid(4, friction__asymmetry=0.02),
        rigid(4, bias__cart="0.3 N"),
    ],
)
def test_trace_of_an_asymmetric_cycle_is_periodic(chosen: Stage) -> None:
    """The trace repeats to 1e-6 of each signal's range; the orbit closes to 1e-8, and the trace is run at rtol 1e-8."""
    (cycle,) = (item for item in hunting_of(chosen).cycles if not item.symmetric)
    for name, signal in moving_parts(cycle.trace).items():
        assert abs(signal[-1] - signal[0]) < 1e-6 * np.ptp(signal), name


@pytest.mark.slow
def test_unequal_friction_keeps_a_cycle_off_the_reference() -> None:
    """1 and 2 % more friction forward, as much less back: at 4 Hz the stage swings farther ahead than back, about as
    widely as before, and slower. Not its own mirror image any more, it is followed over a whole period."""
    equal = 2.0166608e-3
    for share, ahead, behind in ((0.01, 2.1946e-3, 1.8402e-3), (0.02, 2.374e-3, 1.665e-3)):
        cycle = only(rigid(4, friction__asymmetry=share))
        assert not cycle.symmetric
        assert cycle.attracts
        assert float(cycle.trace.position.max()) == pytest.approx(ahead, abs=1e-6)
        assert -float(cycle.trace.position.min()) == pytest.approx(behind, abs=1e-6)
        assert cycle.amplitude == pytest.approx(equal, rel=2e-3)
        assert cycle.period > 3.15031069
        assert cycle.multiplier == pytest.approx(0.8172509**2, rel=1e-3)


def test_mirrored_friction_mirrors_the_cycle() -> None:
    """More friction forward or more friction back: the same cycle, ahead and behind exchanged."""
    one, other = (only(rigid(4, friction__asymmetry=share)) for share in (0.02, -0.02))
    assert one.period == pytest.approx(other.period, rel=1e-8)
    assert one.amplitude == pytest.approx(other.amplitude, rel=1e-8)
    assert one.multiplier == pytest.approx(other.multiplier, rel=1e-5)
    assert float(one.trace.position.max()) == pytest.approx(-float(other.trace.position.min()), rel=1e-4)


def test_much_unequal_friction_ends_hunting() -> None:
    """At 8 Hz, where the cycle attracts less, 5 % of difference is too much: simulations rest from anywhere."""
    chosen = rigid(8, friction__asymmetry=0.05)
    assert hunting_of(chosen).cycles == ()
    assert np.all(last_swing(chosen, np.geomspace(1e-4, 3e-2, 32), 150, 4) < BRISTLES)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("bias", [0.3, -4.5])
def test_constant_force_is_carried_by_the_integrator_alone(bias: float) -> None:
    """A rigid mass on a tilted rail: the integrator carries the force, be it more than friction holds (3 N), and
    everything else moves as before. With the integrator's state it is no mirror image any more, hence followed over a
    whole period."""
    biased, plain = only(rigid(4, bias__cart=f"{bias} N")), only(rigid(4))
    assert not biased.symmetric
    assert biased.period == pytest.approx(plain.period, rel=1e-8)
    assert biased.amplitude == pytest.approx(plain.amplitude, rel=1e-8)
    assert biased.multiplier == pytest.approx(plain.multiplier**2, rel=1e-4)
    after, before = (from_crossing(cycle) for cycle in (biased, plain))
    for name, signal in before.items():
        offset = -bias if name in ("force", "force_i") else 0.0
        assert np.max(np.abs(after[name] - signal - offset)) < 0.02 * np.ptp(signal), name  # straight between samples


def from_crossing(cycle: Cycle) -> dict[str, np.ndarray]:
    """The trace, begun anew where the position rises through zero."""
    parts, time = moving_parts(cycle.trace), cycle.trace.time.to_numpy()
    x = parts["position"]
    k = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))[0]
    start = time[k] - x[k] * (time[k + 1] - time[k]) / (x[k + 1] - x[k])
    at = start + np.linspace(0, cycle.period, 1000)
    return {name: np.interp(at, time, signal, period=cycle.period) for name, signal in parts.items()}


def test_no_force_is_no_bias() -> None:
    """A bias of 0 N leaves the stage its own mirror image, and its cycle symmetric."""
    none, plain = only(rigid(4, bias__cart="0 N")), only(rigid(4))
    assert none.symmetric
    assert none.multiplier == pytest.approx(plain.multiplier, rel=1e-8)
    assert none.period == pytest.approx(plain.period, rel=1e-10)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("rigid, no friction section", "no friction"),
        ("rigid, no friction, PID", "no friction"),
        ("free, no friction, limit", "no friction"),
        ("rigid cart, P", "no integral action"),
        ("rigid, LuGre 3, P", "no integral action"),
        ("free, parasitic, Dahl, PD", "no integral action"),
    ],
)
def test_stages_that_cannot_hunt(name: str, reason: str) -> None:
    """Without friction there is nothing to stick to, without integral action nothing breaks away: no computation."""
    result = hunting(VARIANTS[name])
    assert result.cycles == result.attracting == ()
    assert reason in result.reason
    assert result.certain
    assert result.returns is None


@pytest.mark.parametrize(("integral", "stable"), [(25_000, True), (35_000, False)])
def test_without_friction_only_a_stable_loop_surely_settles(integral: float, stable: bool) -> None:
    """A mass m under kp, ki, kd is stable where kd kp > m ki, up to 29 400 here; with the filter to a little less."""
    stage = VARIANTS["rigid, no friction, PID"].replace({"controller.ki": f"{integral} N/(m*s)"})
    result = hunting(stage)
    assert (result.certain, "no friction to stick to" in result.reason) == (stable, stable)
    assert (judge_many(stage.flat(), 1, 1e-6)[0] == "undecided") == (not stable)
    runs = sweep(stage, {"controller.ki": [f"{integral} N/(m*s)"]}, metrics=["attractor"])
    assert runs.attractor.values.tolist() == ["nothing" if stable else "unknown"]


def test_without_friction_a_loop_that_the_limiter_makes_unstable_does_not_surely_settle() -> None:
    """A tenth of a millimetre settles, ten times as much ends in a swing of metres, for ever: the force is limited."""
    stage = VARIANTS["free, no friction, limit"]
    assert hunting(stage).certain
    gains = {"kp": "180 N/m", "ki": "5e4 N/(m*s)", "kd": "70 N*s/m"}
    changes = {f"controller.{name}": gain for name, gain in gains.items()}
    changes |= {"masses.cart": "6.9 kg", "joint.stiffness": "265 N/m", "joint.damping": "25 N*s/m"}
    small, large = (
        check_given(stage.replace({**changes, "motion.size": size, "motion.duration": "60 s"}))
        for size in ("0.1 mm", "1 mm")
    )
    assert (small.verdict, small.unstable, small.judgement.hunting.certain) == ("settles", (), False)
    assert large.peak_to_peak > 1.0
    assert large.largest_force == pytest.approx(20.0)
    assert large.force_limit is None  # it does not stand there
    assert judge_many(small.stage.flat(), 1, 1e-6)[0] == "undecided"


@pytest.mark.parametrize("scale", [0.1, 7.0])
def test_units_of_length_and_force_do_not_matter_rigid(scale: float) -> None:
    """Lengths and forces scaled together, masses and times kept: the same multiplier, the amplitude scaled.

    To the tolerance and not to rounding: the least swings that are looked at are rounded otherwise.
    """
    names = {"static": (3, "N"), "coulomb": (1, "N"), "stribeck_velocity": (1.6, "mm/s")}
    larger = {f"friction__{name}": f"{scale * value!r} {unit}" for name, (value, unit) in names.items()}
    same_but_for_scale(only(rigid(8)), only(rigid(8, **larger)), scale)


@pytest.mark.slow
def test_units_of_length_and_force_do_not_matter_free() -> None:
    """The stroke is a length too."""
    scale = 3.0
    larger = {"static": "9 N", "coulomb": "3 N", "stribeck_velocity": "4.8 mm/s"}
    changes = {f"friction.{name}": text for name, text in larger.items()} | {"joint.stroke": "3 mm"}
    same_but_for_scale(only(rig(5, free())), only(rig(5, free()).replace(changes)), scale)


def test_unit_of_mass_does_not_matter() -> None:
    """Masses, forces and stiffnesses scaled together: the same motion."""
    scale = 2.5
    names = {"masses__cart": (1.2, "kg"), "masses__stage": (0.5, "kg"), "controller__tuned_mass": (1.7, "kg")}
    names |= {"friction__static": (3, "N"), "friction__coulomb": (1, "N"), "friction__viscous": (0.5, "N*s/m")}
    names |= {"friction__bristle_stiffness": (1e5, "N/m"), "friction__bristle_damping": (316.2277660168379, "N*s/m")}
    heavier = {name: f"{scale * value!r} {unit}" for name, (value, unit) in names.items()}
    same_but_for_scale(only(rigid(8)), only(rigid(8, **heavier)), 1.0)


def same_but_for_scale(small: Cycle, large: Cycle, scale: float) -> None:
    assert large.amplitude == pytest.approx(scale * small.amplitude, rel=1e-7)
    assert large.period == pytest.approx(small.period, rel=1e-7)
    assert large.multiplier == pytest.approx(small.multiplier, rel=1e-5)


def test_newton_does_not_slide_onto_the_rest_line() -> None:
    """Every stage also rests at its reference.

    What is called a cycle swings by many deflections of the bristles, from 2 Hz up to some crossover; beyond it there
    is a reason instead.
    """
    crossovers = np.linspace(2, 30, 57)
    flat = rigid(4).flat() | {"controller.crossover": crossovers}
    cycles = find_cycles(Ensemble.held(flat, crossovers.size))
    assert np.array_equal(cycles.closed, crossovers < crossovers[np.argmin(cycles.closed)])
    assert 15 < crossovers[cycles.closed].max() < 17
    assert np.all(cycles.amplitude[cycles.closed] > 4 * BRISTLES)
    assert np.all(np.diff(cycles.amplitude[cycles.closed]) < 0)
    assert np.all(cycles.gap[cycles.closed] < 1e-8)
    assert np.all(np.isnan(cycles.amplitude[~cycles.closed]))


def test_cycles_of_many_stages_are_those_of_each() -> None:
    """A stage's cycle does not depend on the stages that are computed beside it."""
    crossovers = np.array([4.0, 8.0, 18.0, 12.0])
    flat = rigid(4).flat() | {"controller.crossover": crossovers}
    together = find_cycles(Ensemble.held(flat, crossovers.size))
    assert together.closed.tolist() == [True, True, False, True]
    for k in np.flatnonzero(together.closed):
        alone = only_symmetric(hunting_of(rigid(float(crossovers[k]))))
        assert together.period[k] == pytest.approx(alone.period, rel=1e-9)
        assert together.multiplier[k] == pytest.approx(alone.multiplier, rel=1e-6)


@pytest.mark.parametrize("rtol", [0.0, -1e-6, 1e-16, 1.0, np.nan])
def test_unusable_tolerances_are_refused(rtol: float) -> None:
    with pytest.raises(ValueError, match="rtol"):
        hunting(rigid(4), rtol)


def test_both_cycles_near_a_fold_are_found() -> None:
    """At an asymmetry of 1.7 % the cycle is about to vanish.

    Of 24 simulated starts 20 swing between 0.786 and -0.274 mm for 1500 s, and an unstable cycle lies 2 % beside.
    """
    result = hunting(rigid(8, friction__asymmetry=0.017))
    assert result.certain
    assert len(result.cycles) == 2
    (attracting,) = result.attracting
    assert attracting.middle + attracting.amplitude == pytest.approx(0.786e-3, abs=0.5e-6)
    assert attracting.middle - attracting.amplitude == pytest.approx(-0.274e-3, abs=0.5e-6)


@pytest.mark.slow
def test_an_asymmetric_pair_takes_over_beyond_a_supercritical_flip() -> None:
    """With a joint mode at 30 Hz the free rig at 4.7 Hz has an unstable symmetric cycle and a stable pair.

    It stays there for 400 simulated periods (found by a reviewer); a ramp has no place to hunt about.
    """
    soft = VARIANTS["free, parasitic"].replace({"parasitic.frequency": "30 Hz", "controller.crossover": "4.7 Hz"})
    pair, symmetric = hunting(soft).cycles
    assert (symmetric.symmetric, symmetric.attracts, pair.symmetric, pair.attracts) == (True, False, False, True)
    assert abs(pair.middle) == pytest.approx(0.0161 * pair.amplitude, rel=0.02)
    assert pair.growth == pytest.approx(pair.multiplier, rel=0.02)


@pytest.mark.slow
def test_nothing_is_certain_of_bristles_that_runs_do_not_resolve(rig: Stage) -> None:
    """1e10 times as stiff as the loop, runs at every tolerance let them break away as if friction did not fall: nothing
    attracts in them, where the exact map of such a stage has a cycle (`benchmarks.oracles`)."""
    exact = {
        "friction.model": "lugre",
        "friction.static": "1 N",
        "friction.coulomb": "0.4 N",
        "friction.viscous": "0 N*s/m",
    }
    for stiffness, resolved in (("1e11 N/m", True), ("1e14 N/m", False)):
        stage = rig.replace({"joint.locked": True, **exact, "friction.bristle_stiffness": stiffness})
        survey = hunting(stage.replace({"controller.crossover": "60 Hz"}))
        assert not survey.attracting
        assert survey.certain == resolved


def test_a_stage_without_integral_action_has_no_swings(rig: Stage) -> None:
    still = {"kind": "pid", "kp": "3e3 N/m", "ki": "0 N/(m*s)", "kd": "200 N*s/m", "tau": "1 ms"}
    assert find_swings(rig.replace({"controller": still, "joint.locked": True}).flat()) == ()
