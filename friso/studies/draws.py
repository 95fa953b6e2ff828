"""Judge an uncertain stage by the verdicts on many stages drawn at random from it.

For a stage whose friction nobody knows, the answer is for which friction it would hunt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from friso.engine.allowance import allowance
from friso.engine.arrays import ArrayColumns
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.bandwidth import at_bandwidth, bandwidth
from friso.equations.motion import rests
from friso.equations.structure import shared_structure
from friso.errors import StageError
from friso.hunting import (
    can_hunt,
    cannot_hunt,
    find_attractors,
    judge_many,
    kernels_to_judge,
    loops_unstable,
    rests_off,
    sketch_attractors,
)
from friso.hunting.criteria import ATTRACTED, UNDECIDED, VERDICTS
from friso.intervals import Share, separation, share
from friso.progress import Progress, Tally, silent
from friso.stage import Stage
from friso.stage.contacts import any_contact, written
from friso.stage.correlations import Correlations, Sample, draw, laid_over
from friso.stage.tables import moving_mass
from friso.studies.settings import settings


@dataclass(frozen=True)
class Fates(ArrayColumns):
    """Verdicts on drawn stages, and which of their linear loops are unstable, both (count,).

    Verdicts are words of `friso.hunting.criteria.VERDICTS`. A loop counts as `unstable` if it is so while the stage
    sticks, or while it slides. `amplitudes` [m], half of peak to peak, and `periods` [s] have the shape (count,) too,
    or are empty if they are not known. They are NaN for a stage that has no attractor, or an uncertain one. `offsets`
    [m] are how far off their references stages rest that cannot hunt; NaN for one that has not come to rest, and empty
    if stages may hunt.
    """

    verdicts: np.ndarray
    unstable: np.ndarray
    amplitudes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    periods: np.ndarray = field(default_factory=lambda: np.zeros(0))
    offsets: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def counts(self) -> dict[str, int]:
        """Return how often each verdict occurs."""
        return {word: int(np.count_nonzero(self.verdicts == word)) for word in VERDICTS}

    def share(self, words: tuple[str, ...]) -> Share:
        """Return the probability that a drawn stage has any of these verdicts."""
        return share(np.isin(self.verdicts, words), ~np.isin(self.verdicts, UNDECIDED))

    def separations(self, keys: Mapping[str, np.ndarray]) -> dict[str, float]:
        """Return how well each key separates hunting stages from others, the most decisive first.

        The measure is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 if all hunting stages have
        the larger values, -1 if they have the smaller ones, 0 if the key separates nothing. Stages without a certain
        verdict are left out. The result is empty if all of the others hunt, or none of them.
        """
        decided = ~np.isin(self.verdicts, UNDECIDED)
        attracted = np.isin(self.verdicts[decided], ATTRACTED)
        if attracted.all() or not attracted.any():
            return {}
        by_key = {key: separation(values[decided], attracted)[0] for key, values in keys.items()}
        return dict(sorted(by_key.items(), key=lambda item: -abs(item[1])))


def fates(stage: Stage, sample: Sample, rtol: float, progress: Progress = silent) -> dict[str, Fates]:
    """Judge the drawn stages in each variant: as in the file and, with a joint, locked and free.

    The verdicts come by name of the variant. After Ctrl-C, the result has the stages judged in all variants by then.
    Raises KeyboardInterrupt if there are none yet.
    """
    variants = different(stage)
    structures = [shared_structure(laid_over(variant, sample.keys)) for variant in variants.values()]
    kernels(set[KernelRequest]().union(*map(kernels_to_judge, structures)))
    tally = Tally(progress, sample.count * len(variants))
    parts: dict[str, list[Fates]] = {name: [] for name in variants}
    try:
        for first in range(0, sample.count, settings.stages_together):
            chunk = slice(first, min(first + settings.stages_together, sample.count))
            judged = {name: _fates(variant, sample, chunk, rtol, tally) for name, variant in variants.items()}
            for name, part in judged.items():
                parts[name].append(part)
    except KeyboardInterrupt:
        if not all(parts.values()):
            raise
    by_variant = {name: Fates.joined(some) for name, some in parts.items()}
    return {name: by_variant[same] for name, same in _same(stage).items()}


FINEST_STEP = 1e-6
"""Relative difference below which two bandwidths are one."""

STEP_OF_BANDWIDTHS = 1.26
"""Ratio of bandwidths that are tried, about three an octave. Windows of hunting narrower than a step are missed."""


@dataclass(frozen=True)
class DrawnBandwidths:
    """At which bandwidths drawn stages hunt.

    `factors` multiply the stage's own bandwidth, in ascending order, (bandwidths,). `hunts` is 1 where a drawn stage
    has an attractor, 0 where it surely has none, and NaN where that is not certain or its loop is unstable,
    (draws, bandwidths). `own` is the stage's bandwidth [Hz]; None if its controller states none. Coarse return maps
    tell which stages hunt, so an attractor with a narrow basin may be missed.
    """

    factors: np.ndarray
    hunts: np.ndarray
    own: float | None

    def at(self, factor: float) -> np.ndarray:
        """Return which stages hunt at the bandwidth tried that is nearest to a factor, (draws,)."""
        return self.hunts[:, np.argmin(abs(np.log(self.factors / factor)))]

    @property
    def quiet(self) -> np.ndarray:
        """Tell at which bandwidths nearly all drawn stages surely do not hunt, (bandwidths,)."""
        return _quiet(self.hunts)

    @property
    def cure(self) -> tuple[float, float] | None:
        """Return the first factors between which nearly no drawn stage hunts on a faster controller; None without them.

        It reaches over a coarse step at least, so that the cure does not stand on an edge.
        """
        at = np.flatnonzero(self.factors > 1 + FINEST_STEP)
        for first in at:
            run = 0
            while first + run < len(self.factors) and self.quiet[first + run]:
                run += 1
            low, high = self.factors[first], self.factors[first + run - 1]
            if run and high >= low * STEP_OF_BANDWIDTHS * (1 - FINEST_STEP):
                return float(low), float(high)
        return None

    @property
    def hunting_reaches(self) -> tuple[int, float] | None:
        """Return how many stages hunt next to their own bandwidth, and at which factor; None if none does.

        At their own bandwidth none of them may hunt: hunting begins somewhere between both.
        """
        own = int(np.argmin(abs(np.log(self.factors))))
        hunt = self.hunts[:, max(own - 1, 0) : own + 1] == 1
        near = np.flatnonzero(hunt.any(axis=0))
        return (int(hunt[:, near[-1]].sum()), float(self.factors[max(own - 1, 0) + near[-1]])) if near.size else None

    @property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors between which hunting of each drawn stage ends as the bandwidth grows, two of (draws,).

        Both are NaN for a stage that hunts at none of the bandwidths, at the largest one, or not for certain beyond.
        """
        low, high = np.full((2, len(self.hunts)), np.nan)
        for row, line in enumerate(self.hunts):
            hunting = np.flatnonzero(line > 0)
            if hunting.size and (last := hunting[-1]) + 1 < len(line) and line[last + 1] == 0:
                low[row], high[row] = self.factors[last], self.factors[last + 1]
        return low, high


