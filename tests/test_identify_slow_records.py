"""What slow records leave undetermined, and machines drawn from that range."""

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from friso.errors import InputError
from friso.identification.doubt import KeyCase, Quality, RaisedDoubt, quality_of
from friso.identification.doubts import values
from friso.identification.doubts.values import friction_beyond
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import bandwidth_of, inverse_model
from friso.identification.output_error.parameters import MASS, RATIO, FitParameter
from friso.identification.output_error.to_keys import MACHINES_DRAWN, drawn_from
from friso.identification.readings.common import record
from friso.identification.readings.motion_events import Ramps
from friso.identification.stage_file import made_up

FLAT = {"friction.stribeck_velocity": 1e-3, "axis.kind": "linear"}
MASSES = Estimate.normal("masses.cart", "kg", 3.0, 0.1, "drawn")
COULOMB = Estimate.normal("friction.coulomb", "N", 8.0, 0.1, "drawn")
UNKNOWN = Estimate.unknown("friction.stribeck_velocity", "m/s", "drawn", "not covered")
STRIBECK = Estimate.normal("friction.stribeck_velocity", "m/s", 1e-3, 1e-5, "drawn")


def case_of(estimates: tuple[Estimate, ...], **seen: Any) -> KeyCase:
    """Return estimates together with a log of zeros, as the checks of an identification take them."""
    log: Any = record("made up", 1e-3, position=np.zeros(100), force=np.zeros(100))
    rest: Any = {
        "log": log,
        "inverse": None,
        "fit": None,
        "quality": Quality(noise=0.1, left=0.1, noise_left=0.1, inverse_error=0.1, whole_error=0.1),
    }
    rest |= {"flat": FLAT, "velocity": np.zeros(1), "correlation": np.eye(sum(one.determined for one in estimates))}
    return KeyCase(**rest | {"estimates": estimates} | seen)


def judged(find: Callable[[KeyCase], Iterable[RaisedDoubt]], case: KeyCase) -> KeyCase:
    """The case with the answers of a doubt."""
    for finding in find(case):
        case = case.with_answers(finding)
    assert len(case.correlation) == len(case.determined)
    return case


@pytest.mark.parametrize(
    ("stribeck", "top", "left"),
    [(UNKNOWN, 1e-3, False), (UNKNOWN, 0.1, True), (STRIBECK, 1.5e-3, False), (STRIBECK, 2.1e-3, True)],
)
def test_friction_at_slow_speeds_alone_is_no_coulomb_friction(stribeck: Estimate, top: float, left: bool) -> None:
    case = case_of((MASSES, COULOMB, stribeck), velocity=np.array([0.0, -top]))
    kept = judged(values.find_slow_motion, case).determined
    assert (COULOMB.name in kept) == left
    assert "masses.cart" in kept


def test_all_friction_at_the_highest_slow_speed_may_be_dry() -> None:
    """A Stribeck effect that still acts may have passed for viscous friction, and static friction exceeds Coulomb's."""
    viscous = Estimate.normal("friction.viscous", "N*s/m", 4e3, 100.0, "drawn")
    static = Estimate.unknown("friction.static", "N", "drawn", "not covered", 7.8, 16.0)
    case = case_of((MASSES, COULOMB, viscous, static, UNKNOWN), velocity=np.array([1e-3]))
    coulomb, rest, static = judged(values.find_slow_motion, case).estimates[1:4]
    assert {one.determined for one in (coulomb, rest, static)} == {False}
    assert coulomb.high == pytest.approx(COULOMB.high + viscous.high * 1e-3)
    assert (static.low, static.high) == pytest.approx((coulomb.low, 4 * coulomb.high))


