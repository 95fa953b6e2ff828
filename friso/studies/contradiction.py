"""Ask whether a log contradicts the verdict on a stage, and which single change of the stage would explain the log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster
from friso.errors import InputError
from friso.hunting import judge_many, sketch_attractors
from friso.identification.experiments.hunting import swings_of
from friso.identification.logs.log import Log
from friso.identification.readings.common import digit_of, noise_of
from friso.stage import Stage

CHANGES: Mapping[str, tuple[str, ...]] = {
    "friction.static": ("friction.static",),
    "all friction": ("friction.static", "friction.coulomb"),
    "friction.stribeck_velocity": ("friction.stribeck_velocity",),
    "friction.bristle_stiffness": ("friction.bristle_stiffness",),
    "friction.viscous": ("friction.viscous",),
    "masses": ("masses.cart", "masses.stage"),
    "controller speed": (),
}
"""Changes that are tried, by name, each with the keys that it multiplies; the speed has those of its controller."""


@dataclass(frozen=True)
class Standing:
    """What a machine does while its reference stands still for longest in a log.

    `swing` is half of peak to peak [m], `middle` between the peaks [m] and `period` [s] of its lasting swing; swing and
    period are None for a machine without one.
    `time` [s] is how long the reference stands. `rests` is true if the machine stands still in the later half of it.
    """

    time: float
    swing: float | None
    period: float | None
    rests: bool = True
    middle: float = 0.0

    @property
    def hunts(self) -> bool:
        """Tell whether the machine keeps swinging."""
        return self.swing is not None


@dataclass(frozen=True)
class ExplainingChange:
    """A change that makes the stage do what the log shows: its name, and the factor on its keys.

    `swing` [m] and `period` [s] are those of the changed stage, None if it rests.
    """

    name: str
    factor: float
    swing: float | None
    period: float | None


PERIODS_OF_A_STANDING_LOG = 2.0
"""Periods of the predicted cycle for which a reference must stand before rest in a log contradicts it."""

SHORTEST_STANDING = 0.3  # [s]
"""Shortest time for which a reference stands that shows whether a machine rests: half of the quickest cycles."""


@dataclass(frozen=True)
class Contradiction:
    """What a log shows, what the stage does, and what would explain a difference.

    `swing` [m], `middle` [m] and `period` [s] are those of the stage's largest attractor; swing and period are None if
    nothing attracts it for certain.
    `may_rest` is true if the stage's own move does not end in hunting, though another may.
    """

    standing: Standing
    attracts: bool
    certain: bool
    swing: float | None
    period: float | None
    explanations: tuple[ExplainingChange, ...]
    may_rest: bool = False
    middle: float = 0.0

    @property
    def agrees(self) -> bool:
        """Tell whether log and stage agree on hunting, and on swing and period within a quarter."""
        if self.open or self.standing.hunts != self.attracts:
            return self.open
        return not self.attracts or alike(self.standing, self.swing, self.period)

    @property
    def open(self) -> bool:
        """Tell whether the log decides nothing: it neither swings nor rests, is too short, or the stage does both."""
        if self.standing.hunts:
            return False
        least = PERIODS_OF_A_STANDING_LOG * (self.period or 0.0)
        brief = self.standing.time < max(least, SHORTEST_STANDING)
        return not self.standing.rests or brief or (self.attracts and self.may_rest)


RATIO_OF_ALIKE_SWINGS = 1.25
"""Largest ratio of swings, and of periods, that count as alike: friction of one machine differs by as much."""


def alike(standing: Standing, swing: float | None, period: float | None) -> bool:
    """Tell whether a swing [m] and its period [s] are those of a log within the tolerance of such a comparison."""
    if standing.swing is None or standing.period is None or swing is None or period is None:
        return False
    off = max(abs(np.log(swing / standing.swing)), abs(np.log(period / standing.period)))
    return bool(off < np.log(RATIO_OF_ALIKE_SWINGS))


NOISES_AT_REST = 10.0
"""Largest motion of a machine at rest, peak to peak, in standard deviations of the position's noise."""

COUNTS_OF_A_DITHER = 3
"""Most levels of a position that jumps between counts of its encoder instead of swinging."""

NOISES_OF_A_SWING = 4.0
"""Smallest amplitude of a swing, in standard deviations of the position's noise."""

UNEVENNESS_OF_A_SWING = 0.4
"""Largest standard deviation of the amplitude of a swing, relative to its mean. Noise is less even."""

SAMPLES_OF_A_SWING = 10.0
"""Shortest period of a swing in samples."""

SHARE_OF_A_LASTING_SWING = 0.5
"""Smallest share of the time at which a reference stands that a lasting swing takes."""


