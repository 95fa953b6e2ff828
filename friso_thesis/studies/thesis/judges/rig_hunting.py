"""Judge hunting and standstill of the rig with its real drive (Fig. 24 to 28).

The drive samples and delays, and friction varies along rails.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.intervals import share_interval
from friso.quantities import percent
from friso_thesis.studies.rig.in_position import FORCE_BITS, InPosition, NoisyStandstill
from friso_thesis.studies.rig.measured_cycles import MOTORS
from friso_thesis.studies.rig.moves_on_rails import RailRuns
from friso_thesis.studies.rig.stroke_crossover import StrokeCrossover
from friso_thesis.studies.thesis.as_built import AS_BUILT, COULOMB_LEVEL, RELEASE_DISTANCES, CyclesOnRails, MovesOnRails
from friso_thesis.studies.thesis.claims import BESIDE, Evidence, Finding, FindingTable, Part, judges, number_text
from friso_thesis.studies.thesis.experiments import GRID, MOVES, ON_RAILS, STANDSTILL
from friso_thesis.studies.thesis.judges.rig_loops import RAIL
from friso_thesis.studies.thesis.maps import trend, trend_text
from friso_thesis.studies.thesis.reading import about, words

_ASSUMED = (
    f"Assumed: friction that varies by {percent(AS_BUILT['rail.static_deviation'])} over "
    f"{AS_BUILT['rail.correlation_length']} along the rail, {AS_BUILT['drive.delay']} of delay"
)

PEAK_DEVIATIONS = 0.1e-6, 1e-6
"""Peak deviations in Fig. 28 with the joint locked and free [m]."""


def _runs_with_peaks(runs: RailRuns, which: Any = ...) -> tuple[int, int]:
    """Return the number of runs with counted peaks, and the number of all runs."""
    done = ~runs.failed[which]
    return int((runs.counted[which] & done).sum()), int(done.sum())


def _beside(counted: tuple[int, int], threshold: float) -> str:
    """Say that a count of rails is too near a `threshold` to decide; "" if it decides.

    The count is too near if the 95 % interval of its fraction contains the threshold.
    """
    low, high = share_interval(*counted)
    return BESIDE if low < threshold < high else ""


def _rails(counted: tuple[int, int]) -> str:
    """Say on how many rails peaks are counted, with the interval of their fraction."""
    low, high = share_interval(*counted)
    return f"{counted[0]} of {counted[1]} rails (95 % interval {percent(low)} to {percent(high)})"


@judges("F24", figure="24", needs=(MOVES,), undrawn=RAIL)
def locked_hunts_and_free_settles(evidence: Evidence) -> Finding:
    """Judge whether the rig hunts after the move at 8 Hz if locked, and settles if free."""
    return judged_move(evidence.experiments.moves)


def judged_move(moves: MovesOnRails) -> Finding:
    """Judge on how many rails peaks are counted after the move, joint locked and joint free."""
    locked, free = _runs_with_peaks(moves.locked, 0), _runs_with_peaks(moves.free)
    return Finding.of(
        Part(
            f"with the joint locked peaks are counted, on at least {percent(words.half)} of the rails",
            locked[0] >= words.half * locked[1] > 0,
            f"{_rails(locked)}. {_ASSUMED}",
            why="Where friction differs between the two places at which the stage sticks, its swings die out.",
            undecided=_beside(locked, words.half),
        ),
        Part("with the joint free on none", free[0] == 0 < free[1], _rails(free)),
    )


@judges("F25", figure="25", needs=(MOVES,), undrawn=RAIL)
def locked_needs_crossover(evidence: Evidence) -> Finding:
    """Judge which crossover the locked rig needs, by the move of Fig. 25 and by releases."""
    return judged_crossovers(evidence.experiments.moves)


def judged_crossovers(moves: MovesOnRails) -> Finding:
    """Judge at which crossovers peaks are counted after moves and releases, joint locked."""
    low, middle, high = (_runs_with_peaks(moves.locked, row) for row in range(3))
    quiet = middle[1] - middle[0], middle[1]
    settle = ~moves.locked.counted[1] & ~moves.locked.failed[1]
    lasts = moves.released.counted & moves.released.swings
    started = int((lasts.any(axis=0) & settle).sum())
    return Finding.of(
        Part(
            f"peaks are counted on no rail at {moves.crossovers[2]:g} Hz, on some at {moves.crossovers[0]:g} Hz",
            high[0] == 0 < low[0],
            f"{_rails(low)} at {moves.crossovers[0]:g} Hz, {_rails(high)} at {moves.crossovers[2]:g} Hz. {_ASSUMED}",
        ),
        Part(
            f"at {moves.crossovers[1]:g} Hz no peaks after the same move are no exception: there are none on more "
            f"than a few rails ({percent(words.few)}), and on more rails than at {moves.crossovers[0]:g} Hz",
            quiet[0] > words.few * quiet[1] and middle[0] < low[0],
            f"none on {_rails(quiet)} at {moves.crossovers[1]:g} Hz; peaks on {middle[0]} rails, on {low[0]} at "
            f"{moves.crossovers[0]:g} Hz",
            undecided=_beside(quiet, words.few),
        ),
        Part(
            f"at {moves.crossovers[1]:g} Hz a rail without peaks after the move keeps swinging after a release",
            started > 0,
            f"{started} of {int(settle.sum())} such rails, released {percent(max(RELEASE_DISTANCES))} of the move to "
            "either side",
            why="None of the starts tried on these rails keeps swinging.",
        ),
    )


@judges("F26", figure="26", needs=(GRID,), undrawn=RAIL)
def more_stroke_needs_less_crossover(evidence: Evidence) -> Finding:
    """Judge whether more stroke needs less crossover, by the rails with counted peaks."""
    return judged_grid(evidence.experiments.grid)


def judged_grid(grid: StrokeCrossover) -> Finding:
    """Judge, over stroke and crossover, whether the limit of hunting falls with stroke.

    The limit is a crossover. Also judge that peaks are counted at every stroke at the lowest crossover, and at none at
    the highest.
    """
    limits, share = grid.limits, grid.share
    falls = trend(grid.strokes, limits)
    named = ", ".join(
        f"{limit:.3g} Hz at {stroke * 1e3:.3g} mm" for limit, stroke in zip(limits, grid.strokes, strict=True)
    )
    return Finding.of(
        Part(
            "at the highest crossover no peaks are counted at any stroke, at the lowest some are at every stroke",
            bool((share[:, -1] == 0).all() and (share[:, 0] > 0).all()),
            f"none above {named} (up to {len(grid.rails)} rails a cell). {_ASSUMED}",
        ),
        Part(
            "the limit of the crossover falls with the stroke, as in Fig. 16A (rank correlation at most "
            f"{-words.trend:g}), and is lower at the largest stroke than at the smallest",
            bool(falls <= -words.trend and limits[-1] < limits[0]),
            f"rank correlation {trend_text(falls)}: {limits[-1]:.3g} against {limits[0]:.3g} Hz",
        ),
    )


@judges("F27", figure="27", needs=(ON_RAILS,), undrawn=RAIL)
def simulated_cycles_are_faster(evidence: Evidence) -> Finding:
    """Judge whether cycles on rails that vary are slower than the cycle on an even rail."""
    return judged_cycles(evidence.experiments.cycles)


def judged_cycles(cycles: CyclesOnRails) -> Finding:
    """Judge whether the cycle on an even rail is as the thesis simulates it.

    Also judge whether cycles on varied rails are slower, lopsided and irregular, as measured.
    """
    even, rails = cycles.even, cycles.rails
    swings = rails.swings
    slower = np.where(swings, rails.period, np.nan) / even.period[0]
    larger = np.where(swings, rails.swing, np.nan) / even.swing[0]
    similar = swings & (abs(np.log(larger)) <= np.log(words.similar))
    sides = np.where(swings, rails.above / rails.below, np.nan)
    lopsided = abs(np.log(sides[np.isfinite(sides)]))
    swinging = f"{int(swings.sum())} of {len(swings)} rails still swing at the end"
    times = f", with {np.nanmin(slower):.3g} to {np.nanmax(slower):.3g} times its period" if similar.any() else ""
    scatter = float(np.nanmedian(rails.period_scatter)) if np.isfinite(rails.period_scatter).any() else np.nan
    return Finding.of(
        Part(
            "on an even rail the cycle is symmetric, of the order of a millimetre from peak to peak",
            bool(even.swings[0])
            and about(float(even.swing[0]), 1e-3, words.order)
            and about(float(even.above[0] / even.below[0]), 1.0),
            f"{even.swing[0] * 1e3:.3g} mm, period {even.period[0]:.3g} s, one side "
            f"{even.above[0] / even.below[0]:.3g} times the other",
            why="There is no lasting swing on an even rail.",
        ),
        Part(
            f"on a rail that varies its period is nearly twice as long (at least {words.twice:g} times) at a "
            f"similar swing (within a factor of {words.similar:g}), on at least {percent(words.half)} of those "
            "that keep swinging",
            bool(swings.any() and (slower[similar] >= words.twice).sum() >= words.half * swings.sum()),
            f"{swinging}{times}. {_ASSUMED}",
            why="The rail is not the cause: friction that differs between the two sides slows a cycle down, "
            f"and ends it before it is twice as slow. {_weak_motor(cycles)}",
        ),
        Part(
            f"there its two sides differ (by a factor of more than {words.unequal:g}, on at least "
            f"{percent(words.half)} of those that keep swinging)",
            bool(len(lopsided) and np.quantile(lopsided, 1 - words.half) > np.log(words.unequal)),
            f"larger side over the other, median {np.exp(np.median(lopsided)):.3g}"
            if len(lopsided)
            else "nothing swings on",
            why="Too few keep swinging.",
        ),
        Part(
            f"there it is less regular from cycle to cycle (period scatters by more than {percent(words.uneven)})",
            scatter > words.uneven,
            f"median scatter of the period {percent(scatter)}",
            why="Friction at a given place is the same in each cycle: what changes from cycle to cycle is not in "
            "the model.",
        ),
    )


def _weak_motor(cycles: CyclesOnRails) -> str:
    """Say what a weaker motor and more Coulomb friction do to the cycle on an even rail."""
    cause = (
        f"On an even rail, with a motor that gives {MOTORS[1]:.2g} of its force, which would explain the mass line, "
        f"and {COULOMB_LEVEL:g} times the Coulomb friction,"
    )
    if not (cycles.weak.swings[0] and cycles.even.swings[0]):
        return f"{cause} there is no cycle to compare."
    period, swing = (float(getattr(cycles.weak, name)[0] / getattr(cycles.even, name)[0]) for name in _COMPARED)
    return (
        f"{cause} the period is {period:.3g} times as long at {swing:.3g} times the swing (friso rig measured-cycles)."
    )


_COMPARED = ("period", "swing")


@judges("F28", figure="28", needs=(STANDSTILL,))
def free_joint_stands_less_still(evidence: Evidence) -> Finding:
    """Judge whether the rig stands less still with its joint free, and what damping recovers."""
    return judged_standstill(evidence.experiments.standstill, evidence.force_noise)


def judged_standstill(standstill: InPosition, noise: float = 1.0) -> Finding:
    """Judge whether the stage stands less still with its joint free, and what damping recovers.

    `noise` is that of the drive's force, over what rounding makes.
    """
    at = _at_noise(standstill, noise)
    expected = PEAK_DEVIATIONS[1] / PEAK_DEVIATIONS[0]
    assumed = (
        f"Assumed: {noise * standstill.amplifier * 1e3:.2g} mN RMS of noise of the drive's force ({noise:.2g} times "
        f"that of rounding to {FORCE_BITS} bits), a quiet laboratory's floor"
    )
    return Finding.of(
        Part(
            f"locked the deviation is of the order of {PEAK_DEVIATIONS[0] * 1e6:g} um, free of "
            f"{PEAK_DEVIATIONS[1] * 1e6:g} um",
            _sized(at),
            f"peaks {at.locked * 1e6:.2g} and {at.free * 1e6:.2g} um. {assumed}",
            why=f"The noise of the force decides. {_over_noise(standstill)}",
        ),
        Part(
            f"free it is of the order of {expected:g} times as large as locked",
            about(at.free / at.locked, expected, words.order),
            f"ratio of the peaks {number_text(at.free / at.locked, '.2g')}; of RMS values, with the noise of rounding, "
            f"{number_text(standstill.ratio('all'), '.2g')}",
            why="Without noise of the force the floor moves both, and the free one hardly more.",
        ),
        Part(
            "the joint lacks the damping of the friction: as much as the bearing's bristles have removes at least "
            f"{percent(words.half)} of the difference",
            at.recovered >= words.half,
            f"{percent(at.recovered)} at {standstill.bearing_damping:.3g} N s/m; ten times the joint's own, "
            f"{10 * standstill.own_damping:g} N s/m, which friso assumes, {percent(_tenfold(standstill))}",
            why="The sticking bearing holds the locked stage with its stiff bristles, the free one is held "
            "only by the joint and the controller.",
        ),
        table=_noises(standstill),
    )


def _at_noise(standstill: InPosition, noise: float) -> NoisyStandstill:
    """Return the standstill with a noise of the force between those simulated, interpolated in logarithms."""
    factors = np.log([*standstill.louder])
    locked, free, recovered = np.array([(s.locked, s.free, s.recovered) for s in standstill.louder.values()]).T

    def between(values: np.ndarray) -> float:
        return float(np.interp(np.log(noise), factors, values))

    return NoisyStandstill(np.exp(between(np.log(locked))), np.exp(between(np.log(free))), between(recovered))


def _tenfold(standstill: InPosition) -> float:
    """Return which fraction of the difference ten times the joint's own damping removes."""
    ten = np.log(10 * standstill.own_damping)
    return float(np.interp(ten, np.log(standstill.damping), standstill.recovered))


def _sized(stands: NoisyStandstill) -> bool:
    pairs = zip((stands.locked, stands.free), PEAK_DEVIATIONS, strict=True)
    return all(about(peak, size, words.order) for peak, size in pairs)


def _over_noise(standstill: InPosition) -> str:
    """Say with which noises of the force the deviations at standstill are as measured."""
    met = [f"{factor:g}" for factor, stands in standstill.louder.items() if _sized(stands)]
    tried = ", ".join(f"{factor:g}" for factor in standstill.louder)
    where = f"With {' and '.join(met)} times that of rounding it is met" if met else "It is met with none"
    return f"{where} ({tried} times it were tried)."


def _noises(standstill: InPosition) -> FindingTable:
    """Return a table of the deviations over the noise of the force."""
    rows = tuple(
        (
            f"{factor:g}",
            f"{stands.locked * 1e6:.2g} um",
            f"{stands.free * 1e6:.2g} um",
            f"{stands.free / stands.locked:.2g}",
            percent(stands.recovered),
        )
        for factor, stands in standstill.louder.items()
    )
    damped = f"recovered by {standstill.bearing_damping:.3g} N s/m"
    return FindingTable(("noise of the force over that assumed", "joint locked", "joint free", "ratio", damped), rows)
