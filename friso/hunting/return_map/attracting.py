"""Find the limit cycles of stages by their return maps, and decide which motions swing for ever.

Each attractor of a map is followed by a run, from which an orbit is closed.

For kicks and moves, a run shows where a stage lands, that is, comes to stick. The return map predicts what follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner, returns
from friso.equations.structure import shared_structure
from friso.hunting.attractors.rounds import MOST_REPEATING_SWINGS, SURVEY_RTOL, Pending, close_orbits
from friso.hunting.attractors.survey import Swinging, of_cycles
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.find import CYCLE_RTOL
from friso.hunting.return_map.landing_map import LandingMap, MapAttractor
from friso.hunting.return_map.landings import LANDING_RTOL, find_landings
from friso.hunting.return_map.mapped import Mapped, map_stages

MAP_SCATTER_SHARE = 0.05
"""Largest scatter of landings about the prediction of their neighbours. With more, the stage remembers more than
distance."""


@dataclass(frozen=True)
class MapSurvey:
    """Result of surveying stages by their return maps.

    `mapped` are the runs that sample the maps, `motions` the stable orbits. A stage is `undecided`, shape (count,), if
    its map has an attractor that was not closed as a stable orbit.
    """

    mapped: Mapped
    motions: tuple[Swinging, ...]
    undecided: np.ndarray

    @property
    def resolved(self) -> np.ndarray:
        """Return which stages have a map that decides which motions are stable, shape (count,).

        Every attractor was closed, no run was lost, and landings at equal distances return alike: where they do not,
        the stage remembers more than its distance.
        """
        most = MAP_SCATTER_SHARE
        whole = [one.lost == 0 and one.scatter <= most for one in self.mapped.maps]
        return np.array(whole, bool) & ~self.undecided

    @property
    def attracts(self) -> np.ndarray:
        """Return which stages have an attractor, shape (count,)."""
        attracted = np.zeros(self.mapped.stages.count, bool)
        attracted[[motion.stage for motion in self.motions]] = True
        return attracted


@dataclass(frozen=True)
class _Proposal:
    """Attractor of a stage's map, and the run that will be continued near it."""

    stage: int
    attractor: MapAttractor
    run: int


ATTRACTOR_TRIES = 4
"""Tries to close an attractor. Each adds landings where the map predicts them; after four the map does not
change."""

FOLLOWED_REPETITIONS = 3
"""Repetitions for which a run must follow an attractor of the map before an orbit is closed from it."""


def survey_maps(stages: Ensemble, rtol: float = CYCLE_RTOL) -> MapSurvey:
    """Find the attractors of stages by their return maps.

    Orbits are closed to the relative tolerance `rtol`.
    """
    mapped = map_stages(stages)
    motions: list[Swinging] = []
    repelling: list[Swinging] = []
    for _ in range(ATTRACTOR_TRIES):
        proposals = _left(mapped, motions, repelling)
        if not proposals:
            break
        runs = np.array([proposal.run for proposal in proposals])
        most = max(
            MOST_REPEATING_SWINGS,
            FOLLOWED_REPETITIONS * max(_swings(p.attractor) for p in proposals),
        )
        before = len(mapped.owners)
        mapped = mapped.gone_on(runs, most)
        _close(mapped, np.arange(before, len(mapped.owners)), rtol, motions, repelling)
    lengths, undecided = stages.length, np.zeros(stages.count, bool)
    for stage, found in enumerate(mapped.attractors):
        own = [motion for motion in motions if motion.stage == stage]
        for attractor in found:
            undecided[stage] |= not any(is_motion(attractor, motion, float(lengths[stage])) for motion in own)
    return MapSurvey(mapped, tuple(motions), undecided)


def _left(mapped: Mapped, motions: list[Swinging], repelling: list[Swinging]) -> list[_Proposal]:
    """Return the attractors of maps that are not among the closed orbits yet.

    `motions` are the stable orbits, `repelling` the unstable ones. Attractors without a run near them that can be
    continued are left out.
    """
    lengths = mapped.stages.length

    def is_any(new: _Proposal, closed: list[Swinging], exactly: bool) -> bool:
        own = (motion for motion in closed if motion.stage == new.stage)
        return any(is_motion(new.attractor, motion, float(lengths[new.stage]), exactly) for motion in own)

    return [new for new in _proposals(mapped) if not is_any(new, motions, False) and not is_any(new, repelling, True)]


