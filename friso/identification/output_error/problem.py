"""Define the fit as a problem: the simulation for given parameters, and its distance from the log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from friso.engine.arrays import Status
from friso.engine.batch import DrivenRuns, Inputs, run_driven
from friso.engine.kernel import Kernel, kernel
from friso.equations.controllers.pid import KD, KP, proportional_derivative
from friso.equations.imposed import HELD_FORCE, Driven
from friso.equations.roles import Role, Steady
from friso.equations.structure import structure
from friso.errors import InputError
from friso.identification.inverse_model import SMOOTHING_BANDWIDTHS, motion, smoothed
from friso.identification.logs.checks import runs as stretches
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import MASS, FitParameter, stages
from friso.identification.readings.common import noise_of, robust
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.stage.controllers import CONTROLLER

CONTINUOUS = "the controller is simulated in continuous time"

NOISE_BANDWIDTH = 5 / 8
"""Noise bandwidth [Hz] of a critically damped second-order loop, in units of its natural frequency [rad/s]."""


@dataclass(frozen=True)
class Simulated:
    """Simulated records of position, velocity and the controller's force, in SI units.

    All records have the shape (runs, n), or (n,) for one run, and are NaN after a failure.
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray


FRICTION_SHARE_OF_LINEARITY = 0.01
"""Largest error of a force sensor's linearity that counts, relative to Coulomb friction. More would hide effects
of a tenth of the friction."""

RUN_TOLERANCE = 1e-5
"""Relative tolerance of simulations for a fit. Looser tolerances spoil finite differences."""

DERIVATIVE_STEP = 1e-4
"""Step of a fitted number for finite differences. Smaller steps drown in the solver's tolerance."""

SAMPLES_OF_OUTPUTS = 16384
"""Number of samples whose outputs are computed at once, to stay in the processor's caches."""


