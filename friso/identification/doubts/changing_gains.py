"""Doubt: the controller's gains change during the record, by speed, by place, or at an instant."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import minimum_filter1d

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import least_squares, motion, within_stretches
from friso.identification.readings.common import low_pass, noise_of
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit a control law to the whole record and to two parts of it, and compare the gains.

    A law is the force as a linear function of error, its derivatives and integral. The parts are divided by an
    instant, by speed of the reference, or by place. One linear controller has equal gains in all parts, whatever
    the machine does. Of the divisions that explain the force, the one counts whose laws differ by no more than a
    factor. With drifting clocks the phase of the law changes as well, but not its size.
    """
    if "reference" not in case.log or case.commanded:
        return
    signals, stretch, course = control_law(case)
    fewest = doubt_settings.rows_for_each_gain * (signals.shape[1] - 1 + len(np.unique(stretch)))
    if len(signals) < 2 * fewest:
        return
    left = least_squares(*_deviations(signals, stretch))[1]
    ends = doubt_settings.shares_of_a_part
    shares = np.linspace(min(ends), max(ends), doubt_settings.levels_of_a_part)
    most = doubt_settings.power_left_by_changing_gains * float(left @ left)
    scaled, best, where, ratio = np.inf, most, "", 1.0
    for name, signal in course.items():
        for level in np.quantile(signal, shares):
            below = signal < level
            if min(below.sum(), (~below).sum()) < fewest:
                continue
            one, two = (_deviations(signals[rows], stretch[rows]) for rows in (below, ~below))
            (law, rest), (_, other) = least_squares(*one), least_squares(*two)
            if (squares := float(rest @ rest + other @ other)) >= most:
                continue
            times = _ratio(two[0] @ law, two[1])
            again = least_squares(np.concatenate([one[0], times * two[0]]), np.concatenate([one[1], two[1]]))[1]
            if again @ again < scaled:
                scaled, best, where, ratio = float(again @ again), squares, name.format(level), times
    if not where or not abs(np.log(ratio)) > doubt_settings.logarithm_of_a_gain:
        return
    one_law, two_laws = (np.sqrt(squares / len(signals)) for squares in (left @ left, best))
    words = (
        f"The controller answers the same error with {ratio:.2g} times the force {where}: its gains change, or a "
        f"setting against friction acts there. One controller with fixed gains leaves {one_law:.2g} {case.unit} of the "
        f"force, two leave {two_laws:.2g} {case.unit}; a record with fixed gains and no such setting would decide it"
    )
    yield RaisedDoubt(words=words, size=ratio)


def control_law(case: RecordCase) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return signals to which a linear controller is fitted, and what its gains may depend on.

    The signals, shape (rows, 9), are the error, its derivatives and integral, the motion of the reference and its
    direction, and last the force [N]. All of them pass one filter. Rows with a force at its limits are left out; the
    second result numbers the stretches between them, shape (rows,). The third has time, speed and place by name, shape
    (rows,) each.
    """
    log, part = case.log, case.log.longest
    step, cutoff = log.sample_time, doubt_settings.bandwidths_of_a_controller * case.inverse.bandwidth
    wanted = motion(log["reference"][part], step, cutoff)
    error = wanted.position - motion(log["position"][part], step, cutoff).position
    raw = np.abs(log["force"][part])
    below_limit = raw < raw.max() - doubt_settings.deviations_at_a_limit * noise_of(log["force"][part])
    blurred = round(1 / (cutoff * step))  # samples that the filter reaches, also beyond the ends
    inside = minimum_filter1d(below_limit, 2 * blurred + 1, mode="constant", cval=0)
    stretch = np.cumsum(np.diff(inside.astype(int), prepend=int(inside[0])) > 0)
    speed = np.abs(wanted.velocity)
    creep = doubt_settings.speed_share_of_creeping * speed.max()
    signals = (
        error,
        np.gradient(error, step),
        np.gradient(np.gradient(error, step), step),
        np.cumsum(error) * step,
        wanted.position - wanted.position.mean(),
        wanted.velocity,
        wanted.acceleration,
        np.clip(wanted.velocity / creep, -1.0, 1.0) if creep > 0 else np.zeros_like(error),
        low_pass(log["force"][part], step, cutoff),
    )
    rows = np.flatnonzero(inside)[:: max(1, round(1 / (4 * cutoff * step)))]
    course = {
        "after {:.3g} s": log.time[part][rows],
        "above {:.2g} m/s": np.where(speed > creep, speed, 0.0)[rows],
        "beyond {:.3g} m": wanted.position[rows],
    }
    return np.stack(signals, axis=1)[rows], stretch[rows], course


def _deviations(signals: np.ndarray, stretch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns of a control law and its force [N] as deviations from the means over each stretch."""
    deviations = within_stretches(signals, stretch)
    return deviations[:, :-1], deviations[:, -1]


def _ratio(usual: np.ndarray, force: np.ndarray) -> float:
    """Return the ratio of a force to the usual force, (rows,) [N]; 1 if their shapes differ."""
    likeness = float(usual @ force) / (float(np.linalg.norm(usual) * np.linalg.norm(force)) or 1.0)
    if likeness < doubt_settings.likeness_of_a_law:
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
