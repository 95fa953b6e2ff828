"""Doubt: force and motion differ in timing: one is delayed, or averaged by a filter or a slow channel."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from friso.errors import InputError
from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.log import Log
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Search for the shift of the force, and the average of force or motion, that fit best.

    Lags and widths of 1, 2, 4, ... samples are tried; the best is then refined once to either side.
    """
    log = case.log
    fits: dict[tuple[int, int], InverseModel] = {(0, 1): case.inverse}

    def best(tried: Iterable[tuple[int, int]]) -> tuple[int, int]:
        for lag, width in tried:
            with suppress(InputError):
                fits[lag, width] = _with_timing(case, lag, width)
        return min(fits, key=lambda choice: fits[choice].error)

    period = 1 / (case.inverse.bandwidth * log.sample_time)
    latest = doubt_settings.motion_periods_of_a_shift * period
    widest = doubt_settings.motion_periods_of_an_average * period / 2
    lag, _ = best((sign * lag, 1) for lag in _doubling(latest) for sign in (1, -1))
    lag, _ = plain = best((lag + more, 1) for more in (-abs(lag) // 4, abs(lag) // 4) if more)
    _, width = best((lag, sign * (2 * half + 1)) for half in _doubling(widest) for sign in (1, -1))
    wider = abs(width) // 2 | 1
    lag, width = best((lag, (1 if width > 0 else -1) * (abs(width) + sign * (wider - 1))) for sign in (-1, 1))
    lag, width = filtered = best((lag + more, width) for more in (-max(abs(lag) // 4, 1), max(abs(lag) // 4, 1)))
    simpler = min(fits[plain].error, _error_of_equal_averages(case, *filtered))
    choice = filtered if fits[filtered].error < doubt_settings.error_share_of_a_cause * simpler else plain
    if choice != (0, 1):
        size = choice[0] * log.sample_time
        yield RaisedDoubt(_sentence(*choice, log.sample_time), size, "s", fits[choice], spoils=True)


def _doubling(most: float) -> list[int]:
    """List the powers of two from 1 up to `most`; [] if `most` is below 1."""
    return [2**power for power in range(int(np.log2(most)) + 1)] if most >= 1 else []


def _with_timing(case: RecordCase, lag: int, width: int) -> InverseModel:
    """Fit the inverse model with the force delayed by `lag`, the motion averaged over `width`.

    `lag` and `width` are numbers of samples. A negative `width` averages the force instead.
    """
    moved = _force_moved(case.log, lag, max(-width, 1))
    return case.modelled(moved, averaged=max(width, 1))


def _error_of_equal_averages(case: RecordCase, lag: int, width: int) -> float:
    """Return the error of the inverse model with force and motion averaged alike.

    The force is `lag` samples later. `width` is negative; both are averaged over its size in samples. The error serves
    as a check: averaging the force alone merely hides fast residuals.
    """
    if width >= 0:
        return np.inf
    moved = _force_moved(case.log, lag, -width)
    return case.modelled(moved, averaged=-width).error


def _force_moved(log: Log, lag: int, width: int) -> Log:
    """Return the log with its force `lag` samples later, averaged over `width` samples."""
    force = uniform_filter1d(np.roll(log["force"], lag), width)
    return replace(log, signals={**log.signals, "force": force})


def _sentence(lag: int, width: int, step: float) -> str:
    """Write which shift and which average improve the fit, and what that suggests.

    `lag` and `width` are counted in samples of `step` [s]; a negative width averages the force, not the motion.
    """
    shift = f"{abs(lag) * step * 1e3:.3g} ms {'earlier' if lag < 0 else 'later'}"
    if width == 1:
        return f"shifting the force {shift} improves the fit considerably, which suggests a delay between the channels"
    averaged, shifted, cause = (
        ("motion", "the force", "an averaged or filtered force, or a coupling between force and position")
        if width > 0
        else ("force", "it", "a position that is filtered, or not measured")
    )
    also = f" and shifting {shifted} {shift}" if lag else ""
    span = f"{abs(width) * step * 1e3:.3g} ms"
    return f"averaging the {averaged} over {span}{also} improves the fit considerably, which suggests {cause}"


DOUBT = Doubt(
    "cause",
    find,
    "the fit of the inverse model with the force shifted, and force or motion averaged",
    "intervals reach to the values without it; friction at low speed is refused",
    "a step of the force logged with the motion on the same clock",
)
