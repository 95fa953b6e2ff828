"""Doubts about estimated values, and about what a log can show of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, KeyCase, RaisedDoubt, TriedForces, ValueCase, refused
from friso.identification.estimate import Estimate
from friso.identification.output_error.fit import (
    COST_SHARE_OF_REFINEMENT,
    SEED_OF_REPETITIONS,
    mean_square,
    refine_fit,
    simulated_log,
)
from friso.identification.output_error.parameters import (
    BRISTLES,
    CURVE,
    HIGHEST_FRICTION_RATIO,
    MASS,
    is_free,
    stribeck_up_to,
)
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import by_direction, robust, stribeck_curve
from friso.identification.readings.course import FEWEST_RAMPS
from friso.identification.readings.motion_events import Ramps, force_ramps
from friso.intervals import NORMAL_COVERAGE
from friso.quantities import non_negative, positive
from friso.stage import Stage, numeric_keys, plausible

MEDIAN_ERROR_RATIO = 1.25
"""Ratio of the standard deviations of median and mean, for normal errors: sqrt(pi / 2), rounded."""


def find_break_away_friction(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Compare the friction at which motions begin with the fitted static friction.

    A stage that follows a log shows friction while it moves, and the Stribeck curve extrapolates to standstill. For a
    body that sticks by another law, or with another exponent, the extrapolated static friction is too low.
    """
    if is_free(case.flat) or (case.fit.problem.closed and case.fit.explains(case.quality.noise)):
        return
    ramps = force_ramps(case.log.per_unit_of_force(), case.fit.value(MASS))
    more = friction_beyond(case.determined, case.fit.stage, ramps)
    if more is not None:
        static, unit = case.determined["friction.static"].value, case.unit
        why = f"motions begin with {more:.3g} {unit} of friction, more than the {static:.3g} {unit} of the fit"
        yield RaisedDoubt(words="", size=more - static, unit=case.unit, refuses=dict.fromkeys(CURVE, why))


def friction_beyond(determined: Mapping[str, Any], flat: Mapping[str, Any], ramps: Ramps) -> float | None:
    """Return the friction [N] at which motions begin if it exceeds the fitted static friction.

    Returns None if it does not exceed the interval of static friction, or with too few ramps in either direction.
    `determined` has estimates by key, `flat` the fitted stage, and `ramps` the forces at which motions begin.
    """
    static = determined.get("friction.static")
    sides = [side for _, side in by_direction(ramps.directions)]
    if static is None or len(ramps.forces) < FEWEST_RAMPS:
        return None
    if not all(side.any() for side in sides):
        return None
    bias = sum(one.value for name, one in determined.items() if name.startswith("bias."))
    friction = ramps.forces + ramps.directions * bias - _rises(flat, ramps.speeds)
    medians = [float(np.median(friction[side])) for side in sides]
    middle = float(np.mean(medians))
    apart = robust(friction - np.where(sides[0], *medians))
    scatter = MEDIAN_ERROR_RATIO * apart * np.sqrt(sum(1 / side.sum() for side in sides)) / len(sides)
    unsure = NORMAL_COVERAGE * scatter + float(np.median(ramps.unsure))
    return middle if middle - unsure > static.high else None


SPEEDS_OF_A_START = 50
"""Number of speeds at which a fitted friction curve is evaluated, up to the speed of a body that just began to
move."""


def _rises(flat: Mapping[str, Any], speeds: np.ndarray) -> np.ndarray:
    """Return how far friction can exceed static friction [N], up to each of the speeds [m/s].

    The result has the shape (n,). Viscous friction may rise faster than the Stribeck curve falls.
    """
    static, coulomb = flat["friction.static"], flat["friction.coulomb"]
    up_to = np.linspace(0, 1, SPEEDS_OF_A_START)[:, None] * speeds
    exponent = flat.get("friction.stribeck_exponent", 2.0)
    curve = stribeck_curve(up_to, coulomb, static, flat["friction.stribeck_velocity"], exponent)
    viscous = flat["friction.viscous"] * (1 + abs(flat.get("friction.viscous_asymmetry", 0.0)))
    return (curve + viscous * up_to).max(axis=0) - static


