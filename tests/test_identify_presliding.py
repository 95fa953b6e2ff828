"""Bristles from small motion before sliding: against logs of known bristles, and against the rig's machines."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from rig_machines import EXAMPLE, built
from scipy.integrate import solve_ivp
from scipy.ndimage import gaussian_filter1d
from snapshots import Snapshots

import friso
from friso.identification.experiments.presliding import Presliding, bristles_from_presliding
from friso.identification.logs.log import Log
from friso.identification.method import identify
from friso.identification.readings.at_bearing import Between, StructureMode, machine_between
from friso.identification.readings.common import deflections, jackknife, record
from friso.identification.sources import recognised
from friso.progress import silent
from friso.stage.tables import friction_law
from friso.studies.laws import with_friction
from friso_thesis.studies.rig.experiments.presliding import EXPERIMENT, GENTLE, LOOP_COUNT, loop_log, presliding_log
from friso_thesis.studies.rig.outcome import excite, locked_stage, rig_log, travel

DT, SECONDS = 5e-4, 6.0
LINES = np.array([0.7, 1.3, 2.9, 5.3, 9.7, 17.3, 23.9, 31.1, 37.7])
MASS, STIFFNESS, DAMPING, STATIC = 1.7, 1e5, 300.0, 3.0


def shaken(
    size: float = 2e-7,
    bending: float = STIFFNESS / STATIC,
    noise: float = 0.0,
    top: int = len(LINES),
    step: float = DT,
    **more: Any,
) -> Log:
    """Motion by several sines of this size [m] each, and the force of a mass on bristles, computed in fine steps."""
    fine = 10
    time = np.arange(0, SECONDS, step / fine)
    phases = 2 * np.pi * LINES[:top, None] * time + np.arange(top)[:, None] ** 2
    omega = 2 * np.pi * LINES[:top, None]
    position = size * np.sin(phases).sum(axis=0)
    acceleration = -size * (omega**2 * np.sin(phases)).sum(axis=0)
    moves = np.diff(position)
    z = deflections(moves, np.full(len(moves), 1 / bending))
    force = MASS * acceleration + STIFFNESS * z + DAMPING * np.gradient(z, step / fine) + 0.2
    rng = np.random.default_rng(1)
    signals = {"position": position[::fine], "force": force[::fine]}
    signals["position"] = signals["position"] + noise * rng.standard_normal(len(signals["position"]))
    return record("small", step, **signals, **more)


def shown(result: Presliding) -> list[float]:
    return [result.stiffness.value, result.damping.value, result.mass.value]


def with_force(log: Log, force: np.ndarray) -> Log:
    return replace(log, signals={**log.signals, "force": force})


@given(st.integers(0, 2**31), st.floats(1.0, 1e6))
@settings(max_examples=20)
def test_bristles_bend_as_the_differential_equation_says(seed: int, bending: float) -> None:
    """Against scipy; the path being straight between samples, the closed form is exact."""
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.standard_normal(8)) / bending
    moves = np.diff(position, prepend=position[0])
    z = [0.0]
    for move in moves[1:]:
        run = solve_ivp(lambda _, y, m=move: m * (1 - bending * y * np.sign(m)), (0, 1), z[-1:], rtol=1e-9, atol=1e-15)
        z.append(run.y[0, -1])
    assert deflections(moves[1:], np.full(7, 1 / bending)) == pytest.approx(np.array(z), rel=1e-6, abs=1e-8 / bending)
    assert np.all(np.abs(z) <= 1 / bending)


def kind_of(log: Log) -> str:
    return recognised(log, Path("log.csv"))[0]


@pytest.mark.slow
def test_motion_is_moves_only_if_the_bearing_slides() -> None:
    """Motion of 5 um against bristles of 30 um is not that of sliding; against bristles of 0.1 um it is."""
    before, beyond = (shaken(1e-6, bending, top=5) for bending in (STIFFNESS / STATIC, 1e7))
    moving = {**before.signals, "reference": before["position"]}
    logs = (before, replace(before, signals=moving), beyond)
    assert [kind_of(log) for log in logs] == ["presliding", "presliding", "moves"]


@pytest.mark.slow
@pytest.mark.parametrize(("size", "bending", "spring"), [(6e-5, 1.0, 0.0), (3e-5, 3e5, 0.2)])
def test_a_spring_to_ground_is_no_bristles(size: float, bending: float, spring: float) -> None:
    """A force in proportion to 300 um of travel is that of a spring: no bristles of a bearing bend as far.

    The other log has bristles that bend by 3 um, beside a spring of a fifth of their stiffness.
    """
    plain = shaken(size, bending, top=5)
    log = with_force(plain, plain["force"] + spring * STIFFNESS * plain["position"])
    assert not bristles_from_presliding(log).stiffness.determined
    assert kind_of(log) == "moves"


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("travel", [2e-5, 2e-4, 5e-4])
def test_a_body_that_slides_there_and_back_moves(travel: float) -> None:
    """A controller that holds the friction while the body rests makes the force look like the position."""
    move = gaussian_filter1d(np.repeat([0.0, 1.0], 600), 40)
    position = travel * np.tile(np.concatenate([move, move[::-1]]), 4)
    z = deflections(np.diff(position), np.full(len(position) - 1, 3e-6))
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(z))
    force = 8 * np.gradient(np.gradient(position, DT), DT) + 15 / 3e-6 * z + noise
    assert kind_of(record("there and back", DT, position=position, reference=position, force=force)) == "moves"


@pytest.mark.slow
def test_known_bristles_are_found_and_a_lag_is_taken_off() -> None:
    log, truth = shaken(), [STIFFNESS, DAMPING, MASS]
    plain = bristles_from_presliding(log)
    assert shown(plain) == pytest.approx(truth, rel=2e-3)
    assert plain.unexplained < 1e-3
    late, delayed = 2 * DT, with_force(log, np.roll(log["force"], -2))
    assert shown(bristles_from_presliding(delayed, Between(delay=late))) == pytest.approx(truth, rel=5e-3)
    # looked for: what came 1 ms late would add 100 N s/m to the damping
    assert shown(bristles_from_presliding(delayed)) == pytest.approx(truth, rel=5e-3)
    wrong = bristles_from_presliding(delayed, Between(delay=late / 2))
    assert abs(wrong.damping.value / DAMPING - 1) > 0.05
    assert wrong.damping.holds(DAMPING)
    assert wrong.mass.holds(MASS)


@pytest.mark.slow
def test_a_held_joint_gives_way_in_series() -> None:
    """The measured position is that of a stage behind a contact of 2e6 N/m; the stage's mass acts on the contact."""
    log, beyond, contact = shaken(), 0.5, 2e6
    position = log["position"]
    for _ in range(3):  # the stage's acceleration is that of its own position
        acceleration = np.gradient(np.gradient(position, DT), DT)
        position = log["position"] + (log["force"] + beyond * acceleration) / contact
    whole = record("held", DT, position=position, force=log["force"] + beyond * acceleration)
    between = Between(contact=contact, mass=MASS + beyond, beyond=beyond / (MASS + beyond))
    assert bristles_from_presliding(whole, between).stiffness.value == pytest.approx(STIFFNESS, rel=5e-3)
    soft = bristles_from_presliding(whole)
    assert soft.stiffness.value == pytest.approx(1 / (1 / STIFFNESS + 1 / contact), rel=0.01)