MOST_OPEN_DRAWS = 0.05
"""Largest share of draws that hunt or have no certain verdict where the others decide: advice holds for 95 %."""


def _quiet(hunts: np.ndarray) -> np.ndarray:
    """Tell whether nearly all stages surely do not hunt; `hunts` has a row for each, as in `DrawnBandwidths`."""
    return (hunts != 0).mean(axis=0) <= MOST_OPEN_DRAWS


TRIAL_DRAWS = 16
"""Draws that are timed first. Fewer are misled by a single slow one."""

WORK_OF_BANDWIDTHS = 3e8
"""Work of trying draws at other bandwidths, about as much as the verdicts on them."""

USUAL_BANDWIDTHS = 10
"""Bandwidths that are usually tried, among which the work is divided."""

DRAWS_OF_BANDWIDTHS = 64
"""Most draws tried at other bandwidths. If none of 59 hunts, 95 % of all do not, with 95 % confidence."""


def by_bandwidth(stage: Stage, sample: Sample) -> DrawnBandwidths | None:
    """Find at which bandwidths the first drawn stages hunt: faster until nearly none does, or slower until most do.

    The number of stages follows from a fixed amount of work. Where nearly none hunts, a survey of all attractors
    confirms that. Returns None if the controller cannot be made faster, or if the stages cannot hunt.
    """
    own = bandwidth(stage.flat())
    if (own is None and not (stage.controller and stage.controller.speeds_up)) or not can_hunt(stage.flat()):
        return None
    trial = min(sample.count, TRIAL_DRAWS)
    with allowance() as spent:
        ladder = _Ladder(stage, sample, trial, own)
        ladder.hunts(0)
    count = int(WORK_OF_BANDWIDTHS / USUAL_BANDWIDTHS * trial / max(spent.used, 1.0))
    if (count := min(sample.count, count, DRAWS_OF_BANDWIDTHS)) > trial:
        ladder = _Ladder(stage, sample, count, own)
    if ladder.hunts(0).any():
        ladder.climb()
    if np.count_nonzero(ladder.hunts(0) == 1) < ladder.count / 2:
        ladder.descend()
    places = sorted(ladder.columns)
    columns = np.stack([ladder.columns[one] for one in places], axis=1)
    return DrawnBandwidths(np.array([*map(ladder.factor, places)]), columns, own)


