"""Compare options: run every option on every machine, all machines of an option at once.

The bandwidth is found from which a controller alone brings random machines to rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.motion import Stand, last_corner, rests, stands
from friso.equations.settings import settings_named
from friso.equations.structure import shared_structure
from friso.errors import InputError
from friso.frequency.crossover import bandwidths_at, limits
from friso.hunting.criteria import CREEPS, SWINGS, settling_in_the_end
from friso.progress import Progress, silent
from friso.shares import Share, share
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.stage.correlations import Correlations
from friso.stage.rig import AS_BUILT
from friso.studies.compare.machines import Machines, draw_machines
from friso.studies.compare.measures import (
    EstimatedValue,
    Later,
    LoopRobustness,
    MachineMeasures,
    difference,
    linear_loops,
    measure_chunk,
    median,
    staying_in_position,
)
from friso.studies.compare.options import ADRC, OPTIONS, CompareOptions, Option, linear_flat, options
from friso.studies.settings import settings
from friso.virtual_rig.run import RecordedRuns, run
from friso.virtual_rig.task import MoveTask, own_motion


@dataclass(frozen=True)
class NeededBandwidth:
    """Fractions of drawn machines that come to rest in the end by the controller alone, over bandwidth.

    `bandwidths` [Hz], shape (n,), are the last 0 dB crossings of the stage's own open loop, with ever faster
    controllers. They run from the present one to the highest that keeps enough margin. `shares`, shape (n,), are the
    fractions, and `factors`, shape (n,), say how much faster the controllers are. The joint is locked, and the
    controller in continuous time.
    """

    bandwidths: np.ndarray
    shares: np.ndarray
    factors: np.ndarray

    def turning(self, enough: float) -> int | None:
        """Return the index of the bandwidth from which on enough machines come to rest.

        `enough` is the fraction of machines that counts as enough. Returns None if the fraction at the highest
        bandwidth is smaller.
        """
        missed = np.flatnonzero(self.shares < enough)
        first = int(missed[-1]) + 1 if missed.size else 0
        return first if first < len(self.shares) else None


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def needed_bandwidth(machines: Machines, locked: Stage, within: float) -> NeededBandwidth | None:
    """Run moves of some machines at many bandwidths, and count those that come to rest.

    The joint is `locked` in the stage, and rest means `within` [m] of the reference. Returns None if no higher
    bandwidth keeps the margin.
    """
    tried, count = settings.needed_bandwidths, min(machines.count, settings.needed_machines)
    ideal = locked.replace({table: None for table in AS_BUILT if getattr(locked, table)})
    flat = ideal.flat()
    highest, own = limits(linear_flat(locked, locked.flat())).highest_comfortable, bandwidth(flat) or 1.0
    if highest is None or highest <= own:
        return None
    factors = np.geomspace(1.0, highest / own, tried)
    drawn = {key: np.tile(values[:count], tried) for key, values in machines.keys.items() if key in flat}
    every = faster(ideal.flat({**as_tuned(flat), **drawn}), np.repeat(factors, count))
    rests = np.zeros(tried * count, bool)
    options = RunOptions(rtol=settings.needed_rtol, bands=(within, within), record_from=np.inf)
    for runs in run_chunks(kernel(shared_structure(every)), every, len(rests), options):
        done = np.equal(runs.results.statuses, Status.DONE)
        rests[runs.numbers] = done & np.isfinite(settling_in_the_end(runs.part(every), runs, "inner"))
    return NeededBandwidth(bandwidths_at(ideal, factors), rests.reshape(tried, count).mean(axis=1), factors)


LEAST_INTERVAL = 1e-3
"""Least time [s] between evaluated samples. It is rounded up to a whole number of the drive's samples."""

FOLLOWED_MACHINES, LONGER_FACTOR = 40, 6
"""Number of machines that are run again, and the factor on their duration. An integrator that was reset may swing that
slowly."""

TRIED_MACHINES = 8
"""Machines that are followed for `LONGER_FACTOR` squared; only if one of them swings so slowly, the others are, too."""

NOT_FOLLOWED = Later(np.zeros(0, bool), np.zeros(0, bool))
"""Result for an option whose machines are not run again for longer."""

