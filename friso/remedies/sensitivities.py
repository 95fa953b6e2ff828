"""Differentiate cycle, edge of hunting, settling time and margin by the file's keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import STATISTICS, Results, Status
from friso.engine.settings import room_settings
from friso.equations.bandwidth import bandwidth
from friso.equations.motion import initial_displacement, rests, size, stands
from friso.equations.structure import decisive_keys
from friso.errors import InputError
from friso.frequency.crossover import settled_members
from friso.frequency.family import scan_stability
from friso.frequency.loops import response
from friso.frequency.margins import margins
from friso.frequency.members import Members
from friso.frequency.system import DriveTiming
from friso.hunting import (
    CycleDerivatives,
    Ensemble,
    Margin,
    can_hunt,
    check_given,
    cycle_derivatives,
    edge_derivatives,
    flow_derivatives,
)
from friso.remedies.settings import settings
from friso.stage import Stage, numeric_keys
from friso.stage.arguments import check_arguments
from friso.stage.controllers import as_tuned, controller_of

SENSITIVITY_RTOL = 1e-11
"""Relative tolerance of the runs, because derivatives need six digits."""


NOISE = 100 * SENSITIVITY_RTOL
"""Relative error of times in runs with that tolerance."""

ENTERED = STATISTICS.index("inner_exit")
"""Column of the statistics with the time at which a run last entered the band."""

START = "motion.displacement"
"""Key of the motion that gives the start of a release. It is the only one that is not part of the reference."""

TABLES = ("masses.", "friction.", "joint.", "controller.", "bias.", "transmission.", "motor_friction.")
"""Prefixes of keys on which the limit cycle may depend."""


@dataclass(frozen=True)
class EdgeDerivatives:
    """The edge of hunting as a bandwidth [Hz], and its derivatives `by` keys [Hz/SI], (keys,).

    For a controller that states no bandwidth, the edge is a multiple of the present speed.
    """

    edge: float
    by: np.ndarray


@dataclass(frozen=True)
class SettlingDerivatives:
    """The settling `time` [s] of the stage's own move, and its derivatives [s/SI], (keys,).

    The time runs from the last corner of the reference until the stage stays `within` [m]. The time jumps where a
    turning point crosses the edge of this band. `jump` is the distance of the nearest turning point from that edge,
    over the band.
    """

    within: float
    time: float
    by: np.ndarray
    jump: float


@dataclass(frozen=True)
class MarginDerivatives:
    """The least modulus margin of a stage's settled states, and its derivatives [1/SI], (keys,).

    Settled states are the limit cases, and all states stuck under a bias force. The derivatives hold for the state and
    the frequency at which the loop comes closest to -1.
    """

    margin: float
    by: np.ndarray


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of cycle, edge of hunting, margin and settling time by keys of a stage.

    `values` of the keys are in SI. A part is None if the stage has no such quantity, or none that is smooth. The
    settling time is also None if it was not asked for.

    Examples
    --------
    >>> import friso
    >>> locked = friso.load(friso.example("thesis_rig")).replace({"joint.locked": True})
    >>> friso.sensitivity(locked).ranked()[0]  # the key that moves the edge most  # doctest: +SKIP
    """

    stage: Stage
    keys: tuple[str, ...]
    values: np.ndarray
    cycle: CycleDerivatives | None
    edge: EdgeDerivatives | None
    margin: MarginDerivatives | None
    settling: SettlingDerivatives | None = None

    def ranked(self) -> list[tuple[str, float]]:
        """Rank the keys by how far a change of 1 % moves the edge; empty without an edge."""
        if self.edge is None:
            return []
        moves = 0.01 * self.values * self.edge.by
        return [(self.keys[k], float(moves[k])) for k in np.argsort(-np.abs(moves), kind="stable")]