HALVINGS_OF_BANDWIDTHS = 2
"""Halvings of the step in which hunting ends. Fewer advise more bandwidth than is needed."""

REACH_OF_BANDWIDTHS = 8.0
"""Largest factor up and down to which bandwidths are tried. Few machines can be made faster by more."""

MOST_UNSTABLE_DRAWS = 0.5
"""Largest share of draws whose loop may be unstable at a bandwidth before no faster ones are tried."""


@dataclass(frozen=True)
class _Ladder:
    """The first `count` stages of a sample at bandwidths that are places on a ladder of even ratios.

    Place 0 is the stage's bandwidth, `own` [Hz]. `columns` are results by place, as in `DrawnBandwidths`.
    """

    stage: Stage
    sample: Sample
    count: int
    own: float | None
    columns: dict[int, np.ndarray] = field(default_factory=dict)

    coarse: ClassVar[int] = 1 << HALVINGS_OF_BANDWIDTHS
    """Places in a coarse step."""

    def factor(self, place: int) -> float:
        """Return the bandwidth at a place, as a factor on that of the stage."""
        return float(STEP_OF_BANDWIDTHS ** (place / self.coarse))

    def within(self, place: int) -> bool:
        """Tell whether a place is within reach."""
        return 1 / REACH_OF_BANDWIDTHS <= self.factor(place) <= REACH_OF_BANDWIDTHS

    def hunts(self, place: int, thoroughly: bool = False) -> np.ndarray:
        """Return which stages hunt at a place: 1, 0, or NaN where that is not certain or a loop unstable, (count,).

        Coarse maps tell it, or `thoroughly` a survey, which replaces what a map has told.
        """
        if thoroughly or place not in self.columns:
            keys = {key: values[: self.count] for key, values in self.sample.keys.items()}
            flat = at_bandwidth(laid_over(self.stage, keys), self.factor(place) * (self.own or 1.0))
            attracted = (find_attractors if thoroughly else sketch_attractors)(flat, self.count)
            sure = attracted.certain & ~loops_unstable(flat, self.count) & self.stands_as_built(place)
            self.columns[place] = np.where(sure, attracted.attracts, np.nan)
        return self.columns[place]

    def stands_as_built(self, place: int) -> bool:
        """Tell whether the loop of the stage itself stays stable with samples and delays of its drive."""
        from friso.frequency.bode import unstable_as_built  # 0.3 s to import

        return not any(unstable_as_built(at_bandwidth(self.stage.flat(), self.factor(place) * (self.own or 1.0))))

    def climb(self) -> None:
        """Try faster controllers until nearly no stage hunts over a coarse step, and find the first such bandwidth."""
        place, quiet = 0, 0
        while quiet < 2 and self.within(place + self.coarse):
            place += self.coarse
            column = self.hunts(place)
            quiet = quiet + 1 if _quiet(column) else 0
            if np.isnan(column).mean() > MOST_UNSTABLE_DRAWS:
                return
        if quiet < 2:
            return
        low, high = place - 2 * self.coarse, place - self.coarse
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _quiet(self.hunts(middle)) else (middle, high)
        while not _quiet(self.hunts(high, thoroughly=True)) and high < place:
            high += 1

    def descend(self) -> None:
        """Try slower controllers until most stages hunt."""
        place = 0
        while self.within(place - self.coarse) and np.count_nonzero(self.hunts(place) == 1) < self.count / 2:
            place -= self.coarse
            self.hunts(place)


