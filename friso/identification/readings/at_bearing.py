"""Convert the drive's command and the sensor's signal to force and motion of the body on the bearing.

Forces are compared below a cut-off; the motion, on which friction depends, is kept up to a few times the cut-off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import bilinear, lfilter, lfilter_zi

from friso.identification.kind import Prior
from friso.identification.logs.log import Log
from friso.identification.readings.common import channel, deflection, low_pass, motion_bandwidth, robust
from friso.stage.tables import moving_mass

HELD = "The joint is assumed held, with the limiter's stiffness: no bending shows."


@dataclass(frozen=True)
class StructureMode:
    """First mode of a structure, on the side of the force and the sensor.

    A fraction `share` of the moving mass stands on a spring; `frequency` [Hz] and damping ratio describe this part
    while the rest is held.
    """

    share: float
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Between:
    """Elements between the commanded force and the bearing.

    `delay` [s] (None: not known) and `bandwidth` of the current loop [Hz] describe the drive. `mass` [kg] is the
    assumed moving mass, of which the fraction `beyond` is beyond the joint; `contact` [N/m] is the stiffness of the
    limiter that holds the joint, `joint` [N/m] the joint's own. `mode` is the structural mode. `viscous` has the
    viscous friction [N s/m] and the half-width of its interval.
    """

    delay: float | None = None
    bandwidth: float = np.inf
    mass: float = 0.0
    beyond: float = 0.0
    contact: float = np.inf
    joint: float = 0.0
    mode: StructureMode | None = None
    viscous: tuple[float, float] = (0.0, 0.0)


DIRECT = Between()
"""No elements between commanded force and bearing; the delay is not known."""


def machine_between(flat: Mapping[str, Any]) -> Between:
    """Return the elements between the commanded force and the bearing, from a stage's flat keys.

    A joint counts as held by its limiter. The stage file's parasitic frequency is of both parts of the mass against
    each other; with one part held, the other's frequency is lower.
    """
    drive, joint, mode = (
        {key.removeprefix(name): value for key, value in flat.items() if key.startswith(name)}
        for name in ("drive.", "joint.", "parasitic.")
    )
    held, moving = flat.get("masses.stage", 0.0), float(moving_mass(flat))
    lower = np.sqrt(1 - mode["mass"] / held) if mode else 1.0
    return Between(
        delay=drive.get("delay", 0.0) + drive["sample_time"] / 2 if "sample_time" in drive else None,
        bandwidth=drive.get("current_bandwidth", np.inf),
        mass=moving,
        beyond=held / moving if joint and held else 0.0,
        contact=joint.get("limiter_stiffness", np.inf),
        joint=joint.get("stiffness", 0.0),
        mode=StructureMode(mode["mass"] / moving, *(lower * mode[key] for key in ("frequency", "damping_ratio")))
        if mode
        else None,
        viscous=(flat.get("friction.viscous", 0.0), 0.0),
    )


def believed_between(prior: Prior, log: Log) -> Between:
    """Return the elements between force and bearing, from other experiments or the stage file.

    The viscous friction of a stage file counts as uncertain by its whole size. Raises InputError if the log's [setup]
    makes a change that the stage does not allow.
    """
    believed = machine_between(prior.believed(log))
    viscous = prior.estimates.get("friction.viscous")
    return replace(believed, viscous=(believed.viscous[0], viscous.half_width if viscous else believed.viscous[0]))


@dataclass(frozen=True)
class BearingRecord:
    """A stretch of a log of a body on a bearing.

    Over `time` [s] the record has the position [m] of the body on which the force acts, the deflection [m] of the joint
    that carries this body (None: the joint is held), and the force [N], each of shape (n,).
    """

    time: np.ndarray
    position: np.ndarray
    bent: np.ndarray | None
    force: np.ndarray

    @property
    def interval(self) -> float:
        """Return the time between samples [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def body(self) -> np.ndarray:
        """Return the position [m] on the bearing, shape (n,), without the deflection of a contact."""
        return self.position if self.bent is None else self.position - self.bent

    def seen(self, cutoff: float, step: int = 1) -> BearingRecord:
        """Return the record low-passed at `cutoff` [Hz] and thinned, with positions from its start.

        Every `step`th sample is kept. Without thinning, the force stays unfiltered.
        """
        place = low_pass(self.position, self.interval, cutoff)
        bent = None if self.bent is None else low_pass(self.bent, self.interval, cutoff)[::step]
        force = self.force if step == 1 else low_pass(self.force, self.interval, cutoff)
        return BearingRecord(self.time[::step], (place - place[0])[::step], bent, force[::step])


PERIODS_OF_AN_EDGE = 2.0
"""Length of the stretch at each end of a record that the low-pass distorts, in periods of its cut-off."""


@dataclass(frozen=True)
class LowPass:
    """A low-pass at a `cutoff` [Hz] over time [s], shape (n,)."""

    time: np.ndarray
    cutoff: float

    @property
    def inside(self) -> slice:
        """Return the samples that the filter's transients at the ends do not affect."""
        edge = int(PERIODS_OF_AN_EDGE / (self.cutoff * (self.time[1] - self.time[0])))
        return slice(edge, len(self.time) - edge)

    def __call__(self, signal: np.ndarray) -> np.ndarray:
        """Return a signal, shape (n,), low-passed, without the samples that the ends affect."""
        return low_pass(signal, float(self.time[1] - self.time[0]), self.cutoff)[self.inside]


def record_of(log: Log, part: slice, between: Between) -> BearingRecord:
    """Read a part of a log as a record of the body on the bearing.

    Raises InputError for missing channels.
    """
    position, force = channel(log, "position")[part], channel(log, "force")[part]
    bent = _bent(log, part, position, float(force.std()) / between.contact)
    return BearingRecord(log.time[part], position, bent, force)


SAMPLED_FREQUENCY = 0.2
"""Highest frequency of motion that a spline follows, relative to the sampling frequency."""

PERIODS_OF_A_RECORD = 20
"""Shortest record, in periods of the low-pass."""

ROUNDING_OF_A_POSITION = 1e-9
"""Largest motion that counts as rounding error, relative to the largest position."""

DEVIATIONS_OF_SEEN_MOTION = 10.0
"""Smallest visible motion, in standard deviations of the noise."""


def why_unseen(record: BearingRecord, fewest: int) -> str:
    """Return why a record cannot be used, such as too few samples or no force; "" if it can.

    `fewest` is the number of samples that it must have.
    """
    if len(record.time) < fewest:
        return f"the record has {len(record.time)} samples: {fewest} are needed"
    if not np.ptp(record.force) > 0:
        return "the force does not change"
    highest = motion_bandwidth(record.body, record.interval)
    if highest * record.interval > SAMPLED_FREQUENCY:
        needed = SAMPLED_FREQUENCY / highest
        sampled = f"one sample in {record.interval:.3g} s"
        return f"{sampled}, and the motion goes up to {highest:.3g} Hz: one in {needed:.3g} s or less is needed"
    cutoff = max(highest, PERIODS_OF_A_RECORD / (len(record.time) * record.interval))
    motion = float(low_pass(record.position, record.interval, cutoff).std())
    noise = robust(np.diff(record.position, 2)) / 6**0.5
    rounding = ROUNDING_OF_A_POSITION * float(np.abs(record.position).max())
    if not motion > max(DEVIATIONS_OF_SEEN_MOTION * noise, rounding):
        return f"the motion, {motion:.2g} m RMS, does not stand out from the noise"
    return ""


def cutoff_of(record: BearingRecord) -> float:
    """Choose the low-pass [Hz] of a record: the bandwidth of its motion, within limits.

    The low-pass is at most a fraction of the sampling frequency, and at least so high that several of its periods fit
    into the record.
    """
    highest = motion_bandwidth(record.body, record.interval)
    lowest = PERIODS_OF_A_RECORD / (len(record.time) * record.interval)
    return max(min(highest, SAMPLED_FREQUENCY / (2 * record.interval)), lowest)


def at_bearing(record: BearingRecord, between: Between, mass: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position [m], force [N] and acceleration [m/s^2] at the bearing, each (n,).

    The force is delayed by drive and current loop. The acceleration is such that the whole moving mass times it is the
    inertia force. `mass` [kg] determines the force through a compliant contact.
    """
    time, acceleration = record.time, rate_of(record.time, rate_of(record.time, record.position))
    force, before = _force_after_delay(time, record.force, between), between.beyond * acceleration
    if between.mode is not None:
        before = before + between.mode.share * (_mode_acceleration(time, acceleration, between.mode) - acceleration)
    gives = (force - mass * before) / between.contact if record.bent is None else record.bent
    body = record.position - gives
    return body, force, before + (1 - between.beyond) * rate_of(time, rate_of(time, body))


def rate_of(time: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Differentiate a signal at times [s], both of shape (n,), by a spline."""
    return CubicSpline(time, signal)(time, 1)


DEFLECTION_SHARE_OF_BENDING = 0.02
"""Smallest deflection of a joint that bends, relative to the motion."""

CONTACT_RATIO_OF_BENDING = 3.0
"""Smallest deflection of a joint that bends, relative to the deflection of the contact that holds it."""

DEVIATIONS_OF_BENDING = 3.0
"""Smallest deflection of a joint that bends, in standard deviations of the sensor's noise."""


def _bent(log: Log, part: slice, position: np.ndarray, gives: float) -> np.ndarray | None:
    """Return the measured deflection [m] of a joint that bends.

    Returns None if the deflection is not measured. Returns None as well if it hardly exceeds its noise, a fraction of
    the motion, or what the contact of a held joint `gives` [m].
    """
    measured = deflection(log)
    if measured is None or len(position) < PERIODS_OF_A_RECORD:
        return None
    bent, cutoff = measured[part], SAMPLED_FREQUENCY / log.sample_time / 4
    size = low_pass(bent, log.sample_time, cutoff).std()
    noise = low_pass(np.random.default_rng(0).standard_normal(len(bent)), log.sample_time, cutoff).std()
    noise *= robust(np.diff(bent, 2)) / 6**0.5
    of_motion, of_contact = DEFLECTION_SHARE_OF_BENDING, CONTACT_RATIO_OF_BENDING
    least = max(DEVIATIONS_OF_BENDING * noise, of_motion * position.std(), of_contact * gives)
    return bent if size > least else None


def _force_after_delay(time: np.ndarray, command: np.ndarray, between: Between) -> np.ndarray:
    """Return the force [N], (n,), that follows a commanded force after delay and current loop."""
    late = CubicSpline(time, command)(np.maximum(time - (between.delay or 0.0), time[0]))
    if not np.isfinite(between.bandwidth):
        return late
    ratio = 1 / (np.pi * between.bandwidth * (time[1] - time[0]))
    b, a = np.array([1.0, 1.0]) / (1 + ratio), np.array([1.0, (1 - ratio) / (1 + ratio)])
    return lfilter(b, a, late, zi=lfilter_zi(b, a) * late[0])[0]


POINTS_PER_SAMPLE = 8
"""Points per sample when a structural mode is simulated. A mode at a tenth of the sampling rate errs by 0.05 %."""


def _mode_acceleration(time: np.ndarray, acceleration: np.ndarray, mode: StructureMode) -> np.ndarray:
    """Compute the acceleration [m/s^2] of a mode's mass from the acceleration of its base."""
    omega, points = 2 * np.pi * mode.frequency, POINTS_PER_SAMPLE
    step = float(time[1] - time[0]) / points
    fine = CubicSpline(time, acceleration)(np.linspace(time[0], time[-1], (len(time) - 1) * points + 1))
    damping = 2 * mode.damping_ratio * omega
    b, a = bilinear([damping, omega**2], [1.0, damping, omega**2], 1 / step)
    return lfilter(b, a, fine, zi=lfilter_zi(b, a) * fine[0])[0][::points]
