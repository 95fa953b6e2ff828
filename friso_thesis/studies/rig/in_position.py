"""Standstill with the joint locked and free (thesis, Fig. 28).

The experiment shows which disturbance moves the stage, and what damping recovers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.signal import welch

from friso.engine.arrays import ArrayColumns
from friso.progress import Progress
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.studies.rig.moves_on_rails import crossover, crossover_key, move, with_joint
from friso.studies.rig.outcome import Outcome, interval, rig_log
from friso.virtual_rig.run import RecordedRuns, as_built_keys, run
from friso.virtual_rig.task import MoveTask, standing

FASTER_CROSSOVER = 2.0
"""Raised crossover relative to that of the stage: 16 Hz for the 8 Hz of the thesis's rig (Sec. 4.3.2)."""

SETTLING_TIME, RECORD_LENGTH = 4.0, 12.0
"""Settling time before the record [s], and length of the record [s]."""

LONGEST_INTERVAL = 5e-4
"""Longest time between samples [s]."""

FORCE_BITS = 14
"""Resolution of the drive's force between its limits [bits]: our choice. The noise of the amplifier is taken to be that
of rounding to uniform steps."""

LIMIT_FACTOR = 60.0
"""Largest force over the static friction, for a drive that states none: that of the thesis's rig, rounded."""

FLOOR = {"frequency": ["1 Hz", "10 Hz", "100 Hz"], "acceleration": [f"{a} m/s^2/Hz^0.5" for a in (1e-5, 1e-4, 1e-4)]}
"""Acceleration of the floor of a quiet laboratory, for a stage that states none: our choice. In thirds of an octave its
velocity stays below 2.4 um/s RMS, and so below VC-E (3.1 um/s) of the usual vibration criteria."""

DAMPING_RATIOS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Damping ratios of the joint with the stage's mass, our choice."""

SPECTRUM_SEGMENTS = 6
"""Number of segments of the record for its spectrum."""

CASES = {"locked": True, "free": False}
SOURCES = ("encoder", "amplifier", "floor", "all")


@dataclass(frozen=True)
class Standstill(ArrayColumns):
    """Deviation from the mean [m] of runs at a standstill.

    `true` is the true deviation, and `read` the one that the encoder reads, each as RMS and largest value, shape (runs,
    2). `spectrum` (runs, n) is the amplitude spectral density of the true position [m/Hz^0.5].
    """

    true: np.ndarray
    read: np.ndarray
    mean: np.ndarray
    spectrum: np.ndarray


@dataclass(frozen=True)
class InPosition:
    """Standstills at `crossover` [Hz], by case (locked, free) and source of the disturbance.

    There is one run for each, and one for each louder noise of the force. `frequencies` [Hz] belong to the spectra.
    `damped` has runs with a free joint and all disturbances, by `damping` [N s/m]; `own_damping` is the joint's.
    `louder` has the largest deviations [m] locked and free, by the factor on the force noise. `amplifier` is the
    RMS [N] of the force noise; `own_floor` says whether the stage states the floor. `after_move` has, by case, runs
    with all disturbances after the move, as long after it as other runs after their start.
    """

    crossover: float
    amplifier: float
    own_floor: bool
    frequencies: np.ndarray
    runs: Mapping[tuple[str, str], Standstill]
    after_move: Mapping[str, Standstill]
    damping: np.ndarray
    own_damping: float
    damped: Standstill
    traces: Mapping[str, tuple[np.ndarray, np.ndarray]]
    louder: Mapping[float, tuple[float, float]] = field(default_factory=dict)

    def ratio(self, source: str) -> float:
        """Return the RMS with the joint free over the RMS with it locked, for one `source`."""
        return float(self.runs["free", source].true[0, 0] / self.runs["locked", source].true[0, 0])

    @property
    def recovered(self) -> np.ndarray:
        """Return the fraction of the RMS difference, free to locked, that each damping recovers."""
        locked, free = (self.runs[case, "all"].true[0, 0] for case in CASES)
        return (free - self.damped.true[:, 0]) / (free - locked)


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """Return all standstills. Raises InputError without a joint or a crossover."""
    result, recordings = in_position(stage, seed, progress)
    logs = tuple(
        rig_log(recorded, 0, f"in_position_{case}", None, machine, seed)
        for case, (recorded, machine) in recordings.items()
    )
    notes = ("the logs are of a standstill, from which friso identify cannot identify anything",)
    return Outcome("in-position", stage, seed, logs, result, notes)


