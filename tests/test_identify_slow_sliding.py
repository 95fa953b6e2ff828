"""Friction that falls with the speed, from slow sliding: against logs of known bristles, and on the rig's machines."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from refusals import refused
from rig_machines import EXAMPLE, built
from snapshots import Snapshots

import friso
from friso.equations.rail import friction_factors
from friso.identification.experiments.slow_sliding import MassOnBristles, stribeck_from_slow_sliding
from friso.identification.logs.log import Log
from friso.identification.method import identify
from friso.identification.readings.at_bearing import BearingRecord, Between, at_bearing, machine_between
from friso.identification.readings.common import deflections, record
from friso_thesis.studies.rig import many_speeds
from friso_thesis.studies.rig.outcome import RigLog, locked_stage

DT, SECONDS, FINE = 2e-4, 2.0, 10
MASS, STIFFNESS, DAMPING, VISCOUS = 1.7, 1e5, 300.0, 2.0
COULOMB, STATIC, STRIBECK = 1.0, 2.2, 1.5e-3
KNOWN = MassOnBristles((MASS, 0.0), (STIFFNESS, 0.0), (DAMPING, 0.0))
TRUE = [COULOMB, STATIC, STRIBECK]
THERE = Between(delay=0.0, mass=MASS, viscous=(VISCOUS, 0.0))


def sliding(
    swing: float = 4e-3,
    mean: float = 1.5e-3,
    coulomb: float = COULOMB,
    stribeck: float = STRIBECK,
    noise: float = 0.0,
    start: float = 0.0,
    exponent: float = 2.0,
) -> Log:
    """Motion at a mean velocity [m/s] that swings by `swing` [m/s], there and back, and the force of a mass on LuGre's
    bristles, computed in fine steps from a deflection at the `start` [m] on."""
    item = DT / FINE
    time = np.arange(0, SECONDS, item)
    way = np.tanh(20 * (SECONDS / 2 - time))
    omega = 2 * np.pi * 9.0
    velocity = mean * way + swing * np.sin(omega * time) * (1 + 0.3 * np.sin(0.37 * omega * time))
    position = np.cumsum(velocity) * item
    acceleration = np.gradient(velocity, item)
    moves = np.diff(position)
    level = coulomb + (STATIC - coulomb) * np.exp(-(np.abs(moves / item / stribeck) ** exponent))
    z = deflections(moves, level / STIFFNESS, start)
    force = MASS * acceleration + STIFFNESS * z + DAMPING * np.gradient(z, item) + VISCOUS * velocity + 0.2
    rng = np.random.default_rng(1)
    seen = position[::FINE]
    return record("slow", DT, position=seen + noise * rng.standard_normal(len(seen)), force=force[::FINE])


def values(log: Log, between: Between = THERE, bristles: MassOnBristles = KNOWN) -> list[float]:
    return [estimate.value for estimate in stribeck_from_slow_sliding(log, between, bristles).estimates]


def holds(log: Log, between: Between = THERE, bristles: MassOnBristles = KNOWN) -> bool:
    result = stribeck_from_slow_sliding(log, between, bristles)
    return all(estimate.holds(true) for estimate, true in zip(result.estimates, TRUE, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("coulomb", "stribeck"), [(0.4, 2.5e-3), (1.7, 1.2e-3), (1.2, 0.8e-3)])
def test_known_friction_is_found(coulomb: float, stribeck: float) -> None:
    log = sliding(coulomb=coulomb, stribeck=stribeck)
    assert values(log) == pytest.approx([coulomb, STATIC, stribeck], rel=0.02)
    assert stribeck_from_slow_sliding(log, THERE, KNOWN).unexplained < 0.01


@pytest.mark.slow
def test_noise_and_doubt_about_bristles_viscous_friction_and_delay_are_in_the_intervals() -> None:
    log = sliding()
    assert holds(log)
    assert holds(sliding(noise=2e-9))
    doubtful = replace(KNOWN, damping=(1.03 * DAMPING, 0.04 * DAMPING), mass=(1.01 * MASS, 0.01 * MASS))
    assert holds(log, bristles=doubtful)
    doubted, plain = (stribeck_from_slow_sliding(log, THERE, these).estimates for these in (doubtful, KNOWN))
    assert all(one.half_width > other.half_width for one, other in zip(doubted, plain, strict=True))
    assert holds(log, replace(THERE, viscous=(3 * VISCOUS, 2 * VISCOUS)))
    late = replace(log, signals={**log.signals, "force": np.roll(log["force"], -1)})
    assert values(late, replace(THERE, delay=DT)) == pytest.approx(TRUE, rel=0.02)
    assert holds(late, replace(THERE, delay=0.8 * DT))


@pytest.mark.slow
def test_strained_bristles_at_the_start_and_another_exponent_do_not_matter() -> None:
    for start in (-1.5e-5, 1e-5):
        assert values(sliding(start=start)) == pytest.approx(TRUE, rel=0.02)
    log = sliding(exponent=1.0)
    assert values(log, bristles=replace(KNOWN, exponent=1.0)) == pytest.approx(TRUE, rel=0.03)
    assert not holds(log)


@pytest.mark.slow
def test_a_stage_with_a_mode_is_what_its_two_masses_do() -> None:
    """The reference is the steady vibration of two masses on a spring at the frequency of the free pair."""
    stage = friso.load(EXAMPLE)
    flat = stage.flat()
    part, whole, time = flat["parasitic.mass"], flat["masses.stage"], np.arange(0, 2.0, 1e-4)
    reduced = part * (whole - part) / whole
    pair = 2 * np.pi * flat["parasitic.frequency"]
    spring, damping = reduced * pair**2, 2 * flat["parasitic.damping_ratio"] * reduced * pair
    for hertz in (40.0, 90.0, 150.0):
        s = 2j * np.pi * hertz
        followed = (spring + s * damping) / (spring + s * damping + part * s**2)
        turning = np.exp(s * time)
        record = BearingRecord(time, 1e-6 * turning.real, np.zeros(len(time)), 0 * time)
        total = flat["masses.cart"] + whole
        _, _, inertia = at_bearing(record, machine_between(flat), total)
        true = ((total - part + part * followed) * s**2 * 1e-6 * turning).real
        inside = slice(len(time) // 2, -200)
        assert total * inertia[inside] == pytest.approx(true[inside], abs=0.01 * np.abs(true).max())


def test_a_contact_is_taken_off() -> None:
    """A stage of a third of the mass beyond a contact of 5e6 N/m: the log as the sensor on it sees it, by a few rounds
    of what the stage does to the force and the motion."""
    log, time = sliding(), np.arange(0, SECONDS, DT)
    share, contact = 1 / 3, 5e6
    position, force = log["position"], log["force"]
    for _ in range(4):
        jerks = np.gradient(np.gradient(position, time), time)
        carried = share * MASS * jerks
        position = log["position"] + (force - carried) / contact
        force = log["force"] + share * MASS * (jerks - np.gradient(np.gradient(log["position"], time), time))
    seen = replace(log, signals={"position": position, "force": force})
    assert values(seen, replace(THERE, contact=contact, beyond=share)) == pytest.approx(TRUE, rel=0.02)


def unlike() -> Log:
    log = sliding()
    return replace(log, signals={**log.signals, "force": np.roll(log["force"], 150)})


QUICK = 1e-6 * np.sin(2 * np.pi * 1500 * DT * np.arange(9000))


@pytest.mark.thorough
@pytest.mark.parametrize(
    "make",
    [
        lambda: replace(sliding(), segments=(slice(0, 1500),)),
        lambda: record("x", DT, position=np.full(5000, 0.1), force=np.arange(5000.0)),
        lambda: record("x", DT, position=sliding()["position"], force=np.zeros(10000)),
        lambda: record("x", DT, position=QUICK, force=np.arange(9000)),
        lambda: sliding(swing=0.4e-3, mean=0.4e-3),
        unlike,
    ],
    ids=["short", "still", "without force", "quick", "slow", "unlike"],
)
def test_what_a_log_cannot_show_is_told(make: Callable[[], Log], snapshots: Snapshots, request: Any) -> None:
    stribeck = stribeck_from_slow_sliding(make(), THERE, KNOWN).estimates[2]
    assert not stribeck.determined
    snapshots.check("identify", f"sliding, {request.node.callspec.id}", stribeck.reason)


def test_bristles_delay_and_force_have_to_be_known() -> None:
    assert not stribeck_from_slow_sliding(sliding(), THERE, None).estimates[2].determined
    assert not stribeck_from_slow_sliding(sliding(), replace(THERE, delay=None), KNOWN).estimates[0].determined
    with refused("force"):
        stribeck_from_slow_sliding(record("x", DT, position=np.zeros(9000)), THERE, KNOWN)


def test_level_friction_shows_its_level_alone() -> None:
    coulomb, _, stribeck = stribeck_from_slow_sliding(sliding(coulomb=STATIC), THERE, KNOWN).estimates
    assert coulomb.value == pytest.approx(STATIC, rel=0.02)
    assert not stribeck.determined


def test_friction_without_a_falling_curve_is_not_slid_on_the_rig() -> None:
    dahl = {"model": "dahl", "coulomb": "1 N", "bristle_stiffness": "1e5 N/m", "viscous": "0.5 N*s/m"}
    tables = {key: table for key, table in friso.load(EXAMPLE).as_written().items() if key != "rail"}
    stage = friso.Stage(**{**tables, "friction": dahl})
    still = {"position": np.zeros(200), "force": np.zeros(200)}
    assert many_speeds.slow_sliding_logs(stage, [RigLog("x", None, DT, still, {}, stage, 1)], 1) == ()


@pytest.fixture
def one_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many_speeds, "SHARED_PLACES", 1)
    monkeypatch.setattr(many_speeds, "SLOW_PLACES", 2)


@pytest.mark.usefixtures("one_place")
@pytest.mark.thorough
def test_a_machine_on_which_no_slow_pass_is_steady_shows_its_friction_on_the_rig() -> None:
    """Drawn machine 93: its passes tell no Stribeck velocity, at whatever setting; friction as at the place."""
    machine = built(93)
    stage, flat = locked_stage(machine.truth), machine.flat
    passes = many_speeds.many_speeds(stage, 1)
    assert not passes.places[0].velocity.both.stribeck_velocity.determined
    for item in many_speeds.slow_sliding(stage, [place.log for place in passes.places], 1):
        places = item.log.true["cart_position"]
        there = friction_factors(flat, np.linspace(places.min(), places.max(), 500)).mean(axis=1)
        coulomb, static, stribeck = item.result.estimates
        assert coulomb.value == pytest.approx(flat["friction.coulomb"] * there[1], rel=0.02)
        assert static.value == pytest.approx(flat["friction.static"] * there[0], rel=0.02)
        assert stribeck.value == pytest.approx(flat["friction.stribeck_velocity"], rel=0.03)
        assert stribeck.holds(flat["friction.stribeck_velocity"])


@pytest.mark.slow
@pytest.mark.usefixtures("one_place")
def test_the_stage_file_takes_it_with_what_presliding_shows() -> None:
    from friso_thesis.studies.rig.experiments.presliding import presliding_log

    machine = built(93)
    stage, flat = locked_stage(machine.truth), machine.flat
    passed = many_speeds.many_speeds_logs(stage, 1)
    slow: list[tuple[Any, str]] = [(log.log, "slow-sliding") for log in many_speeds.slow_sliding_logs(stage, passed, 1)]
    alone = identify(slow, machine.guess)
    assert not any(estimate.determined for estimate in alone.estimates)
    assert alone.stage is None  # no file from nothing
    small = presliding_log(stage, "small", 0.01, 1).log
    identification = identify([*slow, (small, "presliding")], machine.guess)
    assert identification.stage is not None
    for key in ("friction.static", "friction.coulomb"):
        assert identification.stage.flat()[key] == pytest.approx(flat[key], rel=0.15)
    assert identification.stage.flat()["friction.stribeck_velocity"] == pytest.approx(
        flat["friction.stribeck_velocity"], rel=0.03
    )
    assert identification.correlations.keys
