"""Slow motion on a free joint, the cart sticking and slipping: static friction.

Thesis, Sec. 4.2.3, Fig. 20. While the cart sticks, the joint pulls at it with k_j times the growing deflection; at the
peak the cart breaks away, and its velocity shows a spike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import Estimate, with_interval
from friso.identification.estimate_documents import estimates_document
from friso.identification.kind import TIME, WAYS, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.readings.common import (
    Mean,
    by_direction,
    by_segment,
    by_t,
    channel,
    correlated_mean,
    deflection,
    low_pass,
    on_bearing,
    rate,
    solve_normal_equations,
)
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.identification.readings.motion_events import SPEED_SHARE_OF_AN_ONSET, Slip, slips, static_friction
from friso.intervals import NORMAL_COVERAGE
from friso.shown.documents import entries
from friso.shown.drawing.figure import GREY, INK, Axis, Figure, Markers, Panel, Series
from friso.shown.text import range_with_unit
from friso.stage import Stage

STOPPED = "the force on the cart stops rising before it slips: the limiter was touched, or the sensor is at its end"

KEY = "friction.static"

LOADED = "joint.stiffness", "N/m", "force over deflection while the cart sticks"
"""Key, unit and method of the joint's stiffness from a log of slips."""


@dataclass(frozen=True, kw_only=True)
class StickSlip:
    """Static friction from slow motion that sticks and slips.

    Fields are static friction [N] in total and per direction; the mean break-away force [N] per direction at the
    measured force rate, and its range over the slips (5 to 95 %); a force [N] common to both directions (sensor offset,
    or unequal friction); and the joint's `stiffness` [N/m] from force and deflection of this log.

    Per slip, shape (n,): time [s], place on the rail [m], direction, peak deflection [m] (NaN without sensor),
    break-away force [N] in that direction, force rate [N/s], highest speed of the cart [m/s]. Over time, shape
    (samples,): force on the cart [N] and its speed [m/s].
    """

    static: Estimate
    forward: Estimate
    backward: Estimate
    break_away_forward: Estimate
    break_away_backward: Estimate
    spread: tuple[float, float]
    offset: Estimate
    stiffness: Estimate
    times: np.ndarray
    places: np.ndarray
    directions: np.ndarray
    deflections: np.ndarray
    forces: np.ndarray
    rates: np.ndarray
    speeds: np.ndarray
    pull: np.ndarray
    cart_velocity: np.ndarray
    warnings: tuple[str, ...]


LOW_PASS_OF_STICK_SLIP = 100.0  # [Hz]
"""Low-pass of deflection and velocity in stick-slip motion, faster than any slip."""

STROKE_SHARE_AT_A_STOP = 0.05
"""Distance from the stroke at which the limiter counts as touched, relative to the stroke."""


def static_from_stick_slip(
    log: Log, stiffness: Estimate | float | None = None, stage_mass: float = 0.0, stroke: float = np.inf
) -> StickSlip:
    """Estimate static friction from slow motion that sticks and slips.

    With the joint's `stiffness` [N/m] (an Estimate brings its interval) the force on the cart is stiffness times
    measured deflection; without, the actuator force less `stage_mass` [kg] times the acceleration of the position. The
    effect of the finite force rate is extrapolated or bounded, see `rate_effect`. Slips from a deflection at the
    `stroke` [m] of the joint do not count. Quantities that the record cannot show are unknown, with the reason. Raises
    InputError for missing channels or an unusable stiffness.
    """
    cutoff, measured = LOW_PASS_OF_STICK_SLIP, deflection(log)
    deflected = None if measured is None else by_segment(log, measured, low_pass, cutoff)
    pull, relative_error = _pull(log, stiffness, deflected, _actuator(log, stage_mass, cutoff))
    body = on_bearing(log)
    cart_velocity = np.zeros_like(body)
    rows: list[tuple[float, ...]] = []
    shares, loads = [], []
    for part in log.segments:
        breaks = slips(body[part], log.sample_time, cutoff)
        cart_velocity[part] = breaks.speed
        shares.append(breaks.share)
        for slip in breaks.starts:
            onset, _, rest, top, direction = slip
            at, force, before, rising, held = _peak(direction * pull[part], log.sample_time, cutoff, slip)
            at += part.start
            bent = np.nan if deflected is None else float(direction * deflected[at])
            unseen = _unseen(direction * breaks.speed[onset + 1 : top + 1]) * log.sample_time
            late = max(force - before, 0.0) + abs(rising) * (unseen + 1 / cutoff)
            place = (float(log.time[at]), float(body[at]), float(direction))
            held = held or abs(bent) > (1 - STROKE_SHARE_AT_A_STOP) * stroke
            loads += [] if held else [slice(part.start + rest, part.start + onset)]
            rows.append((*place, bent, force, rising, float(abs(breaks.speed[top])), held, late))
    table = np.array([row for row in rows if row[5] > 0 or row[7]]).reshape(-1, 9).T
    joint_stiffness = _stiffness(log, deflected, loads, cutoff)
    return _answer(table, pull, cart_velocity, relative_error, joint_stiffness, _why(shares))


