"""Try a design in simulated moves of machines drawn from the specification.

The joint is free, and locked for comparison. A map over crossover and stroke shows how many corners of the
specification do not come to rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design_method.population import Population, random_machines, typical_move
from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.engine.arrays import ArrayColumns
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.engine.settings import room_settings
from friso.equations.controllers.van_dijk import CROSSOVER, TUNED_MASS
from friso.equations.motion import last_corner
from friso.equations.structure import shared_structure
from friso.hunting.criteria import CREEPS, FAILED, RESTS, SWINGS, outcomes, settling_of_runs
from friso.hunting.measures import run_ends, turns_of
from friso.progress import Progress, silent
from friso.shares import share_interval
from friso.stage import Stage

RETURN = "motion.return_at"
"""Key of the time [s] at which a move there and back returns."""

THERE_AND_BACK = {
    "kind": "there_and_back",
    "acceleration": "1 m/s^2",
    "acceleration_time": "0 s",
    "return_at": "5 s",
    "duration": "20 s",
}
"""A motion with placeholder numbers, which each machine replaces."""


@dataclass(frozen=True)
class MachineOutcomes(ArrayColumns):
    """Outcomes of machines after their moves, as arrays of shape (count,).

    `words` say what the run does until its end (`friso.hunting.criteria.run_outcome`), with the position window as
    band. A machine rests if it stays in the window for the last quarter of the run. All other machines are simulated
    ten times as long, and their words are those of the longer run. `settling` [s] is the time after a corner of the
    reference from which the stage stays in the window, at the worse end of its move; NaN if it does not rest. `swing`
    [m] is the peak-to-peak motion in the last quarter.
    """

    words: np.ndarray
    settling: np.ndarray
    swing: np.ndarray

    @property
    def completed(self) -> np.ndarray:
        """Tell which runs were simulated to their end, shape (count,)."""
        return self.words != FAILED

    @property
    def restless(self) -> np.ndarray:
        """Tell which machines swing or creep at the end, shape (count,)."""
        return np.isin(self.words, (SWINGS, CREEPS))

    @property
    def tried(self) -> int:
        """Return the number of moves simulated to their end."""
        return int(self.completed.sum())

    @property
    def missed(self) -> int:
        """Return the number of moves after which the stage does not come to rest in the window."""
        return int(self.restless.sum())

    @property
    def swinging(self) -> int:
        """Return the number of moves after which the stage keeps swinging."""
        return int(np.count_nonzero(self.words == SWINGS))

    @property
    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the probability of not coming to rest (Clopper and Pearson)."""
        return share_interval(self.missed, self.tried)

    def slower_than(self, share: float) -> float:
        """Return the settling time [s] that the fraction `share` of the moves exceeds.

        The result is infinite if more moves than that do not settle.
        """
        times = np.where(np.isnan(self.settling), np.inf, self.settling)[self.completed]
        return float(np.quantile(times, 1 - share, method="higher")) if times.size else np.inf

    def followed(self, number: int) -> float:
        """Return for how long [s] the machine with this number was simulated after its move."""
        soon = self.settling[number] <= (1 - settings.last_share) * settings.followed_time
        return settings.followed_time if soon else settings.longer_factor * settings.followed_time

    @property
    def worst(self) -> int:
        """Return the index of the worst move.

        The worst is the move that swings or creeps over the largest distance. If all come to rest, it is the move that
        settles last.
        """
        rank = np.where(self.restless, self.swing + 1e9, np.nan_to_num(self.settling, nan=-1.0))
        return int(np.where(self.completed, rank, -np.inf).argmax())


@dataclass(frozen=True)
class Verification:
    """The machines and moves drawn, with their outcomes for the joint `free` and, of the first ones, `locked`.

    `compared` has the outcomes with a free joint of those that were also moved with a locked one. `worst` is the worst
    machine with a free joint, as a stage.
    """

    population: Population
    free: MachineOutcomes
    locked: MachineOutcomes
    worst: Stage

    @property
    def compared(self) -> MachineOutcomes:
        return self.free.take(slice(len(self.locked.words)))


def verification(stage: Stage, spec: Spec, softening: float, progress: Progress) -> Verification:
    """Try the design in machines and moves drawn from the specification; the first ones with a locked joint, too.

    The load reduces the drive stiffness by up to the fraction `softening`.
    """
    flat = stage.flat()
    machines = random_machines(spec, flat, settings.verified_moves, softening)
    window = float(spec.position.window)

    def moved(count: int, name: str, held: bool) -> MachineOutcomes:
        drawn = {key: values[:count] for key, values in machines.keys.items()}
        keys = {**flat, **drawn, "joint.locked": held, "motion.kind": "there_and_back"}
        return move_machines(keys, count, window, progress, f"moves, {name}")

    free = moved(machines.count, "joint free", False)
    locked = moved(min(settings.compared_moves, machines.count), "joint locked", True)
    return Verification(machines, free, locked, _worst_stage(stage, machines.of(free.worst), free.followed(free.worst)))


