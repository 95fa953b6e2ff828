"""Outcome of an experiment of the rig: logs, the true motion behind each, and the analysis.

Sizes, durations and places of experiments are chosen from the stage. Times are in periods of the controller's
crossover, distances in lengths of the stage's own motion, deflections in strokes, and forces in friction forces. On the
thesis's rig (8 Hz, 90 mm, 1 mm, 3 N) the values are those of the thesis. A multisine injected into the closed loop at
standstill shows plant and open loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.equations.bandwidth import bandwidth, breakaway, proportional_stiffness, sped_up
from friso.errors import InputError
from friso.identification.logs.log import Log
from friso.identification.readings.common import record
from friso.identification.response.records import Channels, FrequencyResponse, ResponseRecord, from_log, multisine
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.tables import moving_mass
from friso.virtual_rig.run import RecordedRuns, as_built_keys, run
from friso.virtual_rig.task import own_motion, standing

WIDE_STROKE = 8.0
"""Stroke during identification over the stage's own stroke.

It is 8 mm in the thesis (Sec. 4.2.1), "for safety reasons".
"""

WAY_FACTOR = 5 / 3
"""Way at constant speed over the length of the stage's own motion: 150 mm for 90 mm (Sec. 4.2.3)."""

VAN_DIJK_ALPHA = 0.1
"""Alpha of the van Dijk controller to which plain gains are compared, as in the thesis."""

FIXED_MASS = 1e9
"""Mass [kg] of a cart that practically does not move."""


_FREE = 'stiffness = "2.4 N/mm", damping = "0.5 N*s/m", stroke = "1 mm"'


def jointed(stage: Stage) -> Stage:
    """Return the stage unchanged. Raises InputError if it has no joint."""
    if stage.joint is None:
        raise InputError("joint", "no [joint]", "a stage with a joint", '[joint] stiffness = "2.4 N/mm"')
    return stage


def freed(stage: Stage) -> Stage:
    """Return the stage with its joint free and its limiters far away.

    Raises InputError if it has no joint that can be free, or no stroke.
    """
    free = free_stage(stage)
    stroke = free.flat()["joint.stroke"]
    if not stroke > 0:
        raise InputError("joint.stroke", f"{stroke:g} m", "a stroke greater than 0", 'stroke = "1 mm"')
    return free.with_numbers({"joint.stroke": WIDE_STROKE * stroke})


def free_stage(stage: Stage) -> Stage:
    """Return the stage with its joint free.

    Raises InputError if it has no joint, or lacks the keys of a free one.
    """
    free = jointed(stage).variants().get("free")
    if free is None:
        expected = "a joint with stiffness (or a [flexure]), damping and stroke, which this experiment frees"
        raise InputError("joint", "a joint of which the file tells that it is locked alone", expected, _FREE)
    return free


def locked_stage(stage: Stage) -> Stage:
    """Return the stage with its joint held. Raises InputError if it has no joint."""
    return jointed(stage).replace({"joint.locked": True})


def pace(stage: Stage) -> float:
    """Return the controller's crossover [Hz].

    For plain gains it is that of a van Dijk controller with equal proportional gain.
    """
    flat = stage.flat()
    named = bandwidth(flat)
    if named is not None:
        return float(named)
    return float(np.sqrt(proportional_stiffness(flat) / (moving_mass(flat) * np.sqrt(VAN_DIJK_ALPHA)))) / (2 * np.pi)


def friction(stage: Stage) -> float:
    """Return the break-away friction [N]; without friction, the force for 1 m/s^2 (our choice)."""
    return float(breakaway(stage.flat())) or float(moving_mass(stage.flat()))


def travel(stage: Stage) -> tuple[float, float]:
    """Return the two ends [m] of the stage's own motion.

    If the motion does not move, they are a hundred strokes to either side of it; without a stroke, 0.1 m.
    """
    low, high = own_motion(stage).span
    reach = 0.0 if high > low else 100 * stage.flat().get("joint.stroke", 1e-3)
    return low - reach, high + reach


