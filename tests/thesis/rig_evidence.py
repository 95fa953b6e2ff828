"""Evidence on the rig as built (F24 to F28), made up: no simulation."""

from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.response.records import FrequencyResponse
from friso_thesis.studies.rig.experiments.frf import MeasuredLoop, Plant
from friso_thesis.studies.rig.in_position import InPosition, NoisyStandstill, Standstill
from friso_thesis.studies.rig.moves_on_rails import RailRuns
from friso_thesis.studies.rig.stroke_crossover import StrokeCrossover
from friso_thesis.studies.thesis.as_built import CyclesOnRails, MovesOnRails, RailTraces, RigLoops

HUNTS, FAILED = 7, -1
"""Peaks of a run that hunts; of one that failed, which says nothing."""


def rail_runs(peaks: Any, **keys: Any) -> RailRuns:
    """Return invented runs with these peak counts, which swing by 1 mm every 0.5 s to the end unless `keys` differ."""
    counts = np.array(peaks)
    every = {"swing": 1e-3, "period": 0.5, "above": 5e-4, "below": 5e-4, "rising": 0.5}
    every |= {"period_scatter": 0.0, "height_scatter": 0.0, **keys}
    swings = np.broadcast_to(np.array(every.pop("swings", True)), counts.shape)
    words = np.where(counts == FAILED, "failed", np.where(swings, "swings", "rests"))
    whole = {name: np.broadcast_to(np.array(value, float), counts.shape) for name, value in every.items()}
    return RailRuns(np.maximum(counts, 0), words, **whole)


def moves(first: Any, free: Any = (0, 0, 0, 0), middle: Any = (0, 0, 0, 0), high: Any = (0, 0, 0, 0),
          released: Any = (0, 0, 0, 0), **cycle: Any) -> MovesOnRails:  # fmt: skip
    """Return invented moves on four rails; releases to one side start nothing, those to the other a `cycle`."""
    let_go = rail_runs([(0, 0, 0, 0), released], **cycle)
    return MovesOnRails(np.array([8.0, 9.5, 14.3]), rail_runs([first, middle, high]), rail_runs(free), let_go)


def grid(*highest: int, runs: Any = None) -> StrokeCrossover:
    """Return invented runs at three strokes; `highest`: number of the highest crossover that hunts, -1 for none.

    Or the runs are given.
    """
    crossovers = np.array([4.0, 6.0, 8.0])
    hunts = np.arange(3) <= np.array(highest)[:, None] if runs is None else np.array([])
    peaks = np.repeat(HUNTS * hunts[..., None], 2, axis=2) if runs is None else np.array(runs)
    return StrokeCrossover(np.array([2e-5, 3e-4, 1e-3]), crossovers, np.array([1.0, 2.0]), 8.0, rail_runs(peaks))


SLOW = {"period": 1.0, "swing": 1.2e-3, "above": 7e-4, "below": 5e-4, "period_scatter": 0.1}
"""Cycles of a rail that varies, as the thesis has them."""


def cycles(even: dict[str, Any] | None = None, **rails: Any) -> CyclesOnRails:
    return CyclesOnRails(rail_runs([HUNTS], **(even or {})), rail_runs([HUNTS] * 4, **{**SLOW, **rails}), np.zeros(4),
                  rail_runs([HUNTS], **SLOW))  # fmt: skip


def standstill(locked: float = 1e-7, free: float = 1e-6, recovered: float = 0.6) -> InPosition:
    """Peaks [m], which grow with the noise, and the share of the difference that the bearing's damping takes away."""
    rms = 3e-8 * np.array([1.0, 10.0])

    def still(*true: list[float]) -> Standstill:
        both = np.array(true)
        return Standstill(both, both, np.zeros(len(both)), np.zeros((len(both), 2)))

    runs = {("locked", "all"): still([rms[0], locked]), ("free", "all"): still([rms[1], free])}
    damped = still(*([rms[1] - share * (rms[1] - rms[0]), free] for share in (0.0, 0.1, 0.99)))
    damping = np.array([0.5, 5.0, 50.0])
    time = np.linspace(0.0, 12.0, 50)
    drawn = {case: (time, size * np.sin(time)) for case, size in (("locked", locked), ("free", free))}
    noises = {k: NoisyStandstill(k * locked, k * free, recovered) for k in (0.1, 1.0, 10.0)}
    return InPosition(16.0, 7e-3, False, np.array([1.0, 2.0]), runs, {}, damping, 0.5, damped, drawn, noises, 316.0)


def traces() -> RailTraces:
    """Moves at three crossovers, of which the lowest swings with the joint locked, and on both rails."""
    time = np.linspace(0.0, 20.0, 200)
    swing = 5e-4 * np.sin(4 * time)
    moves = {("locked", 8.0): swing, ("locked", 9.5): 0.1 * swing, ("locked", 14.3): 0 * time, ("free", 8.0): 0 * time}
    return RailTraces(time, moves, {"even rail": swing, "rail that varies": 0.8 * swing}, 0.09)


def loop(tuned: float, *crossings: float) -> MeasuredLoop:
    line, none = np.array([tuned, 20 * tuned]), np.zeros(2)
    response = FrequencyResponse(
        frequency=line,
        response=np.array([1.0, 0.1]) + 0j,
        deviation=none,
        noise=none,
        distortion=none,
        degrees=none + 2,
        kind="multisine",
    )
    return MeasuredLoop(
        tuned, response, tuple(Estimate.normal("crossover", "Hz", crossing, 0.1, "") for crossing in crossings)
    )


def loops(
    locked: tuple[tuple[float, ...], ...] = ((9.0,), (45.0, 700.0)), free: tuple[float, ...] = (6.0, 21.0),
    stable: int = 3, weak: tuple[float, float] = (2.4, 0.9),
) -> RigLoops:  # fmt: skip
    """Crossings of the loops tuned to 8 and 48 Hz and of the free one [Hz]; how many of the settings 20, 35, 50 and
    75 Hz are stable; masses that a weaker motor shows locked and free [kg]."""
    apparent = np.array([[1.7, weak[0], 1.2], [0.5, weak[1], 0.3]])
    settings = np.array([20.0, 35.0, 50.0, 75.0])
    held = tuple(loop(tuned, *item) for tuned, item in zip((8.0, 48.0), locked, strict=True))
    first = loop(8.0, *free)
    mass = Estimate.normal("mass", "kg", 0.5, 0.01, "")
    plant = Plant((first.response,), first.response, 11.0, mass, (33.0, 100.0))
    return RigLoops(held, first, plant, settings, np.arange(4) < stable, apparent)
