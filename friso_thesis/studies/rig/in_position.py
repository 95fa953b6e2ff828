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
from friso.quantities import percent
from friso.shown.drawing.figure import BLUE, GREEN, GREY, ORANGE, VERMILLION, Axis, Figure, Limit, Panel, Series
from friso.shown.text import with_unit
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.virtual_rig.run import RecordedRuns, as_built_keys, run
from friso.virtual_rig.task import MoveTask, standing
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.moves_on_rails import crossover, crossover_key, move, with_joint
from friso_thesis.studies.rig.outcome import Outcome, interval, rig_log

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
class NoisyStandstill:
    """Standstill with another noise of the force: largest deviations [m] with the joint locked and free.

    `recovered` is the fraction of the RMS difference, free to locked, that the joint recovers with as much damping as
    the bristles of the bearing have.
    """

    locked: float
    free: float
    recovered: float


@dataclass(frozen=True)
class InPosition:
    """Standstills at `crossover` [Hz], by case (locked, free) and source of the disturbance.

    There is one run for each, and one for each louder noise of the force. `frequencies` [Hz] belong to the spectra.
    `damped` has runs with a free joint and all disturbances, by `damping` [N s/m]; `own_damping` is the joint's.
    `louder` has standstills by the factor on the force noise. `amplifier` is the
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
    louder: Mapping[float, NoisyStandstill] = field(default_factory=dict)
    bearing_damping: float = 0.0
    """Damping [N s/m] of the bearing's bristles, which holds the locked stage."""

    def ratio(self, source: str) -> float:
        """Return the RMS with the joint free over the RMS with it locked, for one `source`."""
        return float(self.runs["free", source].true[0, 0] / self.runs["locked", source].true[0, 0])

    @property
    def recovered(self) -> np.ndarray:
        """Return the fraction of the RMS difference, free to locked, that each damping recovers."""
        locked, free = (self.runs[case, "all"].true[0, 0] for case in CASES)
        return (free - self.damped.true[:, 0]) / (free - locked)


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
    flat = stage.flat()
    bearing = float(flat.get("friction.bristle_damping", 0.0))
    louder = _over_noise(shaken, noisy, seed, bearing, runs, noises)
    damping = 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"]) * np.array(DAMPING_RATIOS)
    damped = _standstill(_recorded(shaken, noisy, seed, {"joint.damping": damping}, len(damping)), SETTLING_TIME)
    progress(len(CASES) + 1, len(CASES) + 1, "done")
    traces = {case: _watched(recorded, SETTLING_TIME) for case, (recorded, _) in recordings.items()}
    logged_each = interval(stage, LONGEST_INTERVAL)
    frequencies = np.fft.rfftfreq(segment(logged_each), logged_each)
    return InPosition(
        FASTER_CROSSOVER * crossover(stage), force, stage.floor is not None, frequencies, runs, after, damping,
        float(flat["joint.damping"]), damped, traces, louder, bearing,
    ), recordings  # fmt: skip


def _over_noise(
    stage: Stage,
    task: MoveTask,
    seed: int,
    damping: float,
    runs: Mapping[tuple[str, str], Standstill],
    noises: tuple[float, ...],
) -> dict[float, NoisyStandstill]:
    """Return standstills by the factor on the force noise, free also with a `damping` [N s/m] of the joint.

    `runs` has the others, by case and source.
    """
    if not noises:
        return {}
    louder = replace(task, injected=np.outer(noises, task.injected))
    changes = {"joint.damping": np.full(len(noises), damping)}
    damped = _standstill(_recorded(stage, louder, seed, changes, len(noises)), SETTLING_TIME).true[:, 0]
    every = {}
    for factor, rest in zip(noises, damped, strict=True):
        locked, free = (runs[case, _louder(factor)].true[0] for case in CASES)
        recovered = (free[0] - rest) / (free[0] - locked[0])
        every[factor] = NoisyStandstill(float(locked[1]), float(free[1]), float(recovered))
    return every


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


COLOURS = {"locked": VERMILLION, "free": BLUE}

PARTS = (GREEN, ORANGE, GREY)
"""Colours of the single disturbances, in order."""


def _source(result: InPosition, source: str) -> str:
    locked, free = (with_unit(result.runs[case, source].true[0, 0], "m") for case in CASES)
    return f"{source} {locked} and {free}"


def _damping(result: InPosition) -> str:
    """Say how much of the free joint's larger deviation at standstill more damping removes."""
    recovered = result.recovered
    best = int(np.argmax(recovered))
    factor = result.damping / result.own_damping
    ten = int(np.argmin(abs(np.log(factor / 10))))
    if recovered[best] < 0.01:
        return "More damping in the joint recovers none of the difference."
    return (
        f"Damping in the joint recovers little of the difference: {percent(recovered[ten])} at {factor[ten]:.3g} times "
        f"its own {with_unit(result.own_damping, 'N*s/m')}, and at most {percent(recovered[best])}, at "
        f"{with_unit(result.damping[best], 'N*s/m')}. The rest is due to stiffness: the locked stage is held by the "
        "sticking bearing, the free one only by the joint and the controller."
        if recovered[ten] < 0.5
        else f"Damping in the joint recovers {percent(recovered[ten])} of the difference at {factor[ten]:.3g} "
        f"times its own {with_unit(result.own_damping, 'N*s/m')}, and {percent(recovered[best])} at "
        f"{with_unit(result.damping[best], 'N*s/m')}."
    )


