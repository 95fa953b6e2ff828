"""Doubts about the controller behind the force: its feedforward, gains and sign."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from scipy.ndimage import minimum_filter1d

from friso.errors import InputError
from friso.identification.combine import spread_of
from friso.identification.doubt import ERROR_SHARE_OF_A_CAUSE, SPEED_SHARE_OF_CREEPING, Doubt, RaisedDoubt, RecordCase
from friso.identification.inverse_model import InverseModel, least_squares, motion, moved_in, unit_of, within_stretches
from friso.identification.logs.log import Log
from friso.identification.readings.common import low_pass, noise_of
from friso.identification.response.analysis import Bench
from friso.identification.witness import DEVIATIONS_AT_A_LIMIT
from friso.intervals import NORMAL_COVERAGE

ACCELERATION, DIRECTION = "reference acceleration", "reference direction"
"""Names of the additional columns of the inverse model."""


def find_missing_feedforward(case: RecordCase) -> Iterator[RaisedDoubt]:
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


SPEED_SHARE_OF_A_FAST_STAGE = 0.1
"""Speed above which a missing feedforward must show, relative to the highest. Of 400 drawn sound logs, 1 was
reported (98 if all speeds counted); of 186 logs without their feedforward, 130 were (174)."""

SAMPLES_OF_A_REFERENCE = 20
"""Fewest samples of a segment from which the filter can compute the reference's motion."""


def lacks_when_fast(inverse: InverseModel, fed: np.ndarray) -> bool:
    """Tell whether feedforward [N], (rows,), is missing from the force while the stage is fast.

    The fit must miss it in both halves of these rows. In a servo that follows well, reference and measured acceleration
    differ by friction at low speed and by sticking. Feedforward could imitate both where the inverse model lacks them,
    but not where the stage slides.
    """
    speed = np.abs(inverse.columns[:, 1])
    fast = np.flatnonzero(speed > SPEED_SHARE_OF_A_FAST_STAGE * speed.max())
    if len(fast) < 2 * SAMPLES_OF_A_REFERENCE:
        return False
    columns = np.column_stack([inverse.columns, fed])
    for rows in np.array_split(fast, 2):
        solution, left = least_squares(columns[rows], inverse.measured[rows])
        if not solution[-1] > NORMAL_COVERAGE * np.sqrt(spread_of(columns[rows], left)[-1, -1]):
            return False
    force = inverse.measured[fast]
    without, left = (least_squares(some[fast], force)[1] for some in (inverse.columns, columns))
    return bool(np.linalg.norm(left) < ERROR_SHARE_OF_A_CAUSE * np.linalg.norm(without))


def _of_reference(log: Log, bandwidth: float) -> dict[str, np.ndarray]:
    """Return the reference's acceleration [m/s^2] and direction, (n,) each; {} if not logged.

    The acceleration is filtered as for a motion of this `bandwidth` [Hz].
    """
    if "reference" not in log:
        return {}
    columns = {name: np.zeros(len(log.time)) for name in (ACCELERATION, DIRECTION)}
    for part in log.segments:
        if part.stop - part.start > SAMPLES_OF_A_REFERENCE:
            reference = moved_in(log, log["reference"][part], bandwidth)
            columns[ACCELERATION][part] = reference.acceleration
            columns[DIRECTION][part] = np.sign(np.gradient(log["reference"][part]))
    return columns


MISSING_FEEDFORWARD = Doubt(
    "cause",
    find_missing_feedforward,
    "the fit of the inverse model with acceleration and direction of the reference",
    "intervals reach to the values without it; friction at low speed is refused",
    "a log of the whole force of the drive",
    after=("force-by-place",),
)


def find_perhaps_feedforward(case: RecordCase) -> Iterator[RaisedDoubt]:
    """State the mass in case the logged force leaves out a feedforward.

    The doubt is raised if the reference's acceleration explains much more of the force, but not clearly while the stage
    is fast.
    """
    fed, share = fed_forward(case), ERROR_SHARE_OF_A_CAUSE
    if case.commanded or fed is None or fed[0].error >= share * case.inverse.error:
        return
    if lacks_when_fast(case.inverse, fed[1]):
        return
    mass, kg = case.inverse.value("mass") - fed[0].value(ACCELERATION), unit_of("kg", case.log)
    words = f"if the force leaves out a feedforward, which this log does not tell, the mass is about {mass:.2g} {kg}"
    yield RaisedDoubt(words=words, size=mass, unit=kg)


PERHAPS_FEEDFORWARD = Doubt(
    "otherwise",
    find_perhaps_feedforward,
    "the fit of the inverse model with acceleration and direction of the reference",
    "reported",
    "a log of the whole force of the drive",
)


ROWS_FOR_EACH_GAIN = 5
"""Fewest rows for each gain in either part of a record. With fewer a gain fits noise."""

SHARES_OF_A_PART = (0.1, 0.9)
"""Range of the fractions of a record between which gains may change. Shorter parts show too little."""

LEVELS_OF_A_PART = 17
"""Number of instants, speeds and places at which gains may change. Between two of them, a twentieth of the record
is in the wrong part."""

