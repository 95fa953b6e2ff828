"""Sample the return maps of many stages at once.

The module chooses where runs begin, and adds runs where a map is too coarse.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from friso.hunting.attractors.rounds import LEAST_SWING
from friso.hunting.cycle.ensemble import Ensemble, spread_over, stuck
from friso.hunting.return_map.curve import BREAK_JUMP_LOG
from friso.hunting.return_map.landing_map import LandingMap, MapAttractor, attractors_of
from friso.hunting.return_map.landings import LANDING_RTOL, Landings, find_landings
from friso.stage.controllers import FORCE_LIMIT

RUN_LANDINGS = 3  # [landings]
"""Landings of a run. From the first one on, they no longer depend on the start."""

RUNS_ADDED = 12
"""Most runs added at once for one stage, because all other stages wait for them."""


@dataclass(frozen=True)
class Mapped:
    """Stages with the runs that sample their return maps.

    Each run belongs to the stage with the number `owners` (runs,). It began stuck at `starts` (runs,), signed, in
    deflections of the loop by the break-away force; NaN marks a run that goes on from another one. `continued` (runs,)
    marks runs from which others go on. `landings` are the landings of all runs, to the relative tolerance `rtol`.
    """

    stages: Ensemble
    owners: np.ndarray
    starts: np.ndarray
    continued: np.ndarray
    landings: Landings
    rtol: float = LANDING_RTOL

    @cached_property
    def maps(self) -> tuple[LandingMap, ...]:
        """Return the return map of each stage."""
        return tuple(self._map(k) for k in range(self.stages.count))

    def _map(self, stage: int) -> LandingMap:
        """Return the return map of one stage, from its own runs."""
        which = np.flatnonzero(self.owners == stage)
        length, symmetric = float(self.stages.length[stage]), bool(self.stages.symmetric[stage])
        return LandingMap.of(self.landings.take(which), length, symmetric).renumbered(which)

    @cached_property
    def attractors(self) -> tuple[tuple[MapAttractor, ...], ...]:
        """Return the attractors of each stage's map; maps whose attractors are not known yet are iterated together."""
        if new := [one for one in self.maps if "attractors" not in vars(one)]:
            for one, found in zip(new, attractors_of(new), strict=True):
                vars(one)["attractors"] = found
        return tuple(one.attractors for one in self.maps)

    @property
    def surely_attract(self) -> np.ndarray:
        """Return which stages have an attractor on their map that can be trusted, shape (count,)."""
        return np.array(
            [one.surely_attracts(found) for one, found in zip(self.maps, self.attractors, strict=True)], bool
        )

    def take(self, numbers: np.ndarray) -> Mapped:
        """Select the stages with these numbers, none of them twice, and their runs."""
        which = np.flatnonzero(np.isin(self.owners, numbers))
        owners = np.array([np.flatnonzero(numbers == owner)[0] for owner in self.owners[which]], np.int64)
        runs = (self.starts[which], self.continued[which], self.landings.take(which))
        return Mapped(self.stages.take(numbers), owners, *runs, self.rtol)

    def joined(self, owners: np.ndarray, starts: np.ndarray, landings: Landings) -> Mapped:
        """Add runs that have landed already; `owners`, shape (runs,), number their stages.

        `starts`, shape (runs,), are where they stuck at first, in deflections of the loop by the break-away force.
        """
        together = self.landings.joined(landings)
        joined = Mapped(
            self.stages,
            np.append(self.owners, owners),
            np.append(self.starts, starts),
            np.append(self.continued, np.zeros(len(owners), bool)),
            together,
            self.rtol,
        )
        if "maps" in vars(self):
            changed = set(owners.tolist())
            maps = (joined._map(k) if k in changed else before for k, before in enumerate(self.maps))
            vars(joined)["maps"] = tuple(maps)
        return joined

    def begun(self, owners: np.ndarray, starts: np.ndarray, most: int | None = None) -> Mapped:
        """Add runs that begin stuck at `starts`; `owners` number their stages, both (runs,).

        Starts are signed, in deflections of the loop by the break-away force. A run lands at most `most` times (None:
        as the settings say).
        """
        most = RUN_LANDINGS if most is None else most
        return self.joined(owners, starts, _stuck_at(self.stages, owners, starts, most, self.rtol))

    def gone_on(self, runs: np.ndarray, most: int) -> Mapped:
        """Continue the numbered runs from their last landing, for up to `most` landings.

        Returns the old and the continued runs.
        """
        owners, states = self.owners[runs], self.landings.ends[runs]
        more = find_landings(self.stages.take(owners), states, most, self.rtol)
        continued = self.continued.copy()
        continued[runs] = True
        before = Mapped(self.stages, self.owners, self.starts, continued, self.landings, self.rtol)
        vars(before)["maps"] = self.maps
        return before.joined(owners, np.full(len(runs), np.nan), more)

    def finer(self) -> Mapped:
        """Add runs in the gaps of maps that are still too coarse."""
        wanted = [self._wanted(k) for k in range(self.stages.count)]
        owners = np.repeat(np.arange(self.stages.count), [len(starts) for starts in wanted])
        return self.begun(owners, np.concatenate(wanted)) if owners.size else self

    def _wanted(self, stage: int) -> np.ndarray:
        """Choose starts for more runs of a stage, so that points fill gaps in its map, (n,)."""
        landing_map, starts = self.maps[stage], []
        which = np.flatnonzero((self.owners == stage) & np.isfinite(self.starts))
        which = which[np.argsort(self.starts[which], kind="stable")]
        length, symmetric = float(self.stages.length[stage]), bool(self.stages.symmetric[stage])
        seen = self.landings.distances[which] / length
        seen = np.abs(seen) if symmetric else seen
        for place in gaps(landing_map)[:RUNS_ADDED]:
            start = _start_that_lands(self.starts[which], seen, place)
            if start is not None and not np.isclose(start, self.starts[which], rtol=1e-6).any():
                starts.append(start)
        starts += _beside(self.starts[which], which, unclosed(landing_map))
        return np.unique(starts + _at_breaks(self.starts[which], seen[:, 1]))