USUAL_WORK = 3e8
"""Work of a check without a requested number of draws (see `friso.engine.allowance`). It takes about 4 s on one
core."""

USUAL_DRAWS = 256
"""Default draws. They give a fraction to five percent; more make a check wait."""


def affordable(stage: Stage, correlations: Correlations, seed: int, rtol: float) -> int:
    """Return how many stages to draw for a fixed amount of work, measured on a few draws.

    The number is a power of two, for which Sobol's points are spread evenly.
    """
    with allowance() as spent:
        fates(stage, draw(stage, correlations, TRIAL_DRAWS, seed), rtol)
    most = min(TRIAL_DRAWS * USUAL_WORK / max(spent.used, 1.0), USUAL_DRAWS)
    return 1 << max(TRIAL_DRAWS.bit_length() - 1, int(np.log2(most)))


@dataclass(frozen=True)
class Draws:
    """Stages drawn from an uncertain one with a seed, and verdicts on them by variant.

    Variants are as in the file, locked and free; `bandwidths` are by variant, too. After an interruption there are
    fewer stages than were `asked` for, and no `bandwidths`.
    """

    stage: Stage
    sample: Sample
    seed: int
    fates: Mapping[str, Fates]
    asked: int
    bandwidths: Mapping[str, DrawnBandwidths] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        stage: Stage,
        sample: Sample,
        seed: int,
        rtol: float,
        progress: Progress = silent,
    ) -> Draws:
        """Judge the stages of a sample (see `fates`), and find at which bandwidths the first ones hunt."""
        judged = fates(stage, sample, rtol, progress)
        count = len(next(iter(judged.values())).verdicts)
        keys = {key: values[:count] for key, values in sample.keys.items()}
        bandwidths: dict[str, DrawnBandwidths] = {}
        if count == sample.count:
            tried = {name: by_bandwidth(variant, sample) for name, variant in different(stage).items()}
            by_name = {name: tried[same] for name, same in _same(stage).items()}
            bandwidths = {name: one for name, one in by_name.items() if one is not None}
        return cls(stage, replace(sample, keys=keys, count=count), seed, judged, sample.count, bandwidths)

    def split(self, name: str) -> bool:
        """Tell whether the drawn stages of a variant differ in whether they hunt, or are not decided for certain.

        They differ, too, if none hunts but hunting of some begins between their own bandwidth and the next one tried.
        """
        fates = self.fates[name]
        attracted = np.isin(fates.verdicts, ATTRACTED)
        open_ones = np.isin(fates.verdicts, UNDECIDED)
        tried = self.bandwidths.get(name)
        next_to = tried is not None and not attracted.any() and tried.hunting_reaches is not None
        differ = next_to or len({*attracted[~open_ones].tolist()}) > 1
        return bool(open_ones.mean() > MOST_OPEN_DRAWS or differ)

    def unit(self, key: str) -> str:
        """Return the SI unit of a key."""
        return self.stage.numeric_keys()[key].unit


def different(stage: Stage) -> dict[str, Stage]:
    """Return the variants of a stage (as in the file, locked, free) without repetitions."""
    variants: dict[str, Stage] = {}
    for name, variant in stage.variants().items():
        if variant not in variants.values():
            variants[name] = variant
    return variants


def _same(stage: Stage) -> dict[str, str]:
    """Return, for each variant of a stage, the name of the first variant that equals it."""
    variants = stage.variants()
    return {
        name: next(other for other, one in variants.items() if one == variant) for name, variant in variants.items()
    }