BREAK_AWAY_FRICTION = Doubt(
    "curve",
    find_break_away_friction,
    "the friction at which motions begin",
    "static friction and the Stribeck curve are refused",
    "force ramps from rest (break-away)",
)


WHY_OF_DECAYING_DAMPING = "bristle damping that falls with the speed explains the record better than constant damping"


def find_decaying_damping(case: FitCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if damping that falls with the speed explains part of the residual.

    The damping of friso's bristles is constant; another form falls as exp(-(v/v_s)^2) (Olsson et al. 1998,
    doi:10.1016/S0947-3580(98)70113-X). On logs of the other form, bristles came out up to 1.8 times too stiff.
    """
    for tried, explained in case.explained(forces):
        if explained.sizes[0] > tried.least and explained.sure(case.fit)[0]:
            yield RaisedDoubt(
                refuses=dict.fromkeys(BRISTLES, WHY_OF_DECAYING_DAMPING), fit=case.reaching(explained.moved)
            )


TRIED_FALLING_DAMPING = 0.1
"""Tried damping at rest of bristles whose damping falls with the speed, relative to half of the critical one."""

LEAST_FALLING_DAMPING = 0.1
"""Smallest fitted damping at rest that counts as falling, relative to half of the critical one."""


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that falling damping saves along the log, for half of the critical damping at rest."""
    bristles = case.bristles()
    if bristles is None:
        return
    damping = np.sqrt(case.fit.value(BRISTLES[0]) * case.fit.value(MASS))
    saved = damping * bristles.rate * (1 - np.exp(-(bristles.speed**2)))
    yield TriedForces([saved], [TRIED_FALLING_DAMPING], least=LEAST_FALLING_DAMPING)


DECAYING_DAMPING = Doubt(
    "fit",
    find_decaying_damping,
    "the force that bristles save whose damping falls with the speed",
    "bristles are refused",
    "small motion before sliding",
    after=("friction-by-direction",),
    forces=forces,
    of_form=True,
)


def find_implausible_value(case: tuple[Stage, Sequence[Estimate]]) -> Iterator[RaisedDoubt]:
    """List identified keys of a stage whose values are implausible.

    `case` has the stage and the estimates.
    """
    stage, estimates = case
    keys = [estimate.name for estimate in estimates if estimate.determined]
    for sentence in plausible.implausible_values(stage):
        if sentence.partition(" ")[0] in keys:
            yield RaisedDoubt(words=f"{sentence}: a wrong unit or --scale of a channel?")


IMPLAUSIBLE_VALUE = Doubt(
    "stage",
    find_implausible_value,
    "values that no positioning stage has",
    "reported",
    "units and scales of the channels",
)


NOT_ABOVE_ZERO = "its interval reaches down to zero"
"""Reason given for a quantity without a value: it must be positive but its interval contains zero."""

NEGATIVE = "it comes out negative, which it cannot be"
"""Reason given for a quantity without a value: its whole interval is negative."""


