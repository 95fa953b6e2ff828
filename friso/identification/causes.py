"""Why a log may not be described by a mass with friction: a delay, a constant force, a mode in the band."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import welch

from friso.errors import InputError
from friso.identification.inverse_model import InverseModel, inverse_model
from friso.identification.logs.log import Log

LAGS = (-16, -8, -4, -2, -1, 1, 2, 4, 8, 16)
"""Samples by which the force is moved in the search for a delay, and then by a quarter of the best more and less."""

BETTER = 0.7
"""Share of the error that is left once a cause is taken away that counts as found."""

PEAK = 0.5
"""Share of the power of what is left in one peak from which on that counts as an oscillation."""

UNKNOWN = (
    "a delay, a constant force and a mode in the band were looked for, and none of them explains it: check --scale, "
    "its sign too, and which channel is which"
)
"""What to do where no cause is found."""


@dataclass(frozen=True)
class Cause:
    """What may be wrong with a log, in a sentence; the inverse model without it, where there is one."""

    sentence: str
    without: InverseModel | None = None


def causes(log: Log, inverse: InverseModel, cart_share: float) -> list[Cause]:
    """What may be wrong with a log that the inverse model does not describe, as far as the log tells; nothing where
    none of these explains it."""
    plain = (_constant(inverse, log.unit("force")), _oscillation(inverse))
    return [*_delay(log, inverse, cart_share), *(Cause(sentence) for sentence in plain if sentence)]


def _delay(log: Log, inverse: InverseModel, cart_share: float) -> list[Cause]:
    """The delay between force and motion that makes the inverse model fit much better, if one does."""
    fits: dict[int, InverseModel] = {}

    def tried(lags: Iterable[int]) -> int | None:
        for lag in lags:
            moved = replace(log, signals={**log.signals, "force": np.roll(log["force"], lag)})
            with suppress(InputError):
                fits[lag] = inverse_model(moved, inverse.bandwidth, False, cart_share)
        return min(fits, key=lambda lag: fits[lag].error, default=None)

    rough = tried(LAGS)
    lag = None if rough is None else tried({rough - abs(rough) // 4, rough + abs(rough) // 4} - {rough})
    if lag is None or fits[lag].error > BETTER * inverse.error:
        return []
    shift = f"{abs(lag) * log.sample_time * 1e3:.3g} ms {'earlier' if lag < 0 else 'later'}"
    return [Cause(f"a force {shift} fits much better: a delay between the channels?", fits[lag])]


def _constant(inverse: InverseModel, unit: str) -> str:
    offset, coulomb = (abs(inverse.value(name)) for name in ("offset", "coulomb"))
    if offset <= max(coulomb, 0.1 * float(np.std(inverse.measured))):
        return ""
    return f"a constant force of {inverse.value('offset'):.3g} {unit} is larger than friction: gravity, or an offset?"


def _oscillation(inverse: InverseModel) -> str:
    left = inverse.measured - inverse.fitted
    step = float(np.median(np.diff(inverse.time)))
    rates, power = welch(left, 1 / step, nperseg=min(len(left), 256))
    peak = int(np.argmax(power))
    share = power[max(peak - 1, 0) : peak + 2].sum() / power.sum() if power.sum() > 0 else 0.0
    if share < PEAK or peak == 0:
        return ""
    return f"{100 * share:.0f} % of what is left swings at {rates[peak]:.3g} Hz: a mode in the band?"