def longest_travel(stage: Stage) -> float:
    """Return the length [m] of the way at constant speed, a fixed fraction of the travel."""
    low, high = travel(stage)
    return WAY_FACTOR * (high - low)


def quicker(stage: Stage, factors: Any) -> dict[str, Any]:
    """Return the keys of the stage's controller made faster by `factors`, with SI values."""
    return sped_up(stage.flat(), factors)


def interval(stage: Stage, length: float) -> float:
    """Return a log's sample time [s]: at most `length`, in whole samples of the drive.

    The sample time is at least one such sample, even if that is longer than `length`.
    """
    step = as_built_keys(stage)["drive.sample_time"]
    return max(1, int(length / step * (1 + 1e-9))) * step


@dataclass(frozen=True)
class RigLog:
    """A log as the drive writes it, with the true motion behind it.

    `kind` is the kind of experiment for `friso identify` (None: recognised from the log), and `interval` the sample
    time [s]. `logged` and `true` are SI arrays of shape (n,) by role, such as "position". Further fields are the stage
    that ran, the seed of its noise, and why the run ended early ("": it did not).
    """

    name: str
    kind: str | None
    interval: float
    logged: Mapping[str, np.ndarray]
    true: Mapping[str, np.ndarray]
    stage: Stage
    seed: int
    failure: str = ""

    @property
    def log(self) -> Log:
        """Return the log as `friso identify` reads it, without the true motion."""
        return record(self.name, self.interval, **self.logged)


@dataclass(frozen=True)
class Outcome:
    """Outcome of an experiment on a stage: logs, a result of its own class, and `notes`."""

    experiment: str
    stage: Stage
    seed: int
    logs: tuple[RigLog, ...]
    result: Any
    notes: tuple[str, ...] = ()


def rig_log(recorded: RecordedRuns, row: int, name: str, kind: str | None, stage: Stage, seed: int) -> RigLog:
    """Return one run of a chunk, in `row`, as a log up to a failure.

    The log also ends early if, from some time on, the command only swings between its limits. `kind` is the kind of
    experiment for `friso identify` (None: recognised from the log).
    """
    status = int(recorded.statuses[row])
    count = recorded.logged["position"].shape[1]
    if status != Status.DONE:
        count = int(np.isfinite(recorded.logged["position"][row]).sum())
    logged, true = (
        {role: np.array(values[row, :count]) for role, values in signals.items()}
        for signals in (recorded.logged, recorded.true)
    )
    why = "" if status == Status.DONE else Status(status).text
    if not why and (end := _swings_between_limits(recorded.logged["force"][row], stage)):
        count, why = end, "the command swings between its limits to the end: the sampled loop is unstable"
    logged, true = ({role: values[:count] for role, values in channels.items()} for channels in (logged, true))
    why = why and f"after {count * recorded.interval:.3g} s: {why}"
    return RigLog(name, kind, recorded.interval, logged, true, stage, seed, why)


def stopped(log: RigLog) -> InputError:
    """Return the error for a log that stopped before it shows anything."""
    return InputError("controller", f"a loop that stopped {log.failure}", "a stable one", 'crossover = "8 Hz"')


LOG_PARTS, SATURATED_SHARE = 20, 0.1
"""Number of parts into which a log is divided to test stability, and a fraction of a part.

The command of an unstable loop spends at least this fraction of a part at its two limits.
"""


def _swings_between_limits(force: np.ndarray, stage: Stage) -> int:
    """Return the number of samples after which a command [N] only swings between its limits.

    `force` has the shape (n,). The result is 0 if the command does not end so, or has no limits.
    """
    limit = stage.flat().get(FORCE_LIMIT, np.inf)
    parts = np.array_split(force, LOG_PARTS)
    ways = [(np.mean(part >= 0.999 * limit), np.mean(part <= -0.999 * limit)) for part in parts]
    swings = np.array([min(sides) > 0 and sum(sides) > SATURATED_SHARE for sides in ways])
    if not swings[-1]:
        return 0
    rests = np.flatnonzero(~swings)
    first = int(rests[-1]) + 1 if len(rests) else 0
    return sum(len(part) for part in parts[: first + 1])


