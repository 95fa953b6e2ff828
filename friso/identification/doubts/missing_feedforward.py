"""Doubt: the logged force lacks a feedforward of the drive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from friso.errors import InputError
from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import InverseModel, least_squares, moved_in, unit_of
from friso.identification.logs.log import Log
from friso.identification.settings import doubt_settings
from friso.identification.spread import spread_of
from friso.intervals import NORMAL_COVERAGE

ACCELERATION, DIRECTION = "reference acceleration", "reference direction"
"""Names of the additional columns of the inverse model."""


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Look for a feedforward of acceleration or direction missing from the logged force.

    The feedforward must improve the fit while the stage is fast, too.
    """
    fed = None if case.commanded else fed_forward(case)
    if fed is None or not lacks_when_fast(case.inverse, fed[1]):
        return
    model, mass = fed[0], -fed[0].value(ACCELERATION)
    kg = unit_of("kg", case.log)
    coulomb = f"{-model.solution.get(DIRECTION, 0.0):.2g} {case.unit}"
    also = f" and {coulomb} in its direction" if DIRECTION in model.solution else ""
    words = (
        f"the force lacks {mass:.2g} {kg} times the acceleration of the reference{also}, which suggests that a "
        "feedforward is not part of it"
    )
    yield RaisedDoubt(words=words, size=mass, unit=kg, without=model, spoils=True)


def fed_forward(case: RecordCase) -> tuple[InverseModel, np.ndarray] | None:
    """Fit the inverse model with feedforward of the reference's acceleration and direction.

    Also returns the missing force [N] that is in proportion to the acceleration, shape (rows,). Returns None without a
    reference, or if nothing is missing.
    """
    log, inverse = case.log, case.inverse
    columns = _of_reference(log, inverse.bandwidth)
    if not columns:
        return None
    accelerated = {ACCELERATION: columns[ACCELERATION]}
    with suppress(InputError):
        alone, both = (case.modelled(log, extra=extra) for extra in (accelerated, columns))
        if alone.value(ACCELERATION) < 0:
            lacking = max(both.value(ACCELERATION), both.value(DIRECTION)) < 0
            return both if lacking else alone, inverse.measured - alone.measured
    return None


def lacks_when_fast(inverse: InverseModel, fed: np.ndarray) -> bool:
    """Tell whether feedforward [N], (rows,), is missing from the force while the stage is fast.

    The fit must miss it in both halves of these rows. In a servo that follows well, reference and measured acceleration
    differ by friction at low speed and by sticking. Feedforward could imitate both where the inverse model lacks them,
    but not where the stage slides.
    """
    speed = np.abs(inverse.columns[:, 1])
    fast = np.flatnonzero(speed > doubt_settings.speed_share_of_a_fast_stage * speed.max())
    if len(fast) < 2 * doubt_settings.samples_of_a_reference:
        return False
    columns = np.column_stack([inverse.columns, fed])
    for rows in np.array_split(fast, 2):
        solution, left = least_squares(columns[rows], inverse.measured[rows])
        if not solution[-1] > NORMAL_COVERAGE * np.sqrt(spread_of(columns[rows], left)[-1, -1]):
            return False
    force = inverse.measured[fast]
    without, left = (least_squares(some[fast], force)[1] for some in (inverse.columns, columns))
    return bool(np.linalg.norm(left) < doubt_settings.error_share_of_a_cause * np.linalg.norm(without))


def _of_reference(log: Log, bandwidth: float) -> dict[str, np.ndarray]:
    """Return the reference's acceleration [m/s^2] and direction, (n,) each; {} if not logged.

    The acceleration is filtered as for a motion of this `bandwidth` [Hz].
    """
    if "reference" not in log:
        return {}
    columns = {name: np.zeros(len(log.time)) for name in (ACCELERATION, DIRECTION)}
    for part in log.segments:
        if part.stop - part.start > doubt_settings.samples_of_a_reference:
            reference = moved_in(log, log["reference"][part], bandwidth)
            columns[ACCELERATION][part] = reference.acceleration
            columns[DIRECTION][part] = np.sign(np.gradient(log["reference"][part]))
    return columns


DOUBT = Doubt(
    "cause",
    find,
    "the fit of the inverse model with acceleration and direction of the reference",
    "intervals reach to the values without it; friction at low speed is refused",
    "a log of the whole force of the drive",
    after=("force-by-place",),
)