def _after(result: InPosition) -> list[str]:
    creeps = {case: abs(float(result.after_move[case].mean[0])) for case in CASES}
    parts = [f"{with_unit(value, 'm')} with the joint {case}" for case, value in creeps.items()]
    return [f"From {SETTLING_TIME:.3g} s after a move on, the mean position is still off by {' and '.join(parts)}."]


def _over_time(result: InPosition) -> Figure:
    lines = tuple(
        Series(*result.traces[case], f"joint {case}", COLOURS[case], width=0.8) for case in ("free", "locked")
    )
    panel = Panel("", Axis("Time", "s"), Axis("Position minus reference", "m"), lines)
    caption = "The true position, all disturbances (Fig. 28)."
    return Figure("in_position", f"Standstill at {result.crossover:.3g} Hz", caption, (panel,))


def _spectra(result: InPosition) -> Figure:
    """Draw the spectra of the position at a standstill, one panel for each case of the joint."""
    panels = []
    above = slice(1, None)
    for case, colour in COLOURS.items():
        lines = [
            Series(result.frequencies[above], result.runs[case, source].spectrum[0, above], source, line, width=width)
            for source, line, width in zip(SOURCES, (*PARTS, colour), (1.0, 1.0, 1.0, 1.6), strict=True)
        ]
        densities = Axis("Amplitude density", "m/Hz^0.5", (1e-14, 1e-6), log=True)
        panels.append(Panel(f"joint {case}", Axis("Frequency", "Hz", log=True), densities, tuple(lines)))
    title = "Effect of each disturbance on the position"
    return Figure("in_position_spectra", title, "One-sided spectra of the true position.", tuple(panels), columns=2)


def _over_damping(result: InPosition) -> Figure:
    """Draw the RMS position error at standstill over the damping of the joint.

    The values of the locked and the free joint are shown for comparison.
    """
    free = Series(result.damping, result.damped.true[:, 0], "joint free", BLUE)
    limits = (
        Limit((float(result.runs["locked", "all"].true[0, 0]),), "joint locked", VERMILLION),
        Limit(
            (float(result.runs["free", "all"].true[0, 0]),),
            f"joint free, its own {with_unit(result.own_damping, 'N*s/m')}",
            GREY,
        ),
    )
    y = Axis("RMS deviation", "m", (0.0, 1.2 * float(result.damped.true[:, 0].max())))
    panel = Panel("", Axis("Damping of the joint", "N*s/m", log=True), y, (free,), limits=limits)
    return Figure("in_position_damping", "What damping in the joint recovers", "All disturbances.", (panel,))


def _document(run: Standstill) -> dict[str, float]:
    names = ("rms_m", "peak_m")
    true = dict(zip(names, run.true[0], strict=True))
    read = {f"read_{name}": value for name, value in zip(names, run.read[0], strict=True)}
    return {**true, **read, "mean_m": float(run.mean[0])}


class InPositionExperiment(RigExperiment):
    """Standstill with the joint locked and free, by disturbance and damping."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Return all standstills. Raises InputError without a joint or a crossover."""
        result, recordings = in_position(stage, seed, progress)
        logs = tuple(
            rig_log(recorded, 0, f"in_position_{case}", None, machine, seed)
            for case, (recorded, machine) in recordings.items()
        )
        notes = ("the logs are of a standstill, from which friso identify cannot identify anything",)
        return Outcome("in-position", stage, seed, logs, result, notes)

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say how still the stage stands, what moves it, and what damping does."""
        result: InPosition = outcome.result
        locked, free = (result.runs[case, "all"].true[0] for case in CASES)
        floor = "the floor of the stage file" if result.own_floor else "a quiet laboratory's floor (assumed)"
        return [
            f"Settled at {result.crossover:.3g} Hz, the stage deviates by {with_unit(locked[0], 'm')} RMS "
            f"(peak {with_unit(locked[1], 'm')}) with the joint locked and by {with_unit(free[0], 'm')} RMS "
            f"(peak {with_unit(free[1], 'm')}) with it free: {result.ratio('all'):.2g} times as much.",
            f"Disturbances: {floor}, and force noise of the drive of {with_unit(result.amplifier, 'N')} RMS (assumed: "
            f"rounding to {FORCE_BITS} bits). Each one alone, RMS with the joint locked and free: "
            f"{'; '.join(_source(result, source) for source in SOURCES[:-1])}.",
            _damping(result),
            *_after(result),
        ]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw position over time, spectra, and RMS over the damping."""
        result: InPosition = outcome.result
        return [_over_time(result), _spectra(result), _over_damping(result)]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return all results for the JSON document."""
        result: InPosition = outcome.result
        return {
            "crossover_hz": result.crossover,
            "amplifier_noise_n": result.amplifier,
            "floor_of_the_stage": result.own_floor,
            "runs": {case: {source: _document(result.runs[case, source]) for source in SOURCES} for case in CASES},
            "after_move": {case: _document(result.after_move[case]) for case in CASES},
            "frequencies_hz": result.frequencies,
            "spectra_m_per_root_hz": {case: result.runs[case, "all"].spectrum[0] for case in CASES},
            "damping_ns_per_m": result.damping,
            "damped_rms_m": result.damped.true[:, 0],
            "recovered": result.recovered,
        }


EXPERIMENT = InPositionExperiment()
