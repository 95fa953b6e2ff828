"""Whether a loop is stable, friction aside, against the criterion of Hurwitz."""

from collections.abc import Callable

import numpy as np
import pytest
from variants import VARIANTS

import friso
from friso.equations.bandwidth import faster
from friso.hunting import AttractionEnd, BandwidthWindow, Ensemble, loops_unstable, unstable
from friso.hunting.loop import at_lower_gains
from friso.hunting.margin import unstable_bandwidths
from friso.stage import Stage


def loop_at_lower_gains(chosen: Stage) -> str:
    (word,) = at_lower_gains(Ensemble.held(chosen.flat(), 1))
    return word


def damped(name: str, share: float) -> Stage:
    """A stage with so much of the integral gain up to which viscous friction damps it, sigma_2 kp / m."""
    flat = VARIANTS[name].flat()
    mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
    gain = share * flat["friction.viscous"] * flat["controller.kp"] / mass
    return VARIANTS[name].replace({"controller.ki": f"{gain!r} N/(m*s)"})


@pytest.mark.parametrize("name", ["rigid stage, PI", "rigid, Stribeck 2, PI, limit"])
@pytest.mark.parametrize(("share", "states"), [(0.98, ()), (1.02, ("slides",))])
def test_a_pi_controller_is_stable_as_far_as_viscous_friction_damps(
    name: str, share: float, states: tuple[str, ...]
) -> None:
    """m s^3 + sigma_2 s^2 + kp s + ki has its roots on the left where m ki < sigma_2 kp."""
    assert unstable(damped(name, share)) == states


def test_a_loop_without_proportional_gain_is_looked_at() -> None:
    """An integral gain alone: neither a length nor a natural frequency gives its states a scale."""
    assert unstable(VARIANTS["rigid stage, PI"].replace({"controller.kp": "0 N/m"})) == ()


@pytest.mark.parametrize(("share", "always"), [(0.98, "stable"), (1.02, "unstable")])
def test_where_a_force_limit_unsettles_a_loop(share: float, always: str) -> None:
    """m s^3 + sigma_2 s^2 + N kp s + N ki has its roots on the left at all gains N where m ki < sigma_2 kp."""
    assert loop_at_lower_gains(damped("rigid, Stribeck 2, PI, limit", share)) == always


@pytest.mark.parametrize("mass", [0.01, 0.1, 0.3, 0.6, 1.7, 200.0])
def test_van_dijks_rules_tuned_for_another_mass(mass: float) -> None:
    """The roots of (m s^2 + sigma_2 s) tau_i s (tau_p s + 1) + k_p (tau_z s + 1)(tau_i s + 1) decide (Eq. 7, 8)."""
    chosen = VARIANTS["rigid"].replace({"controller.tuned_mass": f"{mass} kg"})
    flat = chosen.flat()
    omega, root = 2 * np.pi * flat["controller.crossover"], flat["controller.alpha"] ** -0.5
    gain, tau_z, tau_p = mass * omega**2 / root, root / omega, 1 / (omega * root)
    tau_i = flat["controller.beta"] * tau_z
    moving = [flat["masses.cart"] + flat["masses.stage"], flat["friction.viscous"], 0.0]
    loop = np.polymul(np.polymul(moving, [tau_i, 0.0]), [tau_p, 1.0])
    control = gain * np.polymul([tau_z, 1.0], [tau_i, 1.0])
    lost = np.roots(np.polyadd(loop, control)).real.max() > 0
    assert unstable(chosen) == (("slides",) if lost else ())
    assert lost == (mass < 0.2)


def test_van_dijks_rules_need_their_gain_where_hardly_anything_is_viscous() -> None:
    """The derivative makes the loop stable at its own gain; at lower ones m ki > sigma_2 kp decides."""
    assert unstable(VARIANTS["rigid"]) == ()
    assert loop_at_lower_gains(VARIANTS["rigid"]) == "unstable"


def test_a_stage_without_friction_is_judged_too() -> None:
    """Without friction nothing sets the size of its motion, which follows from friction otherwise.

    A PI controller alone never damps the stage.
    """
    assert unstable(VARIANTS["rigid, no friction section"]) == ()
    pushed = VARIANTS["rigid stage, PI"].as_written()
    smooth = Stage(**{name: table for name, table in pushed.items() if name != "friction"})
    assert unstable(smooth) == ("sticks", "slides")