ENOUGH_SHARE = 0.99
"""Fraction of the machines that an option must bring into position to count as bringing them to rest."""

LATEST_STAND_SHARE = 0.5
"""Latest time, over the duration, at which the reference may come to stand, because lasting swings are sought
afterwards."""


@dataclass(frozen=True)
class OptionResult:
    """An option with the measures of each machine's run, and with the linear loop of each.

    `later` has longer runs of the first machines. It is empty if too few machines are in position at the end of the
    shorter runs.
    """

    option: Option
    measures: MachineMeasures
    later: Later
    loops: LoopRobustness

    @property
    def letter(self) -> str:
        """Return the letter of the option."""
        return self.option.letter

    @property
    def swinging(self) -> Share:
        """Return the probability that a machine swings in the end: in its run, or followed for longer."""
        return share(self.measures.swings, self.measures.done)

    @property
    def counted(self) -> Share:
        """Return the probability of distinct peaks (see `friso.hunting.criteria.peak_count`)."""
        return share(self.measures.counted > 0, self.measures.done)

    @property
    def settled(self) -> Share:
        """Return the probability that a machine is in position at the end of the run, at rest."""
        return share(self.measures.rests, self.measures.done)

    @property
    def stays(self) -> Share:
        """Return the probability of staying in position in the last half of a `LONGER_FACTOR` run.

        The result is NaN without longer runs.
        """
        if not self.later.done.size:
            return Share(np.nan, np.nan, np.nan)
        return share(self.later.stays, self.later.done)

    @property
    def settling(self) -> EstimatedValue:
        """Return the median settling time [s] over all machines, including those that never settle."""
        return median(self.measures.settling)

    @property
    def in_position(self) -> EstimatedValue:
        return median(self.measures.in_position)

    @property
    def force(self) -> EstimatedValue:
        return median(self.measures.force)

    @property
    def margin(self) -> EstimatedValue:
        return median(self.loops.margin)

    @property
    def unstable(self) -> int:
        return int(np.count_nonzero(~self.loops.stable))

    @property
    def failed(self) -> int:
        return int(np.count_nonzero(~self.measures.done))

    @property
    def in_position_count(self) -> int:
        """Return the number of machines that are in position by the end of the run, and stay there."""
        return int(self.measures.rests.sum())

    @property
    def rests(self) -> bool:
        """Tell whether enough machines come into position with the option, and stay there.

        `ENOUGH_SHARE` is the fraction required of all machines in position, and of those run for longer that stay.
        Without longer runs the result is false.
        """
        in_position = self.in_position_count >= ENOUGH_SHARE * len(self.measures.settling)
        return bool(in_position and self.later.stays.size and self.later.stays.mean() >= ENOUGH_SHARE)


@dataclass(frozen=True)
class Paired:
    """An option compared with option a, on the same machines.

    `swinging` is the increase in the probability of swinging at the end. `sooner`, `later` and `alike` are fractions of
    machines: in position sooner or later than with option a, or at the same time (or never with both).

    `in_position` and `force` are medians over the machines, of the option's value divided by that with option a. The
    values are the root mean square deviation in position, and the root mean square force.
    """

    swinging: EstimatedValue
    sooner: Share
    later: Share
    alike: Share
    in_position: EstimatedValue
    force: EstimatedValue


