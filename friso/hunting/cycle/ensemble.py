"""Stages of equal equations that run side by side, with the states from which hunting starts.

Arrays have one row for each stage or run, to select from.

The reference is at zero, and any initial state may be given. Stages start at rest, or stuck off their reference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, columns, kernel
from friso.equations.motion import without_motion
from friso.equations.roles import Role, Steady
from friso.equations.structure import Structure, carrying_force, shared_structure
from friso.stage.controllers import integral_leak
from friso.stage.tables import BACKLASH


class ArrayRows:
    """Base of dataclasses with one row for every stage or run.

    All arrays have these rows, and so have parts with arrays of their own. Numbers and words that all rows share stay
    unchanged.
    """

    def take(self, numbers: Any) -> Self:
        """Select the rows with these numbers; a number may occur several times."""
        parts = {part.name: _rows_of(getattr(self, part.name), numbers) for part in fields(self)}  # type: ignore[arg-type]
        return replace(self, **parts)  # type: ignore[type-var]


def spans(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last numbers of each group of neighbouring flags, shape (count,), that are true."""
    ends = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0))
    return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]


def _rows_of(part: Any, numbers: Any) -> Any:
    """Select rows by number from an array, or all arrays in a `part`; return others unchanged."""
    if isinstance(part, np.ndarray):
        return part[numbers]
    if isinstance(part, tuple):
        return tuple(_rows_of(one, numbers) for one in part)
    return part.take(numbers) if hasattr(part, "take") and not isinstance(part, np.generic) else part


PER_STAGE = ("symmetric", "length", "scales", "relaxed", "per_newton", "balancing")
"""Cached properties of an ensemble that have one row per stage."""

OF_ALL = ("structure", "kernel")
"""Cached properties of an ensemble that are common to all its stages."""


FRICTIONLESS_SIZE = 1e-6  # [m]
"""Size of the motion of a stage without friction. It is linear, so any size will do."""

CHATTERING_RTOL = 1e-7
"""Tolerance of cycles that may chatter, where many are followed or searched for, and widest one for the slope of a
return map. Finer runs change their multipliers by less than the scatter from one stage to the next."""


