"""Doubt: the controller's gains change during the record, by speed, by place, or at an instant."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import minimum_filter1d

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import least_squares, motion
from friso.identification.readings.common import low_pass, noise_of
from friso.identification.settings import DoubtSettings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit the force by error, its derivatives and integral, over the whole record and over two parts of it.

    The parts are divided by an instant, by speed of the reference, or by place. One linear controller has equal gains
    in all parts, whatever the machine does. With drifting clocks the law changes as well, but not its size.
    """
    settings = DoubtSettings.current()
    if "reference" not in case.log:
        return
    columns, force, course = control_law(case)
    fewest = settings.rows_for_each_gain * columns.shape[1]
    if len(force) < 2 * fewest:
        return
    left = least_squares(columns, force)[1]
    shares = np.linspace(min(settings.shares_of_a_part), max(settings.shares_of_a_part), settings.levels_of_a_part)
    best, where, ratio = settings.power_left_by_changing_gains * float(left @ left), "", 1.0
    for name, signal in course.items():
        for level in np.quantile(signal, shares):
            below = signal < level
            if min(below.sum(), (~below).sum()) < fewest:
                continue
            (law, rest), (_, other) = (least_squares(columns[rows], force[rows]) for rows in (below, ~below))
            if rest @ rest + other @ other < best:
                best, where = float(rest @ rest + other @ other), name.format(level)
                ratio = _ratio(columns[~below] @ law, force[~below])
    if not where or not abs(np.log(ratio)) > settings.logarithm_of_a_gain:
        return
    one, two = (np.sqrt(squares / len(force)) for squares in (left @ left, best))
    words = (
        f"The controller's gains change {where}, so that for the same error the force is {ratio:.2g} times as large: "
        f"one controller with fixed gains leaves {one:.2g} {case.unit} of the force, two leave {two:.2g} {case.unit}; "
        "a record with fixed gains would decide it"
    )
    yield RaisedDoubt(words, ratio)


def control_law(case: RecordCase) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return the regressors of a linear controller, its force [N], and the variables on which gains may depend, by row.

    The regressors, shape (rows, columns), are the error, its derivatives and integral, the motion of the reference and
    its direction, all through one filter. Rows with a force at its limits are left out; the integral may stand
    meanwhile, so each stretch between them has its own constant.
    """
    settings, log, part = DoubtSettings.current(), case.log, case.log.longest
    step, cutoff = log.sample_time, settings.bandwidths_of_a_controller * case.inverse.bandwidth
    wanted = motion(log["reference"][part], step, cutoff)
    error = wanted.position - motion(log["position"][part], step, cutoff).position
    raw = np.abs(log["force"][part])
    below_limit = raw < raw.max() - settings.deviations_at_a_limit * noise_of(log["force"][part])
    inside = minimum_filter1d(below_limit, 2 * round(1 / (cutoff * step)) + 1)
    stretch = np.cumsum(np.diff(inside.astype(int), prepend=int(inside[0])) > 0)
    speed = np.abs(wanted.velocity)
    creep = settings.speed_share_of_creeping * speed.max()
    columns = np.stack(
        [
            error,
            np.gradient(error, step),
            np.gradient(np.gradient(error, step), step),
            np.cumsum(error) * step,
            wanted.position - wanted.position.mean(),
            wanted.velocity,
            wanted.acceleration,
            np.clip(wanted.velocity / creep, -1.0, 1.0) if creep > 0 else np.zeros_like(error),
            *(stretch == np.arange(1 + stretch[-1])[:, None]),
        ],
        axis=1,
    )
    rows = np.flatnonzero(inside)[:: max(1, round(1 / (4 * cutoff * step)))]
    course = {
        "after {:.3g} s": log.time[part][rows],
        "above {:.2g} m/s": np.where(speed > creep, speed, 0.0)[rows],
        "beyond {:.3g} m": wanted.position[rows],
    }
    return columns[rows], low_pass(log["force"][part], step, cutoff)[rows], course


def _ratio(usual: np.ndarray, force: np.ndarray) -> float:
    """Return the ratio of a force to the `usual` one, each of shape (rows,) [N]; 1 if they are not proportional."""
    likeness = float(usual @ force) / (float(np.linalg.norm(usual) * np.linalg.norm(force)) or 1.0)
    if likeness < DoubtSettings.current().likeness_of_a_law:
        return 1.0
    return float(usual @ force / (usual @ usual))


DOUBT = Doubt(
    "record",
    find,
    "the force by error, its derivatives and integral, over parts of the record",
    "reported",
    "a record with fixed gains",
)
"""Without a reference the error is not known; a stage that follows the log then needs no controller."""