@pytest.mark.parametrize(
    ("beyond", "left"),
    [((1.1, 1.4, 1.5, 1.6), True), ((1.1, 1.4, 0.9, 1.6), False), ((1.1, np.inf, np.inf, np.inf), True)],
)
def test_stiffer_bristles_beside_errors_of_the_position(
    beyond: tuple[float, ...], left: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bristles are refused if stiffer ones leave no more of the record than of a simulated log of their own machine."""
    stiffness = Estimate.normal("friction.bristle_stiffness", "N/m", 3e5, 2e4, "drawn")
    problem = SimpleNamespace(names=(stiffness.name,), closed=False, parameters=[SimpleNamespace(high=1e8)])
    fit: Any = SimpleNamespace(problem=problem, inner=np.array([np.log(3e5)]), free=(0,), slopes=None)
    refitted = SimpleNamespace(inner=np.zeros((4, 1)), cost=2.0 * np.array(beyond))
    own = SimpleNamespace(residuals=lambda inner: np.full((1, 100), 2**0.5))
    monkeypatch.setattr(values, "refine_fit", lambda *arguments, **named: refitted)
    monkeypatch.setattr(values, "simulated_log", lambda *arguments: own)
    case = case_of((stiffness,), fit=fit, inverse=SimpleNamespace(bandwidth=20.0))
    assert (stiffness.name in judged(values.find_stiffer_bristles, case).determined) == left


@pytest.mark.parametrize(("share", "off"), [(0.01, MASSES.half_width), (0.9, 0.81 * 3.0), (1.1, None)])
def test_what_is_left_passes_for_inertia(share: float, off: float | None) -> None:
    """Little of it does nothing, much of it makes the mass uncertain, and beyond the inertia there is no mass."""
    case = case_of((MASSES,), acceleration=np.array([0.5, -0.5]), unexplained=share * 3.0 * 0.5)
    (mass,) = judged(values.find_lost_inertia, case).estimates
    assert mass.determined == (off is not None)
    assert off is None or mass.half_width == pytest.approx(off)


def test_machines_are_drawn_from_intervals_and_from_what_is_left() -> None:
    """A parameter that is withdrawn, or known only to lie above zero, is not drawn near its fitted value."""
    static = Estimate.unknown("friction.static", "N", "drawn", "not covered", 8.0, 32.0)
    parameters = [
        FitParameter(MASS, "kg", 3.0, 0.6, 15.0),
        FitParameter("friction.coulomb", "N", 8.0, 1.0, 40.0),
        FitParameter(RATIO, "", 1.0, 1.0, 4.0, logarithmic=False),
        FitParameter("friction.viscous", "N*s/m", 5.0, 0.0, 50.0, logarithmic=False),
    ]
    inner = np.array([np.log(3.0), np.log(8.0), 1.0, 5.0])
    rows = drawn_from((MASSES, COULOMB, static), np.eye(2), parameters, inner)
    assert rows.shape == (MACHINES_DRAWN, 4)
    assert np.ptp(rows[:, 0]) > 0
    assert MASSES.low <= np.exp(rows[:, 0]).min() <= np.exp(rows[:, 0]).max() <= MASSES.high
    assert rows[:, 2].min() < 1.5
    assert rows[:, 2].max() > 2.5
    nothing = Estimate.unknown("masses.cart", "kg", "drawn", "withdrawn")
    viscous = Estimate.unknown("friction.viscous", "N*s/m", "drawn", "not bounded", 0.0, 20.0)
    rows = drawn_from((nothing, viscous), np.zeros((0, 0)), [parameters[0], parameters[3]], inner[[0, 3]])
    assert np.exp(np.ptp(rows[:, 0])) > 5
    assert 10 < np.ptp(rows[:, 1]) <= 20.0


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("left", "doubted", "failed"), [(0.5, False, False), (1.0, True, False), (15.0, True, True)])
def test_a_record_that_the_whole_model_alone_describes_is_described(left: float, doubted: bool, failed: bool) -> None:
    """A record counts as described if the complete model explains it, even where the inverse model cannot.

    An example is the force of a stage that sticks. What counts are the residuals of the fit, and a cause is named
    unless the complete model is clearly better than the inverse model.
    """
    time = np.arange(8000) * 1e-3
    position = 0.05 * np.sin(2 * np.pi * 0.5 * time)
    force = 11.0 * np.sign(np.cos(2 * np.pi * 0.5 * time)) + 20.0 * np.sin(2 * np.pi * 3.1 * time)
    log = record("axis", 1e-3, position=position, force=force)
    inverse = inverse_model(log, bandwidth_of(log))
    stage = made_up(log, inverse).flat()
    problem = SimpleNamespace(noise_left=lambda noise: noise, closed=False, counted=np.ones(len(time)))
    fit: Any = SimpleNamespace(left=left, problem=problem, stage=stage, explains=lambda noise: False)
    quality = quality_of(log, inverse, fit, 0.05, 0.0)
    assert quality.failed == failed
    assert not quality.rejected
    assert bool(quality.without) == doubted


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("phase", [0.0, 1.0, 2.0, 4.0, 5.0])
def test_vibration_beyond_the_moves_does_not_hide_the_mass(phase: float) -> None:
    """A loop that shakes on the steps of its encoder: force and position swing at 40 Hz, but not as a mass does."""
    time = np.arange(8000) * 1e-3
    position, swing = 0.05 * np.sin(2 * np.pi * 0.5 * time), 2 * np.pi * 40 * time
    velocity, acceleration = np.gradient(position, time), np.gradient(np.gradient(position, time), time)
    force = 8.0 * acceleration + 20.0 * velocity + 4.0 * np.sign(velocity) + 15.0 * np.sin(swing)
    log = record("shaking", 1e-3, position=position + 4e-5 * np.sin(swing + phase), force=force)
    within = inverse_model(log)
    assert within.bandwidth < bandwidth_of(log) / 1.5
    for name, value in (("mass", 8.0), ("viscous", 20.0), ("coulomb", 4.0)):
        estimate = within.estimate(name)
        assert estimate.low <= value <= estimate.high
        assert estimate.half_width < 0.2 * value


def test_friction_before_sliding_is_no_force_of_the_wrong_sign() -> None:
    """A force that goes with the position, and feeds friction, is not one that accelerates a mass backward."""
    time, rng = np.arange(6000) * 1e-3, np.random.default_rng(3)
    position = 1e-6 * sum(np.sin(2 * np.pi * line * time + rng.uniform(0, 6)) for line in (0.7, 3.1, 11.3))
    force = 1e6 * position + 3e3 * np.gradient(position, time) + 0.3 * rng.standard_normal(len(time))
    assert inverse_model(record("small", 1e-3, position=position, force=force)).estimate("mass").high < 0
    with pytest.raises(InputError, match="scale"):
        inverse_model(record("moves", 1e-3, position=position, force=-8.0 * np.gradient(np.gradient(position))))


def test_static_friction_below_that_of_break_aways_is_not_believed() -> None:
    """A body that sticks without bristles: its Stribeck curve, seen in motion alone, led to too little."""
    static = Estimate("friction.static", "N", 11.3, 10.7, 11.9, "output error")
    bias = Estimate("bias.cart", "N", 1.0, 0.9, 1.1, "output error")

    curve = {"friction.static": 11.3, "friction.coulomb": 10.3, "friction.viscous": 10.0}
    curve["friction.stribeck_velocity"] = 2e-3

    def ramps(level: float, count: int = 6, more: float = 0.0, backward: int = 2) -> Ramps:
        directions = np.where(np.arange(count) % backward, 1.0, -1.0)
        forces = level * np.array([1, 1.01, 0.98, 0.99, 1, 1.02])[:count] + (more - 1) * directions
        rest = [np.zeros(count)] * 2
        unsure = np.full(count, 0.1)
        return Ramps(*rest, directions, forces, np.ones(count), unsure, np.zeros(count), np.full(count, 0.05), 0.0, ())

    both, steeper = {static.name: static, bias.name: bias}, {**curve, "friction.viscous": 60.0}
    assert friction_beyond(both, curve, ramps(13.9)) == pytest.approx(13.9, rel=0.05)
    assert friction_beyond(both, curve, ramps(11.9)) is None
    assert friction_beyond(both, curve, ramps(13.9, 2)) is None
    assert friction_beyond({bias.name: bias}, curve, ramps(13.9)) is None
    assert friction_beyond(both, curve, ramps(11.5, more=3, backward=5)) is None
    assert friction_beyond(both, steeper, ramps(13.9)) is None
