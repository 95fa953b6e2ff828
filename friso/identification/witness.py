"""Replay the given controller on the logged reference and position, and compare its force with the logged one.

The controller saw the machine: where both are right, the force that it commands on what was logged is the logged force.
What turns one into the other names what is wrong with the record or with the controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import bilinear, lfilter, ss2tf

from friso.errors import InputError
from friso.identification.inverse_model import least_squares, unit_of
from friso.identification.logs.log import Log
from friso.identification.readings.common import noise_of
from friso.quantities import percent, plain_factor
from friso.stage.controllers import CONTROLLER, NO_SETTINGS, settings_of
from friso.stage.tables import TRANSMISSION

if TYPE_CHECKING:
    from friso.frequency.system import System


FORCE_LEFT_BY_THE_CONTROLLER = 0.15
"""Largest share of the logged force that a controller leaves which explains it. Sound records leave 0.02 to 0.09,
a clock that is off by two 0.6 and more."""

ERROR_OF_AN_AGREEING_SLOPE = 0.15
"""Largest error of the force by the given controller. Sound records have slopes of 0.94 to 1.00."""


@dataclass(frozen=True, kw_only=True)
class Replay:
    """Force of the controller on a log, compared with the logged force.

    The logged force, of RMS `force` [N], is `slope` times the commanded one, and leaves the share `left` of its own
    variation, of which the share `noise` differs from sample to sample. It comes `lag` [s] after the command. Time
    of the log runs `clock` times as slowly as the controller's. `mass` [kg] times the reference's acceleration, and
    `direction` [N] in its direction, are in it besides. `slopes` are those before and after an instant at which
    gains were switched. With samples that are taken as even, against their time stamps, `left_by_stamps` is the share
    left with these.
    """

    slope: float
    left: float
    noise: float = 0.0
    lag: float = 0.0
    clock: float = 1.0
    mass: float = 0.0
    direction: float = 0.0
    force: float = 1.0
    slopes: tuple[float, float] | None = None
    left_by_stamps: float | None = None

    @property
    def explains(self) -> bool:
        """Tell whether the controller explains the course of the logged force, whatever its size."""
        beyond_noise = np.sqrt(max(self.left**2 - self.noise**2, 0.0))
        return bool(beyond_noise <= FORCE_LEFT_BY_THE_CONTROLLER)

    @property
    def steps(self) -> bool:
        """Tell whether the controller explains two parts of the record alike, each with a constant force of its own."""
        alike = self.slopes is not None and self.slopes[0] * self.slopes[1] > 0
        if not alike or self.slopes is None:
            return False
        return bool(abs(np.log(self.slopes[1] / self.slopes[0])) <= ERROR_OF_AN_AGREEING_SLOPE)

    @property
    def refutes(self) -> bool:
        """Tell whether another controller drove the machine, or one with a feedforward that this one lacks."""
        return bool(self.mass or not (self.agrees or self.steps))

    @property
    def agrees(self) -> bool:
        """Tell whether the controller explains the logged force, its size included."""
        return self.explains and abs(self.slope - 1) <= ERROR_OF_AN_AGREEING_SLOPE


SHARE_OF_A_LIMIT = 0.999
"""Share of the largest force from which a sample counts as at the limit."""

SHARE_AT_A_LIMIT = 0.005
"""Share of samples at the largest force above which it counts as a limit."""

DEVIATIONS_AT_A_LIMIT = 6.0
"""Distance below the largest force at which no limit acts, in standard deviations of the noise."""

SAMPLES_OF_A_START = 10
"""Samples at the start that do not count, in which filters of the controller forget that they began at rest."""

REACH_OF_A_CLOCK = 20.0
"""Largest ratio of clocks searched. Larger ones are units, which the logged names tell."""

CLOCKS_TRIED = 41
"""Clocks tried over that range, a sixth apart. The best one is refined."""

REFINEMENTS_OF_A_CLOCK = 6
"""Halvings of the step between clocks. Six find a clock to 0.3 %."""

SHARE_LEFT_BY_A_CAUSE = 0.4
"""Largest share left with another clock or feedforward, relative to that without, for the cause to be believed."""

SHARES_OF_A_RECORD = (0.2, 0.8)
"""First and last share of a record at which gains may be switched."""

INSTANTS_TRIED = 13
"""Instants tried over that range."""

LEAST_SHARE_OF_A_STATE = 1e-9
"""Smallest effect on the force, relative to the largest, by which states of the controller are told apart."""

SAMPLES_OF_DELAY = 4
"""Longest delay searched from position to force [samples]."""


class Witness:
    """A log with reference, position and force, and the controller of a stage whose keys in SI are `flat`.

    Samples at the force limit do not count. What the controller's integrals and filters hold where a stretch without
    them begins, no channel shows: what they do to the force from there on is left out of both forces.
    """

    def __init__(self, log: Log, flat: Mapping[str, Any]) -> None:
        from friso.frequency.loops import compensator  # imports SymPy, which is slow

        part = log.longest
        self.log, self.step = log, log.sample_time
        self.reference, self.position, self.force = (log[name][part] for name in CHANNELS)
        self.system = compensator(flat, 1)
        self._commands: dict[float, np.ndarray] = {}
        self._ebbs: dict[float, np.ndarray] = {}
        size, limit = np.abs(self.force), float(flat.get(FORCE_LIMIT, np.inf))
        inside = size < SHARE_OF_A_LIMIT * size.max()
        if np.mean(~inside) < SHARE_AT_A_LIMIT:
            inside[:] = True  # the largest force is no limit
        noise = DEVIATIONS_AT_A_LIMIT * noise_of(self.force)
        inside &= size < SHARE_OF_A_LIMIT * limit - noise
        inside[:SAMPLES_OF_A_START] = False
        self.rows = np.flatnonzero(inside)
        self.stretch = np.cumsum(np.diff(inside.astype(int), prepend=0) > 0)[self.rows]

    def best(self) -> Replay:
        """Return the replay that explains the logged force best: over delays, and if need be over clocks.

        Feedforward of the reference is added if neither explains the force.
        """
        plain = self._lagged(1.0)
        if plain.explains:
            return plain
        clocks = np.geomspace(1 / REACH_OF_A_CLOCK, REACH_OF_A_CLOCK, CLOCKS_TRIED)
        near = min((self.replay(float(clock)) for clock in clocks), key=lambda one: one.left)
        step = float(clocks[1] / clocks[0])
        for _ in range(REFINEMENTS_OF_A_CLOCK):
            step = step**0.5
            near = min([near, *(self.replay(near.clock * step**side) for side in (-1, 1))], key=lambda one: one.left)
        others = [self._lagged(near.clock), self._lagged(1.0, fed=True)]
        share = SHARE_LEFT_BY_A_CAUSE * plain.left
        sure = [one for one in others if one.agrees and one.left < share]
        return min(sure, key=lambda one: one.left, default=plain)

    def replay(self, clock: float = 1.0, shift: int = 0, fed: bool = False) -> Replay:
        """Compare the forces, with the controller's clock `clock` times as fast as the log's.

        The command comes `shift` samples later. If `fed`, acceleration and direction of the reference explain a part.
        """
        columns = [np.roll(self.command(clock), shift), np.linspace(0.0, 1.0, len(self.force))]
        if fed:
            rate, acceleration, _ = self._derivatives(self.step)
            columns += [acceleration, np.sign(rate)]
        signals = self._settled(np.stack([*columns, self.force], axis=1)[self.rows], self.stretch, clock)
        solution, left = least_squares(signals[:, :-1], signals[:, -1])
        spread = float(np.std(signals[:, -1])) or 1.0
        mass, direction = solution[2:] if fed else (0.0, 0.0)
        return Replay(
            slope=float(solution[0]),
            left=float(np.std(left)) / spread,
            noise=noise_of(left) / spread,
            lag=shift * self.step,
            clock=clock,
            mass=float(mass),
            direction=float(direction),
            force=spread,
        )

    def command(self, clock: float = 1.0) -> np.ndarray:
        """Return the force [N] that the controller commands on the log, (samples,)."""
        if clock in self._commands:
            return self._commands[clock]
        from friso.frequency.loops import FEEDFORWARD, REFERENCE, STAGE, VELOCITY

        step = self.step / clock
        velocity = np.diff(self.position, prepend=self.position[0]) / step
        inputs = {REFERENCE: self.reference, STAGE: self.position, VELOCITY: velocity}
        inputs |= dict(zip(FEEDFORWARD, self._derivatives(step), strict=True))
        self._commands[clock] = _driven(self.system, inputs, step)
        return self._commands[clock]

    def at_both_ends(self) -> tuple[float, float] | None:
        """Return the slopes before and after the instant that divides the record best; None if none explains it.

        Gains that are switched have two slopes.
        """
        signals, count = np.stack([self.command(), self.force], axis=1)[self.rows], len(self.rows)
        best, slopes = FORCE_LEFT_BY_THE_CONTROLLER, None
        spread = float(np.std(signals[:, 1])) or 1.0
        for share in np.linspace(*SHARES_OF_A_RECORD, INSTANTS_TRIED):
            later = np.arange(count) >= int(share * count)
            settled = self._settled(signals, 2 * self.stretch + later, 1.0)
            fits = [least_squares(settled[part, :1], settled[part, 1]) for part in (~later, later)]
            left = float(np.sqrt(sum(float(rest @ rest) for _, rest in fits) / count)) / spread
            if left < best:
                best, slopes = left, (float(fits[0][0][0]), float(fits[1][0][0]))
        return slopes

    def _settled(self, signals: np.ndarray, stretch: np.ndarray, clock: float) -> np.ndarray:
        """Subtract from signals, (rows, signals), what a state at the begin of a stretch, (rows,), may have caused."""
        ebb, left = self._ebb(clock), np.empty_like(signals)
        for number in np.unique(stretch):
            rows = np.flatnonzero(stretch == number)
            columns = np.column_stack([np.ones(len(rows)), ebb[: len(rows)]])
            columns = columns[:, columns.any(axis=0)]
            directions, sizes, _ = np.linalg.svd(columns / np.abs(columns).max(axis=0), full_matrices=False)
            directions = directions[:, sizes > LEAST_SHARE_OF_A_STATE * sizes[0]]
            left[rows] = signals[rows] - directions @ (directions.T @ signals[rows])
        return left

    def _ebb(self, clock: float) -> np.ndarray:
        """Return the force that each state of the controller causes from 1 on, by itself, (samples, states)."""
        if clock not in self._ebbs:
            from friso.frequency.loops import FORCE

            of_states = self.system.take((), (FORCE,))
            half, one = of_states.a[0] * self.step / clock / 2, np.eye(of_states.a.shape[1])
            onward = np.linalg.inv(one - half)
            rows, power = of_states.c[0] @ onward, onward @ (one + half)
            with np.errstate(all="ignore"):  # a controller that is unstable by itself
                while len(rows) < len(self.force):
                    rows, power = np.vstack([rows, rows @ power]), power @ power
            rows = rows[: len(self.force)]
            self._ebbs[clock] = rows[:, np.isfinite(rows).all(axis=0) & rows.any(axis=0)]
        return self._ebbs[clock]

    def _lagged(self, clock: float, fed: bool = False) -> Replay:
        """Return the best replay with a clock over delays of few samples."""
        shifts = range(-1, SAMPLES_OF_DELAY + 1)
        return min((self.replay(clock, shift, fed) for shift in shifts), key=lambda one: one.left)

    def _derivatives(self, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return velocity, acceleration and jerk of the reference, (samples,) each, with samples a `step` [s] apart."""
        rate = np.gradient(self.reference, step)
        acceleration = np.gradient(rate, step)
        return rate, acceleration, np.gradient(acceleration, step)


