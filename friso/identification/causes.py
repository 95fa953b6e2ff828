"""Why a log may not be described by a mass with friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from friso.identification.alternatives import alternatives, perhaps_fed_forward
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.checks import CLIPPED, clipped_share, jumps
from friso.identification.logs.log import Log
from friso.quantities import percent

PEAK = 0.5
"""Share of the residual's power in one peak from which on it counts as an oscillation."""

FRAGMENT = 0.2
"""Share of a record in its longest stretch without gaps up to which the gaps are named."""

COARSE = 500
"""Steps of the position's digits over the whole travel from which on these are fine enough not to be named."""

UNKNOWN = (
    "a delay, a filter, a constant force, one that drifts or varies with position, a missing feedforward and a mode in "
    "the band were considered, and none explains it: check --scale, including its sign, and which channel is which"
)
"""What to do where no cause is found."""


@dataclass(frozen=True)
class Cause:
    """What may be wrong with a log, in a sentence; the inverse model without it, where there is one; and whether it
    passes for slow friction."""

    sentence: str
    without: InverseModel | None = None
    spoils: bool = False


def causes(log: Log, inverse: InverseModel, cart_share: float) -> list[Cause]:
    """What may be wrong with a log that the inverse model does not describe, as far as the log tells; nothing where
    none of these explains it."""
    better = [Cause(other.sentence, other.model, True) for other in alternatives(log, inverse, cart_share)]
    of_record = [_jump(log), _coarse(log)]
    fed = "" if better else perhaps_fed_forward(log, inverse, cart_share)
    plain = [_constant(inverse, log.unit("force")), fed, "" if better else _oscillation(inverse)]
    first, last = ([Cause(sentence) for sentence in sentences if sentence] for sentences in (of_record, plain))
    return [*first, *better, *_clipped(log), *last]


def fragment(log: Log) -> str:
    """A sentence on a record of which gaps leave little to fit; "" for one that is whole, or nearly."""
    part, step = log.longest, log.sample_time
    count = part.stop - part.start
    if count > FRAGMENT * len(log.time):
        return ""
    return (
        f"The record has gaps, and the longest stretch without one, {step * count:.3g} s of "
        f"{step * len(log.time):.3g} s, is all that is fitted: export it without gaps"
    )


def _jump(log: Log) -> str:
    part = log.longest
    size, sample = jumps(log["position"][part])
    if not size:
        return ""
    at = log.time[part][sample]
    return f"the position jumps by {size:.3g} m at {at:.4g} s, as after homing or a reset: cut the record there"


def _coarse(log: Log) -> str:
    position = log["position"][log.longest]
    steps = np.abs(np.diff(position))
    digit, travel = float(steps[steps > 0].min(initial=np.inf)), float(np.ptp(position))
    if digit * COARSE < travel:
        return ""
    return f"the position has steps of {digit:.2g} m over a travel of {travel:.3g} m: log it with more digits"


def _clipped(log: Log) -> list[Cause]:
    share = clipped_share(log["force"])
    sentence = f"{percent(share)} of the force samples lie at its extremes: the channel clips"
    return [Cause(sentence, None, True)] if share > CLIPPED else []


def _constant(inverse: InverseModel, unit: str) -> str:
    offset, coulomb = (abs(inverse.value(name)) for name in ("offset", "coulomb"))
    if offset <= max(coulomb, 0.1 * float(np.std(inverse.measured))):
        return ""
    force = f"{inverse.value('offset'):.3g} {unit}"
    return f"a constant force of {force} exceeds the friction: gravity, or an offset of the channel"


def _oscillation(inverse: InverseModel) -> str:
    left = inverse.measured - inverse.fitted
    step = float(np.median(np.diff(inverse.time)))
    rates, power = welch(left, 1 / step, nperseg=min(len(left), 256))
    peak = int(np.argmax(power))
    share = power[max(peak - 1, 0) : peak + 2].sum() / power.sum() if power.sum() > 0 else 0.0
    if share < PEAK or peak == 0:
        return ""
    return (
        f"{percent(share)} of the power of the residual is near {rates[peak]:.3g} Hz: a mode in the band, or a force "
        "that repeats along the way, such as cogging"
    )
