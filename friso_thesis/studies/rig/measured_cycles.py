"""Hunting cycles as irregular and as slow as the measured ones (thesis, Fig. 27).

The question is how much friction has to vary for that, and what else makes cycles slow. The thesis gives no numbers for
the irregularity. Of the period it says that the simulated one is nearly half of the measured one, at a similar
amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER, TUNED_MASS
from friso.equations.rail import friction_factors
from friso.intervals import Share, share
from friso.progress import Progress
from friso.quantities import percent
from friso.shown.drawing.figure import BLUE, INK, VERMILLION, Axis, Band, Figure, Limit, Map, Markers, Panel, Series
from friso.shown.text import with_unit
from friso.stage import Stage
from friso.virtual_rig.task import MoveTask
from friso_thesis.studies.rig.experiments import RigExperiment
from friso_thesis.studies.rig.experiments.hunting import CRITERIA, Trace, runs_document, share_document
from friso_thesis.studies.rig.moves_on_rails import (
    RailRuns,
    crossover,
    distance,
    move,
    numbers_of,
    once,
    rails,
    released,
    run_moves,
    with_joint,
)
from friso_thesis.studies.rig.outcome import Outcome, rig_log

FRICTION_DEVIATIONS = (0.02, 0.05, 0.1, 0.2, 0.3)
"""Relative standard deviations of static and of Coulomb friction: our choice."""

CORRELATION_LENGTHS = (2.0, 5.0, 10.0, 20.0)
"""Correlation lengths relative to the swing of the cycle on an even rail: our choice."""

ELEMENT_HARMONICS = (0.01, 0.02, 0.05, 0.1)
"""Amplitudes of the rolling elements' harmonic, relative to mean friction: our choice."""

ELEMENT_PITCH = 4.0
"""Pitch of the rolling elements relative to the swing on an even rail, for a stage that states none."""

