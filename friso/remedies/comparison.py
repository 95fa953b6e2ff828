"""Compare stages on the same drawn machines: who swings on, who settles and how soon, force and error.

Each machine makes the move of the stage file, with the drive as built if any of the files describes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from friso.engine.arrays import ArrayColumns
from friso.engine.batch import part_of, run_chunks, usual_interval
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner, rests
from friso.equations.structure import shared_structure
from friso.errors import InputError
from friso.hunting.criteria import CREEPS, FAILED, RESTS, SWINGS
from friso.hunting.measures import Measures, measure_runs, measuring_options
from friso.intervals import Share, quantile_interval, share
from friso.progress import Progress, silent
from friso.remedies.catalogue import BANDWIDTH
from friso.remedies.machines import MEETING_SHARE, Fleet, Goal, draw_common
from friso.remedies.method import tune
from friso.stage import Stage
from friso.stage.controllers import as_tuned, controller_of
from friso.stage.correlations import Correlations
from friso.stage.rig import is_as_built
from friso.virtual_rig.run import measured_recording, run_flat, with_complete_drive
from friso.virtual_rig.task import SAMPLE_TIME, motion_task

RUN_RTOL = 1e-6
"""Relative tolerance of runs with the controller in continuous time, as in maps."""

LATEST_STAND_SHARE = 0.5
"""Latest time, over the duration, at which the reference may come to stand, because lasting swings are sought
afterwards."""

LONGER_FACTORS = (2, 6, 36)
"""Factors on the duration of runs, for machines that end off their reference without a swing in their own run."""

TRIED_MACHINES = 8
"""Machines that are followed first for longer than twice their run; only if one of them swings, the others are, too."""


@dataclass(frozen=True)
class Quantile:
    """A value that 95 % of the machines do not exceed, and its 95 % interval; infinite if too few reach it."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, values: np.ndarray) -> Quantile:
        """Return the quantile of values (n,), of which some may be infinite."""
        ordered = np.sort(values)
        low, high = quantile_interval(ordered, MEETING_SHARE)
        return cls(float(ordered[int(np.ceil(MEETING_SHARE * values.size)) - 1]), max(low, 0.0), high)


@dataclass(frozen=True)
class MachineMeasures(ArrayColumns):
    """Measures of the runs of machines, arrays of shape (count,).

    `outcome` are words of `friso.hunting.criteria.run_outcome`, with the tolerance as band. `settling` [s] is the
    longest time to settle at a place (`friso.hunting.criteria.run_outcome`). `force` [N] is the largest one, and
    `error` [m] the largest deviation in the last quarter of the run. Numbers that are unknown, or never reached, are
    infinite.
    """

    outcome: np.ndarray
    settling: np.ndarray
    force: np.ndarray
    error: np.ndarray

    @classmethod
    def of(cls, measures: Measures) -> MachineMeasures:
        """Return what is compared of the measures of runs."""
        error = np.abs(measures.offset) + measures.peak_to_peak / 2
        numbers = (measures.settling_time[0], measures.largest_force, error)
        return cls(measures.outcome, *(np.where(np.isfinite(column), column, np.inf) for column in numbers))


@dataclass(frozen=True)
class Compared:
    """A stage with its `name` and the measures of the machines that it was laid over."""

    name: str
    stage: Stage
    measures: MachineMeasures

    @property
    def isolated(self) -> bool:
        """Tell whether the stage stands on a free joint."""
        return self.stage.joint is not None and not self.stage.flat()["joint.locked"]

    @property
    def done(self) -> np.ndarray:
        """Return which runs were completed, shape (count,)."""
        return self.measures.outcome != FAILED

    @property
    def swinging(self) -> Share:
        """Return the probability that a machine swings in the end: in its run, or followed for longer."""
        return share(self.measures.outcome == SWINGS, self.done)

    @property
    def resting(self) -> Share:
        """Return the probability that a machine is in position at the end of its run, at rest."""
        return share(self.measures.outcome == RESTS, self.done)

    @property
    def settled(self) -> int:
        """Return how many machines settle wherever their reference stands."""
        return int(np.isfinite(self.measures.settling).sum())

    @cached_property
    def settling(self) -> Quantile:
        """Return the time [s] in which 95 % of the machines settle; infinite if fewer do."""
        return Quantile.of(self.measures.settling)

    @cached_property
    def force(self) -> Quantile:
        """Return the largest force [N] of 95 % of the machines."""
        return Quantile.of(self.measures.force)

    @cached_property
    def error(self) -> Quantile:
        """Return the largest deviation [m] of 95 % of the machines at the end of their runs."""
        return Quantile.of(self.measures.error)

    @property
    def failed(self) -> int:
        """Return how many runs were not completed."""
        return int(np.count_nonzero(~self.done))