def _actuator(log: Log, stage_mass: float, cutoff: float) -> np.ndarray | None:
    """Return the low-passed actuator force minus the stage's inertia [N]; None without a force.

    The inertia is `stage_mass` [kg] times the acceleration of the position; both are low-passed at `cutoff` [Hz].
    """
    if "force" not in log:
        return None
    force = by_segment(log, channel(log, "force"), low_pass, cutoff)
    if not stage_mass:
        return force
    return force - stage_mass * _acceleration(log, cutoff)


def _acceleration(log: Log, cutoff: float) -> np.ndarray:
    """Return the acceleration of the position [m/s^2], shape (n,), low-passed at `cutoff` [Hz]."""
    return by_segment(log, by_segment(log, channel(log, "position"), rate, cutoff), rate, cutoff)


def _pull(
    log: Log, stiffness: Estimate | float | None, deflected: np.ndarray | None, pushed: np.ndarray | None
) -> tuple[np.ndarray, float]:
    """Return the low-passed force on the cart [N], and the relative error of its scale.

    The force is the `stiffness` [N/m] times the deflection or, without a stiffness, the actuator force `pushed`. Raises
    InputError for a stiffness that is not positive, and if the log has neither signal.
    """
    if stiffness is None:
        return channel(log, "force") if pushed is None else pushed, 0.0  # raises if missing
    value, half = (stiffness.value, stiffness.half_width) if isinstance(stiffness, Estimate) else (stiffness, 0.0)
    if not (np.isfinite(value) and value > 0 and np.isfinite(half)):
        raise InputError("stiffness", f"{value:g} +/- {half:g} N/m", "a stiffness greater than 0", "2.4 N/mm", log.name)
    if deflected is None:
        deflected = channel(log, "relative_position")  # raises if missing
    return value * deflected, half / NORMAL_COVERAGE / value


def _stiffness(log: Log, deflected: np.ndarray | None, loads: list[slice], cutoff: float) -> Estimate:
    """Estimate the joint's stiffness from force and deflection while the cart sticks (`loads`)."""
    pushed = _actuator(log, 0.0, cutoff)
    if deflected is None or pushed is None or "position" not in log:
        reason = "force, position and deflection are not all measured"
        return Estimate.unknown(*LOADED, reason)
    bending = by_segment(log, deflected, rate, cutoff)
    return stiffness_of_loading(deflected, bending, _acceleration(log, cutoff), pushed, loads)


FEWEST_LOADS = 3
"""Fewest loads of a joint between slips. Fewer give no error of the stiffness."""


def stiffness_of_loading(
    deflection: np.ndarray, rate: np.ndarray, acceleration: np.ndarray, force: np.ndarray, loads: list[slice]
) -> Estimate:
    """Estimate the stiffness [N/m] of a joint that is loaded between slips of the cart.

    The deflection [m] and its rate [m/s], the acceleration of the stage [m/s^2] and the actuator's force [N] are
    low-passed, shape (n,). `loads` are the samples between slips, in which the cart sticks and the joint is loaded.

    Least squares fits a spring, a damper and a mass, with an offset for each load: after a slip the stage swings on its
    joint. The error is by the jackknife over loads. Creep of the cart does not matter. With fewer than three loads the
    stiffness is unknown.
    """
    count = len(loads)
    if count < FEWEST_LOADS:
        return Estimate.unknown(*LOADED, f"{count} loads between slips: {FEWEST_LOADS} are needed")
    signals = [np.stack([x[s] - x[s].mean() for x in (deflection, rate, acceleration, force)]) for s in loads]
    products = np.array([x @ x.T for x in signals])
    if not products[:, 0, 0].sum() > 0:
        return Estimate.unknown(*LOADED, "the deflection stays the same")
    without = np.array([_spring(products.sum(axis=0) - product) for product in products])
    error = float(np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)))
    value = _spring(products.sum(axis=0))
    linear, (key, unit, method) = LINEARITY_OF_SENSORS * abs(value), LOADED
    estimate = by_t(key, unit, Mean(value, error, count - 1), method, linear, linear)
    return estimate.if_positive("more deflection does not need more force")