@dataclass(frozen=True)
class Problem:
    """A stage that follows a log, with the parameters to fit and the force [N] to reproduce.

    In a `closed` loop the stage has its own controller and follows the logged reference; `target` is the logged force.
    Otherwise the logged force acts on the stage, and a guiding controller of friso drives it along the logged position;
    `target` is zero, because the guiding controller's force is what the model does not explain.

    `start` has position [m] and velocity [m/s] at the beginning; `counted`, shape (n,), is 0 at samples that the fit
    leaves out. `unsettled` has alternative inputs that the log allows (held or interpolated force, smoothness).
    `sharper` has positions [m], smoothed less and less, that the stage may follow instead. `shaking` [N] is the guiding
    controller's force due to noise of the motion, for the position followed and each sharper one. The noise
    `accumulates` if the position was integrated from a velocity.
    """

    flat: Mapping[str, Any]
    form: Driven
    inputs: Inputs
    target: np.ndarray
    parameters: tuple[FitParameter, ...]
    closed: bool
    start: tuple[float, float]
    counted: np.ndarray
    unsettled: tuple[Inputs, ...] = ()
    sharper: tuple[np.ndarray, ...] = ()
    shaking: tuple[float, ...] = (0.0,)
    accumulates: bool = False
    cutoffs: tuple[float, ...] = (np.inf,)

    @property
    def names(self) -> list[str]:
        """Return the names of the parameters."""
        return [parameter.name for parameter in self.parameters]

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the ranges of the fitted numbers, each of shape (parameters,)."""
        low, high = np.array([(one.inner(one.low), one.inner(one.high)) for one in self.parameters]).T
        return low, high

    def parameter(self, name: str) -> FitParameter:
        """Return a parameter by its name."""
        return self.parameters[self.names.index(name)]

    @property
    def kernel(self) -> Kernel:
        """Return the compiled equations of the stage."""
        return kernel(self.form)

    def noise_left(self, noise: float) -> float:
        """Return the RMS residual [N] that errors of the sensors leave, if the force has this `noise` [N].

        In closed loop the residual is the noise itself. For a stage that follows the log, the guiding controller passes
        only slow noise. The controller's response to position noise is added, and so is the error of a force sensor
        that is not quite linear, as far as it is small beside Coulomb friction.
        """
        if self.closed:
            return noise
        omega = 2 * self.flat[KP] / self.flat[KD]
        passes = min(1.0, np.sqrt(2 * NOISE_BANDWIDTH * omega * self.inputs.sample_time))
        linear = LINEARITY_OF_SENSORS * float(np.std(self.inputs.force[self.counted > 0]))
        most = FRICTION_SHARE_OF_LINEARITY
        linear = min([linear, *(most * one.start for one in self.parameters if one.name == "friction.coulomb")])
        return float(np.linalg.norm(np.array([noise * passes, self.shaking[0], linear])))

    def held_to(self, level: int) -> Problem:
        """Return the problem with the stage driven along one of the `sharper` positions, by number.

        The next sharper position is added to the unsettled inputs.
        """
        inputs = replace(self.inputs, reference=self.sharper[level])
        held = tuple(replace(inputs, held=one.held) for one in self.unsettled if one.held != self.inputs.held)
        sharper = self.sharper[level + 1 :]
        further = tuple(replace(inputs, reference=reference) for reference in sharper[:1])
        shaking, cutoffs = self.shaking[level + 1 :], self.cutoffs[level + 1 :]
        own = {"inputs": inputs, "sharper": sharper, "shaking": shaking, "cutoffs": cutoffs}
        return replace(self, unsettled=(*held, *further), **own)

    def part(self, samples: slice) -> Problem:
        """Return the problem on a stretch of the samples.

        If the stretch begins later than the first sample, the stage starts with position and velocity of the reference.
        """
        reference = self.inputs.reference[samples]
        inputs = replace(self.inputs, reference=reference, force=self.inputs.force[samples])
        start = self.start
        if samples.start:
            start = float(reference[0]), float((reference[1] - reference[0]) / self.inputs.sample_time)
        target, counted = self.target[samples], self.counted[samples]
        return replace(self, inputs=inputs, target=target, counted=counted, start=start, unsettled=(), sharper=())

    def simulated(self, inner: np.ndarray) -> Iterator[tuple[np.ndarray, Simulated]]:
        """Simulate fitted numbers, (runs, parameters), in chunks; yield run numbers and records."""
        flat = stages(self.flat, self.parameters, inner)
        starts = self._starts(flat, len(inner))
        for runs in run_driven(self.kernel, flat, len(inner), self.inputs, starts, RUN_TOLERANCE):
            yield runs.numbers, self._record(flat, runs)

    def record(self, inner: np.ndarray) -> Simulated:
        """Return the simulated record for fitted numbers (parameters,); its signals are (n,)."""
        ((_, record),) = self.simulated(inner[None])
        return Simulated(record.position[0], record.velocity[0], record.force[0])

    def residuals(self, inner: np.ndarray) -> np.ndarray:
        """Return target minus simulated force [N], shape (runs, n).

        Residuals are 0 at samples that do not count, and infinite for runs that failed.
        """
        residuals = np.empty((len(inner), len(self.target)))
        for numbers, record in self.simulated(inner):
            residuals[numbers] = (self.target - record.force) * self.counted
        return np.where(np.isfinite(residuals), residuals, np.inf)

    def jacobians(self, inner: np.ndarray, free: np.ndarray, residuals: np.ndarray) -> list[np.ndarray]:
        """Return the derivatives of the residuals for each row of fitted numbers, (rows, parameters).

        They have the shape (n, free) for the numbers that are `free` in that row. `residuals` [N] are those of the
        rows, (rows, n). All come from runs side by side.
        """
        owner, number = np.nonzero(free)
        steps = np.array([self._step(inner[row], int(i)) for row, i in zip(owner, number, strict=True)])
        moved = inner[owner].copy()
        moved[np.arange(len(owner)), number] += steps
        slopes = (self.residuals(moved) - residuals[owner]) / steps[:, None]
        return [slopes[owner == row].T for row in range(len(inner))]

    def linearised(self, inner: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residual [N], (n,), of fitted numbers, and its derivatives, (n, free).

        The fitted numbers `inner` have the shape (parameters,); derivatives are by the `free` ones. At each sample the
        smaller of the differences to both sides counts: a break-away that a step just causes, or prevents, appears on
        one side only and is no derivative.
        """
        numbers = np.flatnonzero(free)
        ahead = np.array([self._step(inner, int(i)) for i in numbers])
        low, high = (end[numbers] for end in self.bounds)
        within = (inner[numbers] - ahead >= low) & (inner[numbers] - ahead <= high)
        steps = np.concatenate([ahead, np.where(within, -ahead, ahead)])
        moved = np.tile(inner, (len(steps), 1))
        moved[np.arange(len(steps)), np.tile(numbers, 2)] += steps
        at, *off = self.residuals(np.vstack([inner, moved]))
        to, fro = np.split((np.array(off) - at) / steps[:, None], 2)
        return at, np.where(np.abs(to) <= np.abs(fro), to, fro).T

    def _step(self, inner: np.ndarray, i: int) -> float:
        """Return the step of number `i` by which derivatives are taken, towards its range's middle."""
        low, high = (end[i] for end in self.bounds)
        share = 1.0 if self.parameters[i].logarithmic else 0.01 * (high - low)
        size = DERIVATIVE_STEP * share
        return size if inner[i] < (low + high) / 2 else -size

    def _starts(self, flat: Mapping[str, Any], runs: int) -> np.ndarray:
        """Return the states in which runs begin: position and velocity of the log's beginning.

        The bristles are bent as far as the first force bends them.
        """
        position, velocity = self.start
        speed = np.gradient(self.inputs.reference[:3], self.inputs.sample_time)[0]
        beginning = Steady(self.inputs.reference[0] - position, position, velocity, speed, self.target[0])
        reached = {**flat, "motion.size": np.nan, "motion.duration": np.inf}
        starts = self.kernel.settled(reached, beginning, runs)
        if bristles := self.kernel.having(Role.BRISTLE):
            pull = self.target[0] + self.inputs.force[..., 0] + flat.get("bias.cart", 0.0) + flat.get("bias.stage", 0.0)
            held = flat.get("friction.static", flat["friction.coulomb"])
            bent = np.clip(pull, -held, held) / flat["friction.bristle_stiffness"]
            starts[:, bristles] = np.reshape(bent, (-1, 1))
        return starts

    def _record(self, flat: Mapping[str, Any], runs: DrivenRuns) -> Simulated:
        """Extract position, velocity and force from finished runs; NaN for runs that failed."""
        position, velocity = (runs.states[:, :, i] for i in (self.kernel.position, self.kernel.velocity))
        held = self.kernel.held
        force = runs.held[:, :, held.index(HELD_FORCE)] if HELD_FORCE in held else self._force(flat, runs)
        failed = runs.statuses != Status.DONE
        return Simulated(*(np.where(failed[:, None], np.nan, channel) for channel in (position, velocity, force)))

    def _force(self, flat: Mapping[str, Any], runs: DrivenRuns) -> np.ndarray:
        """Compute the force [N] of the controller from the states at the samples, shape (runs, n).

        In a closed loop this is the stage's own controller. Otherwise it is the controller by which friso guides the
        stage along the logged position.
        """
        count = runs.states.shape[1]
        if not self.closed:
            return self._holding_force(runs)
        part = {key: value[runs.numbers] if np.ndim(value) else value for key, value in flat.items()}
        part |= {"motion.size": np.nan, "motion.duration": np.nan}
        values = [np.asarray(value)[:, None] for value in self.kernel.values(part, len(runs.numbers))]
        reference = self.inputs.segments[0, :count, 1:].T[:, None, :]
        states = np.moveaxis(runs.states, 2, 0)
        force = np.empty(runs.states.shape[:2])
        size = max(1, SAMPLES_OF_OUTPUTS // len(runs.numbers))
        for first in range(0, count, size):
            part = slice(first, first + size)
            modes = self.kernel.modes(states[..., part], 0.0, reference[..., part], values)
            outputs = self.kernel.module.outputs(states[..., part], modes, 0.0, reference[..., part], values)
            force[:, part] = outputs[list(self.kernel.outputs).index("force")]
        return force

    def _holding_force(self, runs: DrivenRuns) -> np.ndarray:
        """Return the force [N] of the controller that drives a stage along a log, shape (runs, n).

        The simulated motion is smoothed like the log's, so that blurred reversals of the log cause no force.
        """
        step = self.inputs.sample_time
        position = smoothed(runs.states[:, :, self.kernel.position], step, self.cutoffs[0])
        off = self.inputs.reference[: position.shape[1]] - position
        return self.flat[KP] * off + self.flat[KD] * np.gradient(off, step, axis=1)


def loop_problem(flat: Mapping[str, Any], log: Log, part: slice, parameters: Sequence[FitParameter]) -> Problem:
    """Set up the stage with its own controller on the log's reference.

    A logged `disturbance` force acts as well. The beginning is left out until the loop has forgotten its initial state.
    """
    sampled = "drive.sample_time" in flat and not why_continuous(flat, log.sample_time)
    samples = round(flat.get("drive.velocity_samples", 1.0)) if sampled else 0
    count = part.stop - part.start
    extra = log["disturbance"][part] if "disturbance" in log else np.zeros(count)
    inputs = Inputs(log["reference"][part], extra, log.sample_time)
    start, counted = _start(log, part), _after_start(count, log.sample_time) * log.measured(part)
    target, form = log["force"][part] - extra, Driven(structure(flat), samples)
    return Problem(flat, form, inputs, target, tuple(parameters), True, start, counted)


SAMPLE_TIME_TOLERANCE = 1e-3
"""Relative difference below which sample times of log and drive count as equal."""


def why_continuous(flat: Mapping[str, Any], sample_time: float) -> str:
    """Return why a sampling drive's controller is simulated in continuous time, "" if it is not.

    `sample_time` [s] is the log's. The text is also "" if the drive's sample time is not known.
    """
    if "drive.sample_time" not in flat:
        return ""
    step = flat["drive.sample_time"]
    if abs(step / sample_time - 1) >= SAMPLE_TIME_TOLERANCE:
        return f"{CONTINUOUS}: the drive samples every {1e3 * step:g} ms, the log every {1e3 * sample_time:g} ms"
    return ""


SMOOTHING_STEPS = (1, 2, 4, 8)
"""Cut-off frequencies tried for smoothing the position, relative to the inverse model's cut-off."""

BANDWIDTH_OF_A_MACHINE = 1000.0  # [Hz]
"""Highest bandwidth of moves of a body that slides. Moves of 20 ms have up to 500 Hz, with the sharpest corners."""


def tracking(
    flat: Mapping[str, Any], log: Log, part: slice, parameters: Sequence[FitParameter], bandwidth: float
) -> Problem:
    """Set up the stage under the logged force, guided along the smoothed logged position.

    A slow controller guides the stage, because a fast one, or noise, would shake the bristles of a stage at rest.
    `bandwidth` [Hz] is the motion's. A log determines neither whether its force is held between samples or
    interpolated, nor how smooth its motion was: these stay unsettled. Raises InputError for a log that never moves for
    long enough.
    """
    step = log.sample_time
    highest = SMOOTHING_BANDWIDTHS
    cutoffs = [highest * times * bandwidth for times in SMOOTHING_STEPS]
    smooth, *sharper = (motion(log["position"][part], step, cutoff).position for cutoff in cutoffs)
    # the force is held from each sample to the next
    held = abs(flat.get("drive.sample_time", np.inf) / step - 1) < SAMPLE_TIME_TOLERANCE
    inputs = Inputs(smooth, log["force"][part], step, held)
    counted, omega = moving(log["position"][part], smooth, step, bandwidth)
    counted[-round(1 / (cutoffs[0] * step)) - 1 :] = 0.0  # the smoothed signal lacks samples beyond the end
    if bandwidth > BANDWIDTH_OF_A_MACHINE or not counted.any():
        fast = f"moves of {bandwidth:.3g} Hz" if counted.any() else "rest, as far as the noise of the position shows"
        actual = f"{log.sample_time * len(counted):.3g} s of {fast}"
        expected = "moves of a machine: is the time or the position in another unit, or does the body never slide?"
        raise InputError("position", actual, expected, '--unit TIME="ms", or --as presliding', log.name)
    mass = next(parameter.start for parameter in parameters if parameter.name == MASS)
    held = {key: value for key, value in flat.items() if not key.startswith(f"{CONTROLLER}.")}
    held |= proportional_derivative(mass * omega**2, 2 * mass * omega)
    return Problem(
        *(held, Driven(structure(held)), inputs, np.zeros(part.stop - part.start), tuple(parameters), False),
        start=_start(log, part),
        counted=counted * log.measured(part),
        unsettled=(replace(inputs, held=not inputs.held), replace(inputs, reference=sharper[0])),
        sharper=tuple(sharper),
        shaking=tuple(2 * mass * omega * _shaking(log, part, cutoff) for cutoff in cutoffs),
        accumulates=log.is_integrated,
        cutoffs=tuple(cutoffs),
    )


def _shaking(log: Log, part: slice, cutoff: float) -> float:
    """Return the velocity noise [m/s] below `cutoff` [Hz] of a log's motion.

    It is the noise of a velocity that was integrated, which accumulates in the position, or that of the position.
    """
    band = min(cutoff, 0.5 / log.sample_time)
    if log.is_integrated:
        return float(noise_of(log["velocity"][part]) * np.sqrt(2 * band * log.sample_time))
    return float(noise_of(log["position"][part]) * 2 * np.pi * np.sqrt(2 * log.sample_time * band**3 / 3))


TIME_CONSTANTS_OF_SETTLING = 6.0
"""Number of its time constants after which the guiding controller has forgotten the initial state, to 2 %."""

MOVE_SHARE_OF_SETTLING = 0.5
"""Longest time of the guiding controller to settle, relative to the longest move. Half of the move remains."""

BANDWIDTH_OF_HOLDING = 10.0  # [Hz]
"""Highest bandwidth of the controller that drives a stage along a log. A faster one shakes the bristles."""


def moving(position: np.ndarray, smooth: np.ndarray, sample_time: float, bandwidth: float) -> tuple[np.ndarray, float]:
    """Return 1 where a position [m], shape (n,), moves and 0 where it rests, and the guiding controller's frequency.

    While a stage sticks, the guiding controller's force shows micrometres of distance to the log, not an unexplained
    force. So rests do not count, nor does the time in which the controller settles after each rest and after the
    beginning. The frequency [rad/s] follows from the motion's `bandwidth` [Hz], and is high enough for the controller
    to settle within the longest move.
    """
    resting = _resting(position, blur_of(position, smooth), sample_time)
    resting[0] = True
    longest = max((move.stop - move.start for move in stretches(~resting)), default=0) * sample_time
    constants, most = TIME_CONSTANTS_OF_SETTLING, MOVE_SHARE_OF_SETTLING
    needed = constants / (2 * np.pi * most * longest) if longest else bandwidth
    omega = 2 * np.pi * min(max(bandwidth, needed), BANDWIDTH_OF_HOLDING)
    samples = np.arange(len(position))
    since = samples - np.maximum.accumulate(np.where(resting, samples, 0))
    return np.where(since * sample_time > min(constants / omega, most * longest), 1.0, 0.0), omega


DEVIATIONS_OF_A_REST = 20.0
"""Largest motion of a stage at rest, in standard deviations of the position's noise."""

TIME_OF_A_REST = 0.1  # [s]
"""Shortest standstill that counts as rest."""

MOTION_SHARE_OF_A_REST = 0.25
"""Largest motion of a stage at rest, relative to its fastest motion in as long a time."""


def _resting(position: np.ndarray, blur: float, sample_time: float) -> np.ndarray:
    """Tell at which samples a position [m], shape (n,), rests: it stays within its `blur` [m] for some time.

    The time is so long that the fastest motion goes well beyond the blur in it.
    """
    still = DEVIATIONS_OF_A_REST * blur
    window = max(3, round(TIME_OF_A_REST / sample_time))
    while True:
        span = maximum_filter1d(position, window) - minimum_filter1d(position, window)
        if still <= MOTION_SHARE_OF_A_REST * span.max() or 4 * window > len(position):
            return span <= still
        window *= 2


def blur_of(position: np.ndarray, smooth: np.ndarray) -> float:
    """Return the standard deviation [m] of the noise of a position, shape (n,).

    The noise is the difference to the `smooth` position or, with little smoothing, the difference between neighbours.
    """
    return max(robust(position - smooth), noise_of(position))


RECORD_SHARE_OF_A_START = 0.05
"""Largest fraction of a record that is left out at its start (friso's choice)."""

TIME_OF_A_START = 0.1  # [s]
"""Time at the start of a closed-loop record that the fit leaves out (friso's choice)."""


def _after_start(count: int, sample_time: float) -> np.ndarray:
    """Return 0 for the first samples of a closed loop and 1 for all others, shape (count,).

    The first samples depend on the initial state of the loop, which a log shows only roughly.
    """
    most = RECORD_SHARE_OF_A_START * count
    first = round(min(TIME_OF_A_START / sample_time, most))
    return np.where(np.arange(count) < first, 0.0, 1.0)


SAMPLES_OF_FIRST_VELOCITY = 10
"""Number of samples from which the initial velocity is computed."""


def _start(log: Log, part: slice) -> tuple[float, float]:
    """Return initial position [m] and velocity [m/s], by a parabola through the first samples."""
    count = SAMPLES_OF_FIRST_VELOCITY
    slope = np.polyfit(np.arange(count) * log.sample_time, log["position"][part][:count], 2)[1]
    return float(log["position"][part.start]), float(slope)