@pytest.mark.slow
def test_a_mode_of_the_structure_is_told_from_the_mass() -> None:
    """A third of the mass on a spring at 150 Hz, its force added in closed form to sines of up to 37.7 Hz: known, and
    not known."""
    share, mode = 1 / 3, 150.0
    log, time = shaken(), np.arange(0, SECONDS, DT)
    omega = 2 * np.pi * LINES[:, None]
    phases = omega * time + np.arange(len(LINES))[:, None] ** 2
    more = (omega / (2 * np.pi * mode)) ** 2
    extra = -2e-7 * share * MASS * (more / (1 - more) * omega**2 * np.sin(phases)).sum(axis=0)
    shaking = with_force(log, log["force"] + extra)
    assert bristles_from_presliding(shaking).mass.value == pytest.approx(MASS, rel=2e-3)
    expected = bristles_from_presliding(shaking, Between(delay=0.0, mode=StructureMode(share, mode, 1e-6)))
    assert expected.mass.value == pytest.approx(MASS, rel=1e-3)


@pytest.mark.slow
def test_noise_of_the_sensor_and_slow_motion_widen_the_intervals() -> None:
    bristles = bristles_from_presliding(shaken(noise=2e-9))
    assert bristles.stiffness.holds(STIFFNESS)
    assert bristles.damping.holds(DAMPING)
    slow = bristles_from_presliding(shaken(top=1, noise=1e-8))
    assert slow.stiffness.holds(STIFFNESS)
    assert slow.mass.holds(MASS)
    assert slow.mass.half_width > 0.5 * MASS


