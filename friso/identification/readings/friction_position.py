"""Read friction along the rail at constant speed, and decide whether the log allows it (thesis, Fig. 21).

The actuator force equals friction only if the motion is steady and the loop fast enough. If passes over equal places
repeat the force, it is friction of the rail, not oscillation of the loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.signal import lfilter, periodogram

from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log
from friso.identification.readings.common import block_mean, by_t, channel, low_pass, on_bearing
from friso.identification.readings.motion_events import LOW_PASS_OF_PASSES, Pass, passes
from friso.intervals import NORMAL_COVERAGE


@dataclass(frozen=True)
class Harmonic:
    """A periodic variation of friction along the way.

    Fields are wavelength [m], amplitude [N], and the frequency [Hz] at which the variation appears at the log's speed.
    """

    wavelength: float
    amplitude: float
    frequency: float


@dataclass(frozen=True)
class PassMap:
    """Friction along the rail in one pass.

    Fields are the velocity [m/s]; the force [N] over `places` [m], NaN outside the pass; mean and standard deviation of
    the force [N]; correlation length [m]; the strongest harmonics; and whether the motion was steady.
    """

    velocity: float
    places: np.ndarray
    force: np.ndarray
    mean: Estimate
    spread: float
    correlation_length: Estimate
    harmonics: tuple[Harmonic, ...]
    steady: bool


CORRELATION_OF_PASSES = 0.5
"""Correlation of the maps of two passes from which they repeat each other."""


@dataclass(frozen=True)
class FrictionPosition:
    """Friction along the rail in several passes.

    `pairs` has the correlation of the maps of every pair of passes over common places, as (first, second, correlation);
    `repeatability` is their mean. `separated` tells whether the force is friction of the rail, and `verdict` says so in
    a sentence.
    """

    passes: tuple[PassMap, ...]
    repeatability: Estimate
    pairs: tuple[tuple[int, int, float], ...]
    separated: bool
    verdict: str
    warnings: tuple[str, ...]

    @property
    def repeats(self) -> bool:
        """Tell whether passes over the same places repeat the force, which then depends on the place."""
        return self.repeatability.determined and self.repeatability.value >= CORRELATION_OF_PASSES


POINTS_OF_A_FRICTION_MAP = 400
"""Number of places of a friction map over the whole travel."""


def friction_position(log: Log, mass: float = 0.0, crossover: float | None = None) -> FrictionPosition:
    """Read friction along the rail from passes at constant velocity, without inertia.

    Inertia is `mass` [kg] times acceleration. With the loop's `crossover` [Hz] the verdict also considers whether the
    loop is fast enough for the variations seen. Raises InputError for missing channels.
    """
    stretches = passes(log)
    position, force = on_bearing(log), channel(log, "force")
    if not stretches:
        unknown = _no_repeatability("no stretch of constant velocity")
        verdict = "Dynamic friction cannot be determined: the log has no stretch of constant velocity."
        return FrictionPosition((), unknown, (), False, verdict, ())
    travel = [np.ptp(position[p.span]) for p in stretches]
    long = [p for p, length in zip(stretches, travel, strict=True) if length >= 0.2 * max(travel)]
    ends = [position[p.span] for p in long]
    places = np.linspace(min(x.min() for x in ends), max(x.max() for x in ends), POINTS_OF_A_FRICTION_MAP)
    maps = tuple(_map(stretch, places, position, force, log.sample_time, mass) for stretch in long)
    pairs = _pairs(maps)
    repeatability = _repeatability(maps, pairs)
    separated, verdict = _verdict(maps, repeatability, crossover)
    short = len(stretches) - len(long)
    warnings = []
    if short:
        less = f"{short} passes go less than a fifth of the longest one's way"
        warnings.append(f"{less}: friction along the rail leaves them out.")
    if not mass:
        warnings.append("No mass is given: the force contains that of inertia.")
    return FrictionPosition(maps, repeatability, pairs, separated, verdict, tuple(warnings))


def _map(
    stretch: Pass, places: np.ndarray, position: np.ndarray, force: np.ndarray, sample_time: float, mass: float
) -> PassMap:
    """Return the force along the rail in one pass, without inertia, as a mean for each place.

    A place may be passed several times where the motion goes back a little; places without samples are interpolated.
    """
    x, f = position[stretch.span], force[stretch.span]
    smooth = low_pass(x, sample_time, LOW_PASS_OF_PASSES)
    f = f - mass * np.gradient(np.gradient(smooth, sample_time), sample_time)
    step = places[1] - places[0]
    bins = np.clip(np.round((x - places[0]) / step).astype(int), 0, len(places) - 1)
    count = np.bincount(bins, minlength=len(places))
    with np.errstate(invalid="ignore"):
        mapped = np.where(count > 0, np.bincount(bins, f, minlength=len(places)) / count, np.nan)
    inside = np.arange(bins.min(), bins.max() + 1)
    covered = inside[count[inside] > 0]
    mapped[inside] = np.interp(inside, covered, mapped[covered])  # fill places without samples
    row = mapped[inside]
    mean = by_t("friction force along the rail", "N", block_mean(row), "mean over position by blocks")
    flat = _flat(row, inside)
    varies = float(row.std()), _correlation_length(flat, step), _harmonics(flat, step, abs(stretch.velocity))
    return PassMap(stretch.velocity, places, mapped, mean, *varies, stretch.steady)


def _flat(row: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return a row of forces [N] without their trend over the places, both of shape (n,)."""
    return row - np.polyval(np.polyfit(places, row, 1), places)