@check_arguments
def sensitivity(
    stage: Stage, keys: Sequence[str] | None = None, edge: Margin | None = None, within: float | None = None
) -> Sensitivities:
    """Return derivatives of hunting cycle, edge of hunting and modulus margin to `keys`.

    Without `keys`, all keys in the equations are taken. The `edge` is computed unless that of a check is passed. With
    `within` [m], the deviation that counts as in position, the settling time is differentiated as well.

    Derivatives of the cycle and of the settling time are exact. They follow from variational equations along the keys,
    with saltation where the equations switch. Only the part by which keys move the start of a move is by central
    differences.

    The edge is that of a flip. Its derivatives follow from the multipliers, which are exact derivatives of the flow;
    their own change is taken by central differences. Derivatives of the margin are central differences of the loop at
    one frequency.

    Raises InputError for an unknown key, for one whose value is 0 (keys change by fractions), and for a deviation that
    is not positive. With `within`, also for keys of the motion, except the start of a release.

    Examples
    --------
    >>> import friso
    >>> locked = friso.load(friso.example("thesis_rig")).replace({"joint.locked": True})
    >>> friso.sensitivity(locked, ["friction.static"])  # doctest: +SKIP
    """
    flat = {**stage.flat(), **as_tuned(stage.flat())}
    names = _keys(flat) if keys is None else tuple(keys)
    numeric = numeric_keys(flat)
    for name in names:
        if name not in numeric or name not in flat:
            raise InputError("keys", name, "numeric keys of the stage", "friction.static")
        if not flat[name]:
            raise InputError(
                "keys", f"{name} = 0", "keys that are not 0: they are changed by shares", "friction.static"
            )
    values = np.array([flat[name] for name in names])
    flat = _with_equations_of(flat, names)
    if within is not None and not within > 0:
        raise InputError("within", f"{within:g}", "a deviation [m] greater than 0", "within=1e-6")
    for name in names if within is not None else ():
        if name.startswith("motion.") and (name, flat["motion.kind"]) != (START, "release"):
            allowed = f"keys of anything but the motion, or {START} of a release, as the settling time is asked for"
            raise InputError("keys", name, allowed, "friction.static")
    hunts = can_hunt(flat)
    return Sensitivities(
        stage,
        names,
        values,
        cycle_derivatives(flat, names, SENSITIVITY_RTOL) if hunts else None,
        _of_edge(stage, flat, names, edge) if hunts else None,
        _of_margin(flat, names),
        None if within is None else _of_settling(flat, names, within),
    )


def edge_sensitivities(stage: Stage, edge: Margin | None) -> Sensitivities:
    """Return the derivatives of the edge of hunting and of the margin by all keys.

    Only keys in the equations count.
    """
    flat = {**stage.flat(), **as_tuned(stage.flat())}
    names = _keys(flat)
    values = np.array([flat[name] for name in names])
    by = _of_edge(stage, flat, names, edge) if edge is not None and can_hunt(flat) else None
    return Sensitivities(stage, names, values, None, by, _of_margin(flat, names))