@pytest.mark.cases(first=4)
@pytest.mark.parametrize(
    "make",
    [
        lambda: shaken(noise=2e-7),
        lambda: shaken(step=5.5e-3),
        lambda: replace(shaken(), segments=(slice(0, 500),)),
        lambda: record("x", DT, position=np.full(12000, 0.5), force=np.arange(12000.0)),
        lambda: shaken(size=2e-5),
        lambda: shaken(size=1e-4),
    ],
    ids=["noise", "slow", "short", "still", "slides", "slides far"],
)
def test_what_a_log_cannot_show_is_told(make: Callable[[], Log], snapshots: Snapshots, request: Any) -> None:
    """Where it slides, most of the force is inertia, which hides how little of the friction the model explains."""
    stiffness = bristles_from_presliding(make()).stiffness
    assert not stiffness.determined
    snapshots.check("identify", f"bristles, {request.node.callspec.id}", stiffness.reason)


def test_what_has_no_force_or_no_bristles_is_refused() -> None:
    with refused("force"):
        bristles_from_presliding(record("x", DT, position=np.zeros(10000)))
    with refused("friction.model"):
        EXPERIMENT.run(friso.load(EXAMPLE).replace({"friction": {"model": "none"}}), 1, silent)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("size", [3e-6, 1e-5, 2e-5])
def test_a_slow_loop_of_another_law_is_no_mass(size: float) -> None:
    """A stage on springs and sliders has other loops than the bristles of the model.

    At one frequency inertia looks like stiffness: a mass of 1.7 kg was stated as 761 to 1406 kg.
    """
    time, rng = np.arange(0, 4, 1e-3), np.random.default_rng(1)
    position = size * np.sin(4 * np.pi * time)
    stiffness, most = np.array([40e3, 30e3, 20e3, 10e3]), STATIC * np.array([0.1, 0.25, 0.35, 0.3])
    springs = np.zeros((len(time), 4))
    for n, move in enumerate(np.diff(position), start=1):
        springs[n] = np.clip(springs[n - 1] + stiffness * move, -most, most)
    force = -MASS * (4 * np.pi) ** 2 * position + springs.sum(axis=1) + DAMPING * np.gradient(position, 1e-3)
    force += 1e-3 * rng.standard_normal(len(time))
    log = record("loop", 1e-3, position=position + 1e-9 * rng.standard_normal(len(time)), force=force)
    bristles = bristles_from_presliding(log)
    assert bristles.mass.holds(MASS) or not bristles.mass.determined
    assert bristles.stiffness.holds(1e5) or not bristles.stiffness.determined


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("strength", [2.0, 0.3])
def test_a_rig_that_is_shaken_off_its_bristles_shows_none(strength: float) -> None:
    stage = locked_stage(friso.load(EXAMPLE))
    log = rig_log(excite(stage, 0.02, 1, kind=replace(GENTLE, strength=strength)), 0, "x", None, stage, 1).log
    bristles = bristles_from_presliding(log, machine_between(stage.flat()))
    assert not any(item.determined for item in (bristles.mass, bristles.damping, bristles.stiffness))


@pytest.mark.thorough
def test_loops_before_sliding_close_under_gms_and_drift_under_lugre() -> None:
    """On the rig, up to half of static friction: drift between successive loops as a share of their width."""
    stage = locked_stage(friso.load(EXAMPLE)).replace({"rail": None})
    measured = friction_law("lugre").shown(stage.flat())
    drift = {}
    for machine in (stage, with_friction(stage, "gms", friction_law("gms").keeping(measured, 2))):
        log = loop_log(machine, "loop", 0.02, 1, 0.5)
        turns = np.reshape(log.logged["position"], (LOOP_COUNT, -1))
        assert np.max(np.abs(log.logged["disturbance"])) == pytest.approx(1.5, rel=1e-3)
        drift[machine.flat()["friction.model"]] = abs(turns[-1].mean() - turns[-2].mean()) / np.ptp(turns[-1])
    assert drift["lugre"] > 2 * drift["gms"]  # the integrator moves the loop, too


def test_a_slow_current_loop_is_taken_off() -> None:
    stage = locked_stage(friso.load(EXAMPLE)).replace({"drive.current_bandwidth": "100 Hz"})
    flat = stage.flat()
    bristles = bristles_from_presliding(presliding_log(stage, "slow", 0.02, 1).log, machine_between(flat))
    assert bristles.damping.value == pytest.approx(flat["friction.bristle_damping"], rel=0.03)
    assert bristles.damping.holds(flat["friction.bristle_damping"])
    assert bristles.mass.holds(1.7)


