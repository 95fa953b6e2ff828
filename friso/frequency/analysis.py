"""Return a stage in one of its states as a linear system of python-control (`friso.linear`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from friso.errors import InputError
from friso.frequency.loops import closed_loop, open_loop
from friso.frequency.members import Members, level, limit_cases, limiter_in_series, limiter_states
from friso.frequency.parts import FORCE, RATED, REFERENCE, STAGE, VELOCITY, compensator, plant, reference_derivatives
from friso.frequency.system import System
from friso.quantities import quoted
from friso.stage import Stage
from friso.stage.arguments import check_arguments

if TYPE_CHECKING:
    from control import StateSpace


@check_arguments
def linear(stage: Stage, case: str | Members | None = None, part: str = "plant", series: bool = False) -> StateSpace:
    """Return a stage in one state as a `control.StateSpace` in SI units, with named signals.

    `case` is the name of a limit case ("stuck", "sliding", "stuck-touched", "sliding-touched", or "given" for a stage
    that has just one; default: the first of them that the stage has), or a state such as
    `friso.member(speed=1e-3)` [m/s], `friso.member(bias=2.0)` [N], both with `touched=True` if the limiter is.
    `part` is one of

    - "plant": from "force" on the stage and "disturbance on cart" [N] to "stage", "cart" and "joint deflection" [m];
    - "controller": from "reference" and "stage" [m] (and "stage velocity" [m/s] if it measures that) to "force" [N];
      one with feedforward also from "reference velocity" [m/s], "reference acceleration" [m/s^2] and "reference jerk"
      [m/s^3], here and below;
    - "open": the loop cut at the actuator, from "force" to minus the "force" of the controller;
    - "closed": from "force", "reference", "disturbance on cart" and "sensor noise" [m] to "stage", "cart", "joint
      deflection" and "force".

    All are in continuous time, without sampling, delay and current loop of a drive. With `series`, a touched limiter
    acts by the formula that Table 1 of the thesis prints, instead of in parallel with the joint. Where the cart is
    stuck, its bristles follow it and are no states; a derivative of the measured velocity does not see the noise of the
    sensor, which has none. Raises InputError for an unknown case or part, and for a state that the stage cannot be in.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load(friso.example("thesis_rig"))
    >>> friso.linear(stage, "stuck").output_labels
    ['stage', 'cart', 'joint deflection']
    """
    if not isinstance(case, str | Members | None):
        raise InputError("case", quoted(case), "the name of a limit case, or a state", "case=friso.member(speed=1e-3)")
    flat: Mapping[str, Any] = stage.flat()
    cases = limit_cases(flat)
    member = _checked(flat, case) if isinstance(case, Members) else _chosen("case", case or next(iter(cases)), cases)
    if series and member.touched.all():
        flat, member = limiter_in_series(flat), member.with_limiter(False)
    system = _chosen("part", part, _PARTS)(flat, member)
    return _control(system, f"{stage.name} {part}".strip())


def _checked(flat: Mapping[str, Any], member: Members) -> Members:
    """Return a state of a stage unchanged, after checking that the stage can be in it.

    Raises InputError for several states at once, a limiter that cannot be so, or a bias force that breaks the cart
    away.
    """
    if len(member) != 1:
        raise InputError(
            "case", f"{len(member)} states", "a single one", "friso.linear(stage, friso.member(speed=1e-3))"
        )
    if bool(member.touched[0]) not in limiter_states(flat):
        state = f"a limiter that is {'' if member.touched[0] else 'not '}touched"
        raise InputError("case", state, "what the joint allows: free with a stroke, it may be both", "touched=False")
    least, most = -level(flat, not member.forward[0]), level(flat, bool(member.forward[0]))
    if member.bias[0] and not least < member.bias[0] < most:
        expected = f"between {least:g} N and {most:g} N, at which the cart breaks away"
        raise InputError("case", f"a bias of {member.bias[0]:g} N", expected, "friso.member(bias=0.5)")
    return member


def _control(system: System, name: str) -> StateSpace:
    from control import StateSpace

    names = {"states": [*system.states], "inputs": [*system.inputs], "outputs": [*system.outputs]}
    return StateSpace(system.a[0], system.b[0], system.c[0], system.d[0], name=name, **names)


def _controller(flat: Mapping[str, Any], member: Members) -> System:
    controller = compensator(flat, len(member))
    measured = (REFERENCE, STAGE, VELOCITY) if controller.sees(VELOCITY) else (REFERENCE, STAGE)
    return controller.take((*measured, *reference_derivatives(controller)), (FORCE,))


def _at_axis(system: System) -> System:
    """Return the system without its outputs of velocity, which only the controller uses."""
    return system.take(system.inputs, [name for name in system.outputs if name not in (VELOCITY, RATED)])


_PARTS: dict[str, Callable[[Mapping[str, Any], Members], System]] = {
    "plant": lambda flat, member: _at_axis(plant(flat, member)),
    "controller": _controller,
    "open": open_loop,
    "closed": lambda flat, member: _at_axis(closed_loop(flat, member)),
}


def _chosen(what: str, name: str, choices: Mapping[str, Any]) -> Any:
    if name not in choices:
        first = next(iter(choices))
        raise InputError(what, quoted(name), f"one of {', '.join(choices)}", f'friso.linear(stage, {what}="{first}")')
    return choices[name]
