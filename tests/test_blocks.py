"""Blocks of controllers, by themselves: steady motions last, and integrators rest at limits."""

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest
import sympy as sp
from variants import limit, lugre, stage, step, van_dijk

import friso
from friso.equations.blocks import Blocks, Demand, Loop, Measured, Signal, loop_signals
from friso.equations.component import STEADY, Kink, Role
from friso.equations.continuous import Continuous, ForceLimit
from friso.equations.sampled import SAMPLE_TIME, Rest, Sampled
from friso.frequency.loops import FORCE, STAGE, compensator
from friso.quantities import Quantity, Value, positive
from friso.stage import ControllerSection, register_controller
from friso.stage.controllers import CONTROLLERS
from friso_thesis.studies.describing.balance import receptance

ERROR, POSITION, VELOCITY, SPEED = STEADY[:4]
GOING = Loop(*STEADY[:4])

BLOCKS: dict[str, Callable[[Blocks, Signal], Signal]] = {
    "difference": lambda blocks, signal: blocks.derivative(signal, "n"),
    "biquad": lambda blocks, signal: blocks.biquad(signal, (2, sp.Rational(1, 50), 3), (1, sp.Rational(1, 20), 1), "n"),
}


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("name", BLOCKS)
def test_a_steady_motion_lasts_from_sample_to_sample(name: str) -> None:
    """At each sample, held numbers become those of the motion one sample later."""
    blocks = Sampled(3)
    signal = BLOCKS[name](blocks, loop_signals(GOING, sp.S.One, sp.S.One).position)
    _, held = blocks.finished(Demand({}, signal, signal, signal), None, Rest())
    now = {entry.symbol: entry.settled for entry in held}
    later = {POSITION: POSITION + VELOCITY * SAMPLE_TIME}
    for item in held:
        assert sp.simplify(item.update.xreplace(now) - item.settled.xreplace(later)) == 0
    assert sp.simplify(signal.value.xreplace(now) - signal.settled) == 0


def test_a_steady_motion_lasts_in_continuous_time() -> None:
    blocks = Continuous(sp.S.One)
    signal = BLOCKS["biquad"](blocks, loop_signals(GOING, sp.S.One, sp.S.One).position)
    now = {item.symbol: item.settled for item in blocks.states}
    for state in blocks.states:
        assert sp.simplify(state.derivative.xreplace(now) - sp.diff(state.settled, POSITION) * VELOCITY) == 0
    assert sp.simplify(signal.value.xreplace(now) - signal.settled) == 0


@pytest.mark.parametrize("beyond", [(), ("force",), ("integral",), ("force", "integral")])
def test_an_integrator_rests_at_each_limit_and_at_both(beyond: tuple[str, ...]) -> None:
    """Wound up further than either limit allows, or both, it stays; it does not run back."""
    blocks = Continuous(sp.S.One)
    signal = blocks.integral(loop_signals(GOING, sp.S.One, sp.S.One).error, sp.S(2), limit=sp.S(3))
    bound = ForceLimit.of(signal, "clamp")
    states, resting = blocks.finished(Demand({}, signal, signal, signal), bound)
    (integral,) = (state for state in states if state.role == Role.INTEGRAL)
    modes = {kink.beyond: 0 for kink in (*bound.kinks, *resting)} | {Kink("winding_up", ERROR).beyond: 1}
    for name in beyond:
        modes |= {sp.Symbol(f"beyond_{mode}_upper", real=True): 1 for mode in (name, f"rest_{name}")}
    modes |= {sp.Symbol("beyond_rest_upper", real=True): int("force" in beyond)}
    assert integral.derivative.subs(modes) == (0 if beyond else ERROR)


@pytest.mark.parametrize(("anti_windup", "hunts"), [("clamp", False), ("none", True), ("back_calculation", True)])
def test_anti_windup_decides_on_a_large_step(anti_windup: str, hunts: bool) -> None:
    """Integrals that wind up on the way carry the stage beyond its reference, from where it sticks and slips."""
    time = "50 ms" if anti_windup == "back_calculation" else ""
    controller = van_dijk("8 Hz", limit("6 N", anti_windup, time))
    run = friso.simulate(stage(step("10 mm", "60 s"), friction=lugre(2), controller=controller))
    last = run["position"].sel(time=slice(30, 60))
    assert (float(last.max() - last.min()) > 1e-3) == hunts


class LimitedShares(ControllerSection):
    """PI whose shares are limited one by one."""

    kind: Literal["limited-shares"]
    gain: Annotated[Value, Quantity("N/m", positive, "3 N/m")]
    share: Annotated[Value, Quantity("N", positive, "2 N")]

    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "spring", "i": "integral"})

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        return True

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: None) -> sp.Expr:
        return blocks.key("gain")

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: None) -> Mapping[str, Signal]:
        gain, share = blocks.key("gain"), blocks.key("share")
        return {
            "p": blocks.limiter(measured.error * gain, share, "p"),
            "i": blocks.integral(measured.error, gain, limit=share),
        }


@pytest.fixture
def limited_shares() -> Iterator[dict[str, Any]]:
    register_controller(LimitedShares)
    keys = {"kind": "limited-shares", "gain": 5.0, "share": 2.0}
    yield {"friction.model": "none", "masses.stage": 1.0} | {f"controller.{key}": value for key, value in keys.items()}
    del CONTROLLERS.forms["limited-shares"], CONTROLLERS.classes["limited-shares"]


def test_small_motions_know_no_limits_inside_a_controller(limited_shares: dict[str, Any]) -> None:
    """Linear systems are those of gain (1 + 1/s), within every limit."""
    s = 2j * np.pi * 3.0
    control = compensator(limited_shares, 1).take((STAGE,), (FORCE,)).at(np.array([s]))
    assert control[0, 0, 0, 0] == pytest.approx(-5.0 * (1 + 1 / s))
    cart, _ = receptance(limited_shares, np.array([3.0]))
    assert cart[0] == pytest.approx(-1 / (s**2 + 5.0 * (1 + 1 / s)))