@pytest.mark.slow
def test_a_free_joint_is_seen_by_its_sensor_or_by_its_stiffness() -> None:
    """If the deflection is measured, the joint need not be held.

    If not, the stiffness of the joint is not taken for that of the bristles. Cables pull at the stage, which then moves
    ten times as far as the cart; this rig has none.
    """
    none = {"cable.stiffness": "0 N/m", "cable.drag": "0 N*s/m"}
    stage = friso.load(EXAMPLE).replace({"drive.relative_noise": "1 nm", **none})
    log, between = presliding_log(stage, "free", 0.02, 1).log, machine_between(stage.flat())
    bristles = bristles_from_presliding(log, between)
    assert bristles.stiffness.holds(stage.flat()["friction.bristle_stiffness"])
    assert bristles.damping.holds(stage.flat()["friction.bristle_damping"])
    assert bristles.mass.holds(1.7)
    assert bristles.stiffness.half_width < 0.1 * bristles.stiffness.value
    blind = replace(log, signals={role: log.signals[role] for role in ("position", "force")})
    assert not bristles_from_presliding(blind, between).stiffness.determined


def test_the_jackknife_is_the_covariance_of_least_squares() -> None:
    """With white noise the covariance is known in closed form.

    A single jackknife over eight blocks scatters; the mean of many does not.
    """
    rng, count = np.random.default_rng(5), 800
    columns = rng.standard_normal((count, 3)) @ np.array([[1, 0.8, 0], [0, 0.6, 0], [0, 0, 1e-5]])
    expected = np.linalg.inv(columns.T @ columns)
    average = np.mean([jackknife(columns, rng.standard_normal(count)) for _ in range(400)], axis=0)
    size = np.sqrt(np.diag(expected))
    assert average / np.outer(size, size) == pytest.approx(expected / np.outer(size, size), abs=0.15)


@pytest.mark.thorough
def test_drawn_machines_show_their_bristles_on_the_rig() -> None:
    """12 machines with their drives as built: 36 intervals of stiffness, damping and mass; of 95 % intervals, 31 or
    fewer of 36 hold with a probability of 2 %."""
    held, widths = 0, []
    for seed in range(12):
        machine = built(seed)
        stage, flat = locked_stage(machine.truth), machine.flat
        log = presliding_log(stage, "presliding", travel(stage)[0], seed).log
        bristles = bristles_from_presliding(log, machine_between({**flat, "masses.stage": 1.2 * flat["masses.stage"]}))
        mass = flat["masses.cart"] + flat["masses.stage"]
        held += bristles.stiffness.holds(flat["friction.bristle_stiffness"])
        held += bristles.damping.holds(flat["friction.bristle_damping"]) + bristles.mass.holds(mass)
        widths.append([bristles.stiffness.half_width / flat["friction.bristle_stiffness"]])
    assert held >= 32
    assert np.median(widths) < 0.02


@pytest.mark.slow
def test_damping_found_without_the_viscous_friction_is_at_most_its_sum_with_that() -> None:
    """However much of the sum is viscous friction."""
    viscous = DAMPING / 3
    log = shaken()
    slid = with_force(log, log["force"] + viscous * np.gradient(log["position"], DT))
    for logs in ([slid], [slid, slid]):
        estimates = identify([(log, "presliding") for log in logs]).estimates
        (damping,) = (one for one in estimates if one.name == "friction.bristle_damping")
        assert not damping.determined
        assert damping.low == 0
        assert DAMPING + viscous <= damping.high < 1.05 * (DAMPING + viscous)


@pytest.mark.slow
def test_the_stage_file_takes_bristles_and_masses() -> None:
    machine = built(3)
    stage = locked_stage(machine.truth)
    logs = [presliding_log(stage, f"small_{n}", travel(stage)[0], n).log for n in (1, 2)]
    identification = identify([(log, "presliding") for log in logs], machine.guess)
    flat = identification.stage.flat()
    for key in ("friction.bristle_stiffness", "friction.bristle_damping", "masses.cart", "masses.stage"):
        assert flat[key] == pytest.approx(machine.flat[key], rel=0.03)
    places = [identification.correlations.keys.index(f"masses.{name}") for name in ("cart", "stage")]
    assert identification.correlations.matrix[places[0], places[1]] == pytest.approx(1)