def _spring(products: np.ndarray) -> float:
    """Fit the last of several signals by all others, and return the coefficient of the first.

    `products`, shape (signals, signals), are the scalar products of the signals.
    """
    return float(solve_normal_equations(products[:-1, :-1], products[:-1, -1])[0])


SHARE_NEAR_A_PEAK = 0.01
"""Distance below its peak within which the force counts as near the peak, relative to the peak."""

DURATION_NEAR_A_PEAK = 4.0
"""Time near the peak above which a force had stopped rising, relative to the usual time."""


def _peak(pull: np.ndarray, sample_time: float, cutoff: float, slip: Slip) -> tuple[int, float, float, float, bool]:
    """Find the peak of the force on the cart, `pull`, between the start of a slip and top speed.

    `pull` [N] is positive in the direction of the slip. Returns the peak's sample and height, the pull at the onset of
    visible motion, and the rate of the pull over the last third of the rest.

    The last result is true if the pull had stopped rising. It then stayed within a hundredth of the peak for several
    times as long as its usual rate and the filter take.
    """
    onset, start, rest, top, _ = slip
    at = start + int(np.argmax(pull[start : top + 1]))
    begin = max(onset - max((onset - rest) // 3, 5), 0)
    rising = (pull[onset] - pull[begin]) / ((onset - begin) * sample_time)
    tenths = np.unique(np.linspace(rest, onset, 11).astype(int))
    usual = float(np.median(np.diff(pull[tenths]) / (np.diff(tenths) * sample_time)))
    share, times = SHARE_NEAR_A_PEAK, DURATION_NEAR_A_PEAK
    near = float((pull[rest : at + 1] > (1 - share) * pull[at]).sum()) * sample_time
    held = not usual > 0 or near > times * (share * abs(pull[at] / usual) + 1 / cutoff)
    return at, float(pull[at]), float(pull[onset]), float(rising), bool(held)


def _unseen(speed: np.ndarray) -> float:
    """Estimate for how many samples before its first visible one a motion was hidden in noise.

    `speed`, shape (n,), runs from the first visible sample to the maximum. Before, it is taken to have doubled in equal
    times, as in its first visible doubling. An evenly accelerating body would be hidden for less.
    """
    first, top = float(speed[0]), float(speed[-1])
    if not first > SPEED_SHARE_OF_AN_ONSET * top:
        return 0.0
    doubled = int(np.argmax(speed >= min(2 * first, top)))
    return doubled * float(np.log2(first / (SPEED_SHARE_OF_AN_ONSET * top)))


TIME_SHARE_OF_SLIDING = 0.6
"""Fraction of time above the slip threshold beyond which a body slides rather than sticks and slips."""


def _why(shares: list[float]) -> str:
    """Return why a log has no slips, from the fractions of time spent sliding."""
    if shares and min(shares) > TIME_SHARE_OF_SLIDING:
        return "the cart slides all the time"
    return "the cart shows no slips out of rest"


SHARE_OF_HELD_SLIPS = 0.5
"""Fraction of slips without a rising force above which the log does not show static friction."""


def _answer(
    table: np.ndarray, pull: np.ndarray, velocity: np.ndarray, relative_error: float, stiffness: Estimate, why: str
) -> StickSlip:
    """Make the result from the `table` of all slips: a row per quantity, a column per slip.

    `pull` [N] and `velocity` [m/s] are the cart's over time. `why` says why a direction may have no slips. Static
    friction has only a lower bound if, before most slips, the pull had stopped rising or the joint was at its stroke.
    """
    times, places, directions, deflections, forces, rates, speeds, held, late = table

    def static(chosen: np.ndarray, words: str) -> Estimate:
        if not chosen.any():
            return Estimate.unknown(KEY, "N", f"stick-slip{words}", f"{why}{words}", 0.0)
        if held[chosen].mean() > SHARE_OF_HELD_SLIPS:
            low = max(0.0, float(forces[chosen].mean() * (1 - relative_error * NORMAL_COVERAGE)))
            return Estimate.unknown(KEY, "N", f"stick-slip{words}", STOPPED, low)
        used = chosen & (rates > 0)  # ranges of held mean values may be missing
        return static_friction(KEY, forces[used], rates[used], relative_error, late[used].mean())

    masks = dict(by_direction(directions))
    means = {name: _mean(f"break-away force, {name}", forces[m], relative_error, why) for name, m in masks.items()}
    forward, backward = (static(mask, f" {words}") for words, mask in masks.items())
    shown = forward.determined or backward.determined
    every = _both(forward, backward) if shown else static(np.ones(len(forces), dtype=bool), "")
    low, high = np.percentile(forces, [5, 95]) if len(forces) else (np.nan, np.nan)
    offset = _offset(means["forward"], means["backward"])
    return StickSlip(
        static=every,
        forward=forward,
        backward=backward,
        break_away_forward=means["forward"],
        break_away_backward=means["backward"],
        spread=(float(low), float(high)),
        offset=offset,
        stiffness=stiffness,
        times=times,
        places=places,
        directions=directions,
        deflections=deflections,
        forces=forces,
        rates=rates,
        speeds=speeds,
        pull=pull,
        cart_velocity=velocity,
        warnings=_notes(len(forces), offset),
    )


def _notes(count: int, offset: Estimate) -> tuple[str, ...]:
    """List notes on the zero of the force, on unequal directions, and on few slips."""
    notes = []
    if count and not offset.determined:
        notes.append("The zero of the force on the cart is used as measured; slips in one direction cannot verify it.")
    elif count and not offset.holds(0.0):
        size = f"{2 * abs(offset.value):.3g} N"
        notes.append(f"The directions differ by {size}: an offset of the sensor, or unequal friction.")
    if 0 < count < 5:
        notes.append(f"Only {count} slips: the range along the rail is not shown.")
    return tuple(notes)


def _mean(name: str, forces: np.ndarray, relative_error: float, why: str) -> Estimate:
    """Return the mean break-away force of one direction, named `name`.

    `relative_error` is that of the scale of the forces. The mean is not determined with fewer than two slips; `why`
    says why there are none.
    """
    method = "mean of the peaks of the force on the cart before slips"
    if len(forces) < 2:
        return Estimate.unknown(name, "N", method, f"{len(forces)} slips: {why}" if not len(forces) else "1 slip")
    mean = correlated_mean(forces)
    error = float(np.hypot(mean.error, relative_error * mean.value))
    return by_t(name, "N", Mean(mean.value, error, mean.freedom), method)


def _both(forward: Estimate, backward: Estimate) -> Estimate:
    """Return the mean of both directions, in which a common offset cancels.

    If the cart slips in one direction only, this direction's value counts. If one direction gives a value and the other
    a bound, the result is a bound, because the offset is not known.
    """
    if not (forward.determined and backward.determined):
        seen, unseen = (forward, backward) if forward.determined else (backward, forward)
        if not unseen.low > 0:  # no slips at all
            return seen
        low = (forward.low + backward.low) / 2
        return Estimate.unknown(KEY, "N", seen.method, f"one direction alone shows it: {unseen.reason}", low)
    value, low, high, systematic = (
        (getattr(forward, name) + getattr(backward, name)) / 2 for name in ("value", "low", "high", "systematic")
    )
    method = f"mean of both directions: {forward.method}"
    return Estimate(KEY, "N", value, low, high, method, systematic=systematic)


def _offset(forward: Estimate, backward: Estimate) -> Estimate:
    """Return half of the difference between forward and backward break-away force.

    The offset is not determined if the cart slips in one direction only.
    """
    name = "offset of the force on the cart"
    method = "half the difference of the break-away forces forward and backward"
    if not (forward.determined and backward.determined):
        return Estimate.unknown(name, "N", method, "slips in one direction only")
    half = float(np.hypot(forward.half_width, backward.half_width)) / 2
    middle = (forward.value - backward.value) / 2
    return Estimate(name, "N", middle, middle - half, middle + half, method)


STIFFNESS_SHARE_OF_A_LIMITER = 0.1
"""Largest stiffness of a joint, relative to its limiter's stiffness."""


def _of_joint(stiffness: Estimate, stage: Stage | None) -> bool:
    """Tell whether a stiffness is the joint's, not that of a limiter that holds it."""
    if stage is None or stage.joint is None or not stiffness.determined:
        return False
    limiter = stage.flat()["joint.limiter_stiffness"]
    return bool(stiffness.value < STIFFNESS_SHARE_OF_A_LIMITER * limiter)


def _broken(values: np.ndarray, log: Log) -> np.ndarray:
    """Break the line of a signal of shape (n,) at the gaps of a log.

    The last sample before each gap becomes NaN.
    """
    broken = values.astype(float)
    broken[[part.stop - 1 for part in log.segments[:-1]]] = np.nan
    return broken


class StickSlipKind(ExperimentKind[StickSlip]):
    """Slow motion that sticks and slips, which shows static friction."""

    title = "Stick-slip"
    after = ("frequency", "moves", "steps")
    roles = ("relative_position|position", "force")

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> StickSlip:
        """Analyse a stick-slip log, with the joint's stiffness from the best available source."""
        flat, (_, mass) = prior.flat(log), prior.masses(log)
        stroke, stiffness = flat.get("joint.stroke", np.inf), prior.estimates.get("joint.stiffness")
        result = static_from_stick_slip(log, stiffness or flat.get("joint.stiffness"), mass, stroke)
        if stiffness is None and result.stiffness.determined:
            return static_from_stick_slip(log, result.stiffness, mass, stroke)
        return result

    def estimates(self, result: StickSlip, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return static friction, and the stiffness if it is that of the stage's joint."""
        return (result.static, *([result.stiffness] if _of_joint(result.stiffness, stage) else ()))

    def facts(self, result: StickSlip) -> Facts:
        """List static friction, break-away forces and the joint's stiffness."""
        facts = [
            ("Static friction", with_interval(result.static)),
            ("Forward", with_interval(result.forward)),
            ("Backward", with_interval(result.backward)),
            ("Break-away force as measured, forward", with_interval(result.break_away_forward)),
            ("Break-away force as measured, backward", with_interval(result.break_away_backward)),
            ("Force common to both directions", with_interval(result.offset)),
            ("Stiffness of the joint", with_interval(result.stiffness)),
            ("Slips", str(len(result.times))),
        ]
        if len(result.times):
            facts.append(("Break-away forces, 5 % to 95 % of the slips", range_with_unit(*result.spread, "N")))
        return tuple(facts)

    def numbers(self, result: StickSlip) -> dict[str, Any]:
        """Return static friction with all slips, for the document."""
        sides = estimates_document(result, "forward", "backward", "break_away_forward", "break_away_backward")
        estimates = estimates_document(result, "static", "offset", "stiffness")
        return {**sides, **estimates, "slips": len(result.times), **entries(result, "spread_n", "warnings")}

    def figures(self, result: StickSlip, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw the force on the cart with its peaks, and the cart's speed, over time."""
        (log,) = logs
        assert isinstance(log, Log)
        pull = Series(log.time, _broken(result.pull, log), "force on the cart", GREY, width=1.0)
        peaks = tuple(
            Markers(result.times[chosen], sign * result.forces[chosen], f"break-away, {word}", WAYS[word], "triangle")
            for word, sign, chosen in (("forward", 1, result.directions > 0), ("backward", -1, result.directions < 0))
            if chosen.any()
        )
        speed = Series(log.time, _broken(result.cart_velocity, log), "", INK, width=0.9)
        time = replace(TIME, limits=(float(log.time[0]), float(log.time[-1])))
        panels = (
            Panel("", time, Axis("Force on the cart", "N"), (pull,), peaks),
            Panel("", time, Axis("Velocity of the cart", "m/s"), (speed,)),
        )
        caption = (
            "While the cart sticks, the force on it grows; at the peak it breaks away, and its velocity shows a spike. "
            f"Static friction: {with_interval(result.static)}."
        )
        return [Figure(f"{name}_slips", "Stick-slip", caption, panels)]


KIND = StickSlipKind()