def witnessed(log: Log, flat: Mapping[str, Any]) -> tuple[Log, Replay | None]:
    """Replay the controller of a stage on a log, as `replayed` does, and return the log by the clock that it confirms.

    Where time stamps scatter, it may be they and not the instants of the samples that do: samples are taken as even if
    the controller explains the force only so, or clearly better. Raises InputError as `replayed` does.
    """
    if log.as_even is not None:
        witness, even = _witness(log, flat), replayed(log.as_even, flat)
        if witness and even and even.explains:
            stamped = witness.best()
            if not stamped.explains or even.left < SHARE_LEFT_BY_A_CAUSE * stamped.left:
                return log.as_even, replace(even, left_by_stamps=stamped.left)
    return log, replayed(log, flat)


SLOPES_OF_A_SCALE = (0.3, 3.0)
"""Slopes between which gains may be others than stated. Beyond, a unit or a sign is wrong."""


def replayed(log: Log, flat: Mapping[str, Any]) -> Replay | None:
    """Replay the controller of a stage on a log; None where what it saw and commanded is not what was logged.

    That is so with a disturbance in the force, if the controller may see the motor and the log the load, for settings
    against friction, which are not linear, and where nothing varies. Raises InputError if the log contradicts its own
    clock, unit or sign: no value of such a log holds.
    """
    witness = _witness(log, flat)
    if witness is None:
        return None
    replay = witness.best()
    left = f"the controller leaves {percent(witness.replay().left)} of the force, so {percent(replay.left)}"
    if replay.clock != 1.0:
        slow = f"time that runs {plain_factor(replay.clock)} times as slowly as the controller's"
        actual = f"{slow} (with time as logged {left})"
        expected = "the clock with which the drive sampled, or another controller"
        example = f'--dt "{log.sample_time / replay.clock * 1e3:.4g} ms"'
        raise InputError("time", actual, expected, example, log.name)
    low, high = SLOPES_OF_A_SCALE
    if replay.explains and not low < replay.slope < high:
        actual = f"a force that is {replay.slope:.3g} times what the controller of the stage file commands"
        expected = "force and controller with agreeing units and signs (of position, too)"
        thousands = np.log(abs(replay.slope)) / np.log(1000)
        scale = f'--scale force="{1 / replay.slope:.3g} {log.unit("force")}/{log.unit("force")}"'
        by_unit = replay.slope > 0 and abs(thousands - round(thousands)) < ERROR_OF_AN_AGREEING_SLOPE / 3
        example = '--unit CHANNEL="mm" for position and reference' if by_unit else scale
        raise InputError("force", actual, expected, example, log.name)
    return replay if replay.explains else replace(replay, slopes=witness.at_both_ends())