STATIC_FACTORS, COULOMB_FACTORS = (0.75, 1.0, 1.25, 1.5, 2.0), (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
"""Static and Coulomb friction relative to those of the stage, on an even rail: our choice."""

CYCLE_STARTS = (0.0, 0.005, 0.01, 0.02)
"""Starts of a cycle: the move (0), or a release from a fraction of the move's distance."""

LONGER_RUNS = 1.5
"""Length of the runs relative to others, so that slow cycles repeat often enough."""

MASS_FACTOR = 1.47
"""Mass read from the mass line relative to the weighed mass (Sec. 4.2.1)."""

MOTORS = (1.0, 1 / MASS_FACTOR)
"""Motor constants relative to the stage's. With the weaker motor, the weighed mass would show the measured mass
line."""

AS_SLOW, SIMILAR_SWING = 1.8, 1.5
"""Thresholds of periods and swings relative to the even rail. A period from the first on is "nearly twice"; swings
within the second factor are "similar"."""

BINS = (0.0, 0.01, 0.02, 0.03, 0.05, 0.1, np.inf)
"""Edges of the bins for the asymmetry of friction."""


@dataclass(frozen=True)
class CycleComparison:
    """Cycles with the joint locked, at the stage's crossover.

    - `even`: on an even rail, one run.
    - `field`: on rails with random friction, shape (deviations, lengths, rails). `asymmetry` is the difference in the
      logarithm of static friction between the two sides of the target, at half the even rail's swing from it.
    - `rolling`, `rolling_asymmetry`: on rails whose friction has a first harmonic, shape (harmonics, rails).
    - `levels`: on an even rail with other static and Coulomb friction, shape (motors, static, coulomb). The motors are
      the one that the drive assumes and the weaker one of `MOTORS`.
    - `others`: on an even rail with one other change, by its name. If one start does not lead to a cycle, another was
      taken.
    - `traces`: the even rail, and the varied rail with the slowest cycle of a similar swing (None: there is none).
      `slowest` has the deviation, length [m] and seed of that rail.
    """

    even: RailRuns
    deviations: np.ndarray
    lengths: np.ndarray
    field: RailRuns
    asymmetry: np.ndarray
    harmonics: np.ndarray
    pitch: float
    rolling: RailRuns
    rolling_asymmetry: np.ndarray
    levels: RailRuns
    others: Mapping[str, RailRuns]
    traces: tuple[Trace, Trace | None]
    slowest: tuple[float, float, float] | None

    def slower(self, runs: RailRuns) -> np.ndarray:
        """Return periods over that of the even rail; NaN for runs that do not swing at their end."""
        return np.where(runs.swings, runs.period, np.nan) / self.even.period[0]

    def larger(self, runs: RailRuns) -> np.ndarray:
        """Return swings over that of the even rail; NaN for runs that do not swing at their end."""
        return np.where(runs.swings, runs.swing, np.nan) / self.even.swing[0]

    def as_measured(self, runs: RailRuns) -> np.ndarray:
        """Return which runs have nearly twice the period of the even rail at a similar swing."""
        swing = self.larger(runs)
        return (self.slower(runs) >= AS_SLOW) & (swing <= SIMILAR_SWING) & (swing >= 1 / SIMILAR_SWING)

    @property
    def by_asymmetry(self) -> list[tuple[Share, float]]:
        """Return how often and how slowly cycles swing, for each range of asymmetry in `BINS`.

        All rails with random friction count. A pair has the fraction of runs that still swing at the end, and the
        median of their periods over that of the even rail (NaN: none swings).
        """
        size, rows = np.abs(self.asymmetry), []
        for low, high in pairwise(BINS):
            inside = (size >= low) & (size < high)
            swinging = share(self.field.swings[inside], ~self.field.failed[inside])
            slower = self.slower(self.field)[inside]
            rows.append((swinging, float(np.nanmedian(slower)) if np.isfinite(slower).any() else np.nan))
        return rows


def compare_cycles(
    stage: Stage,
    seed: int,
    deviations: Sequence[float],
    lengths: Sequence[float],
    harmonics: Sequence[float],
    machines: int,
    progress: Progress,
) -> CycleComparison:
    """Compare the cycles of a stage with its joint locked, on `machines` rails of each kind.

    Kinds differ by the `deviations` of friction, its correlation `lengths` in swings of the stage, and `harmonics` of
    rolling elements.
    """
    even = on_rail(stage)
    plain = started(even, seed, {}, 1, progress, "an even rail")
    swing = float(plain.swing[0]) if plain.swings[0] else 0.01 * distance(stage)
    long = swing * np.array(lengths)
    seeds = even.flat()["rail.seed"] + np.arange(float(machines))
    first, second = (axis.ravel() for axis in np.meshgrid(deviations, long, indexing="ij"))
    cases = {"rail.static_deviation": first, "rail.coulomb_deviation": first, "rail.correlation_length": second}
    field, asymmetry = moves_on_varied_rails(even, seed, cases, seeds, swing, progress, "rails with a random field")
    shape = (len(deviations), len(long), machines)
    pitch = stage.flat().get("rail.rolling_pitch", ELEMENT_PITCH * swing)
    rolling = even.replace({"rail.rolling_pitch": f"{pitch!r} m"})
    waves = {"rail.first_harmonic": np.array(harmonics)}
    rolled, rolled_asymmetry = moves_on_varied_rails(
        rolling, seed, waves, seeds, swing, progress, "rails with rolling elements"
    )
    result = CycleComparison(
        plain, np.array(deviations), long, field.shaped(*shape), asymmetry.reshape(shape), np.array(harmonics), pitch,
        rolled.shaped(len(harmonics), machines), rolled_asymmetry.reshape(len(harmonics), machines),
        levels(even, seed, progress), single_changes(even, seed, progress), (_trace(even, seed), None), None,
    )  # fmt: skip
    return _with_slowest(result, even, seed, seeds)


def on_rail(stage: Stage) -> Stage:
    """Return the stage on a rail with the same friction everywhere.

    The keys of this rail can then be changed.
    """
    seed = 1.0 if stage.rail is None else stage.flat()["rail.seed"]
    level = 0.0 if stage.rail is None else stage.flat()["rail.offset"]
    bare = stage.replace({"rail": None}) if stage.rail is not None else stage
    return bare.replace({"rail.seed": seed, "rail.offset": level, "rail.correlation_length": "5 mm"})


def _longer(task: MoveTask) -> MoveTask:
    return replace(task, duration=LONGER_RUNS * task.duration)


def started(
    stage: Stage, seed: int, changes: Mapping[str, Any], count: int, progress: Progress, label: str
) -> RailRuns:
    """Return how runs of `count` machines end, shape (count,).

    `changes` are their keys. Each machine is run from the move and from several other starts; the first run that keeps
    swinging counts, or else the run from the move.
    """
    tasks = [move(stage) if share == 0 else released(stage, share * distance(stage)) for share in CYCLE_STARTS]
    runs = [run_moves(stage, _longer(task), [seed] * count, changes, progress, label) for task in tasks]
    all_runs = RailRuns.joined(runs).shaped(len(tasks), count)
    first = np.argmax(all_runs.swings, axis=0)
    return all_runs.take((first, np.arange(count)))


def moves_on_varied_rails(
    stage: Stage,
    seed: int,
    cases: Mapping[str, np.ndarray],
    seeds: np.ndarray,
    swing: float,
    progress: Progress,
    label: str,
) -> tuple[RailRuns, np.ndarray]:
    """Simulate the move on every rail in every case; compare friction around the target.

    `cases` lists changed rail keys, and `seeds` the seeds of the rails. The second result is the logarithm of the ratio
    of friction half a `swing` beyond and before the target. Both results have the shape (cases * rails,).
    """
    count = len(next(iter(cases.values())))
    changes = {key: np.repeat(values, len(seeds)) for key, values in cases.items()}
    changes["rail.seed"] = np.tile(seeds, count)
    followed = run_moves(stage, _longer(move(stage)), numbers_of(seed, count, len(seeds)), changes, progress, label)
    sides = distance(stage) + np.array([-swing / 2, swing / 2])
    flat, runs = stage.flat(), range(count * len(seeds))
    at = [friction_factors(flat | {key: values[run] for key, values in changes.items()}, sides)[0] for run in runs]
    return followed, np.diff(np.log(at), axis=1)[:, 0]


def levels(stage: Stage, seed: int, progress: Progress) -> RailRuns:
    """Return cycles with other motors and friction levels, shape (motors, static, coulomb).

    Static friction is at least as large as Coulomb friction.
    """
    flat = stage.flat()
    motor, first, second = (
        axis.ravel() for axis in np.meshgrid(MOTORS, STATIC_FACTORS, COULOMB_FACTORS, indexing="ij")
    )
    coulomb = second * flat["friction.coulomb"]
    changes = {"friction.static": np.maximum(first * flat["friction.static"], coulomb), "friction.coulomb": coulomb}
    changes["drive.motor_constant_ratio"] = motor * flat.get("drive.motor_constant_ratio", 1.0)
    cycles = started(stage, seed, changes, len(first), progress, "other friction levels")
    return cycles.shaped(len(MOTORS), len(STATIC_FACTORS), len(COULOMB_FACTORS))


def single_changes(stage: Stage, seed: int, progress: Progress) -> dict[str, RailRuns]:
    """Return the cycle on an even rail after one change of the stage, by name of the change."""
    flat = stage.flat()
    mass = flat[TUNED_MASS]
    motor = {"drive.motor_constant_ratio": flat.get("drive.motor_constant_ratio", 1.0) / MASS_FACTOR}
    named = {
        f"motor gives {MOTORS[1]:.2g} of the force, tuned as before": motor,
        f"motor gives {MOTORS[1]:.2g} of the force, tuned for {MASS_FACTOR:g} times the mass": motor
        | {TUNED_MASS: MASS_FACTOR * mass},
        "alpha twice as large": {ALPHA: 2 * flat[ALPHA]},
        "beta one and a half times as large": {BETA: 1.5 * flat[BETA]},
        f"crossover {1 / MASS_FACTOR:.2g} times as high": {CROSSOVER: flat[CROSSOVER] / MASS_FACTOR},
        "cables ten times as stiff, with ten times the drag": {
            key: 10 * flat[key] for key in ("cable.stiffness", "cable.drag") if key in flat
        },
        "current loop of a hundredth of the bandwidth": {
            key: flat[key] / 100 for key in ("drive.current_bandwidth",) if key in flat
        },
    }
    changed = {name: changes for name, changes in named.items() if changes}
    keys = {key for changes in changed.values() for key in changes}
    ideal = {"drive.motor_constant_ratio": 1.0, **flat}
    lanes = {key: np.array([changes.get(key, ideal[key]) for changes in changed.values()]) for key in keys}
    cycles = started(stage, seed, lanes, len(changed), progress, "other drives")
    return {name: cycles.take([row]) for row, name in enumerate(changed)}


def _with_slowest(result: CycleComparison, even: Stage, seed: int, seeds: np.ndarray) -> CycleComparison:
    """Add the trace over time of the slowest cycle with a similar swing on a random rail."""
    similar = abs(np.log(result.larger(result.field))) <= np.log(SIMILAR_SWING)
    slower = np.where(similar, np.nan_to_num(result.slower(result.field)), 0.0)
    if not slower.max(initial=0.0) > 1:
        return result
    row, column, rail = map(int, np.unravel_index(np.argmax(slower), slower.shape))
    slowest = (float(result.deviations[row]), float(result.lengths[column]), float(seeds[rail]))
    machine = _machine(even, slowest)
    number = seed + rail
    return replace(result, traces=(result.traces[0], _trace(machine, number)), slowest=slowest)


def _machine(even: Stage, rail: tuple[float, float, float]) -> Stage:
    deviation, length, seed = rail
    keys = {"rail.static_deviation": deviation, "rail.coulomb_deviation": deviation, "rail.seed": seed}
    return even.replace({**keys, "rail.correlation_length": f"{length!r} m"})


def _trace(stage: Stage, seed: int) -> Trace:
    recorded = once(stage, _longer(move(stage)), [seed])
    return Trace(recorded.time, recorded.logged["position"][0] - recorded.logged["reference"][0, -1])


def _logged_machines(
    stage: Stage, seed: int, slowest: tuple[float, float, float] | None
) -> list[tuple[str, Stage, int]]:
    """Return name, stage and noise seed of each log: on an even rail, and on a varied one.

    `slowest` has the deviation, length [m] and seed of the rail with the slowest cycle; None: there is none.
    """
    even = on_rail(stage)
    first = even.flat()["rail.seed"]
    machines = [("measured_cycles_even_rail", even, seed)]
    if slowest is not None:
        machines.append(("measured_cycles_varied_rail", _machine(even, slowest), seed + int(slowest[2] - first)))
    return machines


AREA = "#cfdfee"

COUNTED_FROM = 10.0
"""Time [s] from which cycles are drawn and counted."""

ASYMMETRY = "Difference of friction between the two sides"


def _field(result: CycleComparison) -> str:
    """Say how many rails with random friction give cycles as slow as the measured ones."""
    as_slow, done = result.as_measured(result.field), int((~result.field.failed).sum())
    swings = int(result.field.swings.sum())
    slowest = np.nanmax(result.slower(result.field)) if swings else np.nan
    return (
        f"On rails with a random field {swings} of {done} runs still swing at their end; {int(as_slow.sum())} of them "
        f"have at least {AS_SLOW:g} times that period at a similar swing (within a factor of {SIMILAR_SWING:g}); the "
        "slowest "
        f"has {slowest:.3g} times."
    )


def _asymmetry(result: CycleComparison) -> str:
    """Say how a difference in friction between both sides of the target slows and ends cycles."""
    rows = [(low, high, *row) for low, high, row in zip(BINS[:-1], BINS[1:], result.by_asymmetry, strict=True)]
    low, high, even, slow = rows[0]
    parts = [
        f"{percent(even.probability)} keep swinging where it differs by less than {percent(high)} (period "
        f"{slow:.3g} times)"
    ]
    for low, high, swinging, slow in rows[1:]:
        if np.isfinite(swinging.probability):
            upper = f"{percent(low)} to {percent(high)}" if np.isfinite(high) else f"more than {percent(low)}"
            times = f" ({slow:.3g} times)" if np.isfinite(slow) else ""
            parts.append(f"{percent(swinging.probability)} at {upper}{times}")
    return (
        "A difference in friction between the two places where the stage sticks slows a cycle down, and ends it: "
        f"{', '.join(parts)}."
    )


def _rolling(result: CycleComparison) -> str:
    swings = result.rolling.swings.mean(axis=1)
    parts = [f"{percent(share)} at {percent(size)}" for share, size in zip(swings, result.harmonics, strict=True)]
    return (
        f"With rolling elements of {with_unit(result.pitch, 'm')} pitch, the following shares keep swinging, by first "
        f"harmonic: {', '.join(parts)}."
    )


def _irregular(result: CycleComparison) -> str:
    """Say whether cycles on varied rails are lopsided, and whether they repeat."""
    swings = result.field.swings & np.isfinite(result.field.rising)
    if not swings.any():
        return "No cycle on a varied rail lasts long enough to show how regular it is."
    above, below = result.field.above[swings], result.field.below[swings]
    sides = np.median(np.maximum(above, below) / np.minimum(above, below))
    scatter, heights = (
        np.median(values[swings]) for values in (result.field.period_scatter, result.field.height_scatter)
    )
    return (
        f"Such cycles are lopsided: one side is {sides:.2g} times as high as the other (median). From cycle to cycle "
        f"they repeat: the period scatters by {percent(scatter, 3)}, the heights by {percent(heights, 3)} of the "
        "swing. Friction at a given place is the same every time, so a varying rail does not make a cycle irregular; "
        "what changes from cycle to cycle is not in the model."
    )


def _levels(result: CycleComparison) -> str:
    """Say whether other friction levels, or a weaker motor, make the cycle as slow as measured."""
    slow, swing = result.slower(result.levels), result.larger(result.levels)
    matches = np.argwhere(result.as_measured(result.levels))
    if not len(matches):
        best = np.unravel_index(np.nanargmax(slow), slow.shape)
        return (
            "On an even rail none of the friction levels tried makes the cycle that slow; the slowest has "
            f"{slow[best]:.3g} times the period at {swing[best]:.3g} times the swing ({_level(*best)})."
        )
    closest = sorted(map(tuple, matches), key=lambda cell: abs(np.log(swing[cell])) + abs(np.log(slow[cell] / 2)))
    named = [f"{_level(*cell)} ({slow[cell]:.3g} and {swing[cell]:.3g})" for cell in closest[:3]]
    return (
        f"On an even rail {len(matches)} of {slow.size} other motors and friction levels make it that slow; closest to "
        f"twice the period at the same swing (period and swing over those of the file): {'; '.join(named)}."
    )


def _level(motor: Any, row: Any, column: Any) -> str:
    named = f"static friction times {STATIC_FACTORS[row]:g}, Coulomb friction times {COULOMB_FACTORS[column]:g}"
    return named if MOTORS[motor] == 1 else f"motor giving {MOTORS[motor]:.2g} of its force, {named}"


def _other_changes(result: CycleComparison) -> str:
    parts = []
    for name, runs in result.others.items():
        slow, swing = float(result.slower(runs)[0]), float(result.larger(runs)[0])
        parts.append(f"{name}: {f'{slow:.3g} and {swing:.3g}' if np.isfinite(slow) else 'no cycle'}")
    return f"Other changes on an even rail, period and swing over those of the file: {'; '.join(parts)}."


def _cycles(result: CycleComparison) -> Figure:
    """Draw the cycle on an even rail, and the slowest one on a rail that varies."""
    even, varied = result.traces
    lines = [Series(*_late(even.time, even.deviation), "even rail", BLUE)]
    if varied is not None:
        assert result.slowest is not None
        deviation, length, rail = result.slowest
        label = f"deviation {percent(deviation)} over {with_unit(length, 'm')}, rail {rail:.0f}"
        lines.append(Series(*_late(varied.time, varied.deviation), label, VERMILLION))
    panel = Panel("", Axis("Time", "s"), Axis("Position minus reference", "m"), tuple(lines))
    caption = "The slowest cycle of a similar swing among the rails that vary (Fig. 27: measured and simulated)."
    return Figure("measured_cycles", "Cycles on an even rail and on one that varies", caption, (panel,))


def _late(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    late = time >= COUNTED_FROM
    return time[late], values[late]


def _maps(result: CycleComparison) -> Figure:
    """Draw maps over the correlation length and the deviation of friction along the rail."""
    lengths, deviations = (
        [with_unit(length, "m") for length in result.lengths],
        [percent(length) for length in result.deviations],
    )
    x, y = Axis("Correlation length", "", words=(*lengths,)), Axis("Deviation of friction", "", words=(*deviations,))
    columns, rows = (np.arange(float(len(words))) for words in (lengths, deviations))
    shares = result.field.swings.mean(axis=2)
    slow = _medians(result.slower(result.field))
    quantities = (
        ("Share of rails still swinging", shares, (0.0, 1.0)),
        ("Period over that of the even rail", slow, None),
    )
    panels = tuple(
        Panel("", x, y, maps=(Map(columns, rows, values, name, "", limits=limits),))
        for name, values, limits in quantities
    )
    caption = (
        f"{result.field.swings.shape[2]} rails in each cell; the period is the median of those that keep swinging."
    )
    return Figure("measured_cycles_rails", "Rails with a random field of friction", caption, panels, columns=2)


def _medians(values: np.ndarray) -> np.ndarray:
    """Return medians over the last axis, ignoring NaN; NaN where all values are NaN."""
    defined = np.asarray(np.isfinite(values).any(axis=-1))
    return np.where(defined, np.nanmedian(np.where(defined[..., None], values, 0.0), axis=-1), np.nan)


def _by_asymmetry(result: CycleComparison) -> Figure:
    """Draw how often and how slowly cycles swing, over the asymmetry of friction.

    Asymmetry is the difference of static friction, in the logarithm, between both sides of the target.
    """
    size, slow = np.abs(result.asymmetry).ravel(), result.slower(result.field).ravel()
    alive = np.isfinite(slow)
    largest = float(size.max())
    points = Markers(size[alive], slow[alive], "rails that keep swinging", BLUE)
    rows = [
        (low, min(high, largest), row[0]) for low, high, row in zip(BINS, BINS[1:], result.by_asymmetry, strict=False)
    ]
    rows = [row for row in rows if np.isfinite(row[2].probability)]
    middle = np.array([(low + high) / 2 for low, high, _ in rows])
    ends = ("probability", "low", "high")
    share, low, high = (np.array([getattr(estimate, name) for *_, estimate in rows]) for name in ends)
    axis = Axis(ASYMMETRY, "")
    shares = Panel(
        "share that keeps swinging", axis, Axis("Share of rails", "", (-0.03, 1.03)),
        (Series(middle, share, "in each class", BLUE),), bands=(Band(middle, low, high, "95 % interval", AREA),),
    )  # fmt: skip
    periods = Panel(
        "period of those", axis, Axis("Period over that of the even rail", ""), markers=(points,),
        limits=(Limit((AS_SLOW,), "nearly twice", INK),),
    )  # fmt: skip
    caption = (
        "The natural logarithm of static friction half a swing to one side of the target, minus that to the other."
    )
    return Figure(
        "measured_cycles_asymmetry", "What slows a cycle down and ends it", caption, (shares, periods), columns=2
    )


def _level_maps(result: CycleComparison) -> Figure:
    """Draw maps of period and swing over the levels of static and Coulomb friction."""
    x, y = Axis("Static friction over the file's", ""), Axis("Coulomb friction over the file's", "")
    quantities = (
        ("Period over the file's", result.slower(result.levels)),
        ("Swing over the file's", result.larger(result.levels)),
    )
    panels = tuple(
        Panel(
            _motor(motor),
            x,
            y,
            maps=(Map(np.array(STATIC_FACTORS), np.array(COULOMB_FACTORS), values[row].T, name, ""),),
        )
        for row, motor in enumerate(MOTORS)
        for name, values in quantities
    )
    return Figure(
        "measured_cycles_levels",
        "Even rail, other friction levels",
        "Empty: no cycle after the move or any of the releases tried.",
        panels,
        columns=2,
    )


def _motor(share: float) -> str:
    return "motor as assumed" if share == 1 else f"motor giving {share:.2g} of its force"


def _cycle_document(runs: RailRuns) -> dict[str, Any]:
    sides = {"above_m": runs.above, "below_m": runs.below, "rising_share": runs.rising}
    scatter = {"period_scatter": runs.period_scatter, "height_scatter": runs.height_scatter}
    return runs_document(runs) | sides | scatter


class MeasuredCyclesExperiment(RigExperiment):
    """Cycles beside the measured one, and what slows them down."""

    def run(self, stage: Stage, seed: int, progress: Progress) -> Outcome:
        """Run all cycles.

        Raises InputError without a joint, a crossover or a motion that moves the stage.
        """
        locked = with_joint(stage, locked=True)
        crossover(stage)
        result = compare_cycles(
            locked,
            seed,
            FRICTION_DEVIATIONS,
            CORRELATION_LENGTHS,
            ELEMENT_HARMONICS,
            len(rails(on_rail(locked))),
            progress,
        )
        logs, notes = [], ()
        if result.slowest is None:
            notes = ("no varied rail has a slower cycle of a similar swing",)
        for name, machine, number in _logged_machines(locked, seed, result.slowest):
            recorded = once(machine, _longer(move(machine)), [number])
            logs.append(rig_log(recorded, 0, name, "moves", machine, number))
        return Outcome("measured-cycles", stage, seed, tuple(logs), result, notes)

    def sentences(self, outcome: Outcome) -> list[str]:
        """Say how the cycle on an even rail looks, and what varied rails and other causes change."""
        result: CycleComparison = outcome.result
        even = result.even
        if not even.swings[0]:
            return [
                "On an even rail the stage does not swing at the end of the run, so there is no cycle to compare with."
            ]
        return [
            f"On an even rail the cycle swings {with_unit(float(even.swing[0]), 'm')} peak to peak with a period "
            f"of {with_unit(float(even.period[0]), 's')}; from cycle to cycle its period scatters by "
            f"{percent(float(even.period_scatter[0]), 3)}.",
            _field(result),
            _asymmetry(result),
            _rolling(result),
            _irregular(result),
            _levels(result),
            _other_changes(result),
        ]

    def figures(self, outcome: Outcome) -> list[Figure]:
        """Draw Fig. 27, maps over kinds of rails, cycles on lopsided rails, and friction levels."""
        result: CycleComparison = outcome.result
        if not result.even.swings[0]:
            return [_cycles(result)]
        return [_cycles(result), _maps(result), _by_asymmetry(result), _level_maps(result)]

    def numbers(self, outcome: Outcome) -> dict[str, Any]:
        """Return all results; arrays of runs have the shapes of `CycleComparison`."""
        result: CycleComparison = outcome.result
        classes = [
            {"from": low, "to": high, **share_document(share), "period_over_even": slow}
            for low, high, (share, slow) in zip(BINS, BINS[1:], result.by_asymmetry, strict=False)
        ]
        field = {
            "deviations": result.deviations,
            "correlation_lengths_m": result.lengths,
            "asymmetry": result.asymmetry,
        }
        rolling = {"harmonics": result.harmonics, "pitch_m": result.pitch, "asymmetry": result.rolling_asymmetry}
        levels = {
            "motors": np.array(MOTORS),
            "static_over_file": np.array(STATIC_FACTORS),
            "coulomb_over_file": np.array(COULOMB_FACTORS),
        }
        return {
            "criteria": CRITERIA,
            "even_rail": _cycle_document(result.even),
            "field": field | _cycle_document(result.field),
            "by_asymmetry": classes,
            "rolling": rolling | _cycle_document(result.rolling),
            "levels": levels | _cycle_document(result.levels),
            "others": {name: _cycle_document(runs) for name, runs in result.others.items()},
        }


EXPERIMENT = MeasuredCyclesExperiment()