@dataclass(frozen=True)
class Comparison:
    """Stages compared on the same machines, drawn with a seed.

    A machine is in position `within` a tolerance [m]. The runs are of the machines `as_built`, or with the controller
    in continuous time. An interruption skipped the stages in `not_run`, which are given by name.
    """

    results: tuple[Compared, ...]
    machines: Fleet
    within: float
    seed: int
    as_built: bool
    notes: tuple[str, ...] = ()
    not_run: tuple[str, ...] = ()

    @property
    def stage(self) -> Stage:
        """Return the first stage."""
        return self.results[0].stage

    @property
    def ranked(self) -> tuple[Compared, ...]:
        """Return the stages by how soon 95 % of the machines settle, then by how many do."""
        return tuple(sorted(self.results, key=lambda result: (result.settling.value, -result.settled)))


def compare(
    stages: Mapping[str, Stage],
    count: int = 400,
    seed: int = 1,
    within: float = 1e-6,
    correlations: Sequence[Correlations] | None = None,
    progress: Progress = silent,
    notes: Sequence[str] = (),
) -> Comparison:
    """Run `count` machines with each of several stages, given by name.

    The machines are drawn once and laid over each stage (`friso.remedies.machines.draw_common`). A machine is in
    position `within` a tolerance [m] of its reference. `notes` are for the reader. Raises InputError for keys of which
    hardly any draw is allowed in all stages.
    """
    as_built = any(is_as_built(stage) for stage in stages.values())
    notes, clocked = [*notes], dict[str, Stage]()
    for name, stage in stages.items():
        clocked[name] = stage
        if as_built and "drive.sample_time" not in stage.flat():
            clocked[name] = stage.with_numbers({"drive.sample_time": SAMPLE_TIME})
            notes.append(f"{name}: the stage file gives no drive.sample_time: {1e6 * SAMPLE_TIME:g} us are taken")
    own = correlations or [Correlations() for _ in stages]
    machines, held = draw_common([*clocked.values()], own, count, seed)
    if held:
        notes.append(f"not drawn, being the same on all machines: {', '.join(held)}")
    work, results = _Work(machines, seed, within, as_built), list[Compared]()
    try:
        for number, (name, stage) in enumerate(clocked.items()):
            parts = []
            for part in work.runs(stage, np.arange(count), 1):
                done = number * count + sum(len(one.outcome) for one in parts)
                progress(done, len(stages) * count, name)
                parts.append(part)
            measures = work.with_slow_swings(stage, MachineMeasures.joined(parts))
            results.append(Compared(name, stages[name], measures))
    except KeyboardInterrupt:
        if not results:
            raise
    left = tuple(stages)[len(results) :]
    return Comparison(tuple(results), machines, within, seed, as_built, tuple(notes), left)


def check_motion(stage: Stage) -> None:
    """Check the motion. Raises InputError if the reference comes to stand too late in the run, or never."""
    flat = stage.flat()
    corner, duration = float(last_corner(flat)), flat["motion.duration"]
    if not rests(flat):
        example = '[motion] kind = "step", size = "1 mm", duration = "20 s"'
        raise InputError("motion.kind", f'"{flat["motion.kind"]}"', "a reference that stands in the end", example)
    if corner > LATEST_STAND_SHARE * duration:
        expected = f"at least {corner / LATEST_STAND_SHARE:g} s: the reference stands by half of it"
        raise InputError(
            "motion.duration", f"{duration:g} s", expected, f'duration = "{corner / LATEST_STAND_SHARE:g} s"'
        )


