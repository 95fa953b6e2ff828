"""Judge the stability of a stage's loop without friction.

If the loop is unstable, tuning is the cause of swinging, not friction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np

from friso.equations.roles import Role, Steady
from friso.hunting.cycle.ensemble import Ensemble
from friso.stage import Stage
from friso.stage.controllers import NO_SETTINGS, controller_of
from friso.stage.tables import BACKLASH, MOTOR_MASS, MOTOR_STATES

LoopState = Literal["sticks", "slides"]
LowerGains = Literal["stable", "unstable", "unknown"]


def winds_up_at_a_limit(stages: Ensemble) -> bool:
    """Tell whether stages have a force limit without anti-windup."""
    controller = stages.structure.controller
    return bool(controller and controller.anti_windup == "none")


def far_beyond_a_limit(stages: Ensemble) -> np.ndarray | None:
    """Judge loops far beyond a force limit without anti-windup: a `LowerGains` each, (count,).

    Large swings grow if the loop is unstable there, and shrink if it is stable. Returns None if there is no such limit.
    """
    return at_lower_gains(stages) if winds_up_at_a_limit(stages) else None


def may_run_away(stages: Ensemble) -> np.ndarray:
    """Return which stages may diverge beyond a force limit without anti-windup, shape (count,).

    Their loop at lower gains is unstable or unknown. All are False without such a limit.
    """
    far = far_beyond_a_limit(stages)
    return np.zeros(stages.count, bool) if far is None else far != "stable"


def surely_run_away(stages: Ensemble) -> np.ndarray:
    """Return which stages surely diverge beyond a force limit without anti-windup, (count,).

    Their loop at lower gains is unstable. All are False without such a limit.
    """
    far = far_beyond_a_limit(stages)
    return np.zeros(stages.count, bool) if far is None else far == "unstable"


LOOPS_AT_ONCE = 256
"""Loops of a map that are analysed together, at 0.1 MB each."""


@np.errstate(all="ignore")
def at_lower_gains(stages: Ensemble) -> np.ndarray:
    """Judge the stability of sliding stages at their own and all lower gains, shape (count,).

    Each gets a `LowerGains`. A loop is "unstable" if it is so at one of the gains, with the viscous friction of the
    direction that has less. The result is "unknown" if the controller does not name the keys of its gain. It is also
    "unknown" if the controller acts differently near the reference and far from it, which the linear loop at rest does
    not show.

    A force limit acts as a lower gain, the lower the larger the motion. Without anti-windup, only the force limit and
    the viscous friction matter for the largest motions: with a mass m and viscous friction b, they shrink if b k_p > m
    k_i and grow if less. This is Hurwitz's criterion for the loop at any gain.
    """
    at_once = LOOPS_AT_ONCE
    controller, form = controller_of(stages.flat), stages.structure.controller
    settings = form.settings if form else NO_SETTINGS
    if not controller.loop_gain or settings.bends:
        return np.full(stages.count, "unknown", dtype=object)
    parts = np.split(np.arange(stages.count), range(at_once, stages.count, at_once))
    return np.concatenate([_at_lower_gains(stages.take(part)) for part in parts])


LOWER_GAIN_SHARES = (1e-06, 1.0, 37)
"""First and last gain, and number of gains, at which stability is computed: twelve per decade."""

LEAST_GROWTH_RATE = 1e-5  # [natural frequencies]
"""Slowest growth rate that is not rounding. A stage that sticks has poles at 0."""


def _at_lower_gains(stages: Ensemble) -> np.ndarray:
    """Judge the stability of sliding stages at their own and all lower gains, shape (count,).

    The stages are few enough for the memory, and their controller names the keys of its gain.
    """
    shares = np.geomspace(*LOWER_GAIN_SHARES)
    controller, form = controller_of(stages.flat), stages.structure
    flat = stages.take(np.repeat(np.arange(stages.count), len(shares))).flat
    gains = {key: flat[key] * np.tile(shares, stages.count) for key in map(controller.key, controller.loop_gain)}
    slower = Ensemble.held({**flat, **gains}, stages.count * len(shares), form=form)
    growths = _growth(_sliding(slower, _rates(slower), np.min)) / (LEAST_GROWTH_RATE * slower.number("rate"))
    growing, shrinking = (
        (growths > 1).reshape(-1, len(shares)),
        (growths <= 1).reshape(-1, len(shares)),
    )
    words = np.where(shrinking.all(axis=1), "stable", "unknown")
    return np.where(growing.any(axis=1), "unstable", words).astype(object)


def unstable(stage: Stage) -> tuple[LoopState, ...]:
    """Return the states in which the loop is unstable while the stroke limiter is not touched.

    The stage either sticks, held by its bristles, or slides with only viscous friction.
    """
    return tuple(state for state, where in unstable_among(Ensemble.held(stage.flat(), 1)).items() if where[0])


def leaves_for_good(stage: Stage) -> bool:
    """Tell whether a stage that has left the range of all runs diverges for ever.

    The result is true if the loop is unstable and no force limit with anti-windup can catch the stage in a larger
    swing.
    """
    stages = Ensemble.held(stage.flat(), 1)
    controller = stages.structure.controller
    limited = bool(controller and controller.anti_windup) and not winds_up_at_a_limit(stages)
    return not limited and bool(unstable(stage))


@np.errstate(all="ignore")  # absurd gains leave infinities behind
def unstable_among(stages: Ensemble) -> dict[LoopState, np.ndarray]:
    """Return which stages have an unstable loop while they stick and while they slide, (count,).

    A sliding stage is damped by the mean viscous friction of both directions.
    """
    limit = LEAST_GROWTH_RATE * stages.number("rate")
    return {state: growth > limit for state, growth in _growths(stages).items()}


@np.errstate(all="ignore")
def surely_calm(stages: Ensemble) -> np.ndarray:
    """Return which stages that cannot hunt have no other lasting swing either, shape (count,).

    Their loops are stable, also with the limiter of a free joint touched, and beyond a force limit without anti-windup.
    They have no backlash, no dither, no friction that follows the drive's force, and no window with a memory that
    switches the force. Without friction, the
    controller must also act alike near the reference and far from it.
    """
    least_rate = LEAST_GROWTH_RATE
    form = stages.structure
    drive, controller = form.transmission, form.controller
    settings = controller.settings if controller else NO_SETTINGS
    rubs = form.friction != "none" or (drive is not None and drive.friction != "none")
    winds = controller is not None and controller.integral and "integral_reset" in settings
    bent = settings.swings_alone or (not rubs and (settings.bends or winds))
    if form.plays or "dither_amplitude" in settings or bent or form.follows_drive:
        return np.zeros(stages.count, bool)
    limit = least_rate * stages.number("rate")
    growths = [_growths(stages, touched).values() for touched in {False, form.joint == "free"}]
    stable = np.all([growth <= limit for state in growths for growth in state], axis=0)  # NaN counts as unstable
    return stable & ~may_run_away(stages) & ~lags(stages)


def lags(stages: Ensemble) -> np.ndarray:
    """Return which stages have a controller that lags instead of integrating, shape (count,).

    At standstill the force of such a controller keeps growing, although it has no integral: below the crossover the
    force comes behind the error, which feeds a swing. A controller whose force never lags below the crossover only
    takes energy out.
    """
    at_once, controller = LOOPS_AT_ONCE, stages.structure.controller
    lagging = np.zeros(stages.count, bool)
    if controller is not None and not controller.integral:
        pulled_back = np.flatnonzero(stages.number("stiffness") > 0)
        for part in np.split(pulled_back, range(at_once, pulled_back.size, at_once)) if pulled_back.size else ():
            lagging[part] = _lags(stages.take(part))
    return lagging


LAG_RATES = (1e-6, 30.0)  # [natural frequencies]
"""Lowest and highest rate at which lags are looked for. A slower lag rises too slowly to break a stage away."""

LAG_POINTS = 200
"""Rates at which the phase is computed: 27 per decade, finer than any lag."""

LAG_ANGLE = 1e-3  # [rad]
"""Phase lag of the force behind the error from which a controller counts as a lag. With a smaller one, the force at
standstill exceeds that of a slip by only a few thousandths. So the slip stops even if Coulomb friction is a
hundredth of static friction."""


@np.errstate(all="ignore")
def _lags(stages: Ensemble) -> np.ndarray:
    """Return which controllers without integral lag, shape (count,).

    The stages are few enough for the memory.
    """
    from friso.frequency.loops import FORCE, STAGE, VELOCITY, compensator

    rate = stages.number("rate")
    mass = stages.number("stiffness") / rate**2
    lowest, highest = LAG_RATES
    omega = rate[:, None] * np.geomspace(lowest, highest, LAG_POINTS)
    control = compensator(stages.flat, stages.count).take((STAGE, VELOCITY), (FORCE,)).at(1j * omega)[:, :, 0]
    stiffness = -(control[..., 0] + 1j * omega * control[..., 1])
    acts = np.abs(stiffness) > mass[:, None] * omega**2
    return np.any(acts & (np.angle(stiffness) < -LAG_ANGLE), axis=1)


def _growths(stages: Ensemble, touched: bool = False) -> dict[LoopState, np.ndarray]:
    """Return the fastest growth rates [1/s] of the loop, sticking and sliding, each (count,).

    They are NaN for equations that are not finite. The stroke limiter is pressed if `touched`.
    """
    stuck = _rates(stages, touched)
    return {"sticks": _growth(stuck), "slides": _growth(_sliding(stages, stuck, np.mean))}


def _growth(matrices: np.ndarray) -> np.ndarray:
    """Return the fastest growth rate [1/s] of each of several linear systems, shape (count,).

    `matrices` have the shape (count, states, states); NaN if one is not finite.
    """
    rates = np.full(len(matrices), np.nan)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    rates[finite] = np.linalg.eigvals(matrices[finite]).real.max(axis=1)
    return rates


def _motor_state(stages: Ensemble, which: int) -> int:
    """Return the index of the motor's position (`which` 0) or velocity (1) among the states.

    Without a transmission it is 0.
    """
    names = stages.kernel.states
    return names.index(MOTOR_STATES[which]) if stages.structure.transmission else 0


DERIVATIVE_STEP_SHARE = 1e-6  # [of the states]
"""Step of numerical derivatives. A smaller one is rounding; a larger one includes the curvature of friction."""


def _displaced_states(stages: Ensemble) -> Iterator[np.ndarray]:
    """Yield states (count, states) at zero but for one state moved slightly, each state in turn."""
    for k, scale in enumerate(stages.scales.T):
        moved = np.zeros(stages.scales.shape)
        moved[:, k] = DERIVATIVE_STEP_SHARE * scale
        yield moved


def _rates(stages: Ensemble, touched: bool = False) -> np.ndarray:
    """Return the Jacobian [1/s] of the loop at rest for each stage, (count, states, states).

    Row i, column j has the derivative of the rate of state i by state j, in units of the states' `scales`. In a
    backlash, the motor stands on a flank. If `touched`, the cart stands at twice the stroke and presses the limiter.
    """
    flank = np.zeros((stages.count, len(stages.kernel.states)))
    if touched:
        flank[:, stages.kernel.cart_position] = 2 * np.asarray(stages.flat["joint.stroke"])
    if stages.structure.plays:  # the loop is open within a backlash
        flank[:, _motor_state(stages, 0)] = stages.flat[BACKLASH]
    moved = ((flank + step, flank - step) for step in _displaced_states(stages))
    columns = [(stages.rates(ahead) - stages.rates(behind)) / (2 * DERIVATIVE_STEP_SHARE) for ahead, behind in moved]
    return np.stack(columns, axis=2) / stages.scales[:, :, None]


VISCOUS_SPEED = 1e3  # [loop speeds]
"""Speed, in units of the loop's, at which friction that falls with speed has become viscous."""