FAR_STARTS = (5.0, 300.0, 6)  # [deflections at break-away]
"""Starts from which a stage passes its reference without sticking at first. The runs come to lie on the map
later."""

LIMITED_STARTS = (600.0, 30000.0, 6)  # [deflections at break-away]
"""Farther starts with a force limit, which lets a stage swing as far as it moves the masses."""

NEAR_STARTS = ((0.001, 0.007, 4), (0.01, 3.0, 24))  # [deflections at break-away]
"""Starts near the reference: first, last and number of each range. More are added where the map needs them."""

REFINING_ROUNDS = 2
"""Rounds of refinement. Further rounds change the map only where a search decides in any case."""


def map_stages(
    stages: Ensemble,
    near: tuple[tuple[float, float, int], ...] | None = None,
    rounds: int | None = None,
    rtol: float = LANDING_RTOL,
    sparse: bool = False,
) -> Mapped:
    """Sample the return maps of stages by runs stuck near their reference, and farther off.

    `near` has ranges of distances (first, last, number), in deflections of the loop by the break-away force (None: as
    the settings say). Up to `rounds` times, runs are added where a map is too coarse. A `sparse` map has every third of
    the farther starts only.
    """
    far = spread_over(FAR_STARTS, *([LIMITED_STARTS] if FORCE_LIMIT in stages.flat else []))
    units = np.concatenate([spread_over(*(near or NEAR_STARTS)), far[1::3] if sparse else far])
    sides = [(np.arange(stages.count), 1.0), (np.flatnonzero(~stages.symmetric), -1.0)]
    owners = np.concatenate([np.repeat(which, len(units)) for which, _ in sides])
    starts = np.concatenate([np.tile(side * units, len(which)) for which, side in sides])
    landings = _stuck_at(stages, owners, starts, RUN_LANDINGS, rtol)
    mapped = Mapped(stages, owners, starts, np.zeros(len(owners), bool), landings, rtol)
    for _ in range(REFINING_ROUNDS if rounds is None else rounds):
        mapped = mapped.finer()
    return mapped


def _stuck_at(stages: Ensemble, owners: np.ndarray, starts: np.ndarray, most: int, rtol: float) -> Landings:
    """Return the landings of runs that begin stuck at `starts`, at most `most` of each run.

    `owners` are the numbers of their stages. Both have the shape (runs,). Starts are in deflections of the loop by the
    break-away force.
    """
    several = stages.take(owners)
    return find_landings(several, stuck(several, starts * several.length), most, rtol)


DIAGONAL_GAIN_LOG = 0.1
"""Range about the diagonal in which gaps must be fine: swings grow or shrink by less than a tenth."""

FINE_GAP_LOG = 0.03
"""Widest gap between points near the diagonal, where the map decides stability. Finer gaps take more runs."""

BREAK_WIDTH_LOG = 0.02
"""Width to which a break between two starts is narrowed down."""

COARSE_GAP_LOG = 0.15
"""Widest gap between points away from the diagonal. Wider ones hide folds of the map."""