SAMPLES_OF_A_REPLAY = 50
"""Fewest samples of a replay that says anything."""


def _witness(log: Log, flat: Mapping[str, Any]) -> Witness | None:
    """Return log and controller to be replayed; None where `replayed` says nothing."""
    behind = "disturbance" in log or any(key.startswith(f"{TRANSMISSION}.") for key in flat)
    if behind or settings_of(flat) != NO_SETTINGS or flat.get(f"{CONTROLLER}.coulomb_feedforward"):
        return None
    witness = Witness(log, flat)
    varies = [
        np.ptp(signal[witness.rows]) if len(witness.rows) else 0.0 for signal in (witness.force, witness.command())
    ]
    if len(witness.rows) < SAMPLES_OF_A_REPLAY or not np.all(np.isfinite(varies)) or not all(varies):
        return None
    return witness


def doubt_of(replay: Replay, log: Log) -> str:
    """Say what the replay contradicts: gains, feedforward, or the controller as a whole; "" if it agrees."""
    unit, kg = log.unit("force"), unit_of("kg", log)
    if replay.mass or replay.direction:
        has = "has" if replay.mass > 0 else "lacks"
        also = f", and {abs(replay.direction):.2g} {unit} in its direction"
        also = also if abs(replay.direction) > ERROR_OF_AN_AGREEING_SLOPE * replay.force else ""
        return (
            f"the logged force {has} {abs(replay.mass):.3g} {kg} times the acceleration of the reference{also}, which "
            "the controller of the stage file does not command: a feedforward"
        )
    if replay.agrees:
        return ""
    if replay.explains:
        return (
            f"the logged force is {replay.slope:.3g} times what the controller of the stage file commands: its gains "
            "or the scale of the force are off by that"
        )
    if replay.steps:
        return "a constant force changes within the record; with its own in each part the controller explains the force"
    if replay.slopes and replay.slopes[0] * replay.slopes[1] > 0:
        before, after = replay.slopes
        return (
            f"the controller answers the same error with {after / before:.2g} times the force in the later part: its "
            "gains are switched"
        )
    return (
        f"another controller drove the machine: that of the stage file leaves {percent(replay.left)} of the logged "
        "force (check gains, derivative, filters and the mass it is tuned for)"
    )


FORCE_LIMIT = f"{CONTROLLER}.force_limit"

CHANNELS = ("reference", "position", "force")
"""Channels of a log that a replay needs."""


def _driven(system: System, inputs: dict[str, np.ndarray], step: float) -> np.ndarray:
    """Return the force [N] of a linear controller on sampled inputs, by Tustin's rule, (samples,)."""
    from friso.frequency.loops import FORCE

    chosen = system.take([name for name in system.inputs if name in inputs], (FORCE,))
    a, b, c, d = chosen.a[0], chosen.b[0], chosen.c[0], chosen.d[0]
    total = np.zeros(len(next(iter(inputs.values()))))
    for number, name in enumerate(chosen.inputs):
        numerator, denominator = ss2tf(a, b, c, d, input=number)
        if not numerator.any():
            continue
        poles, zeros = bilinear(np.trim_zeros(numerator[0], "f"), denominator, 1 / step)[::-1]
        total += lfilter(zeros, poles, inputs[name])
    return total