MULTISINE_PERIOD, MULTISINE_PERIODS = 8.0, 8
"""Period of the multisine in periods of the crossover, and number of periods.

The period is the inverse of the multisine's lowest frequency (1 Hz on the thesis's rig).
"""

HIGHEST_SHARE = 0.4
"""Highest frequency of the multisine over the sampling rate of the log."""

PHASES = int.from_bytes(b"sines")
"""Second half of the random generator's key for the phases of the multisine."""


@dataclass(frozen=True)
class Excitation:
    """Sizes of a multisine, the sum of sines with which a frequency response is measured.

    `strength` is the RMS of the injected force over static friction, and `top` the highest frequency over the
    crossover. `lines` is the approximate number of frequencies, spaced evenly in the logarithm. `samples` are those of
    the log per period of the crossover.
    """

    strength: float
    top: float
    lines: int
    samples: float


SLIDING = Excitation(2.0, 100.0, 150, 625.0)
"""Excitation that moves the cart, up to 800 Hz on the thesis's rig, logged every 0.2 ms; the thesis states no strength.
"""


def excite(
    stage: Stage,
    place: float,
    seed: int,
    runs: int = 1,
    changes: Mapping[str, Any] | None = None,
    kind: Excitation = SLIDING,
) -> RecordedRuns:
    """Run the stage at a standstill at a place [m], and inject a multisine as a force.

    `seed` draws the phases of the multisine and the noise, and `kind` has the sizes of the multisine. `changes` of keys
    are arrays of shape (runs,). Returns the recorded runs, which share the seed.
    """
    step, slow = as_built_keys(stage)["drive.sample_time"], interval(stage, 1 / (kind.samples * pace(stage)))
    period = round(MULTISINE_PERIOD / pace(stage) / slow) * slow
    lines = np.geomspace(1, min(kind.top * MULTISINE_PERIOD, HIGHEST_SHARE * period / slow), kind.lines)
    force = kind.strength * friction(stage) * sines(round(period / step), np.unique(np.rint(lines).astype(int)), seed)
    task = replace(
        standing(place, MULTISINE_PERIODS * period), injected=np.tile(force, MULTISINE_PERIODS), injected_each=step
    )
    (recorded,) = run(stage, task, [seed] * runs, slow, changes)
    return recorded


def sines(count: int, lines: np.ndarray, seed: int) -> np.ndarray:
    """Return one period of a sum of sines with equal amplitudes, random phases and RMS 1.

    The period has `count` samples. `lines` are the sines' whole numbers of turns in it.
    """
    phases = np.random.Generator(np.random.Philox(key=[seed, PHASES])).uniform(0, 2 * np.pi, len(lines))
    spectrum = np.zeros(count // 2 + 1, complex)
    spectrum[lines] = np.exp(1j * phases)
    signal = np.fft.irfft(spectrum, count)
    return signal / signal.std()


def estimate_plant(logs: Sequence[RigLog]) -> FrequencyResponse:
    """Estimate the response from commanded force to position, averaged over several logs.

    It is estimated indirectly, by way of the injected force. Raises InputError for a log of a loop that was not stable.
    """
    for log in logs:
        if log.failure:
            raise stopped(log)
    return multisine([from_log(log.log, "force", "position", "disturbance")[0] for log in logs])


def loop(log: RigLog) -> FrequencyResponse:
    """Estimate the open loop from one log: the controller's force over the total, sign reversed."""
    injected, commanded = log.logged["disturbance"], log.logged["force"]
    record = ResponseRecord(commanded, injected - commanded, log.interval, injected)
    return multisine([record], Channels("error", "1", "loop", "1"))