def gaps(landing_map: LandingMap) -> np.ndarray:
    """Return the distances at which the map needs a further point, the widest gap first.

    A distance lies in the middle of a gap that is too wide, in the unit of the map and with the sign of its side.
    """
    places, excess = [], []
    for side in landing_map.sides:
        points = landing_map.points(side)
        before = np.abs(landing_map.before[points])
        across = np.abs(landing_map.after[points])
        if len(points) < 2:
            continue
        with np.errstate(all="ignore"):
            u, gain = np.log(before), np.log(across / before)
            apart = np.diff(u)
            lower, upper = np.minimum(gain[:-1], gain[1:]), np.maximum(gain[:-1], gain[1:])
            crosses = (lower < DIAGONAL_GAIN_LOG) & (upper > -DIAGONAL_GAIN_LOG)
            away = np.isinf(across[:-1]) & np.isinf(across[1:])
            breaks = ~(np.abs(np.diff(np.log(across))) < BREAK_JUMP_LOG) & (upper > -1.0) & ~away
        limit = np.where(
            crosses & ~breaks,
            FINE_GAP_LOG,
            np.where(breaks, BREAK_WIDTH_LOG, COARSE_GAP_LOG),
        )
        limit = np.where((upper < -1.0) | away, np.inf, limit)
        wide = np.flatnonzero(apart > limit)
        places += (side * np.exp((u[wide] + u[wide + 1]) / 2)).tolist()
        excess += (apart[wide] / limit[wide]).tolist()
    return np.array(places)[np.argsort(-np.array(excess), kind="stable")] if places else np.zeros(0)


OUTERMOST_LOSS_LOG = 0.3
"""Loss of the outermost points beyond which the map leads inward, so that no attractor lies farther out."""


def unclosed(landing_map: LandingMap) -> list[int]:
    """Return the runs of a map's outermost points, where the map must be extended beyond them.

    It must be extended if, from the nearest or farthest point, the next landing is not much nearer to the reference.
    The result has the numbers of those runs, and is empty if there are none.
    """
    runs = []
    for side in landing_map.sides:
        points = landing_map.points(side)
        for end in points[-1:], points[landing_map.after[points] != 0][:1]:
            if end.size and np.log(max(landing_map.gain[end[0]], 1e-300)) > -OUTERMOST_LOSS_LOG:
                runs.append(int(landing_map.run[end[0]]))
    return runs


def _beside(starts: np.ndarray, numbers: np.ndarray, runs: list[int]) -> list[float]:
    """Return starts half-way, in the logarithm, between some `runs` and their neighbours.

    `starts` ascend; `numbers` are the numbers of their runs. Only neighbours on the same side of the reference count.
    """
    between = []
    for run in runs:
        for k in np.flatnonzero(numbers == run):
            for other in (k - 1, k + 1):
                if 0 <= other < len(starts) and starts[k] * starts[other] > 0:
                    between.append(float(np.sign(starts[k]) * np.sqrt(starts[k] * starts[other])))
    return between


BREAK_SHARES = (0.2, 0.4, 0.6, 0.8)  # [of the way between two starts]
"""Places at which more runs begin, to narrow down a break of the map. More run at once for nothing."""


def _at_breaks(starts: np.ndarray, landings: np.ndarray) -> list[float]:
    """Return starts to add where neighbouring runs land very differently, or just one lands.

    An attractor may reach up to such a break of the map. `starts`, shape (runs,), ascend; `landings`, (runs,), are the
    first landings. All are in deflections of the loop by the break-away force. The list may be empty.
    """
    lands = np.abs(np.nan_to_num(landings)) >= LEAST_SWING
    sizes = np.where(lands, np.abs(landings), 1.0)
    breaks = (lands[:-1] != lands[1:]) | (lands[:-1] & lands[1:] & (np.abs(np.diff(np.log(sizes))) > BREAK_JUMP_LOG))
    near = np.maximum(np.abs(starts[:-1]), np.abs(starts[1:])) <= NEAR_STARTS[-1][1]
    apart = np.abs(np.diff(np.log(np.abs(starts)))) > BREAK_WIDTH_LOG
    ends = np.flatnonzero(breaks & near & apart & (starts[:-1] * starts[1:] > 0))
    shares = np.array(BREAK_SHARES)
    between = [starts[k] * (starts[k + 1] / starts[k]) ** shares for k in ends]
    return np.concatenate(between).tolist() if between else []


def _start_that_lands(starts: np.ndarray, seen: np.ndarray, place: float) -> float | None:
    """Return a start whose run should land at the distance `place`; None if there is none.

    It lies between two neighbouring starts, of which one run lands nearer than `place` and the other farther. `starts`
    (runs,) ascend; `seen` (runs, landings) are landings with the start first.
    """
    best, start = np.inf, None
    for k in range(1, RUN_LANDINGS):
        low, high = seen[:-1, k], seen[1:, k]
        with np.errstate(all="ignore"):
            around = np.flatnonzero(((low - place) * (high - place) <= 0) & (low * high > 0))
            for i in around[starts[around] * starts[around + 1] > 0]:
                apart = abs(np.log(high[i] / low[i]))
                if apart < best:
                    share = np.clip(np.log(place / low[i]) / np.log(high[i] / low[i]), 0.02, 0.98)
                    start = starts[i] * (starts[i + 1] / starts[i]) ** share
                    best = apart
    return None if start is None else float(start)