def _swings(attractor: MapAttractor) -> int:
    return len(attractor.distances) if attractor.periodic else 1


def _proposals(mapped: Mapped) -> list[_Proposal]:
    """Return the attractors of all maps, each with the run that will be continued near it.

    Of the runs that lead to an attractor, the one that ended nearest to it is taken. Attractors without such a run are
    left out.
    """
    proposals = []
    for stage, (landing_map, found) in enumerate(zip(mapped.maps, mapped.attractors, strict=True)):
        for attractor in found:
            basin = attractor.basin
            ending = basin[landing_map.final[basin] & ~mapped.continued[landing_map.run[basin]]]
            if not ending.size:
                continue
            after = landing_map.after[ending]
            with np.errstate(all="ignore"):
                apart = np.abs(np.log(after[:, None] / attractor.distances[None, :]))
            nearest = ending[int(np.nan_to_num(apart, nan=np.inf).min(axis=1).argmin())]
            proposals.append(_Proposal(stage, attractor, int(landing_map.run[nearest])))
    return proposals


SAME_ORBIT_DISTANCE_SHARE = 0.05
"""Largest difference in mean distance between an orbit and the attractor of the map."""


def is_motion(attractor: MapAttractor, motion: Swinging, length: float, exactly: bool = False) -> bool:
    """Tell whether the attractor of a map is the closed cycle `motion` of its stage.

    Both are compared by size, and by how often the stage sticks until they repeat. With `exactly`, these numbers must
    be equal; otherwise one may be a multiple of the other. `length` [m] is the deflection of the loop by the break-away
    force.
    """
    distances = np.abs(attractor.distances) * length
    if exactly and not (attractor.periodic and motion.cycles and len(distances) == motion.cycles.swings):
        return False
    if not attractor.periodic:
        size = float(distances.mean())
    elif len(distances) % 2:  # every landing occurs on either side
        size = float(distances.max())
    else:
        size = float(distances[::2].max() + distances[1::2].max()) / 2
    alike = abs(size / motion.amplitude - 1) < SAME_ORBIT_DISTANCE_SHARE
    return bool(alike and (not attractor.periodic or motion.swings % len(distances) == 0))


def _close(mapped: Mapped, runs: np.ndarray, rtol: float, motions: list[Swinging], repelling: list[Swinging]) -> None:
    """Close orbits from the numbered runs that repeat; add them to `motions` or `repelling`."""
    landings, owners = mapped.landings.take(runs), mapped.owners[runs]
    sizes, times, swings = np.zeros(len(runs)), np.zeros(len(runs)), np.zeros(len(runs), np.int64)
    for k, owner in enumerate(owners.tolist()):
        end = 0 if landings.rest[k] or landings.lost[k] else int(landings.count[k]) + 1
        path, when = landings.distances[k, 1:end], landings.times[k, 1:end]
        symmetric = bool(mapped.stages.symmetric[owner])
        simple = any(motion.stage == owner and motion.swings == 2 for motion in repelling)
        swings[k] = _repeats(path, symmetric, 1 + symmetric if simple else 0)
        if swings[k]:
            times[k], sizes[k] = when[-1] - when[-1 - swings[k]], np.ptp(path)
    which = np.flatnonzero(swings)
    if not which.size:
        return
    some = mapped.stages.take(owners[which])
    pending = Pending(some, landings.ends[which], times[which], np.zeros(which.size), some.symmetric, SURVEY_RTOL)
    for group, cycles in close_orbits(pending, swings[which], times[which], sizes[which], rtol):
        numbers = owners[which[group]]
        for kind, some_cycles in ((motions, cycles.attracting), (repelling, cycles.closed & ~cycles.attracting)):
            for motion in of_cycles(numbers, cycles, mapped.stages.sticking, some_cycles):
                if not any(motion.like(other) for other in kind):
                    kind.append(motion)


SIMPLE_CLOSING_SHARE = 0.05
"""Largest difference between landings of the simplest cycles from which an orbit can be closed."""