def _keys(flat: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the keys that the equations contain, without the motion's keys and keys that are 0."""
    contained = Ensemble.held(flat, 1).kernel.parameters
    return tuple(name for name in contained if name.startswith(TABLES) and flat[name])


def _with_equations_of(flat: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """Return a stage's flat keys, some slightly changed so that equations contain all `keys`.

    An exponent that is a whole number, for example, would otherwise be built in as a constant. Raises InputError for a
    key that equations never contain.
    """
    decisive = [name for name in keys if name in decisive_keys(flat)]
    nearby = {**flat, **{name: np.nextafter(flat[name], np.inf) for name in decisive}}
    contained = Ensemble.held(nearby, 1).kernel.parameters if decisive else ()
    for name in decisive:
        if name not in contained:
            raise InputError("keys", name, "keys that the equations contain as numbers", "friction.static")
    return nearby


def _of_edge(
    stage: Stage, flat: Mapping[str, Any], keys: tuple[str, ...], edge: Margin | None
) -> EdgeDerivatives | None:
    """Return the derivatives of the edge; without `edge`, a check finds the edge first.

    Returns None if there is no certain edge, or none that can be differentiated.
    """
    edge = check_given(stage).judgement.margin if edge is None else edge
    moved = None if edge is None or not edge.certain else edge_derivatives(flat, keys, edge.factor, SENSITIVITY_RTOL)
    if edge is None or moved is None:
        return None
    named = bandwidth(stage.flat())
    hertz = edge.factor * (1.0 if named is None else float(named))
    stated = controller_of(flat).bandwidth_key  # the edge does not move with the key that states the bandwidth
    relative = moved + np.array([float(name == stated) for name in keys])
    return EdgeDerivatives(hertz, hertz * relative / np.array([flat[name] for name in keys]))


@np.errstate(all="ignore")
def _of_settling(flat: Mapping[str, Any], keys: tuple[str, ...], within: float) -> SettlingDerivatives | None:
    """Return the derivatives of the settling time into the band `within` [m], by the keys.

    A derivative is the change of position where the stage last enters the band, over its speed there. Returns None if
    the stage does not settle in its run, or if the time does not change smoothly with the keys.
    """
    if not rests(flat):
        return None
    places = stands(flat)
    stages = Ensemble(flat, len(places))
    untils = np.array([float(place.until) for place in places])
    results = stages.run(_starts(stages, flat, len(places)), untils, SENSITIVITY_RTOL, bands=(within, within))
    if not _all_done(results):
        return None
    corners, entries = np.array([float(place.corner) for place in places]), results.statistics[:, ENTERED]
    longest = int(np.argmax(entries - corners))
    corner, until, entered = corners[longest], untils[longest], entries[longest : longest + 1]
    if not corner < entered[0] < until:
        return None
    stages, duration = Ensemble(flat, 1), untils[longest : longest + 1]
    start = _starts(stages, flat, 1)
    flow = flow_derivatives(stages, keys, start, entered, SENSITIVITY_RTOL)
    if flow is None:
        return None
    end, by_states, by_keys = flow
    position = stages.kernel.position
    by = -(by_states @ _starts_by(stages, flat, keys) + by_keys)[position] / end[stages.kernel.velocity]
    settling = float(entered[0] - corner)
    if not _is_smooth(flat, keys, until, float(entered[0]), settling, by, within):
        return None
    # a single run, with room for all turns
    results = stages.run(start, duration, SENSITIVITY_RTOL, least_swing=0.0, room=room_settings.most_turning_points)
    if not _all_done(results):
        return None
    turns = slice(int(results.turn_counts[0]))
    off, times = np.abs(results.turn_values[0, turns]) / within, results.turn_times[0, turns]
    last = off[(times > corner) & (times <= entered[0])][-1:]
    jump = np.abs(np.append(last, off[(times > entered[0]) & (times < until)]) - 1).min(initial=np.inf)
    return SettlingDerivatives(within, settling, by, float(jump))


def _all_done(results: Results) -> bool:
    return bool(np.all(np.equal(results.statuses, Status.DONE)))


def _is_smooth(
    flat: Mapping[str, Any],
    keys: tuple[str, ...],
    until: float,
    entered: float,
    settling: float,
    by: np.ndarray,
    within: float,
) -> bool:
    """Tell whether the settling time changes smoothly with each key.

    The stage `entered` the band for the last time at a time [s], after `settling` [s]; its run lasts `until` [s]. Keys
    are changed a little either way, and the new times are compared with what the derivatives `by` predict. Times and
    predictions differ if the stage bounces on its limiter so often that neighbouring motions diverge.
    """
    step = settings.loop_change * np.array([flat[name] for name in keys])
    changes = np.concatenate([-np.diag(step), np.diag(step)])
    beside = {name: flat[name] + values for name, values in zip(keys, changes.T, strict=True)}
    stages = Ensemble({**flat, **beside}, len(changes))
    durations = np.full(len(changes), until)
    results = stages.run(
        _starts(stages, stages.flat, len(changes)), durations, SENSITIVITY_RTOL, bands=(within, within)
    )
    moved = results.statistics[:, ENTERED] - entered
    expected = np.concatenate([-step * by, step * by])
    allowed = settings.smooth_share * settings.loop_change * settling + NOISE * entered
    return bool(_all_done(results) and np.all(np.abs(moved - expected) <= allowed))


def _starts(stages: Ensemble, flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return the states in which stages begin their motion, shape (count, states)."""
    sized, place = {**flat, "motion.size": size(flat)}, initial_displacement(flat)
    return stages.kernel.at_rest(sized, place, count, place)[:, : len(stages.kernel.states)]


def _starts_by(stages: Ensemble, flat: Mapping[str, Any], keys: tuple[str, ...]) -> np.ndarray:
    """Return derivatives of the states in which a motion starts, shape (states, keys).

    They are central differences over small changes of the keys.
    """
    columns = []
    for name in keys:
        low, high = _starts(
            stages, {**flat, name: flat[name] * np.array([1 - settings.loop_change, 1 + settings.loop_change])}, 2
        )
        columns.append((high - low) / (2 * settings.loop_change * flat[name]))
    return np.stack(columns, axis=1)


def _of_margin(flat: Mapping[str, Any], keys: tuple[str, ...]) -> MarginDerivatives | None:
    """Return the least modulus margin and its derivatives by central differences.

    Returns None if the loop is unstable in a limit case, or stuck under a bias force.
    """
    members = settled_members(flat)
    loops = scan_stability(flat, members)
    if not loops.stable.all():
        return None
    worst: Members = members[loops.worst()]
    closest = margins(flat, worst)
    omega = np.array([2 * np.pi * closest.closest])

    def distance(changes: Mapping[str, float]) -> float:
        """Return the least distance of the loop from -1 if the keys are changed, at one frequency."""
        nearby = {**flat, **changes}
        return float(np.abs(1 + response(nearby, worst, DriveTiming.of(nearby))(omega))[0])

    by = [
        (
            distance({name: flat[name] * (1 + settings.loop_change)})
            - distance({name: flat[name] * (1 - settings.loop_change)})
        )
        / (2 * settings.loop_change * flat[name])
        for name in keys
    ]
    return MarginDerivatives(closest.modulus_margin, np.array(by))