def _sliding(stages: Ensemble, stuck: np.ndarray, of_directions: Callable[..., np.ndarray]) -> np.ndarray:
    """Return the linear systems of sliding stages, without the bristles of the friction law.

    `stuck` are the systems of the sticking stages, (count, states, states). `of_directions` combines the viscous
    friction of the two directions, such as their mean.
    """
    kernel, flat = stages.kernel, stages.flat
    bodies = ("cart", "stage") if stages.structure.joint == "rigid" else ("cart",)
    mass = sum(np.asarray(flat.get(f"masses.{body}", 0.0)) for body in bodies)
    matrix = stuck.copy()
    for output, body, own in (
        ("friction_force", kernel.cart_velocity, mass),
        ("motor_friction_force", _motor_state(stages, 1), np.asarray(flat.get(MOTOR_MASS, 0.0))),
    ):
        if output not in kernel.outputs:
            continue
        unit = stages.scales[:, body]
        for k, step in enumerate(_displaced_states(stages)):
            change = _force(stages, step, output) - _force(stages, -step, output)
            matrix[:, body, k] += change / (2 * DERIVATIVE_STEP_SHARE * own * unit)
        both = [_viscous(stages, way * VISCOUS_SPEED * unit, output) for way in (1.0, -1.0)]
        matrix[:, body, body] -= of_directions(both, axis=0) / own
    bristles = kernel.having(Role.BRISTLE)
    return np.delete(np.delete(matrix, bristles, 1), bristles, 2)


