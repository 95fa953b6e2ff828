"""The inverse model of a log rid of what may be wrong with it: a delay or averaging between force and motion, a force
that depends on position or drifts, a feedforward that is not part of the force."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from friso.errors import InputError
from friso.identification.inverse_model import SMOOTH, InverseModel, inverse_model, motion, unit_of
from friso.identification.logs.log import Log
from friso.identification.spread import spread_of
from friso.intervals import COVERAGE

BETTER = 0.7
"""A cause counts if the model without it has at most this share of the error."""

RIVAL = 1.5
"""How many times the error of the best alternative another one may leave and still count."""

LATEST, LONGEST = 0.25, 1.0
"""Periods of the motion's bandwidth by which the force is moved at most in the search for a delay, and over which force
or motion are averaged at most in that for a filter: each twice as far as the one before, and then in between."""

PLACES, ROWS = 40, 20
"""Places along the way at which a force may differ, and samples at least for each of them."""

FEWEST = 20
"""Samples of a segment at least, for the motion of its reference."""

FAST = 0.1
"""Share of the highest speed from which on a missing feedforward has to show. Of 400 drawn logs of the whole force, one
was said to lack a feedforward, 98 where all speeds counted; of 186 that lacked one, 130 were, and 174."""

TIME, PLACE, ACCELERATION, DIRECTION = "drift", "place {}", "reference acceleration", "reference direction"
"""Names of further columns of the inverse model."""


@dataclass(frozen=True)
class Alternative:
    """A sentence about what may be wrong with a log, and the inverse model of the log without it."""

    sentence: str
    model: InverseModel


def alternatives(log: Log, inverse: InverseModel, cart_share: float) -> list[Alternative]:
    """Those that fit much better than the inverse model, the best first; none that leaves half as much again."""
    candidates = [*_timing(log, inverse, cart_share), *_with_columns(log, inverse, cart_share)]
    candidates = [candidate for candidate in candidates if candidate.model.error < BETTER * inverse.error]
    candidates.sort(key=lambda candidate: candidate.model.error)
    return [candidate for candidate in candidates if candidate.model.error <= RIVAL * candidates[0].model.error]


def _timing(log: Log, inverse: InverseModel, cart_share: float) -> Iterator[Alternative]:
    """The force moved in time, and what of force and motion the other one has to be averaged like, that fit best."""
    fits: dict[tuple[int, int], InverseModel] = {(0, 1): inverse}

    def best(tried: Iterable[tuple[int, int]]) -> tuple[int, int]:
        for lag, width in tried:
            with suppress(InputError):
                fits[lag, width] = _with_timing(log, inverse, cart_share, lag, width)
        return min(fits, key=lambda choice: fits[choice].error)

    period = 1 / (inverse.bandwidth * log.sample_time)
    lag, _ = best((sign * lag, 1) for lag in _doubling(LATEST * period) for sign in (1, -1))
    lag, _ = plain = best((lag + more, 1) for more in (-abs(lag) // 4, abs(lag) // 4) if more)
    _, width = best((lag, sign * (2 * half + 1)) for half in _doubling(LONGEST * period / 2) for sign in (1, -1))
    wider = abs(width) // 2 | 1
    lag, width = best((lag, (1 if width > 0 else -1) * (abs(width) + sign * (wider - 1))) for sign in (-1, 1))
    lag, width = filtered = best((lag + more, width) for more in (-max(abs(lag) // 4, 1), max(abs(lag) // 4, 1)))
    believed = fits[filtered].error < BETTER * min(
        fits[plain].error, _error_of_equal_averages(log, inverse, cart_share, *filtered)
    )
    choice = filtered if believed else plain
    if choice != (0, 1):
        yield Alternative(_timing_sentence(*choice, log.sample_time), fits[choice])


def _doubling(most: float) -> list[int]:
    """1, 2, 4 and so on, up to a number."""
    return [2**power for power in range(int(np.log2(most)) + 1)] if most >= 1 else []


def _with_timing(log: Log, inverse: InverseModel, cart_share: float, lag: int, width: int) -> InverseModel:
    """The inverse model with the force so many samples later, and the motion averaged over so many; of a negative
    `width` the force instead."""
    moved = _force_moved(log, lag, max(-width, 1))
    return inverse_model(moved, inverse.bandwidth, False, cart_share, averaged=max(width, 1))


def _error_of_equal_averages(log: Log, inverse: InverseModel, cart_share: float, lag: int, width: int) -> float:
    """The error with both averaged alike, where the force is averaged: that alone takes what is fast out of it."""
    if width >= 0:
        return np.inf
    return inverse_model(_force_moved(log, lag, -width), inverse.bandwidth, False, cart_share, averaged=-width).error


def _force_moved(log: Log, lag: int, width: int) -> Log:
    """The log with its force so many samples later, averaged over so many."""
    force = uniform_filter1d(np.roll(log["force"], lag), width)
    return replace(log, signals={**log.signals, "force": force})


def _timing_sentence(lag: int, width: int, step: float) -> str:
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


def _with_columns(log: Log, inverse: InverseModel, cart_share: float) -> Iterator[Alternative]:
    """What a force that drifts, one that depends on the place, and one that the reference prescribes explain."""
    time = log.time - log.time.mean()
    sets = [{TIME: time}, _places(log, len(inverse.measured))]
    for extra, words in zip(sets, (_drift_sentence, _place_sentence), strict=True):
        if extra:
            with suppress(InputError):
                model = inverse_model(log, inverse.bandwidth, False, cart_share, extra=extra)
                yield Alternative(words(model, log), model)
    fed = _fed_forward(log, inverse, cart_share)
    if fed and _lacks_when_fast(inverse, fed[1]):
        yield Alternative(_feedforward_sentence(fed[0], log), fed[0])


def _places(log: Log, rows: int) -> dict[str, np.ndarray]:
    """Columns that tell places along the way apart, each of shape (n,), without the first one's."""
    position, count = log["position"], min(PLACES, rows // ROWS)
    if count < 3:
        return {}
    nodes = np.linspace(position.min(), position.max(), count)
    near = 1 - np.abs(position - nodes[:, None]) / (nodes[1] - nodes[0])
    return {PLACE.format(i): np.maximum(row, 0.0) for i, row in enumerate(near) if i}


def _of_reference(log: Log, bandwidth: float) -> dict[str, np.ndarray]:
    """Acceleration [m/s^2] of the reference and its direction, of shape (n,)."""
    if "reference" not in log:
        return {}
    columns = {name: np.zeros(len(log.time)) for name in (ACCELERATION, DIRECTION)}
    for part in log.segments:
        if part.stop - part.start > FEWEST:
            reference = motion(log["reference"][part], log.sample_time, SMOOTH * bandwidth)
            columns[ACCELERATION][part] = reference.acceleration
            columns[DIRECTION][part] = np.sign(np.gradient(log["reference"][part]))
    return columns


def _fed_forward(log: Log, inverse: InverseModel, cart_share: float) -> tuple[InverseModel, np.ndarray] | None:
    """The inverse model with what a feedforward adds to the force, and what its part in the acceleration is, shape
    (rows,) [N]; None where nothing is lacking in it."""
    columns = _of_reference(log, inverse.bandwidth)
    accelerated = {name: column for name, column in columns.items() if name == ACCELERATION}
    if not columns:
        return None
    with suppress(InputError):
        alone, both = (
            inverse_model(log, inverse.bandwidth, False, cart_share, extra=extra) for extra in (accelerated, columns)
        )
        if alone.value(ACCELERATION) < 0:
            lacking = max(both.value(ACCELERATION), both.value(DIRECTION)) < 0
            return both if lacking else alone, inverse.measured - alone.measured
    return None


def perhaps_fed_forward(log: Log, inverse: InverseModel, cart_share: float) -> str:
    """A sentence on a feedforward that may be missing from the force, where the log does not tell; "" elsewhere."""
    fed = _fed_forward(log, inverse, cart_share)
    if fed is None or fed[0].error >= BETTER * inverse.error or _lacks_when_fast(inverse, fed[1]):
        return ""
    mass = f"{inverse.value('mass') - fed[0].value(ACCELERATION):.2g} {unit_of('kg', log)}"
    return f"if the force leaves out a feedforward, which this log does not tell, the mass is about {mass}"


def _lacks_when_fast(inverse: InverseModel, fed: np.ndarray) -> bool:
    """Whether a force fed forward, shape (rows,) [N], is lacking in both halves of the rows in which the stage is fast.

    Of a servo that follows well, the reference's acceleration differs from the measured one by what friction at low
    speed and sticking do, and stands in for them as far as the inverse model lacks them; not so where it slides."""
    speed = np.abs(inverse.columns[:, 1])
    fast = np.flatnonzero(speed > FAST * speed.max())
    if len(fast) < 2 * FEWEST:
        return False
    columns = np.column_stack([inverse.columns, fed])
    for rows in np.array_split(fast, 2):
        solution, left = _fit(columns[rows], inverse.measured[rows])
        if not solution[-1] > COVERAGE * np.sqrt(spread_of(columns[rows], left)[-1, -1]):
            return False
    without, left = (_fit(some, inverse.measured[fast])[1] for some in (inverse.columns[fast], columns[fast]))
    return bool(np.linalg.norm(left) < BETTER * np.linalg.norm(without))


def _fit(columns: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares: the solution, shape (columns,), and what it leaves, shape (rows,)."""
    solution = np.linalg.lstsq(columns, force, rcond=None)[0]
    return solution, force - columns @ solution


def _drift_sentence(model: InverseModel, log: Log) -> str:
    return f"a force drifting by {model.value(TIME):.2g} {log.unit('force')}/s accounts for most of it"


def _place_sentence(model: InverseModel, log: Log) -> str:
    levels = [value for name, value in model.solution.items() if name.startswith(PLACE.format(""))]
    size = f"{np.ptp([0.0, *levels]):.2g} {log.unit('force')}"
    return f"a force that varies with position, by {size}, accounts for most of it"


def _feedforward_sentence(model: InverseModel, log: Log) -> str:
    mass = f"{-model.value(ACCELERATION):.2g} {unit_of('kg', log)}"
    coulomb = f"{-model.solution.get(DIRECTION, 0.0):.2g} {log.unit('force')}"
    also = f" and {coulomb} in its direction" if DIRECTION in model.solution else ""
    return (
        f"the force lacks {mass} times the acceleration of the reference{also}, which suggests that a feedforward is "
        "not part of it"
    )