@pytest.mark.parametrize(
    ("changes", "always"),
    [
        ({"controller.integral_deadband": "2 um"}, "unknown"),
        ({"controller.error_deadband": "2 um"}, "unknown"),
        ({"controller.standstill_window": "5 um", "controller.standstill_factor": 0.5}, "unknown"),
        ({"controller.stiction_push": "1 N", "controller.stiction_push_window": "1 um"}, "unknown"),
        ({"friction.viscous_asymmetry": 0.8}, "unstable"),
        ({"friction.viscous_asymmetry": -0.8}, "unstable"),
    ],
)
def test_what_acts_about_rest_alone_tells_nothing_of_lower_gains(changes: dict, always: str) -> None:
    """Dead zones and gains at standstill hide the loop far from rest; what damps least is the weaker direction."""
    chosen = damped("rigid, Stribeck 2, PI, limit", 0.6)
    assert loop_at_lower_gains(chosen) == "stable"
    assert loop_at_lower_gains(chosen.replace(changes)) == always


class Begun(Exception):
    """Work has begun."""


def begun(*_: object) -> None:
    raise Begun


MINUTES: dict[str, Callable[[Stage], object]] = {
    "check": lambda stage: friso.check(stage, progress=begun),
    "tune": lambda stage: friso.tune(stage, progress=begun),
    "design": lambda stage: friso.design(stage, progress=begun),
    "compare": lambda stage: friso.compare(stage, machines=20, progress=begun),
    "boundary": lambda stage: friso.boundary(stage, x="controller.crossover=1 Hz..40 Hz", progress=begun),
    "rig": lambda stage: friso.rig("stiffness", stage, progress=begun),
    "sweep": lambda stage: friso.sweep(stage, {"joint.stroke": "0.2 mm..1 mm:3"}, progress=begun),
}


@pytest.mark.cases(first=2, slow=1)
@pytest.mark.parametrize("command", MINUTES)
def test_an_unstable_loop_is_mentioned_before_work_that_takes_minutes(
    command: str, rig: Stage, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(Begun):
        MINUTES[command](rig.replace({"controller.alpha": 0.9}))
    assert sum("is unstable while the stage sticks and while" in text for text in caplog.messages) == 1
    caplog.clear()
    with pytest.raises(Begun):
        MINUTES[command](rig)
    assert not any("unstable" in text for text in caplog.messages)


def test_an_unstable_loop_is_mentioned_beside_a_run(rig: Stage, caplog: pytest.LogCaptureFixture) -> None:
    friso.simulate(rig.replace({"controller.alpha": 0.9}))
    assert any("is unstable while the stage sticks and while" in text for text in caplog.messages)


def test_a_loop_is_unstable_just_inside_the_bandwidths_stated_and_stable_just_outside() -> None:
    """A cascade with filters on a parasitic mode is unstable over a range of bandwidths, and stable again above it."""
    chosen = friso.load(friso.example("twincat_cascade"))
    (window,) = unstable_bandwidths(chosen)
    for end in (window.low, window.high):
        assert end.reserve < 2e-4
        places = np.array([end.inside, end.outside, 1.0])
        assert loops_unstable(faster(chosen.flat(), places), 3).tolist() == [True, False, False]


def test_what_lies_outside_of_another_window_is_left() -> None:
    def window(low: float | None, high: float | None, reserve: float = 0.0) -> BandwidthWindow:
        low_end = None if low is None else AttractionEnd(low, low * (1 - reserve), True)
        return BandwidthWindow(low_end, None if high is None else AttractionEnd(high, high * (1 + reserve), True))

    lost = window(3.89, 8.0)
    for whole, left in (
        (window(3.93, None, 0.01), [(8.0, None)]),
        (window(3.93, 7.0, 0.01), []),
        (window(3.88, 7.0, 0.01), []),
        (window(2.0, 5.0), [(2.0, 3.89)]),
        (window(2.0, None), [(2.0, 3.89), (8.0, None)]),
        (window(None, 3.0), [(None, 3.0)]),
        (window(9.0, None), [(9.0, None)]),
    ):
        parts = whole.without(lost)
        assert [(part.low and part.low.inside, part.high and part.high.inside) for part in parts] == left