@dataclass(frozen=True)
class Comparison:
    """Results of all options on machines drawn with a seed.

    A machine is in position `within` a tolerance [m]. `needed` says how many machines come to rest over the bandwidth
    of the controller alone; None if that was not computed. No faster controller exceeds `bandwidth_limit` [Hz]. An
    interruption skipped the options in `not_run`.
    """

    machines: Machines
    options: CompareOptions
    results: tuple[OptionResult, ...]
    within: float
    seed: int
    notes: tuple[str, ...]
    needed: NeededBandwidth | None = None
    bandwidth_limit: float | None = None
    not_run: tuple[Option, ...] = ()

    @property
    def stage(self) -> Stage:
        return self.machines.stage

    @property
    def shaken(self) -> bool:
        """Tell whether a floor shakes the machines.

        Without a shaking floor, the deviation at rest shows whether machines rest, not how still they stand.
        """
        return self.stage.floor is not None

    @property
    def turning(self) -> float | None:
        """Return the least bandwidth [Hz] at which a faster controller alone is known to bring enough machines to rest.

        Either the controller in continuous time does so from there on, or a faster one does so there on the drive as
        built. Returns None if none does, or if it was not computed.
        """
        needed = self.needed
        if needed is None:
            return None
        at = needed.turning(ENOUGH_SHARE)
        built = (
            result.option.factor
            for result in self.results
            if result.rests and result.option.factor > 1 and not result.option.kind.joint
        )
        bandwidths = [float(np.interp(factor, needed.factors, needed.bandwidths)) for factor in built]
        return min([*bandwidths, *([] if at is None else [float(needed.bandwidths[at])])], default=None)

    def paired(self, result: OptionResult) -> Paired:
        """Compare an option with option a, on the machines whose runs were completed with both."""
        runs, base = result.measures, self.results[0].measures
        both = runs.done & base.done
        with np.errstate(invalid="ignore", divide="ignore"):
            in_position, force = (
                getattr(runs, name)[both] / getattr(base, name)[both] for name in ("in_position", "force")
            )
        return Paired(
            swinging=difference(runs.swings[both], base.swings[both]),
            sooner=share(runs.settling < base.settling, both),
            later=share(runs.settling > base.settling, both),
            alike=share(runs.settling == base.settling, both),
            in_position=median(in_position),
            force=median(force),
        )


def compare(
    stage: Stage,
    count: int = 400,
    seed: int = 1,
    within: float = 1e-6,
    correlations: Correlations | None = None,
    progress: Progress = silent,
    also: tuple[str, ...] = (),
    begins: Callable[[], None] = lambda: None,
    bandwidth_limit: float | None = None,
) -> Comparison:
    """Run `count` machines drawn around a stage under up to seven options, or more with `also`.

    A machine is in position `within` a tolerance [m] of its reference. `also` adds settings against friction
    (`friso.equations.settings`), or "adrc". No faster controller exceeds the `bandwidth_limit` [Hz]. `begins` is called
    before the first long work, once the input has been checked. Raises InputError for a number, a seed or a tolerance
    that is not allowed, and for a motion that ends too late.
    """
    if not 0 < within < np.inf:
        raise InputError("--within", f"{within:g} m", "a length greater than 0", '--within "1 um"')
    settings_named(also, (ADRC,))  # raises for unknown names
    machines = draw_machines(stage, correlations or Correlations(), count, seed)
    places = _places(machines.stage)
    begins()
    progress(0, 1, "how fast the controller may be")
    tried = options(machines, within, also, bandwidth_limit)
    needed = needed_bandwidth(machines, tried.options[0].stage, within)
    work = _Work(machines, own_motion(machines.stage), places, within, progress, len(tried.options))
    results: list[OptionResult] = []
    try:
        for option in tried.options:
            measures = work.with_slow_swings(option, work.runs(option, len(results)))
            may_rest = measures.rests.mean() >= settings.followed_share
            later = work.longer(option) if may_rest else NOT_FOLLOWED
            loops = results[0].loops if results and not option.kind.own_loop else _loops(machines, option)
            results.append(OptionResult(option, measures, later, loops))
    except KeyboardInterrupt:
        if not results:
            raise
    titles = {kind.letter: kind.title for kind in OPTIONS.values()}
    left_out = [f"{letter} {titles[letter]} is left out: {why}" for letter, why in tried.left_out.items()]
    notes = (*machines.notes, *_missing(machines.stage), *left_out, *_troubles(results, count))
    left = tried.options[len(results) :]
    return Comparison(machines, tried, tuple(results), within, seed, notes, needed, bandwidth_limit, left)


def _places(stage: Stage) -> list[Stand]:
    """Return where and when the reference comes to stand.

    Raises InputError if it does so too late in the run, or never.
    """
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
    return [*stands(flat)]