def move_machines(
    flat: dict[str, Any],
    count: int,
    window: float,
    progress: Progress = silent,
    label: str = "moves",
    patient: bool = True,
) -> MachineOutcomes:
    """Simulate the moves of `count` stages, given by keys with arrays of shape (count,).

    If `patient`, stages stand at the far end as long as at the near one, so that both ends decide, and machines that
    are not in position are simulated again for longer. `window` is the position window [m].
    """
    first = _followed_moves(flat, count, window, settings.followed_time, progress, label, patient)
    again = np.flatnonzero(first.restless & patient)
    if again.size:
        keys = {key: value[again] if np.ndim(value) else value for key, value in flat.items()}
        longer = _followed_moves(
            keys,
            again.size,
            window,
            settings.longer_factor * settings.followed_time,
            progress,
            f"{label}, those not at rest for longer",
        )
        better = np.flatnonzero(longer.completed)  # if the long run fails, the word of the short one stays
        for name in ("words", "settling", "swing"):
            getattr(first, name)[again[better]] = getattr(longer, name)[better]
    return first


def _followed_moves(
    flat: dict[str, Any],
    count: int,
    window: float,
    time: float,
    progress: Progress,
    label: str,
    both_ends: bool = True,
) -> MachineOutcomes:
    """Simulate the moves of `count` stages, each followed for a time [s] after its last corner.

    With `both_ends`, the stage stands as long at the far end, and settles as late as at the worse end. `window` is the
    position window [m]; `label` names the work to the progress.
    """
    if both_ends:
        flat = {**flat, RETURN: last_corner(flat) - flat[RETURN] + time}
    corner = np.broadcast_to(np.asarray(last_corner(flat), float), (count,))
    keys = {**flat, "motion.duration": corner + time}
    options = RunOptions(
        rtol=settings.verified_rtol,
        bands=(window, 10 * window),
        window=1 - settings.last_share,
        record_from=np.inf,
        least_swing=window / 4,
        room=round(room_settings.first_turning_points * time / settings.followed_time),
        chunk=settings.runs_per_report,
    )
    outcome = MachineOutcomes(np.full(count, FAILED, dtype=object), np.full(count, np.nan), np.full(count, np.nan))
    done = 0
    for runs in run_chunks(kernel(shared_structure(keys)), keys, count, options):
        numbers = runs.numbers
        end = run_ends(runs, turns_of(runs, corner[numbers]), "inner")
        words = outcomes(end, window, hold=settings.last_share * end.ended)
        settling = np.maximum(end.outside - corner[numbers], 0.0)
        if both_ends:
            settling = settling_of_runs(runs.part(keys), runs, "inner")
            words = np.where((words == RESTS) & ~np.isfinite(settling), CREEPS, words)
        outcome.words[numbers] = words
        outcome.settling[numbers] = np.where(words == RESTS, settling, np.nan)
        outcome.swing[numbers] = end.swing
        done += len(numbers)
        progress(done, count, label)
    return outcome


def _worst_stage(stage: Stage, keys: dict[str, float], time: float) -> Stage:
    """Return a machine as a stage, with its move and a time [s] after it.

    `keys` are those of the machine. The joint has plain numbers instead of leaf springs, since no single size of the
    leaves explains its stiffness.
    """
    flat = stage.flat()
    follow = ("joint.stiffness", "parasitic.frequency", "parasitic.mass", "parasitic.damping_ratio")
    joint = {key: float(flat[key]) for key in (*follow, TUNED_MASS)}
    moved = stage.replace({"motion": THERE_AND_BACK})
    corner = float(last_corner({**flat, **moved.flat(), **keys}))
    numbers = joint | keys | {"motion.duration": corner + time}
    return moved.with_numbers(numbers, without=["flexure"])


@dataclass(frozen=True)
class HuntingMap:
    """The fraction of corners in which the stage is not in position, over crossover and stroke.

    Corners are the extremes of friction and masses. Crossovers [Hz] have shape (n,), strokes [m] (m,), and fractions
    (m, n). A corner counts if the stage is not in position a quarter of a minute after a typical move. The fraction is
    NaN if a run failed.
    """

    crossovers: np.ndarray
    strokes: np.ndarray
    share: np.ndarray


def hunting_map(stage: Stage, spec: Spec, population: Population) -> HuntingMap:
    """Compute the map of corners not in position, over crossover and stroke, around a design.

    The drive stiffness is the design's own.
    """
    flat = stage.flat()
    crossovers, strokes = (
        np.geomspace(low * flat[key], high * flat[key], count)
        for key, (low, high), count in zip(
            (CROSSOVER, "joint.stroke"),
            settings.map_reach,
            (settings.map_crossovers, settings.map_strokes),
            strict=True,
        )
    )
    shape = (settings.map_strokes, settings.map_crossovers, population.count)
    stroke, crossover, number = (
        axis.ravel() for axis in np.meshgrid(strokes, crossovers, np.arange(population.count), indexing="ij")
    )
    machines = {key: value[number] for key, value in population.keys.items()}
    runs = {**flat, **machines, **typical_move(spec), CROSSOVER: crossover, "joint.stroke": stroke}
    outcome = move_machines(runs, len(number), float(spec.position.window), patient=False)
    share = np.where(outcome.completed, outcome.restless, np.nan).reshape(shape).mean(axis=2)
    return HuntingMap(crossovers, strokes, share)