@dataclass(frozen=True)
class _Work:
    """What the runs of all stages share: machines, seed, tolerance `within` [m], and whether the drive is as built."""

    machines: Fleet
    seed: int
    within: float
    as_built: bool

    @np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
    def runs(self, stage: Stage, numbers: np.ndarray, longer: int) -> Iterator[MachineMeasures]:
        """Yield the measures of some machines with a stage, chunk by chunk.

        The runs are `longer` times as long as the stage's motion, and samples as many times as far apart.
        """
        drawn = {key: values[numbers] for key, values in self.machines.drawn(stage).items()}
        flat = stage.flat({**as_tuned(stage.flat()), **drawn})
        flat["motion.duration"] = longer * flat["motion.duration"]
        bands = (self.within, self.within)
        if not self.as_built:
            options = measuring_options(RUN_RTOL, bands=bands)
            for runs in run_chunks(kernel(shared_structure(flat)), flat, len(numbers), options):
                yield MachineMeasures.of(measure_runs(runs.part(flat), runs, bands))
            return
        flat = with_complete_drive(flat)
        task, sample = motion_task(flat, len(numbers)), flat["drive.sample_time"]
        interval = max(1, round(usual_interval(task.duration) / sample)) * sample
        for recorded in run_flat(flat, stage.floor, task, (self.seed + numbers).tolist(), interval):
            yield MachineMeasures.of(measured_recording(part_of(flat, recorded.numbers), recorded, bands))

    def with_slow_swings(self, stage: Stage, measures: MachineMeasures) -> MachineMeasures:
        """Return measures of a stage in which machines swing whose swing is slower than their run.

        Machines that end outside the tolerance without a swing are run for longer. Without an integral nothing moves
        them so late.
        """
        if stage.controller is None or not controller_of(stage.flat()).integrates(stage.flat()):
            return measures
        outcome = measures.outcome.copy()
        for factor in LONGER_FACTORS:
            left = np.flatnonzero(outcome == CREEPS)
            first = len(left) if factor == LONGER_FACTORS[0] else TRIED_MACHINES
            for some in (left[:first], left[first:]):
                if some.size and (some[0] == left[0] or SWINGS in outcome[left[:first]]):
                    swings = np.concatenate([part.outcome == SWINGS for part in self.runs(stage, some, factor)])
                    outcome[some] = np.where(swings, SWINGS, CREEPS)
        return replace(measures, outcome=outcome)


AS_IT_IS, LOCKED, FASTER, ISOLATOR = "as it is", "joint locked", "faster controller", "isolator"
"""Names of the stage as it is, of the stage with its joint locked, and of its remedies."""

REMEDIES = {BANDWIDTH: FASTER, "isolator": ISOLATOR}
"""Names, in a comparison, of remedies of the catalogue: the smallest change of the controller, and the joint."""


def with_remedies(
    stage: Stage, within: float, seed: int, correlations: Correlations, progress: Progress = silent
) -> tuple[dict[str, Stage], tuple[str, ...]]:
    """Return a stage without isolator, faster, and with isolator, by name, as `friso tune` would write these.

    The isolator is the stage's own joint, free, if it has one. Remedies that are not sure to work are left out. Returns
    the stages, and notes that say what is left out. Raises KeyboardInterrupt if the search is interrupted.
    """
    variants = stage.variants()
    rigid, own = variants.get("locked", stage), variants.get("free")
    chosen = [name for name in REMEDIES if own is None or name == BANDWIDTH]
    advice = tune(rigid, Goal(within), seed, correlations, chosen=chosen, progress=progress)
    if advice.interrupted:
        raise KeyboardInterrupt
    working = {outcome.remedy.name: outcome.stage for outcome in advice.outcomes if outcome.certainty == "works"}
    stages = {LOCKED if stage.joint else AS_IT_IS: rigid}
    stages |= {REMEDIES[name]: advice.complete(changed) for name in chosen if (changed := working.get(name))}
    if own is not None:
        stages[ISOLATOR] = own
    left = [REMEDIES[name] for name in chosen if name not in working] if advice.needed else []
    why = "no setting of it is sure to work (friso tune says why, and tries other remedies)"
    notes = [f"{name} is left out: {why}" for name in left]
    if not advice.needed:
        notes.append(f"nothing has to change of the stage {next(iter(stages))}, by friso tune: no remedy is tried")
    return stages, tuple(notes)