@dataclass(frozen=True)
class Ensemble:
    """Stages of one structure, as a mapping of keys to SI numbers or arrays of shape (count,).

    `flat` has the keys, such as "friction.static". `form` is the structure, given where the first stage alone does not
    show it. `threads` bounds the threads of runs; `cancel` is a flag that stops runs (see `RunOptions`).
    """

    flat: Mapping[str, Any]
    count: int
    form: Structure | None = None
    threads: int | None = None
    cancel: np.ndarray | None = None

    @classmethod
    def held(cls, flat: Mapping[str, Any], count: int, **options: Any) -> Ensemble:
        """Make an ensemble of stages with their reference held at 0 instead of their motion.

        `flat` has the keys of `count` stages in SI, and `options` are further fields.
        """
        if (form := options.get("form")) is not None:
            options["form"] = form.standing
        return cls({**without_motion(flat), "motion.kind": "release"}, count, **options)

    def take(self, numbers: np.ndarray) -> Ensemble:
        """Select the stages with these numbers; a number may occur several times."""
        flat = {key: value[numbers] if getattr(value, "ndim", 0) else value for key, value in self.flat.items()}
        taken = replace(self, flat=flat, count=len(numbers))
        computed = {name: value[numbers] for name, value in vars(self).items() if name in PER_STAGE}
        shared = {name: value for name, value in vars(self).items() if name in OF_ALL}
        vars(taken).update(computed | shared)  # properties that are computed already
        return taken

    @cached_property
    def structure(self) -> Structure:
        """Return the structure of the equations that all stages share."""
        return self.form or shared_structure(self.flat)

    @cached_property
    def kernel(self) -> Kernel:
        """Return the compiled equations of the stages."""
        return kernel(self.structure)

    @property
    def chatters(self) -> bool:
        """Tell whether the stages may chatter.

        A stroke limiter may be touched and left many times in a swing. A controller that pushes beyond a window may
        hold the stage at the window's edge as a relay does.
        """
        controller = self.structure.controller
        return self.structure.joint == "free" or (controller is not None and "stiction_push" in controller.settings)

    def searching_rtol(self, rtol: float) -> float:
        """Return the relative tolerance at which many cycles are closed: `rtol`, or a wider one if they may chatter."""
        return max(rtol, CHATTERING_RTOL) if self.chatters else rtol

    @property
    def remember(self) -> bool:
        """Tell whether the stages have several bristles, of which some may stick while others slip.

        The break-away of such a stage depends on its past.
        """
        return len(self.kernel.having(Role.BRISTLE)) > 1

    @cached_property
    def symmetric(self) -> np.ndarray:
        """Return which stages have mirror-image motions, shape (count,), tested on random states."""
        states = np.random.default_rng(0).normal(size=(8, 1, self.scales.shape[1])) * self.scales
        pairs = ((self.rates(family), self.rates(-family)) for family in states)
        return np.all([np.all(np.abs(a + b) <= 1e-9 * np.abs(a), axis=1) for a, b in pairs], axis=0)

    @cached_property
    def values(self) -> list[np.ndarray]:
        """Return the parameters of each stage in the order of the generated functions' arguments."""
        return self.kernel.values({**self.flat, "motion.size": np.nan, "motion.duration": np.inf}, self.count)

    def number(self, name: str) -> np.ndarray:
        """Return a quantity of every stage, shape (count,), by its `name` among compiled functions.

        "rate" [1/s] is the natural frequency of mass and loop, and "stiffness" [N/m] the proportional stiffness of the
        loop. "breakaway" [N] is the largest force of the controller at which nothing moves: friction at rest, and with
        a backlash the force at half of it.
        """
        (value,) = getattr(self.kernel.module, name)(self.values)
        return np.broadcast_to(np.asarray(value, dtype=float), (self.count,))

    @property
    def backlash(self) -> np.ndarray:
        """Return the width of the backlash [m], shape (count,); 0 without one."""
        return np.broadcast_to(np.asarray(self.flat[BACKLASH] if self.structure.plays else 0.0), (self.count,))

    @property
    def friction_at_rest(self) -> np.ndarray:
        """Return the friction force at rest [N], the mean of both directions, (count,).

        It is the break-away force less the controller's force at half the backlash, which friction does not hold.
        """
        return self.number("breakaway") - self.number("stiffness") * self.backlash / 2

    @cached_property
    def length(self) -> np.ndarray:
        """Return the deflection of the loop by the break-away force [m], shape (count,)."""
        return self.number("breakaway") / self.number("stiffness")

    @cached_property
    def scales(self) -> np.ndarray:
        """Return the magnitudes of the states, shape (count, states)."""
        size = np.where(self.length > 0, self.length, FRICTIONLESS_SIZE)
        values = self.kernel.values({**self.flat, "motion.size": size, "motion.duration": np.inf}, self.count)
        return columns(self.kernel.module.scales(values), self.count)

    @property
    def sticking(self) -> int:
        """Return the index of the state that stays constant while a stage sticks.

        It is the position of the body with friction.
        """
        return self.kernel.cart_position

    @property
    def integral(self) -> int:
        """Return the index of the integrator's state that holds the force: the innermost of several."""
        return self.kernel.having(Role.INTEGRAL)[-1]

    @property
    def outer_integrals(self) -> list[int]:
        """Return the indices of the integrators of outer loops."""
        return self.kernel.having(Role.INTEGRAL)[:-1]

    def settled(self, steady: Steady) -> np.ndarray:
        """Return the states in a steady motion after all transients, (count, states)."""
        return self.kernel.settled_at(self.values, steady, self.count)

    def at_rest(self, place: np.ndarray | float, displacement: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the states in which stages at rest at a place [m] begin, (count, states).

        Their reference has been there, or a `displacement` [m] before it (see `Kernel.at_rest`).
        """
        sizes = {"motion.size": np.nan, "motion.duration": np.inf}
        return self.kernel.at_rest({**self.flat, **sizes}, place, self.count, displacement)

    @cached_property
    def relaxed(self) -> np.ndarray:
        """Return the integrator state per displacement [s] that relaxes the actuator, (count,).

        With this state, the actuator of a displaced stage exerts the force that it exerts at the reference.
        """
        return self.settled(Steady(-1.0, 1.0))[:, self.integral]

    @cached_property
    def balancing(self) -> np.ndarray:
        """Return the actuator force [N] about which a stage sticks, shape (count,).

        It is zero if friction alone holds the constant forces; otherwise it balances these forces.
        """
        carrying = carrying_force(self.flat)
        return np.where(np.abs(carrying) < self.number("breakaway"), 0.0, carrying) + np.zeros(self.count)

    def unbalanced(self, states: np.ndarray, number: int | None = None) -> np.ndarray:
        """Return how far the integrators of sticking stages are from balancing constant forces.

        The result is in the unit of the integrator's state, with a sign. Only constant forces that friction does not
        hold need balance. `states` have the shape (count, states), and the result (count,). For the stage `number`
        alone, they are (n, states) and (n,).
        """
        of = slice(None) if number is None else number
        balanced = self.relaxed[of] * states[:, self.sticking] + self.per_newton[of] * self.balancing[of]
        return states[:, self.integral] - balanced

    @cached_property
    def per_newton(self) -> np.ndarray:
        """Return the change of the integrator's state for a force of 1 N, shape (count,)."""
        held, free = (self.settled(Steady(0.0, 0.0, force=force))[:, self.integral] for force in (1.0, 0.0))
        return held - free

    def rates(self, states: np.ndarray) -> np.ndarray:
        """Return the time derivatives of the states, both of shape (count, states).

        The reference stands at zero.
        """
        modes = self.kernel.modes(states.T, 0.0, np.zeros(3), self.values)
        return columns(self.kernel.module.right_hand_side(states.T, modes, 0.0, np.zeros(3), self.values), self.count)

    def steady_friction(self, velocities: np.ndarray) -> np.ndarray | None:
        """Return the friction force [N] in steady motion at velocities [m/s], both (count,).

        Returns None for a law without a steady force.
        """
        states = np.zeros((self.count, self.kernel.initial_size))
        states[:, self.kernel.cart_velocity] = velocities
        rows = self.kernel.module.steady_friction(states.T, self.values)
        return np.broadcast_to(rows[0], (self.count,)) if rows else None

    def run(
        self,
        starts: np.ndarray,
        durations: np.ndarray,
        rtol: float,
        variational: bool = False,
        with_modes: bool = False,
        **run_options: Any,
    ) -> Results:
        """Run each stage from its state in `starts` for its duration [s].

        A run begins in the modes with memory that belong to its state. The `ends` of the result are states alone, or
        with the modes if `with_modes`. With `variational`, small deviations from the run are integrated too.
        Turning points are kept only with `least_swing`, because a limiter that chatters makes too many. `run_options`
        are fields of `RunOptions`.
        """
        run_options = {"least_swing": np.inf, **run_options}
        options = RunOptions(rtol=rtol, threads=self.threads, cancel=self.cancel, **run_options)
        flat = {**self.flat, "motion.duration": durations, "motion.displacement": self.length}
        runs_by = kernel(self.structure, variational) if variational else self.kernel
        parts = list(run_chunks(runs_by, flat, self.count, options, starts))
        room = max(1, *(int(part.results.turn_counts.max(initial=0)) for part in parts))
        rooms = [_with_room(part.results, room) for part in parts]
        results = rooms[0]
        if len(parts) > 1:
            order = np.argsort(np.concatenate([part.numbers for part in parts]))
            results = Results(*(np.concatenate(column)[order] for column in zip(*rooms, strict=True)))
        return results if with_modes else results._replace(ends=results.ends[:, : starts.shape[1]])

    def same_modes(self, states: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return which runs end with equal modes with memory as they began, shape (count,).

        Runs begin in `states`, shape (count, states). `ends`, shape (count, kept), are their final states, followed by
        the modes with memory.
        """
        begun, ended = (self.kernel.modes(state.T, 0.0, np.zeros(3), self.values) for state in (states, ends))
        switches = list(self.kernel.switches)
        return np.all(begun[switches] == ended[switches], axis=0)


def _with_room(results: Results, room: int) -> Results:
    """Extend or cut results to room for this many turning points."""
    turns = results.turn_times[:, :room], results.turn_values[:, :room]
    if missing := room - turns[0].shape[1]:
        turns = tuple(np.pad(column, ((0, 0), (0, missing))) for column in turns)
    return results._replace(turn_times=turns[0], turn_values=turns[1])


def done(results: Results) -> np.ndarray:
    """Return which runs were completed, shape (runs,)."""
    return np.equal(results.statuses, Status.DONE)


def stuck(stages: Ensemble, displacement: np.ndarray, wound: np.ndarray | float = 0.0) -> np.ndarray:
    """Return states of stages stuck at displacements [m] (count,), shape (count, states).

    Bristles are relaxed. The actuator exerts no force, or balances constant forces that friction does not hold.
    Integrals of outer loops have `wound` up for a time [s].

    A stage stuck there winds up until it breaks away, which erases its past. These states form a line through all
    cycles with sticking, and the distance to the reference decides what follows, unless several loops have integrals.
    """
    states = stages.settled(Steady(-displacement, displacement, force=stages.balancing))
    states[:, stages.outer_integrals] = np.reshape(-displacement * wound, (-1, 1))
    return states


def bent(stages: Ensemble, displacement: np.ndarray, *travels: np.ndarray) -> np.ndarray:
    """Return states of stages stuck at displacements [m], with bristles bent by earlier travels.

    The `travels` [m], slow and each of shape (count,), follow one another, and bend bristles no farther than break-away
    does. With several bristles some may stick while others slip, so that the distance alone does not decide what
    follows.
    """
    states, bristles = stuck(stages, displacement), stages.kernel.having(Role.BRISTLE)
    most = stages.scales[:, bristles]
    for travel in travels:
        states[:, bristles] = np.clip(states[:, bristles] + travel[:, None], -most, most)
    return states


def pushed(stages: Ensemble, velocity: np.ndarray) -> np.ndarray:
    """Return states of stages at their reference that move at a velocity [m/s], (count, states).

    All masses move alike; everything else is as from rest.
    """
    states = stages.at_rest(0.0)
    states[:, stages.kernel.having(Role.VELOCITY)] = velocity[:, None]
    return states


LEAK_TIME_CONSTANTS = 10.0  # [time constants]
"""Time after which the integrator of a stuck stage is 5e-5 off its final value."""


def wait(stages: Ensemble, displacement: np.ndarray) -> np.ndarray:
    """Return the time [s] in which the integrator winds up to break-away, (count,).

    The stage sticks meanwhile, at a `displacement` [m]. If the integrator pauses, the result is one period of the
    loop's natural frequency. With a leak it is at most a few time constants of the leak.
    """
    rate = np.abs(stages.rates(stuck(stages, displacement))[:, stages.integral] / stages.per_newton)
    with np.errstate(divide="ignore"):
        winding = np.where(rate > 0, stages.number("breakaway") / rate, 2 * np.pi / stages.number("rate"))
        return np.minimum(winding, LEAK_TIME_CONSTANTS / np.asarray(2 * np.pi * integral_leak(stages.flat)))


def spread_over(*ranges: tuple[float, float, int]) -> np.ndarray:
    """Return numbers, shape (n,), that are spread evenly in their logarithm over ranges: first, last and number."""
    return np.concatenate([np.geomspace(*one) for one in ranges])
