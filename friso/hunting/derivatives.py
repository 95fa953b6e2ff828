"""Differentiate a limit cycle, and the edge of hunting, by keys of the stage file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.find import Cycles, find_cycles
from friso.hunting.cycle.multipliers import multipliers
from friso.hunting.cycle.shooting import Orbits, close
from friso.hunting.settings import edge_settings


@dataclass(frozen=True)
class CycleDerivatives:
    """The limit cycle of a stage, with derivatives of its amplitude and period by keys.

    It is the symmetric cycle, or for a stage that is not symmetric the cycle over a whole period. `attracts` is true if
    it is stable; `amplitude` [m] and `period` [s] are its size. `amplitude_by` and `period_by`, shape (keys,), are
    derivatives by the keys' SI values.
    """

    attracts: bool
    amplitude: float
    period: float
    amplitude_by: np.ndarray
    period_by: np.ndarray


@np.errstate(all="ignore")
def cycle_derivatives(flat: Mapping[str, Any], keys: tuple[str, ...], rtol: float) -> CycleDerivatives | None:
    """Differentiate a stage's cycle by some of its keys; None if no cycle could be closed.

    `flat` has the stage's keys, such as "friction.static", in SI. Runs have the relative tolerance `rtol`. Derivatives
    are exact: variational equations along the keys, which take account of kinks, where derivatives jump.
    """
    stages = Ensemble.held(flat, 1)
    cycles = find_cycles(stages)
    if not cycles.closed[0]:
        return None
    orbits = close(stages, cycles.states, cycles.orbits.times, cycles.sign, rtol, cycles.swings)
    if not orbits.closed[0]:
        return None
    flow = flow_derivatives(stages, keys, orbits.states, orbits.times, rtol)
    if flow is None:
        return None
    ends, by_states, by_keys = flow
    size, sign = stages.scales.shape[1], orbits.sign
    system = np.zeros((size + 1, size + 1))
    system[:size, :size] = sign * by_states - np.eye(size)
    system[:size, size] = stages.rates(sign * ends[None])[0]
    system[size, stages.integral] = 1.0  # phase condition: period and amplitude do not depend on it
    moved = np.linalg.solve(system, np.vstack([-sign * by_keys, np.zeros(len(keys))]))
    halves = 2.0 if sign < 0 else 1.0
    extremes = _extremes(stages, keys, orbits, moved[:size], rtol)
    if extremes is None:
        return None
    amplitude, amplitude_by = extremes
    attracts = bool(cycles.attracting[0])
    return CycleDerivatives(attracts, amplitude, halves * float(orbits.times[0]), amplitude_by, halves * moved[size])


def flow_derivatives(
    stages: Ensemble, keys: tuple[str, ...], state: np.ndarray, time: np.ndarray, rtol: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Run a stage from a state (1, states) for a time [s] (1,), with derivatives of its end.

    Returns the final state (states,), its derivatives by the start (states, states), and its derivatives by `keys` such
    as "friction.static", (states, keys). Returns None if a run was not completed.
    """
    from friso.equations.variational import along  # SymPy takes 0.3 s to import

    size, count = state.shape[1], state.shape[1] + len(keys)
    several = stages.take(np.zeros(count, np.int64))
    beside = {along(name): np.eye(len(keys))[k] for k, name in enumerate(keys)}
    flat = {**several.flat, **{name: np.concatenate([np.zeros(size), row]) for name, row in beside.items()}}
    begun = Ensemble(flat, count, form=stages.structure)
    starts = np.hstack([np.repeat(state, count, axis=0), np.eye(count, size)])
    results = begun.run(starts, np.repeat(time, count), rtol, variational=True, along=keys, window=0.0)
    if not done(results).all():
        return None
    columns = results.ends[:, size : 2 * size]
    return results.ends[0, :size], columns[:size].T, columns[size:].T


def _extremes(
    stages: Ensemble, keys: tuple[str, ...], orbits: Orbits, moved: np.ndarray, rtol: float
) -> tuple[float, np.ndarray] | None:
    """Return half of peak to peak of the position on an orbit, and its derivatives by the keys.

    `moved` (states, keys) are the derivatives of the orbit's state by the keys. Returns None if a run was not
    completed, or turned less than twice.
    """
    whole = orbits.times * (2.0 if orbits.sign < 0 else 1.0)
    results = stages.run(orbits.states, whole, rtol, least_swing=0.0)
    turns = int(results.turn_counts[0])
    if turns < 2:
        return None
    times, values = results.turn_times[0, :turns], results.turn_values[0, :turns]
    sides = []
    for at in (int(values.argmax()), int(values.argmin())):
        flow = flow_derivatives(stages, keys, orbits.states, times[[at]], rtol)
        if flow is None:
            return None
        _, by_states, by_keys = flow
        sides.append((by_states @ moved + by_keys)[stages.kernel.position])
    return float(np.ptp(values) / 2), (sides[0] - sides[1]) / 2


@np.errstate(all="ignore")
def edge_derivatives(flat: Mapping[str, Any], keys: tuple[str, ...], factor: float, rtol: float) -> np.ndarray | None:
    """Return how the edge of hunting in bandwidth depends on each key, shape (keys,).

    The result is the relative change of the edge per relative change of the key. The edge lies at `factor` times the
    bandwidth of the stage, everything else unchanged. Along the edge the multiplier keeps its value; its derivatives
    are central differences. Returns None if no cycle flips there, if a limiter may chatter, or if an orbit could not be
    closed.
    """
    inside = faster(flat, factor * (1 - edge_settings.inside_edge_share))
    first = find_cycles(Ensemble.held(inside, 1))
    if (
        not (first.closed[0] and -1 <= first.multiplier[0] < -edge_settings.flip_multiplier)
        or Ensemble.held(inside, 1).chatters
    ):
        return None
    changed = [
        {name: inside[name] * (1 + step)}
        for name in keys
        for step in (-edge_settings.key_nudge_share, edge_settings.key_nudge_share)
    ]
    changed += [faster(inside, 1 + step) for step in (-edge_settings.key_nudge_share, edge_settings.key_nudge_share)]
    multiplier = _multipliers(inside, changed, first, rtol)
    if multiplier is None:
        return None
    slopes = (multiplier[1::2] - multiplier[::2]) / (2 * edge_settings.key_nudge_share)
    return -slopes[:-1] / slopes[-1]


def _multipliers(
    inside: Mapping[str, Any], changed: Sequence[Mapping[str, Any]], first: Cycles, rtol: float
) -> np.ndarray | None:
    """Return the largest multiplier of stages that differ slightly from one stage, (stages,).

    `inside` is the one stage, as keys and SI values, and `first` is its cycle. `changed` has the new values of keys for
    each of the others. Returns None if an orbit could not be closed, or a multiplier is complex.
    """
    count = len(changed)
    names = {name for change in changed for name, value in change.items() if value != inside[name]}
    flat = {**inside, **{name: np.array([change.get(name, inside[name]) for change in changed]) for name in names}}
    stages = Ensemble.held(flat, count)
    start = np.repeat(first.states, count, axis=0), np.repeat(first.orbits.times, count)
    orbits = close(stages, *start, first.sign, rtol, first.swings)
    if not orbits.closed.all():
        return None
    local = multipliers(stages, orbits, rtol).local[:, 0]
    return np.real(local) if np.all(np.abs(np.imag(local)) < 1e-9) else None