def _viscous(stages: Ensemble, speed: np.ndarray, output: str) -> np.ndarray:
    """Return how steeply friction rises with speed [N s/m] beyond a speed [m/s], (count,).

    It is the mean slope from this speed to twice the speed. `output` names the friction force among the model's
    outputs.
    """
    slow, fast = (_force(stages, _slid(stages, times * speed), output) for times in (1.0, 2.0))
    return (fast - slow) / speed


def _slid(stages: Ensemble, speed: np.ndarray) -> np.ndarray:
    """Return states of stages that have slid at a speed [m/s] until friction is steady.

    The shape is (count, states).
    """
    states = stages.settled(Steady(0.0, 0.0, speed))
    bristles = stages.kernel.having(Role.BRISTLE)
    begun = stages.rates(states)[:, bristles]
    changes = np.empty((stages.count, len(bristles), len(bristles)))
    for column, k in enumerate(bristles):
        moved = states.copy()
        moved[:, k] += stages.scales[:, k]
        changes[:, :, column] = (stages.rates(moved)[:, bristles] - begun) / stages.scales[:, k, None]
    finite = np.isfinite(changes).all(axis=(1, 2))
    states[np.ix_(finite, np.array(bristles, np.intp))] -= (np.linalg.pinv(changes[finite]) @ begun[finite, :, None])[
        :, :, 0
    ]
    return states


def _force(stages: Ensemble, states: np.ndarray, output: str) -> np.ndarray:
    """Return the force [N] that is the model's `output` of this name, shape (count,).

    Stages are in `states`, shape (count, states).
    """
    kernel = stages.kernel
    modes = kernel.modes(states.T, 0.0, np.zeros(3), stages.values)
    rows = kernel.module.outputs(states.T, modes, 0.0, np.zeros(3), stages.values)
    return np.broadcast_to(rows[list(kernel.outputs).index(output)], (stages.count,))