def _length(fields: np.ndarray) -> np.ndarray:
    """Return the lag at which the autocorrelation of each row of `fields` falls to 1/e, (rows,).

    The lag is counted in places along the row; it is NaN if the autocorrelation does not fall that far.
    """
    count = fields.shape[1]
    power = np.abs(np.fft.rfft(fields, 2 * count, axis=1)) ** 2
    correlation = np.fft.irfft(power, axis=1)[:, : count // 2]
    correlation = correlation / correlation[:, :1]
    below = correlation < np.exp(-1)
    at = np.where(below.any(axis=1), below.argmax(axis=1), 1)
    rows = np.arange(len(fields))
    before, after = correlation[rows, at - 1], correlation[rows, at]
    return np.where(below.any(axis=1), at - 1 + (before - np.exp(-1)) / (before - after), np.nan)


CORRELATION_LENGTHS_OF_A_PASS = 5.0
"""Shortest pass that shows a correlation length, in correlation lengths."""

FIELDS_DRAWN = 300
"""Number of random fields drawn for the interval of the correlation length. Fewer leave its ends to chance."""


def _correlation_length(flat: np.ndarray, step: float) -> Estimate:
    """Estimate the correlation length [m] of the force along the rail.

    `flat` is the force without its trend, `step` [m] the distance of places. Over the correlation length the
    autocorrelation falls to 1/e. The interval comes from simulated random fields with exponential correlation,
    detrended likewise: it allows for the ratio of estimated to true length.
    """
    name, unit, method = "correlation length", "m", "autocorrelation of the force over position falls to 1/e"
    if not np.ptp(flat) > 0:
        return Estimate.unknown(name, unit, method, "the force does not vary along the rail")
    length = float(_length(flat[None])[0])
    count = len(flat)
    if not length * CORRELATION_LENGTHS_OF_A_PASS <= count:
        reason = f"the pass holds fewer than {CORRELATION_LENGTHS_OF_A_PASS:g} correlation lengths"
        return Estimate.unknown(name, unit, method, reason, low=count / CORRELATION_LENGTHS_OF_A_PASS * step)
    share = np.exp(-1 / max(length, 0.5))
    noise = np.random.default_rng(0).standard_normal((FIELDS_DRAWN, count + int(5 * length) + 1))
    fields = np.asarray(lfilter([1.0], [1.0, -share], noise, axis=1))[:, -count:]
    trend = np.stack([np.ones(count), np.linspace(-1, 1, count)])
    fields -= fields @ np.linalg.pinv(trend) @ trend
    low, middle, high = np.nanpercentile(_length(fields) / max(length, 0.5), [2.5, 50, 97.5])
    value, least, most = (float(length / ratio * step) for ratio in (middle, high, low))
    return Estimate(name, unit, value, least, most, method)


HARMONICS_OF_A_PASS = 3
"""Number of harmonics reported for each pass."""


def _harmonics(flat: np.ndarray, step: float, speed: float) -> tuple[Harmonic, ...]:
    """Return the strongest spectral lines of the force over the place on the rail.

    `flat` [N] is the force without its trend, at places `step` [m] apart, passed at `speed` [m/s].
    """
    rates, power = periodogram(flat, 1 / step, window="hann", scaling="spectrum")
    inner = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    best = inner[np.argsort(power[inner])[::-1][:HARMONICS_OF_A_PASS]]
    return tuple(Harmonic(float(1 / rates[i]), float((2 * power[i]) ** 0.5), float(speed * rates[i])) for i in best)


def _pairs(maps: tuple[PassMap, ...]) -> tuple[tuple[int, int, float], ...]:
    """Return the correlation of each pair of maps that share half of the shorter one's places.

    An entry has the indices of both maps and the correlation. Maps are detrended. For passes in opposite directions,
    friction against the motion is compared.
    """
    pairs = []
    for (i, first), (j, second) in combinations(enumerate(maps), 2):
        common = np.isfinite(first.force) & np.isfinite(second.force)
        shorter = min(np.isfinite(first.force).sum(), np.isfinite(second.force).sum())
        if common.sum() >= max(0.5 * shorter, 20):
            x = np.arange(common.sum())
            rows = [_flat(np.sign(m.velocity) * m.force[common], x) for m in (first, second)]
            sizes = float(np.sqrt(np.sum(rows[0] ** 2) * np.sum(rows[1] ** 2)))
            pairs.append((i, j, float(rows[0] @ rows[1]) / sizes if sizes > 0 else 0.0))
    return tuple(pairs)


def _no_repeatability(reason: str) -> Estimate:
    """Return an undetermined repeatability; the estimate states the `reason`."""
    method = "correlation of the force over position between passes"
    return Estimate.unknown("repeatability", "1", method, reason, -1, 1)


def _repeatability(maps: tuple[PassMap, ...], pairs: tuple[tuple[int, int, float], ...]) -> Estimate:
    """Estimate the mean correlation of the pairs, with its interval by Fisher's z.

    The shortest pass counts as one independent place for every two correlation lengths, at least four. The
    repeatability is not determined without pairs, or if none of the `maps` shows a correlation length.
    """
    if not pairs:
        return _no_repeatability("no two passes over the same places")
    z = np.arctanh(np.clip([r for _, _, r in pairs], -0.999999, 0.999999))
    lengths = [m.correlation_length for m in maps]
    lengths_shown = [length.value for length in lengths if length.determined]
    if not lengths_shown:
        return _no_repeatability("the passes are too short against the correlation length of the force")
    travel = min(np.isfinite(m.force).sum() * (m.places[1] - m.places[0]) for m in maps)
    independent = max(travel / (2 * float(np.median(lengths_shown))), 4.0)
    error = max((independent - 3) ** -0.5, float(z.std(ddof=1)) / len(z) ** 0.5 if len(z) > 1 else 0.0)
    value, low, high = np.tanh(z.mean() + NORMAL_COVERAGE * error * np.array([0, -1, 1]))
    method = f"mean correlation of the force over position between {len(pairs)} pairs of passes"
    return Estimate("repeatability", "1", float(value), float(low), float(high), method)


def _spreads(maps: Iterable[PassMap]) -> dict[str, list[float]]:
    """Return the standard deviations of the force [N] by speed [mm/s], the slowest first."""
    spreads: dict[str, list[float]] = {}
    for m in sorted(maps, key=lambda m: abs(m.velocity)):
        spreads.setdefault(f"{abs(m.velocity) * 1e3:.3g}", []).append(m.spread)
    return spreads


def _from_to(values: list[float]) -> str:
    """Write the range of some values, or one number if they are nearly equal."""
    return " to ".join(dict.fromkeys((f"{min(values):.2g}", f"{max(values):.2g}")))


def _verdict(maps: tuple[PassMap, ...], repeatability: Estimate, crossover: float | None) -> tuple[bool, str]:
    """Tell whether the force is the friction of the rail, and say in a sentence why or why not.

    It is not if a pass is unsteady, if passes over equal places differ, or if their repeatability is not determined.
    Neither is it if the force varies faster than the loop's `crossover` [Hz].
    """
    interval = f"95 % interval {repeatability.low:.2f} to {repeatability.high:.2f}"
    reasons, correlation = [], f"correlation {repeatability.value:.2f}, {interval}"
    rough = [m for m in maps if not m.steady]
    if rough:
        speeds = ", ".join(_spreads(rough))
        reasons.append(f"the motion at {speeds} mm/s is not steady (it sticks and slips, or oscillates)")
    if not repeatability.determined:
        reasons.append(f"repeatability is not shown ({repeatability.reason})")
    elif repeatability.value < CORRELATION_OF_PASSES:
        reasons.append(f"repeated passes over the same places differ ({correlation})")
    quick = [m for m in maps if crossover and any(h.frequency > crossover for h in m.harmonics[:1])]
    if quick:
        fastest = max(m.harmonics[0].frequency for m in quick)
        reasons.append(f"the force oscillates at {fastest:.3g} Hz, too fast for a loop of {crossover:g} Hz to follow")
    varies = ", ".join(f"{_from_to(spreads)} N at {speed} mm/s" for speed, spreads in _spreads(maps).items())
    if reasons:
        return False, f"Dynamic friction cannot be determined: {'; '.join(reasons)}. The force varies by {varies}."
    repeats = f"The force repeats from pass to pass ({correlation})"
    return True, f"{repeats}: it is friction along the rail, and varies by {varies}."