@dataclass(frozen=True)
class _Work:
    """Inputs of the runs that all options share.

    They are machines, task, stands of the reference, tolerance `within` [m], progress, and number of options.
    """

    machines: Machines
    task: MoveTask
    places: list[Stand]
    within: float
    progress: Progress
    options: int

    def runs(self, option: Option, before: int) -> MachineMeasures:
        """Run an option on all machines and measure them; `before` other options were run already."""
        count, parts = self.machines.count, []
        label, total = option.label, count * self.options
        self.progress(before * count, total, label)
        for recorded in self._recorded(option, np.arange(count), 1):
            parts.append(measure_chunk(recorded, self.places, self.within))
            self.progress(before * count + int(recorded.numbers[-1]) + 1, total, label)
        return MachineMeasures.joined(parts)

    def longer(self, option: Option) -> Later:
        """Run an option on the first machines for longer, and return which stay in position."""
        first = np.arange(min(FOLLOWED_MACHINES, self.machines.count))
        runs = self._recorded(option, first, LONGER_FACTOR)
        return Later.joined([staying_in_position(recorded, self.within) for recorded in runs])

    def with_slow_swings(self, option: Option, measures: MachineMeasures) -> MachineMeasures:
        """Return measures of an option in which machines swing whose swing is slower than their run.

        Machines that end outside the tolerance without a swing are run for longer. Without an integral nothing moves
        them so late.
        """
        controller = option.stage.controller
        if controller is None or not controller.integrates(option.stage.flat()):
            return measures
        outcome = measures.outcome.copy()
        for factor in (2, LONGER_FACTOR, LONGER_FACTOR**2):
            left = np.flatnonzero(outcome == CREEPS)
            tried = len(left) if factor <= LONGER_FACTOR else TRIED_MACHINES
            for numbers in (left[:tried], left[tried:]):
                if numbers.size and (numbers[0] == left[0] or SWINGS in outcome[left[:tried]]):
                    outcome[numbers] = np.where(self._swing(option, numbers, factor), SWINGS, CREEPS)
        return replace(measures, outcome=outcome)

    def _swing(self, option: Option, numbers: np.ndarray, factor: int) -> np.ndarray:
        """Return which of some machines swing in a run that is `factor` times as long."""
        parts = [
            measure_chunk(recorded, self.places, self.within).swings
            for recorded in self._recorded(option, numbers, factor)
        ]
        return np.concatenate(parts)

    def _recorded(self, option: Option, numbers: np.ndarray, longer: int) -> Iterator[RecordedRuns]:
        """Yield the recorded runs of some machines, chunk by chunk.

        They are `longer` times as long as usual, and their samples as many times as far apart.
        """
        task = replace(self.task, duration=longer * self.task.duration)
        sample = self.machines.stage.flat()["drive.sample_time"]
        interval = longer * max(1, int(np.ceil(LEAST_INTERVAL / sample * (1 - 1e-9)))) * sample
        drawn = self.machines.changes(option.stage, option.changes)
        changes = {key: value[numbers] if np.ndim(value) else value for key, value in drawn.items()}
        return run(option.stage, task, self.machines.seeds[numbers].tolist(), interval, changes)


def _loops(machines: Machines, option: Option) -> LoopRobustness:
    flat = linear_flat(option.stage, machines.flat(option.stage, option.changes))
    return linear_loops(option.stage, flat, machines.count)


def _missing(stage: Stage) -> list[str]:
    """List effects on real machines that the comparison and its linear loops leave out."""
    notes = []
    if stage.floor is None:
        notes.append(
            "the stage file has no [floor]: without vibration from outside the in-position RMS shows whether a machine "
            "is at rest, not how still it would stand in a real room"
        )
    if stage.cable is not None:
        notes.append("the linear loops, and so modulus margins and raised bandwidths, leave the cable out")
    return notes


def _troubles(results: list[OptionResult], count: int) -> list[str]:
    """Return notes on unstable loops and failed runs, one for each option that has some."""
    failed = "the intervals of probabilities allow for either outcome of these, medians leave them out"
    notes = []
    for result in results:
        swings, both = result.measures.swings, result.measures.swings & ~result.loops.stable
        unstable = (
            "these machines are simulated and counted like the others; of those that swing at the end they are "
            f"{both.sum()} of {swings.sum()}"
        )
        troubles = (
            ("linear loops that are not stable", result.unstable, unstable),
            ("failed runs", result.failed, failed),
        )
        for trouble, number, consequence in troubles:
            if number:
                notes.append(f"{result.option.label}, {trouble}: {number} of {count}; {consequence}")
    return notes
