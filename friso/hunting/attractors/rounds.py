"""Run stages in rounds, each longer than the last, until they rest or repeat themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.arrays import STATISTICS, Status
from friso.engine.settings import room_settings
from friso.hunting.attractors.recurrence import Recurrence, recurrence
from friso.hunting.attractors.settings import settings as survey_settings
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.find import GUESS_RTOL
from friso.hunting.cycle.rest import wait
from friso.hunting.cycle.return_map import trace_returns
from friso.hunting.cycle.settings import settings as orbit_settings
from friso.hunting.cycle.swings import last_swings
from friso.hunting.rows import ArrayRows
from friso.hunting.settings import ToleranceSettings

SURVEY_RTOL = ToleranceSettings().survey_rtol
TIGHT_SURVEY_RTOL = ToleranceSettings().tight_survey_rtol
"""Relative tolerances of survey runs: the usual one, and a tighter one where only simulations decide."""


@dataclass(frozen=True)
class Pending(ArrayRows):
    """Unfinished runs, one for each stage of the ensemble `stages`.

    `states`, shape (runs, kept), are the states, followed by the modes with memory. `durations` [s] are the lengths of
    the next round. `loose` [m] is the distance from which a stage breaks away. `mirrored` marks stages for which the
    mirror image of a motion is a motion too. Arrays have the shape (runs,) unless stated; `rtol` is the relative
    tolerance.
    """

    stages: Ensemble
    states: np.ndarray
    durations: np.ndarray
    loose: np.ndarray
    mirrored: np.ndarray
    rtol: float = SURVEY_RTOL


@dataclass(frozen=True)
class Ends(ArrayRows):
    """Results of a round of runs, arrays of shape (runs,).

    `states`, shape (runs, kept), are the final states, followed by the modes with memory. A run is `completed`, runs
    `away` from its reference, or certainly comes to `rest`; `steps` counts solver steps. `repeats` describes how the
    last swings repeat; `values` [m] and `times` [s] are the turning points, (runs, swings).
    """

    states: np.ndarray
    completed: np.ndarray
    away: np.ndarray
    rest: np.ndarray
    steps: np.ndarray
    repeats: Recurrence
    values: np.ndarray
    times: np.ndarray

    @property
    def swing(self) -> np.ndarray:
        """Return which runs swing at the end of the round, shape (runs,), periodically or not."""
        return (self.repeats.swings > 0) | (np.isfinite(self.values).sum(axis=1) >= survey_settings.least_turns)


def typical_period(stages: Ensemble) -> np.ndarray:
    """Estimate the period of a hunting cycle [s], (count,).

    The estimate is based on the sticking time and the loop's frequency.
    """
    return 2 * (wait(stages, survey_settings.typical_distance * stages.length) + 2 * np.pi / stages.number("rate"))


def loose_from(stages: Ensemble) -> np.ndarray:
    """Return the smallest tested distance [m] from which a stuck stage overshoots, (count,).

    From smaller distances it creeps home. If it overshoots from none, the result is the largest tested distance.
    """
    shares = np.geomspace(*survey_settings.creep_distances)
    distances = shares * stages.length[:, None]
    sides = (1.0,) if stages.symmetric.all() else (1.0, -1.0)
    returns = np.max([trace_returns(stages, distances, GUESS_RTOL, side).returns for side in sides], axis=0)
    breaks = returns > survey_settings.least_overshoot_share * distances
    first = np.where(breaks.any(axis=1), breaks.argmax(axis=1), len(shares) - 1)
    return distances[np.arange(stages.count), first]


def one_round(runs: Pending, budget: float = np.inf) -> tuple[Pending, Ends]:
    """Run each stage for its duration, within a `budget` of steps.

    Returns the runs at their new states and how they ended.
    """
    room = room_settings.first_turning_points
    stages, count = runs.stages, runs.stages.count
    least = survey_settings.least_swing * stages.length
    results = stages.run(
        runs.states,
        runs.durations,
        runs.rtol,
        with_modes=True,
        window=0.5,
        record_from=np.inf,
        least_swing=least,
        room=max(room, min(survey_settings.run_turning_points, survey_settings.turning_point_room // count)),
        budget=int(min(budget, survey_settings.round_step_limit)),
    )
    completed, away = done(results), np.equal(results.statuses, Status.DIVERGED)
    high, low, steps = (
        results.statistics[:, STATISTICS.index(name)] for name in ("deviation_max", "deviation_min", "attempted")
    )
    values, times = last_swings(
        results, np.maximum(survey_settings.swing_leg_share * (high - low), least), survey_settings.kept_swings
    )
    standing = _stands_still(stages, results.ends, high - low, runs.durations, runs.loose)
    repeats = recurrence(values, times, runs.mirrored)
    # a run that repeats itself may swing about its reference for ever
    rest = completed & standing & (repeats.swings == 0)
    ends = Ends(results.ends, completed, away, rest, steps, repeats, values, times)
    return replace(runs, states=results.ends), ends


def _stands_still(
    stages: Ensemble, ends: np.ndarray, swing: np.ndarray, durations: np.ndarray, loose: np.ndarray
) -> np.ndarray:
    """Return which runs stood still so long that they cannot break away again, shape (runs,).

    `ends` are the final states, `swing` [m] the peak-to-peak deviations over half of the `durations` [s]. `loose` [m]
    is the distance from which a stage breaks away.
    """
    distances = np.abs(ends[:, stages.sticking])
    home = (
        (swing < loose / 2)
        & (distances < loose / 2)
        & (durations / 2 > survey_settings.rest_waits * wait(stages, loose))
    )
    aside = (swing < 2 * survey_settings.least_swing * stages.length) & (
        durations / 2 > 2 * orbit_settings.breakaway_waits * wait(stages, distances)
    )
    return home | aside


def lengthened(runs: Pending, swing: np.ndarray) -> Pending:
    """Return runs with a longer next round.

    `swing`, shape (runs,), marks runs that swing. For any other run the round is long enough to show that it rests or
    swings slowly. But it is not so long that a run which starts to swing does so for most of the round.
    """
    least = np.where(
        swing,
        0.0,
        np.minimum(
            survey_settings.longest_waits * wait(runs.stages, runs.loose),
            survey_settings.quiet_round_factor * runs.durations,
        ),
    )
    return replace(runs, durations=np.maximum(survey_settings.next_round_factor * runs.durations, least))