def _fates(stage: Stage, sample: Sample, chunk: slice, rtol: float, tally: Tally) -> Fates:
    """Judge those of the drawn stages that are in a slice, the `chunk`."""
    flat = laid_over(stage, {key: values[chunk] for key, values in sample.keys.items()})
    count = chunk.stop - chunk.start
    attracted = find_attractors(flat, count)
    verdicts = judge_many(flat, count, rtol, attracted)
    sure = attracted.certain & np.isin(verdicts, ATTRACTED)
    swings = np.where(sure, attracted.amplitude, np.nan), np.where(sure, attracted.period, np.nan)
    offsets = rests_off(flat, count, rtol) if cannot_hunt(stage) and rests(stage.flat()) else np.zeros(0)
    tally.add(count, "machines drawn")
    return Fates(verdicts, loops_unstable(flat, count), *swings, offsets)


@dataclass(frozen=True)
class FrictionLevels:
    """Which of many machines hunt at levels of Coulomb friction, drawn about those of similar contacts.

    `coulomb` [N] are the levels in ascending order, (levels,). `hunts` is 1 where a drawn machine hunts, 0 where it
    does not, and NaN where that is not certain, (machines, levels).
    """

    coulomb: np.ndarray
    hunts: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Return the share of machines that hunt for certain at each level, (levels,)."""
        return (self.hunts == 1).mean(axis=0)

    def ends(self, share: float) -> tuple[float, float] | None:
        """Return the least and the largest level [N] at which at least a share of machines hunt; None if at none."""
        at = np.flatnonzero(self.shares >= share)
        return (float(self.coulomb[at[0]]), float(self.coulomb[at[-1]])) if at.size else None


ACCELERATIONS_OF_FRICTION = (0.01, 10.0)  # [m/s^2]
"""Range of Coulomb friction over mass that bearings have, from air-like to a preloaded screw on a light stage."""

LEVELS_OF_FRICTION = 10
"""Levels of Coulomb friction tried over that range, a factor of two apart."""


def friction_levels(stage: Stage) -> FrictionLevels | None:
    """Draw machines like a stage without friction at levels of Coulomb friction, and see which of them hunt.

    Levels are those that bearings of such a mass may have. Returns None for a stage that states its friction, be it
    none, that moves for ever, or whose loop cannot hunt with any friction.
    """
    if stage.states_friction:
        return None
    mass = float(moving_mass(stage.flat()))
    levels = mass * np.geomspace(*ACCELERATIONS_OF_FRICTION, LEVELS_OF_FRICTION)
    columns = []
    for level in levels:
        column = _hunting(stage, float(level))
        if column is None:
            return None
        columns.append(column)
    return FrictionLevels(levels, np.stack(columns, axis=1))


MACHINES_OF_A_LEVEL = 32
"""Machines drawn at each level of Coulomb friction."""


def _hunting(stage: Stage, coulomb: float) -> np.ndarray | None:
    """Return which machines with a level of Coulomb friction [N] hunt, (machines,); None if none can."""
    axis = stage.axis_kind
    ranges = any_contact(axis).ranges((coulomb, coulomb))
    table: dict[str, Any] = {"model": "lugre", "stribeck_exponent": 2}
    units = {"static": axis.force, "coulomb": axis.force, "stribeck_velocity": f"{axis.length}/s"}
    units |= {
        "bristle_stiffness": axis.unit("N/m"),
        "bristle_damping": axis.unit("N*s/m"),
        "viscous": axis.unit("N*s/m"),
    }
    table |= {key: written(ends, units[key]) for key, ends in ranges.items()}
    table["coulomb"] = f"{coulomb!r} {axis.force}"
    unknown = ", ".join(f"friction.{key}" for key in ranges if key != "coulomb")
    try:
        tried = Stage(**{**stage.as_written(), "friction": table, "unknown": unknown})
        sample = draw(tried, Correlations(), MACHINES_OF_A_LEVEL, 0)
    except StageError:  # uncertain keys of the stage itself may hardly ever fit together
        return None
    flat = laid_over(tried, sample.keys)
    if not can_hunt(flat) or loops_unstable(flat, sample.count).any():
        return None
    attracted = sketch_attractors(flat, sample.count)
    return np.where(attracted.certain, attracted.attracts, np.nan)