def standing_of(log: Log) -> Standing:
    """Return what a machine does where its reference stands for longest.

    Raises InputError for a log without position and reference.
    """
    for channel in ("position", "reference"):
        if channel not in log:
            raise InputError(channel, "nothing", f"a log with its {channel}", f"--map {channel}=CHANNEL", log.name)
    first, last = _longest_stand(log["reference"])
    rows = slice(first, last)
    time = log.time[rows] - log.time[first]
    signals = {name: values[rows] for name, values in log.signals.items()}
    part = Log(log.name, time, log.sample_time, signals, (slice(0, last - first),))
    whole = float(time[-1])
    position = signals["position"]
    noise, digit = noise_of(position), digit_of(position)
    late = position[len(position) // 2 :]
    rests = bool(np.ptp(late) <= max(NOISES_AT_REST * noise, 3 * digit))
    try:
        swings = swings_of(part)
    except InputError:
        return Standing(whole, None, None, rests)
    dithers = len(np.unique(position)) <= COUNTS_OF_A_DITHER
    seen = swings.amplitude > max(NOISES_OF_A_SWING * noise, 2 * digit) and not dithers
    even = swings.amplitude_deviation < UNEVENNESS_OF_A_SWING * swings.amplitude
    slow = swings.period > SAMPLES_OF_A_SWING * log.sample_time
    lasts = swings.count * swings.period > SHARE_OF_A_LASTING_SWING * whole
    if seen and even and slow and lasts:
        return Standing(whole, swings.amplitude, swings.period, False, swings.middle)
    return Standing(whole, None, None, rests)


def _longest_stand(reference: np.ndarray) -> tuple[int, int]:
    """Return the first sample and the end of the longest stretch at which a reference does not change."""
    still = max(np.finfo(np.float32).eps * float(np.ptp(reference)), NOISES_AT_REST * noise_of(reference))
    moves = np.abs(np.diff(reference)) > still
    ends = np.flatnonzero(np.concatenate([[True], moves, [True]]))
    longest = int(np.argmax(np.diff(ends)))
    return int(ends[longest]), int(ends[longest + 1])


REACH_OF_A_CHANGE = 8.0
"""Largest factor tried on keys of a stage to explain a log."""

CHANGES_TRIED = 37
"""Factors tried on a key, 12 % apart, less than the difference that swings may have to be alike."""

RTOL_OF_OWN_MOVES = 1e-6
"""Relative tolerance of the run of a stage's own move that is compared with a log."""


def contradiction(stage: Stage, standing: Standing) -> Contradiction:
    """Compare what a log shows with what attracts the stage, and look for single changes that explain a difference."""
    flat = stage.flat()
    factors = np.geomspace(1 / REACH_OF_A_CHANGE, REACH_OF_A_CHANGE, CHANGES_TRIED)
    own = _attracted(flat, np.ones(1))
    swing, period, middle = (values[0] if own[0][0] else None for values in own[2:])
    sure = bool(own[1][0]) and not stage.uncertain() and not stage.doubt
    attracts = bool(own[0][0])
    may_rest = attracts and not standing.hunts and judge_many(flat, 1, RTOL_OF_OWN_MOVES)[0] != "hunts"
    plain = Contradiction(standing, attracts, sure, swing, period, (), may_rest, middle or 0.0)
    if plain.agrees:
        return plain
    explanations = []
    for name, keys in CHANGES.items():
        held = [key for key in keys if key in flat]
        if (keys and not held) or (not keys and stage.controller is None):
            continue
        changed = faster(flat, factors) if not keys else {**flat, **{key: flat[key] * factors for key in held}}
        if explanation := _nearest(name, standing, factors, _attracted(_valid(changed), factors)):
            explanations.append(explanation)
    ordered = sorted(explanations, key=lambda one: abs(np.log(one.factor)))
    return replace(plain, explanations=tuple(ordered))


def _valid(flat: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return keys of a stage in which static friction is nowhere below Coulomb friction."""
    if "friction.static" not in flat:
        return flat
    return {**flat, "friction.static": np.maximum(flat["friction.static"], flat["friction.coulomb"])}


def _attracted(flat: Mapping[str, Any], factors: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return which stages have an attractor, for which that is certain, and its swing [m], period [s], middle [m]."""
    sketch = sketch_attractors(flat, len(factors))
    return sketch.attracts, sketch.certain, sketch.amplitude, sketch.period, sketch.middle


def _nearest(
    name: str, standing: Standing, factors: np.ndarray, attracted: tuple[np.ndarray, ...]
) -> ExplainingChange | None:
    """Return the change with the smallest factor that makes the stage do what the log shows; None without one."""
    attracts, certain, swings, periods, _ = attracted
    for number in np.argsort(abs(np.log(factors))):
        if not certain[number]:
            continue
        swing, period = (float(values[number]) if attracts[number] else None for values in (swings, periods))
        fits = alike(standing, swing, period) if standing.hunts else not attracts[number]
        if fits:
            return ExplainingChange(name, float(factors[number]), swing, period)
    return None