POWER_LEFT_BY_CHANGING_GAINS = 0.3
"""Largest ratio of the residual's power with two controllers and one. Of 150 drawn machines with gains reduced to
0.4 to 0.7 in a part, 149 were reported; of 100 sound ones and 100 with a limited force, none."""

LOGARITHM_OF_A_GAIN = 0.2
"""Smallest change of the gains that is reported, as a logarithm. Drifting clocks, and filters in a sound
controller, change the law by 0.1."""


def find_changing_gains(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Fit a control law to the whole record and to two parts of it, and compare the gains.

    A law is the force as a linear function of error, its derivatives and integral. The parts are divided by an
    instant, by speed of the reference, or by place. One linear controller has equal gains in all parts, whatever
    the machine does. Of the divisions that explain the force, the one counts whose laws differ by no more than a
    factor. With drifting clocks the phase of the law changes as well, but not its size.
    """
    if "reference" not in case.log or case.commanded:
        return
    signals, stretch, course = control_law(case)
    fewest = ROWS_FOR_EACH_GAIN * (signals.shape[1] - 1 + len(np.unique(stretch)))
    if len(signals) < 2 * fewest:
        return
    left = least_squares(*_deviations(signals, stretch))[1]
    ends = SHARES_OF_A_PART
    shares = np.linspace(min(ends), max(ends), LEVELS_OF_A_PART)
    most = POWER_LEFT_BY_CHANGING_GAINS * float(left @ left)
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
    if not where or not abs(np.log(ratio)) > LOGARITHM_OF_A_GAIN:
        return
    one_law, two_laws = (np.sqrt(squares / len(signals)) for squares in (left @ left, best))
    words = (
        f"The controller answers the same error with {ratio:.2g} times the force {where}: its gains change, or a "
        f"setting against friction acts there. One controller with fixed gains leaves {one_law:.2g} {case.unit} of the "
        f"force, two leave {two_laws:.2g} {case.unit}; a record with fixed gains and no such setting would decide it"
    )
    yield RaisedDoubt(words=words, size=ratio)


BANDWIDTHS_OF_A_CONTROLLER = 3.0
"""Cut-off of error and force in bandwidths of the motion, above which the derivative of the error is noise."""


def control_law(case: RecordCase) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return signals to which a linear controller is fitted, and what its gains may depend on.

    The signals, shape (rows, 9), are the error, its derivatives and integral, the motion of the reference and its
    direction, and last the force [N]. All of them pass one filter. Rows with a force at its limits are left out; the
    second result numbers the stretches between them, shape (rows,). The third has time, speed and place by name, shape
    (rows,) each.
    """
    log, part = case.log, case.log.longest
    step, cutoff = log.sample_time, BANDWIDTHS_OF_A_CONTROLLER * case.inverse.bandwidth
    wanted = motion(log["reference"][part], step, cutoff)
    error = wanted.position - motion(log["position"][part], step, cutoff).position
    raw = np.abs(log["force"][part])
    below_limit = raw < raw.max() - DEVIATIONS_AT_A_LIMIT * noise_of(log["force"][part])
    blurred = round(1 / (cutoff * step))  # samples that the filter reaches, also beyond the ends
    inside = minimum_filter1d(below_limit, 2 * blurred + 1, mode="constant", cval=0)
    stretch = np.cumsum(np.diff(inside.astype(int), prepend=int(inside[0])) > 0)
    speed = np.abs(wanted.velocity)
    creep = SPEED_SHARE_OF_CREEPING * speed.max()
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


LIKENESS_OF_A_LAW = 0.8
"""Smallest correlation of the force with the control law of the other part. It was at least 0.88 on drawn machines
with changed gains, and 0.02 to 0.1 on a hunting stage."""


def _ratio(usual: np.ndarray, force: np.ndarray) -> float:
    """Return the ratio of a force to the usual force, (rows,) [N]; 1 if their shapes differ."""
    likeness = float(usual @ force) / (float(np.linalg.norm(usual) * np.linalg.norm(force)) or 1.0)
    if likeness < LIKENESS_OF_A_LAW:
        return 1.0
    return float(usual @ force / (usual @ usual))


CHANGING_GAINS = Doubt(
    "record",
    find_changing_gains,
    "the force by error, its derivatives and integral, over parts of the record",
    "reported",
    "a record with fixed gains",
)
"""Without a reference the error is not known; a stage that follows the log then needs no controller."""


def find_wrong_sign(bench: Bench) -> Iterator[RaisedDoubt]:
    """Check whether the driven mass moves against the force.

    The phase of a mass line is -180 degrees; 0 degrees means a wrong sign.
    """
    model = bench.two_masses
    if not (model.signs[0] < 0 if model is not None else any(line.sign < 0 for line in bench.lines[:1])):
        return
    force, motion = bench.driven.channels.input, bench.driven.channels.output
    yield RaisedDoubt(
        words=f"The {motion} goes against the {force}, which no mass does: one of them has the wrong sign; the values "
        "are those with the sign reversed"
    )


WRONG_SIGN = Doubt(
    "response", find_wrong_sign, "the phase of the mass line", "reported", "a push by hand with both channels in view"
)