CLOSING_SHARE = 0.01
"""Largest difference between landings of longer cycles, which need better guesses, for an orbit to be closed."""


def _repeats(path: np.ndarray, symmetric: bool, least: int) -> int:
    """Return after how many swings a run's last landings repeat; 0 if they do not.

    Repetitions after fewer than `least` swings do not count. `path`, shape (landings,), has the signed landings; those
    of a `symmetric` stage may repeat on the other side.
    """
    sizes = np.abs(path) if symmetric else path
    for swings in range(1 if symmetric else 2, len(path) // 2 + 1, 1 if symmetric else 2):
        last = min(max(swings, 2), len(path) - swings)
        again = sizes[-last:] / sizes[-last - swings : len(path) - swings]
        share = SIMPLE_CLOSING_SHARE if swings <= 2 - symmetric else CLOSING_SHARE
        if swings >= least and np.all(np.abs(again - 1) < share):
            return swings
    return 0


def motions_go_on(
    flat: Mapping[str, Any], count: int, landing_map: LandingMap, starts: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return which motions of one stage swing for ever, and which are certain, both (count,).

    `landing_map` is the stage's return map. `flat` has its keys in SI, and arrays (count,) where motions differ.
    Motions may also begin at the reference from initial states, `starts` (count, states). The result is uncertain if
    the reference does not come back to its start.
    """
    if starts is not None:
        return _go_on(Ensemble.held(flat, count), starts, landing_map)
    if not returns(flat):
        return np.zeros(count, bool), np.zeros(count, bool)
    shape = kernel(shared_structure(flat))
    long = {**flat, "motion.duration": np.broadcast_to(last_corner(flat) * (1 + 1e-9) + 1e-9, (count,))}
    ends, completed = np.zeros((count, len(shape.full_state))), np.zeros(count, bool)
    for runs in run_chunks(shape, long, count, RunOptions(rtol=LANDING_RTOL, least_swing=np.inf)):
        ends[runs.numbers], completed[runs.numbers] = runs.results.ends, done(runs.results)
    goes_on, decided = _go_on(Ensemble.held(flat, count), ends, landing_map)
    return goes_on & completed, decided & completed


FIRST_LANDINGS = 3  # [landings]
"""Landings after which a stage has forgotten how its motion began."""

FATE_ROUNDS = 8
"""Rounds after which a run that the map does not decide stays unknown."""

UNSURE_LANDING_SHARE = 0.02
"""Error of a landing beyond which the stage still remembers its start."""

MORE_LANDINGS = 3  # [landings]
"""Landings added at a time to runs that the map does not decide yet."""


@np.errstate(all="ignore")  # a stage that never lands is still at its reference
def _go_on(stages: Ensemble, starts: np.ndarray, landing_map: LandingMap) -> tuple[np.ndarray, np.ndarray]:
    """Return which runs swing for ever, and for which that is certain, both (runs,).

    Runs begin from the states `starts`; where they land decides.
    """
    count = len(starts)
    ends, decided, left = np.zeros(count, bool), np.zeros(count, bool), np.arange(count)
    states, most = starts, FIRST_LANDINGS
    for _ in range(FATE_ROUNDS):
        landed = find_landings(stages.take(left), states, most)
        rows = np.arange(left.size)
        before, last = (
            landed.distances[rows, at] / stages.length[left] for at in (np.maximum(landed.count - 1, 0), landed.count)
        )
        shares = np.array([[1 - UNSURE_LANDING_SHARE], [1.0], [1 + UNSURE_LANDING_SHARE]])
        fates = landing_map.goes_on((last * shares).ravel()).reshape(3, -1)
        foretold = np.abs(landing_map.foretold(before) / last) - 1
        sure = (fates == fates[1]).all(axis=0) & (np.abs(foretold) < UNSURE_LANDING_SHARE) & (landed.count == most)
        sure = landed.rest | (sure & ~landed.lost)
        ends[left[sure]], decided[left[sure]] = fates[1][sure] & ~landed.rest[sure], True
        on = ~sure & ~landed.lost
        left, states, most = left[on], landed.ends[on], MORE_LANDINGS
        if not left.size:
            break
    return ends, decided