def find_impossible_value(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Cut intervals at 0 for keys that cannot be negative, and withhold impossible values.

    An estimate whose whole interval is negative is withheld. A key that must be positive gets an upper bound only, if
    its interval contains 0.
    """
    bounds = {key: declared.bound for key, declared in numeric_keys(case.flat).items()}
    answers = {}
    for key, one in case.determined.items():
        bound = bounds.get(key)
        if one.high < 0 and bound in (non_negative, positive):
            answers[key] = one.withheld(NEGATIVE, 0.0)
        elif one.low < 0 and bound is non_negative:
            answers[key] = replace(one, value=max(one.value, 0.0), low=0.0)
        elif one.low <= 0 and bound is positive:
            answers[key] = one.withheld(NOT_ABOVE_ZERO, 0.0, one.high)
    if answers:
        yield RaisedDoubt(answers=answers)


IMPOSSIBLE_VALUE = Doubt(
    "key",
    find_impossible_value,
    "the bounds of the keys",
    "intervals are cut; negative values are refused",
    "a longer log",
)


FORCE_SHARE_OF_NO_FRICTION = 1e-3
"""Smallest possible Coulomb friction, relative to the force's standard deviation."""


def find_little_friction(case: ValueCase) -> Iterator[RaisedDoubt]:
    """Compare the Coulomb friction of the inverse model with zero, and with the whole force.

    In a log with one direction of motion, friction and a constant force cannot be separated, and may cancel.
    """
    value, unit = case.inverse.value("coulomb"), case.unit
    least = FORCE_SHARE_OF_NO_FRICTION * float(np.std(case.inverse.measured))
    if value < least:
        yield RaisedDoubt(words=_sentence(case, value, least), size=value, unit=unit)


def _sentence(case: ValueCase, value: float, least: float) -> str:
    """Write the sentence on possible causes of little, or negative, friction.

    `value` is the Coulomb friction of the inverse model, and `least` the size below which it counts as none, both in
    the unit of the force.
    """
    one, unit = case.inverse.estimate("coulomb"), case.unit
    if not one.determined:
        says, does = ("which helps the motion", "exceeds") if value <= -least else ("next to nothing", "may hide")
        return (
            f"Coulomb friction and the constant force are {value:.2g} {unit} together, {says}: the log moves in one "
            f"direction only, and gravity, or an offset of the channel, {does} friction"
        )
    if value > -least:
        return (
            f"Coulomb friction is estimated as {value:.2g} {unit}, next to nothing: no friction in this force, a wrong "
            "--scale, or friction that a drive compensates"
        )
    interval = f"{value:.3g} {unit} ({one.low:.3g} to {one.high:.3g})"
    if one.high >= 0:
        return f"The log does not tell Coulomb friction from none: it is estimated as {interval}"
    return (
        f"Coulomb friction is estimated as {interval}, negative, as that of no bearing is: the force leaves out what a "
        "drive adds against friction, or more, another channel is taken for it, or the stage hardly slides"
    )


LITTLE_FRICTION = Doubt(
    "value",
    find_little_friction,
    "the Coulomb friction of the inverse model",
    "reported",
    "a log of the whole force of the drive",
)


def find_lost_inertia(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Compare the force that accelerates the masses with the residual beyond noise.

    Any part of the residual may pass for inertia. A mass is withheld if its inertia force is smaller than the residual.
    Otherwise the relative uncertainty of the mass is at least the squared ratio of residual to inertia (friso's
    choice).
    """
    masses = {key: one for key, one in case.determined.items() if key in ("masses.cart", "masses.stage")}
    inertia = sum(mass.value for mass in masses.values()) * float(np.sqrt(np.mean(case.acceleration**2)))
    if inertia < case.unexplained:
        left = f"{case.unexplained:.2g} {case.unit}"
        why = f"its inertia, {inertia:.2g} {case.unit}, is less than what the model leaves unexplained, {left}"
        yield RaisedDoubt(size=inertia, unit=case.unit, refuses=dict.fromkeys(masses, why))
    elif masses and inertia > 0:
        share = (case.unexplained / inertia) ** 2
        answers = {key: one.reaching((1 - share) * one.value, (1 + share) * one.value) for key, one in masses.items()}
        yield RaisedDoubt(size=inertia, unit=case.unit, answers=answers)


LOST_INERTIA = Doubt(
    "key",
    find_lost_inertia,
    "the inertia beside what the model leaves unexplained",
    "masses widen, or are refused",
    "faster moves, or a frequency response",
    after=("slow-motion",),
)


SLIDING = ("friction.coulomb", "friction.viscous", "friction.viscous_asymmetry")
"""Keys of friction beyond the Stribeck effect."""


STRIBECK_VELOCITIES_OF_SLIDING = 2.0
"""Speed, in Stribeck velocities, at which 2 % of the Stribeck effect is left (exponent 2)."""


def find_slow_motion(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse friction of a record that is too slow for the Stribeck effect to decay.

    Such a record shows the sum of the effect and Coulomb friction, of which Coulomb friction is at least a quarter, and
    at most all of it at the highest speed. The record must reach a multiple of the Stribeck velocity. If the velocity
    is not determined, it may be the highest of any bearing, which the record must reach.
    """
    if "friction.stribeck_velocity" not in case.flat:
        return
    stribeck = case.determined.get("friction.stribeck_velocity")
    enough = STRIBECK_VELOCITIES_OF_SLIDING
    top = float(np.abs(case.velocity).max())
    if top >= (enough * stribeck.high if stribeck else stribeck_up_to(case.flat)):
        return
    why = f"the log moves at {top * 1e3:.3g} mm/s at most, where the Stribeck effect may still act"
    coulomb, viscous = (case.determined.get(key) for key in SLIDING[:2])
    if coulomb and viscous:
        why = f"{why}: {coulomb.value + viscous.value * top:.3g} {case.unit} is friction there"
    answers = _bounded(case.estimates, coulomb, viscous.high * top if viscous else np.inf, why) if coulomb else {}
    refuses = {key: why for key in SLIDING if key not in answers}
    yield RaisedDoubt(size=top, unit="m/s", answers=answers, refuses=refuses)


def _bounded(estimates: Sequence[Estimate], coulomb: Estimate, rise: float, why: str) -> dict[str, Estimate]:
    """Return the range of Coulomb friction, which is left without a value, and that of static friction without one.

    `why` is the reason. `rise` [N] is by how much friction exceeds the fitted Coulomb friction at the highest speed: at
    most all of it is Coulomb friction, since a Stribeck effect that still acts may pass for viscous friction.
    """
    (bounded,) = refused([coulomb], {coulomb.name: why}).values()
    bounded = replace(bounded, high=bounded.high + max(rise, 0.0))
    highest = HIGHEST_FRICTION_RATIO * bounded.high
    static = [one for one in estimates if one.name == "friction.static" and not one.determined]
    return {coulomb.name: bounded, **{one.name: one.reaching(bounded.low, highest) for one in static}}


SLOW_MOTION = Doubt(
    "key",
    find_slow_motion,
    "the highest speed of the record",
    "Coulomb and viscous friction are refused",
    "faster moves",
    after=("impossible-value",),
)


STIFFNESS = "friction.bristle_stiffness"
WHY_OF_STIFFER_BRISTLES = "errors of the position would leave as much force unexplained on stiffer bristles"


STIFFNESSES_TRIED = (4.0, 8.0, 16.0)
"""Stiffnesses of bristles that are tried beside the fitted one, relative to it."""


def find_stiffer_bristles(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if stiffer ones would explain the record as well as its position allows.

    An error of the position bends stiff bristles more than soft ones, so that a fit prefers soft ones (errors in
    variables: Fuller 1987, doi:10.1002/9780470316665). Each stiffness that is tried, with all else refitted, leaves a
    residual beside the record, and one beside a simulated log of its own machine. The first must exceed the second.
    """
    fit = case.fit
    if STIFFNESS not in case.determined or fit.problem.closed:
        return
    place = fit.problem.names.index(STIFFNESS)
    most = np.log(fit.problem.parameters[place].high) - fit.inner[place]
    stiffer = np.array([more for more in np.log(STIFFNESSES_TRIED) if more <= most])
    tried = np.repeat(fit.inner[None], 1 + len(stiffer), axis=0)
    tried[1:, place] += stiffer
    free = np.isin(np.arange(len(fit.inner)), [number for number in fit.free if number != place])
    until = settings.iterations_of_a_profile, COST_SHARE_OF_REFINEMENT
    refitted = refine_fit([fit.problem], tried, free, *until, slopes=fit.slopes)
    rng = np.random.default_rng(SEED_OF_REPETITIONS)
    beyond = [
        cost / mean_square(_own_log(case, inner, rng).residuals(inner[None]))[0]
        for inner, cost in zip(refitted.inner, refitted.cost, strict=True)
        if np.isfinite(cost)
    ]
    if np.isfinite(refitted.cost[0]) and min(beyond[1:], default=np.inf) <= max(1.0, beyond[0]):
        yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY_OF_STIFFER_BRISTLES))


def _own_log(case: KeyCase, inner: np.ndarray, rng: np.random.Generator) -> Problem:
    """Return the problem of fitting a simulated log of the machine with the fitted numbers `inner`."""
    bandwidth, noise = case.inverse.bandwidth, case.quality.noise
    return simulated_log(case.fit.problem, inner, case.log, case.log.longest, bandwidth, noise, rng)


STIFFER_BRISTLES = Doubt(
    "key",
    find_stiffer_bristles,
    "what stiffer bristles leave unexplained, beside what errors of the position leave on them",
    "bristles are refused",
    "an encoder of finer resolution, or small motion before sliding",
    after=("impossible-value",),
)