def in_position(
    stage: Stage, seed: int, progress: Progress, noises: tuple[float, ...] = ()
) -> tuple[InPosition, dict[str, tuple[RecordedRuns, Stage]]]:
    """Return all standstills, and by case the run with all disturbances, with its stage.

    With all disturbances, the noise of the force is also multiplied by the factors `noises`.
    """
    fast = with_joint(stage, locked=False).replace(
        {crossover_key(stage): f"{FASTER_CROSSOVER * crossover(stage):.6g} Hz"}
    )
    shaken = fast if stage.floor is not None else fast.replace({f"floor.{key}": value for key, value in FLOOR.items()})
    quiet = fast.replace({"floor": None}) if stage.floor is not None else fast
    force = amplifier_noise(stage)
    step = as_built_keys(stage)["drive.sample_time"]
    noisy = with_noise(standing(0.0, SETTLING_TIME + RECORD_LENGTH), force, seed, step)
    after_move = with_noise(replace(move(stage), duration=SETTLING_TIME + RECORD_LENGTH), force, seed, step)
    # "all" stands first: its run is the one recorded
    plans = (
        (quiet, {"encoder": 0.0, "amplifier": 1.0}),
        (shaken, {"all": 1.0, "floor": 0.0} | {_louder(factor): factor for factor in noises}),
    )
    runs, recordings, after = {}, {}, {}
    for done, (case, locked) in enumerate(CASES.items()):
        progress(done, len(CASES) + 1, f"joint {case}")
        for machine, factors in plans:
            fixed = machine.replace({"joint.locked": locked})
            task = replace(noisy, injected=np.outer([*factors.values()], noisy.injected))
            recorded = _recorded(fixed, task, seed, _silenced(fixed, factors), len(factors))
            stands = _standstill(recorded, SETTLING_TIME)
            runs |= {(case, source): stands.take([row]) for row, source in enumerate(factors)}
            if "all" in factors:
                recordings[case] = (recorded, fixed)
                after[case] = _standstill(_recorded(fixed, after_move, seed), SETTLING_TIME)
    progress(len(CASES), len(CASES) + 1, "joint free, more and less damping")
    peaks = {key: float(stands.true[0, 1]) for key, stands in runs.items()}
    louder = {factor: (peaks["locked", _louder(factor)], peaks["free", _louder(factor)]) for factor in noises}
    flat = stage.flat()
    damping = 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"]) * np.array(DAMPING_RATIOS)
    damped = _standstill(_recorded(shaken, noisy, seed, {"joint.damping": damping}, len(damping)), SETTLING_TIME)
    progress(len(CASES) + 1, len(CASES) + 1, "done")
    traces = {case: _watched(recorded, SETTLING_TIME) for case, (recorded, _) in recordings.items()}
    logged_each = interval(stage, LONGEST_INTERVAL)
    frequencies = np.fft.rfftfreq(segment(logged_each), logged_each)
    return InPosition(
        FASTER_CROSSOVER * crossover(stage), force, stage.floor is not None, frequencies, runs, after, damping,
        float(flat["joint.damping"]), damped, traces, louder,
    ), recordings  # fmt: skip


def _louder(factor: float) -> str:
    return f"all, {factor:g} times the force noise"


def amplifier_noise(stage: Stage) -> float:
    """Return the RMS [N] of the drive's force noise, as from rounding to `FORCE_BITS`.

    The bits divide the range between its limits.
    """
    flat = stage.flat()
    limit = flat.get(FORCE_LIMIT, LIMIT_FACTOR * flat.get("friction.static", 1.0))
    return float(2 * limit / 2**FORCE_BITS / np.sqrt(12))


def with_noise(task: MoveTask, force: float, seed: int, step: float) -> MoveTask:
    """Return the task with a random force added, unknown to the drive.

    The force has an RMS [N], and changes at every sample of the drive, every `step` [s].
    """
    noise = np.random.default_rng(seed).standard_normal(int(np.ceil(task.duration / step)) + 1)
    return replace(task, injected=force * noise, injected_each=step, unknown=True)


def _silenced(stage: Stage, sources: Iterable[str]) -> dict[str, Any]:
    """Return noise and resolution of the encoder for a run with each source of the disturbance.

    They are 0 in runs with the amplifier or the floor alone. The result is empty if the stage has no drive.
    """
    flat, silent = stage.flat(), np.isin([*sources], ("amplifier", "floor"))
    keys = ("drive.encoder_noise", "drive.encoder_resolution") if stage.drive is not None else ()
    return {key: np.where(silent, 0.0, flat[key]) for key in keys if key in flat}


def _recorded(
    stage: Stage, task: MoveTask, seed: int, changes: Mapping[str, Any] | None = None, count: int = 1
) -> RecordedRuns:
    (recorded,) = run(stage, task, [seed] * count, interval(stage, LONGEST_INTERVAL), changes)
    return recorded


def _watched(recorded: RecordedRuns, since: float) -> tuple[np.ndarray, np.ndarray]:
    """Return time [s] and the first run's true deviation from its reference [m] from `since` on.

    The times count from `since` [s].
    """
    late = recorded.time >= since
    deviation = recorded.true["position"][0] - recorded.logged["reference"][0]
    return recorded.time[late] - since, deviation[late]


def _standstill(recorded: RecordedRuns, since: float) -> Standstill:
    late = recorded.time >= since
    reference = recorded.logged["reference"][:, late]
    true, read = (signals["position"][:, late] - reference for signals in (recorded.true, recorded.logged))
    mean = true.mean(axis=1)
    spectrum = welch(true, 1 / recorded.interval, nperseg=segment(recorded.interval), axis=1)[1]
    return Standstill(_rms_and_peak(true), _rms_and_peak(read), mean, np.sqrt(spectrum))


def segment(step: float) -> int:
    """Return the number of samples per segment of the spectrum, for a sample time [s].

    Segments overlap by half.
    """
    return 2 * int(RECORD_LENGTH / step / (SPECTRUM_SEGMENTS + 1))


def _rms_and_peak(deviation: np.ndarray) -> np.ndarray:
    varying = deviation - deviation.mean(axis=1, keepdims=True)
    return np.column_stack([varying.std(axis=1), abs(varying).max(axis=1)])
