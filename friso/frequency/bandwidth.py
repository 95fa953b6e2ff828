"""Compute the bandwidth of a loop: the highest frequency at which its gain is 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from friso.equations.bandwidth import sped_up
from friso.equations.settings import gain_states
from friso.frequency.drive import DriveTiming
from friso.frequency.loops import poles
from friso.frequency.margins import margins, with_resonances
from friso.frequency.members import Members, limit_cases
from friso.stage import Stage

GRID = np.geomspace(0.01, 1e4, 800)
"""Frequencies [Hz] at which loops are evaluated for their bandwidth; more lie near resonances of the stage."""


def loop_bandwidth(stage: Stage) -> float:
    """Return the bandwidth [Hz] of a stage: the last frequency at which its loop has gain 1.

    The stage slides; while it is stuck, the bearing holds it and the loop hardly moves it. The result is NaN if the
    gain never reaches 1. With other gains at standstill the larger bandwidth counts.
    """
    return float(np.fmax.reduce([_last_crossing(flat) for flat in gain_states(stage.flat())]))


def rigid_bandwidth(stage: Stage) -> float:
    """Return the bandwidth [Hz] of a stage with its joint locked and without a parasitic mode.

    The mass then moves as a whole, as van Dijk's rules for the crossover assume.
    """
    flat = {key: value for key, value in stage.flat().items() if not key.startswith("parasitic.")}
    return _last_crossing({**flat, "joint.locked": True} if stage.joint else flat)


def _last_crossing(flat: Mapping[str, Any]) -> float:
    crossings = margins(flat, _sliding(flat)).crossovers
    return float(crossings[-1]) if crossings else float("nan")


def bandwidths_at(stage: Stage, factors: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the bandwidths [Hz] of a stage whose controller is made faster by some factors.

    The shape is (factors,).
    """
    return loop_bandwidths(stage, sped_up(stage.flat(), np.array(factors)), len(factors))


@np.errstate(all="ignore")
def loop_bandwidths(stage: Stage, changes: Mapping[str, Any], count: int) -> np.ndarray:
    """Return the bandwidths [Hz] of a stage with changed keys, in continuous time, (count,).

    `changes` has the keys with their values [SI], arrays (count,). The stage slides; a loop that never falls through
    gain 1 gives NaN. The results have a relative error of 1e-3: the loop is computed on a grid of frequencies, and its
    gain is a power of frequency in between. If the gains at standstill differ, the larger bandwidth counts.
    """
    flat, sliding = stage.flat(), _sliding(stage.flat())
    omega = with_resonances(2 * np.pi * GRID, [poles(flat, sliding, DriveTiming(0.0, 0.0)).cut])
    machines = sliding.repeated(count)
    return np.fmax.reduce([_last_falls(state, machines, omega) for state in gain_states({**flat, **changes})])


def _last_falls(flat: Mapping[str, Any], machines: Members, omega: np.ndarray) -> np.ndarray:
    """Return the last frequencies [Hz] at which open loops fall through gain 1, (machines,).

    `machines` are states of the stage. The frequencies are searched between angular frequencies `omega` [rad/s]. NaN
    marks a loop that never falls through 1.
    """
    loops = poles(flat, machines, DriveTiming(0.0, 0.0)).loop(omega)
    gain, frequency = np.log(np.abs(loops)), np.log(omega / (2 * np.pi))
    falls = (gain[:, :-1] >= 0) & (gain[:, 1:] < 0)
    last = falls.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    rows = np.arange(len(machines))
    before, after = gain[rows, last], gain[rows, last + 1]
    at = frequency[last] + (frequency[last + 1] - frequency[last]) * before / (before - after)
    return np.where(falls.any(axis=1), np.exp(at), np.nan)


def _sliding(flat: Mapping[str, Any]) -> Members:
    """Return the limit case in which the stage slides."""
    return next(case for name, case in limit_cases(flat).items() if not name.startswith("stuck"))
