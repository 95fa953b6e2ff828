"""Analyse a stage linearly: limit cases, states between them, bandwidth, crossovers and what limits them, cascades.

The bandwidth is the highest frequency at which the loop's gain is 1. Crossovers are sought that are stable and have the
required margin. Ranges in which a condition holds have their ends located.

The loops of a cascade are each opened where a drive's Bode plot opens them. The plant leads from the commanded force to
the velocity at the encoder. The velocity loop is cut where the velocity is fed back, with the position loop open. The
position loop is cut where the position is fed back, with the velocity loop closed (Gross, Hamann, Wiegaertner 2001,
Electrical Feed Drives, chapters 3 and 4). With loops at several rates both are characteristic loci
(`friso.frequency.loops`), which do not depend on the place of the cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from typing import Any, Literal

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.equations.bandwidth import bandwidth, faster, sped_up
from friso.equations.settings import gain_states, named_gains
from friso.errors import InputError
from friso.frequency.loops import FORCE, STAGE, VELOCITY, lifted_loop, locus_of, plant, poles, response
from friso.frequency.margins import (
    Margins,
    PoleStability,
    Scan,
    bare_loops,
    closed_loop_poles,
    distance_to_lines,
    frequency_grid,
    loops,
    margins,
    margins_of,
    plant_poles,
    scan_stability,
    spectral_abscissa,
    stability_by_poles,
    with_resonances,
)
from friso.frequency.settings import settings
from friso.frequency.system import (
    Complex,
    DriveTiming,
    Members,
    family,
    limit_cases,
    limiter_in_series,
    member,
    steady_force,
)
from friso.stage import Stage
from friso.stage.controllers import controller_of
from friso.stage.tables import leading_friction

BANDWIDTH_FREQUENCIES = np.geomspace(0.01, 1e4, 800)
"""Frequencies [Hz] at which loops are evaluated for their bandwidth; more lie near resonances of the stage."""


def loop_bandwidth(stage: Stage) -> float:
    """Return the bandwidth [Hz] of a stage: the last frequency at which its loop has gain 1.

    The stage slides; while it is stuck, the bearing holds it and the loop hardly moves it. The result is NaN if the
    gain never reaches 1. With other gains at standstill the larger bandwidth counts.
    """
    return float(np.fmax.reduce([_last_crossing(flat) for flat in gain_states(stage.flat())]))


def rigid_bandwidth(stage: Stage) -> float:
    """Return the bandwidth [Hz] of a stage with its joint locked and without a parasitic mode.

    The mass then moves as a whole, as van Dijk's rules for the crossover assume.
    """
    flat = {key: value for key, value in stage.flat().items() if not key.startswith("parasitic.")}
    return _last_crossing({**flat, "joint.locked": True} if stage.joint else flat)


def _last_crossing(flat: Mapping[str, Any]) -> float:
    crossings = margins(flat, _sliding(flat)).crossovers
    return float(crossings[-1]) if crossings else float("nan")


def bandwidths_at(stage: Stage, factors: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the bandwidths [Hz] of a stage whose controller is made faster by some factors.

    The shape is (factors,).
    """
    return loop_bandwidths(stage, sped_up(stage.flat(), np.array(factors)), len(factors))


@np.errstate(all="ignore")
def loop_bandwidths(stage: Stage, changes: Mapping[str, Any], count: int) -> np.ndarray:
    """Return the bandwidths [Hz] of a stage with changed keys, in continuous time, (count,).

    `changes` has the keys with their values [SI], arrays (count,). The stage slides; a loop that never falls through
    gain 1 gives NaN. The results have a relative error of 1e-3: the loop is computed on a grid of frequencies, and its
    gain is a power of frequency in between. If the gains at standstill differ, the larger bandwidth counts.
    """
    flat, sliding = stage.flat(), _sliding(stage.flat())
    omega = with_resonances(2 * np.pi * BANDWIDTH_FREQUENCIES, [poles(flat, sliding, DriveTiming(0.0, 0.0)).cut])
    machines = sliding.repeated(count)
    return np.fmax.reduce([_last_falls(state, machines, omega) for state in gain_states({**flat, **changes})])


def _last_falls(flat: Mapping[str, Any], machines: Members, omega: np.ndarray) -> np.ndarray:
    """Return the last frequencies [Hz] at which open loops fall through gain 1, (machines,).

    `machines` are states of the stage. The frequencies are searched between angular frequencies `omega` [rad/s]. NaN
    marks a loop that never falls through 1.
    """
    loops = poles(flat, machines, DriveTiming(0.0, 0.0)).loop(omega)
    gain, frequency = np.log(np.abs(loops)), np.log(omega / (2 * np.pi))
    falls = (gain[:, :-1] >= 0) & (gain[:, 1:] < 0)
    last = falls.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    rows = np.arange(len(machines))
    before, after = gain[rows, last], gain[rows, last + 1]
    at = frequency[last] + (frequency[last + 1] - frequency[last]) * before / (before - after)
    return np.where(falls.any(axis=1), np.exp(at), np.nan)


def _sliding(flat: Mapping[str, Any]) -> Members:
    """Return the limit case in which the stage slides."""
    return next(case for name, case in limit_cases(flat).items() if not name.startswith("stuck"))


EVENLY, NEAR_ZERO = np.linspace(0, 1, 6)[1:-1], np.array([-0.002, 0.0, 0.002])
"""Where a step that contains an end is divided: evenly, and near the zero of a straight line, as fractions of the
step."""

Range = tuple[float, float]


def ranges_below(at: np.ndarray, excess: Callable[[np.ndarray], np.ndarray]) -> tuple[Range, ...]:
    """Return the ranges in which a function is below 0, with their ends located.

    `at` are ascending positive arguments (n,) at which `excess`, the function, is evaluated first.
    """
    values = excess(at)
    below = values < 0
    changes = np.flatnonzero(below[1:] != below[:-1])
    ends = [_end(at[k : k + 2], values[k : k + 2], excess) for k in changes]
    ends = [*at[:1][below[:1]], *ends, *at[-1:][below[-1:]]]
    return tuple((float(a), float(b)) for a, b in zip(ends[::2], ends[1::2], strict=True))


def shared(first: tuple[Range, ...], second: tuple[Range, ...]) -> tuple[Range, ...]:
    """Return the ranges in which both of two lists of ranges hold."""
    pairs = [(max(a[0], b[0]), min(a[1], b[1])) for a in first for b in second]
    return tuple(pair for pair in pairs if pair[0] < pair[1])


END_PRECISION = 4e-6
"""Relative accuracy of the ends of ranges, beyond the digits that are shown."""


def _end(at: np.ndarray, values: np.ndarray, excess: Callable[[np.ndarray], np.ndarray]) -> float:
    """Return the zero of the function `excess` between two arguments, from its values there."""
    precise = END_PRECISION * np.log(at[-1] / at[0])
    while np.log(at[-1] / at[0]) > precise:
        with np.errstate(invalid="ignore"):
            zero = np.nan_to_num(values[0] / (values[0] - values[-1]), nan=0.5)
        shares = np.unique(np.clip(np.append(EVENLY, zero + NEAR_ZERO), 0.0005, 0.9995))
        places = at[0] * (at[-1] / at[0]) ** shares
        at, values = np.array([at[0], *places, at[-1]]), np.array([values[0], *excess(places), values[-1]])
        k = int(((values < 0) != (values[0] < 0)).argmax())
        at, values = at[k - 1 : k + 1], values[k - 1 : k + 1]
    return float(np.sqrt(at[0] * at[1]))


COMFORTABLE_MARGIN = 0.5
"""Modulus margin that counts as comfortable: a peak sensitivity of 2, 6 dB."""


@dataclass(frozen=True)
class Limits:
    """Crossovers [Hz] at which a stage is stable, and those with a `comfortable` margin.

    They are ranges within `searched_crossovers`, valid in all limit cases: stuck under any bias force or sliding fast,
    limiter free or touched, with every set of gains that the loop may have.

    For both kinds, one range contains the stage's own crossover, or is the next one below it (or the lowest).
    `highest_stable` and `highest_comfortable` are the upper ends of these ranges, None without a range. `first_lost` is
    the state that becomes unstable just above `highest_stable`. `closest` is the state that comes closest to -1 just
    above `highest_comfortable`. Each comes with the gains that act in it (`named_gains`), and is None if its range ends
    with the search. Without a range, both states are given at the stage's own crossover. For a controller given by
    gains all values are factors of its bandwidth.
    """

    searched: Range
    stable: tuple[Range, ...]
    comfortable: tuple[Range, ...]
    highest_stable: float | None
    highest_comfortable: float | None
    first_lost: tuple[Members, str] | None
    closest: tuple[Members, str] | None

    @property
    def open_ended(self) -> bool:
        """Tell whether the stage is still stable at the end of the search."""
        return self.highest_stable == self.searched[1]


CROSSOVER_NUDGE = 1e-5
"""Relative distance from the end of a range at which a crossover is certainly beyond it."""


def limits(flat: Mapping[str, Any]) -> Limits:
    """Find the crossovers at which a stage is stable, and those with a comfortable margin.

    `flat` has the stage's keys in SI.
    """
    search = _SearchOfGains({name: _Search(keys, settled_members(keys)) for name, keys in named_gains(flat).items()})
    ends, crossover = search.ends, _stated(flat)
    stable = search.stable()
    close = ranges_below(search.at, lambda f: COMFORTABLE_MARGIN - search.distance(f).min(axis=1))
    comfortable = shared(close, stable)
    highest, calm = (range_end(ranges, crossover) for ranges in (stable, comfortable))
    above, beyond = (np.array([end * (1 + CROSSOVER_NUDGE) if end else crossover]) for end in (highest, calm))
    return Limits(
        ends,
        stable,
        comfortable,
        highest,
        calm,
        first_lost=None if highest == ends[1] else search.state(int(search.abscissa(above)[0].argmax())),
        closest=None if calm == ends[1] else search.state(int(search.distance(beyond)[0].argmin())),
    )


def stable_crossovers(flat: Mapping[str, Any], members: Members) -> tuple[Range, ...]:
    """Return the ranges of crossovers [Hz] at which a stage is stable in all given states.

    For a controller that states no crossover, they are factors of its bandwidth.
    """
    return _Search(flat, members).stable()


def range_end(ranges: Sequence[Range], crossover: float) -> float | None:
    """Return the upper end [Hz] of the range that contains a crossover [Hz].

    If none does, it is the end of the next range below, or else of the lowest. None without ranges.
    """
    below = [high for low, high in ranges if low <= crossover] or [high for _, high in ranges[:1]]
    return below[-1] if below else None


LOWEST_CROSSOVER = 0.1  # [Hz]
"""Lowest crossover of the search. Slower loops settle after the moves of any stage."""

HIGHEST_CROSSOVER = 1e4  # [Hz]
"""Highest crossover of the search, beyond the sampling of any drive."""


def searched_crossovers(flat: Mapping[str, Any]) -> Range:
    """Return the range of crossovers [Hz] that is searched.

    The range ends below half the sampling frequency of a drive. For a controller that states no crossover, it is a
    range of factors of its bandwidth.
    """
    drive = DriveTiming.of(flat)
    if bandwidth(flat) is None:
        return 1 / 100.0, 1000.0
    return LOWEST_CROSSOVER, min(HIGHEST_CROSSOVER, 0.999 * drive.highest / (2 * np.pi))


def settled_margin(flat: Mapping[str, Any]) -> float:
    """Return the least modulus margin of the states in which a stage may settle.

    It is 0 if one of them is unstable.
    """
    loops = scan_stability(flat, settled_members(flat))
    return float(loops.distance.min()) if loops.stable.all() else 0.0


def settled_members(flat: Mapping[str, Any]) -> Members:
    """Return the limit cases, and the states stuck under a bias force.

    A stage is in one of them unless it creeps or has just broken away, while its friction falls with speed.
    """
    members = family(flat, settings.search_biases, 2)
    return Members.joined([*limit_cases(flat).values(), members[members.stuck]])


def unstable_as_built(flat: Mapping[str, Any]) -> tuple[bool, bool]:
    """Tell whether a loop is unstable only because of the drive's sampling and delay.

    The first result is for a sticking stage, the second for a sliding one. `flat` has the stage's keys in SI.
    """
    members = settled_members(flat)
    smooth = {key: value for key, value in flat.items() if not key.startswith("drive.")}
    if len(smooth) == len(flat):
        return False, False
    lost = scan_stability(smooth, members).stable & ~scan_stability(flat, members).stable
    return bool(lost[members.stuck].any()), bool(lost[~members.stuck].any())


def _stated(flat: Mapping[str, Any]) -> float:
    """Return the crossover of a stage [Hz]; 1 for a controller that states none."""
    named = bandwidth(flat)
    return 1.0 if named is None else named


def _at(flat: Mapping[str, Any], crossover: np.ndarray) -> dict[str, Any]:
    return faster(flat, crossover / _stated(flat))


SEARCH_DENSITY = 60  # [1/decade]
"""Frequencies per decade of the search. Fewer miss the peak of a resonance."""


@dataclass(frozen=True)
class _Search:
    """Search over crossovers of a stage's controller, in all states in which it may settle.

    `flat` has the stage's keys in SI, and `members` are these states. Parts that do not depend on the crossover are
    computed once.
    """

    flat: Mapping[str, Any]
    members: Members

    @cached_property
    def ends(self) -> Range:
        return searched_crossovers(self.flat)

    @cached_property
    def at(self) -> np.ndarray:
        """Return the crossovers [Hz] at which to look first, shape (crossovers,)."""
        return np.geomspace(*self.ends, settings.crossover_steps)

    def stable(self) -> tuple[Range, ...]:
        """Return the ranges of crossovers at which the stage is stable in all states."""
        return ranges_below(self.at, lambda f: self.abscissa(f).max(axis=1))

    def abscissa(self, crossover: np.ndarray) -> np.ndarray:
        """Return the real part [1/s] of the rightmost closed-loop pole, (crossovers, states)."""
        return self._by_poles(crossover).abscissa.reshape(len(crossover), -1)

    def distance(self, crossover: np.ndarray) -> np.ndarray:
        """Return the least distance of the loop from -1, shape (crossovers, states)."""
        omega, loops_of = self._loops
        held = DriveTiming.of(self.flat).transfer(omega)
        shared = np.array([distance_to_lines(loops_of(_at(self.flat, f)) * held) for f in crossover])
        return np.minimum(shared, self._by_poles(crossover).resonant.reshape(shared.shape))

    @cached_property
    def _loops(self) -> tuple[np.ndarray, Callable[[Mapping[str, Any]], Complex]]:
        """Return frequencies [rad/s] that resolve the loop at all crossovers, and a loop function.

        The function takes the keys of a stage with any controller, and returns its loops at the frequencies. The
        frequencies do not depend on the crossover, so that the distance from -1 is a smooth function of it.
        """
        grids = [frequency_grid(_at(self.flat, np.array(end)), SEARCH_DENSITY) for end in self.ends]
        omega = np.unique(np.concatenate(grids))
        return omega, bare_loops(self.flat, self.members, omega)

    def _by_poles(self, crossover: np.ndarray) -> PoleStability:
        return self._by_poles_at_all if crossover is self.at else self._looked_at(crossover)

    @cached_property
    def _by_poles_at_all(self) -> PoleStability:
        return self._looked_at(self.at)

    def _looked_at(self, crossover: np.ndarray) -> PoleStability:
        """Return the stability of all states at each crossover, one crossover after the other."""
        keys = _at(self.flat, np.repeat(crossover, len(self.members)))
        return stability_by_poles(keys, self.members.repeated(len(crossover)))


@dataclass(frozen=True)
class _SearchOfGains:
    """Search over crossovers with every set of gains that the loop may have: the searches with each, by its name."""

    searches: Mapping[str, _Search]

    @property
    def ends(self) -> Range:
        return self.searches[""].ends

    @property
    def at(self) -> np.ndarray:
        """Return the crossovers [Hz] at which to look first, shape (crossovers,)."""
        return self.searches[""].at

    def stable(self) -> tuple[Range, ...]:
        """Return the ranges of crossovers at which the stage is stable in all states with all gains."""
        return reduce(shared, (search.stable() for search in self.searches.values()))

    def abscissa(self, crossover: np.ndarray) -> np.ndarray:
        """Return the real part [1/s] of the rightmost closed-loop pole, (crossovers, gains and states)."""
        return np.hstack([search.abscissa(crossover) for search in self.searches.values()])

    def distance(self, crossover: np.ndarray) -> np.ndarray:
        """Return the least distance of the loop from -1, shape (crossovers, gains and states)."""
        return np.hstack([search.distance(crossover) for search in self.searches.values()])

    def state(self, number: int) -> tuple[Members, str]:
        """Return the state of a column of `abscissa` and `distance`, and its gains."""
        names, count = [*self.searches], len(self.searches[""].members)
        return self.searches[names[number // count]].members[number % count], names[number // count]


POSITION_TIME = "drive.position_sample_time"

CascadeLoop = Literal["velocity", "position"]


@dataclass(frozen=True)
class CascadeLoops:
    """Loops of a cascade in one state of the stage, complex, over `Bode.omega`.

    `plant` leads from the commanded force to the velocity [m/(N s)], with hold, delay and current loop. `loops` are the
    "velocity" and the "position" loop, with their `margins`.
    """

    plant: np.ndarray
    loops: Mapping[CascadeLoop, np.ndarray]
    margins: Mapping[CascadeLoop, Margins]


def is_cascade(flat: Mapping[str, Any]) -> bool:
    """Tell whether the controller of a stage has a velocity loop within its position loop."""
    return controller_of(flat).feeds_back == "velocity"


def cascade_loops(flat: Mapping[str, Any], member: Members, omega: np.ndarray) -> CascadeLoops:
    """Return the loops of a cascade in one state of the stage, over angular frequencies [rad/s]."""
    drive = DriveTiming.of(flat)
    moved = plant(flat, member).take((FORCE,), (VELOCITY,)).at(1j * omega)[0, :, 0, 0]
    alone = {key: value for key, value in flat.items() if key != POSITION_TIME}  # open the position loop
    timing = DriveTiming.of(alone)
    inner, outer = response(alone, member, timing, cut=STAGE), _position_loop(flat, member, drive)
    of_inner = poles(alone, member, timing, cut=STAGE)
    closed, continuous = of_inner.closed[:, _seen(of_inner.in_s)], of_inner.continuous[:, _seen(of_inner.continuous)]
    of_inner = replace(of_inner, closed=closed, continuous=continuous)
    return CascadeLoops(
        plant=moved * drive.transfer(omega),
        loops={"velocity": inner(omega), "position": outer(omega)},
        margins={
            "velocity": margins_of(inner, alone, member, of_inner),
            "position": margins_of(outer, flat, member, poles(flat, member, drive)),
        },
    )


UNSEEN_POLE = 1e-7
"""Largest pole, relative to the fastest, that counts as 0. It belongs to the position or its integral, which the
velocity loop does not affect."""


def _seen(rates: Complex) -> np.ndarray:
    """Return which poles of a velocity loop its feedback can move, shape (n,).

    `rates` are the poles [rad/s], shape (1, n).
    """
    sizes = np.abs(rates[0])
    return sizes > UNSEEN_POLE * sizes[np.isfinite(sizes)].max(initial=0.0)


def _position_loop(flat: Mapping[str, Any], member: Members, drive: DriveTiming) -> Callable[[np.ndarray], Complex]:
    """Return the position loop as a function of angular frequencies [rad/s].

    The velocity loop within it is closed.
    """
    if not drive.sample_time:
        outer, inner = (response(flat, member, drive, cut=channel) for channel in (VELOCITY, STAGE))
        return lambda omega: outer(omega) / (1 + inner(omega))
    by_position, by_velocity = (lifted_loop(flat, member, drive, cut=channel) for channel in (VELOCITY, STAGE))

    def at(omega: np.ndarray) -> Complex:
        turn = omega * drive.sample_time
        inner = by_velocity.over(turn)
        matrices = np.linalg.solve(np.eye(inner.shape[-1]) + inner, by_position.over(turn))
        return locus_of(matrices.astype(complex), turn)[0]

    return at


PRESCRIBED_SPEEDS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""Speeds of the cart [m/s] at which the open loop is shown, from stuck to sliding fast (thesis, Fig. 8)."""


@dataclass(frozen=True)
class BodeCase:
    """A limit case: its state, its plant, its loop L and the margins.

    The plant is stage position over force [m/N]. Plant and loop are complex, over `Bode.omega`, shape (k,).
    """

    members: Members
    plant: np.ndarray
    loop: np.ndarray
    margins: Margins


@dataclass(frozen=True)
class Unstable:
    """Range of speeds [m/s], from `low` to `high`, at which a sliding stage is not stable.

    `falling` is true if its friction is smaller at the upper end. `touched` is true for a touched limiter, and
    `forward` for motion ahead. `gains` are those that act (`named_gains`).
    """

    low: float
    high: float
    touched: bool
    forward: bool
    falling: bool
    gains: str


@dataclass(frozen=True)
class Prescribed:
    """A cart sliding at a `speed` [m/s], or stuck at 0: its loop L and whether it is stable.

    The loop is given over `Bode.omega`.
    """

    speed: float
    loop: np.ndarray
    stable: bool


@dataclass(frozen=True)
class Bode:
    """Linear analysis of a stage.

    `omega` (k,) [rad/s] are the frequencies of all curves; `cases` are the limit cases by name, optionally with the
    thesis's formula for a touched limiter ("-series"); `cascades` are the loops of a cascade by limit case. All other
    results are computed when they are first used. Many of them are over a family: states near and between the limit
    cases.
    """

    stage: Stage
    omega: np.ndarray
    cases: Mapping[str, BodeCase]
    cascades: Mapping[str, CascadeLoops]

    @property
    def scan(self) -> Scan:
        """Return the stability of the stage in all states of a family, near and between limit cases.

        Its gains are those far from the reference at rest; `scans` has the others as well.
        """
        return self.scans[""]

    @cached_property
    def scans(self) -> Mapping[str, Scan]:
        """Return the stability of the stage in all states of a family by the gains that act (`named_gains`)."""
        return {name: scan_stability(flat, family(flat)) for name, flat in named_gains(self.stage.flat()).items()}

    @cached_property
    def prescribed(self) -> tuple[Prescribed, ...]:
        """Return the loops at the speeds `PRESCRIBED_SPEEDS` of the cart, with a free limiter if possible."""
        return _prescribed(self.stage.flat(), self.omega)

    @property
    def stable(self) -> bool:
        """Tell whether the stage is stable in every state of the family, from stuck to sliding fast, with all gains."""
        return all(scan.stable.all() for scan in self.scans.values())

    @cached_property
    def loops(self) -> np.ndarray:
        """Return the loops L in all states of the family over `omega`, complex, shape (members, k)."""
        return loops(self.scan.flat, self.scan.members, self.omega)

    @cached_property
    def worst(self) -> tuple[Members, Margins, str]:
        """Return the state of the family in which the loop is the worst, with its margins and gains.

        It is the least stable one, or the one whose loop comes closest to -1.
        """
        return self._worst(np.ones(len(self.scan.members), bool))

    @cached_property
    def settled(self) -> tuple[Members, Margins, str]:
        """Return the worst of the states in which a stage may settle, with its margins and gains.

        A stage may settle in the limit cases, and in the states stuck under any bias force.
        """
        return self._worst(self.scan.members.settled)

    @cached_property
    def unstable(self) -> tuple[Unstable, ...]:
        """Return the ranges of speed at which the stage is not stable, gains by gains."""
        return tuple(one for name, scan in self.scans.items() for one in _unstable(scan.flat, scan.members, name))

    @cached_property
    def limits(self) -> Mapping[str, Limits]:
        """Return the ranges of stable crossovers, for the joint "locked" and "free", or "given".

        "given" is the only case without a joint.
        """
        stages = _by_joint(self.stage)
        return dict(zip(stages, side_by_side([partial(limits, flat) for flat in stages.values()]), strict=True))

    def _worst(self, among: np.ndarray) -> tuple[Members, Margins, str]:
        """Return the worst of some states of the family over all gains, with its margins and gains."""
        states = []
        for gains, scan in self.scans.items():
            member = scan.members[scan.worst(among)]
            states.append((member, margins(scan.flat, member), gains))
        unstable = [state for state in states if not state[1].stable]
        if unstable:
            return max(unstable, key=lambda state: state[1].abscissa)
        return min(states, key=lambda state: state[1].modulus_margin)


CURVE_POINTS = 1200
"""Points of a curve. Fewer show corners on a screen; more make the page larger."""


def bode(stage: Stage, band: Range | None = None, series: bool = False) -> Bode:
    """Return the linear analysis of a stage.

    Its curves cover frequencies `band` [Hz] (default: those that matter). With `series`, the thesis's formula for a
    touched limiter is added. Raises InputError for frequencies that are not usable, a controller that exerts no force,
    and a delay that is too long (see `DriveTiming`).
    """
    if band is not None and not 0 < band[0] < band[1] < np.inf:
        raise InputError("band", repr(band), "two rising frequencies [Hz]", "friso.bode(stage, (0.1, 1000.0))")
    flat = stage.flat()
    states = {name: (flat, member) for name, member in limit_cases(flat).items()} | (_in_series(flat) if series else {})
    margins_of = {name: margins(*state) for name, state in states.items()}
    low, high = band or _mattering(flat, margins_of.values())
    for keys in _by_joint(stage).values():  # refuse a delay that is too long now, before the limits are requested
        closed_loop_poles(keys, Members.joined(limit_cases(keys).values()))
    together = Members.joined(limit_cases(flat).values())
    resonant = [closed_loop_poles(flat, together), plant_poles(flat, together)]
    omega = with_resonances(np.geomspace(low, high, CURVE_POINTS) * 2 * np.pi, resonant)
    return Bode(
        stage=stage,
        omega=omega,
        cases={
            name: BodeCase(
                member,
                plant(keys, member).take((FORCE,), (STAGE,)).at(1j * omega)[0, :, 0, 0],
                response(keys, member, DriveTiming.of(keys))(omega),
                margins_of[name],
            )
            for name, (keys, member) in states.items()
        },
        cascades={name: cascade_loops(*state, omega) for name, state in states.items()} if is_cascade(flat) else {},
    )


def _by_joint(stage: Stage) -> dict[str, Mapping[str, Any]]:
    """Return the stage's keys with its joint "locked" and "free", or as "given" without a joint."""
    variants = stage.variants()
    return {name: member.flat() for name, member in variants.items() if name != "given" or len(variants) == 1}


def _in_series(flat: Mapping[str, Any]) -> dict[str, tuple[Mapping[str, Any], Members]]:
    """Return the limit cases with a touched limiter, modelled as in Table 1 of the thesis.

    There the limiter is in series with the joint, so the stage has another joint and no limiter. Each case has a
    stage's keys and a state.
    """
    touched = {name: member for name, member in limit_cases(flat).items() if member.touched[0]}
    return {f"{name}-series": (limiter_in_series(flat), member.with_limiter(False)) for name, member in touched.items()}


SHOWN_BEYOND = 5.0
"""Factor by which curves extend beyond crossovers and resonances."""


def _mattering(flat: Mapping[str, Any], all_margins: Iterable[Margins]) -> Range:
    """Return a range of frequencies [Hz] that shows all crossovers and resonances of a stage.

    The crossovers are those of `all_margins`.
    """
    poles = plant_poles(flat, Members.joined(limit_cases(flat).values()))
    resonances = np.abs(poles[np.abs(poles.imag) > np.abs(poles.real)]) / (2 * np.pi)
    places = np.array(
        [*(f for case_margins in all_margins for f in case_margins.crossovers), *resonances[resonances > 1e-3]]
    )
    places = places if places.size else np.ones(1)
    return float(places.min()) / SHOWN_BEYOND, min(
        float(places.max()) * SHOWN_BEYOND, DriveTiming.of(flat).highest / (2 * np.pi)
    )


def _prescribed(flat: Mapping[str, Any], omega: np.ndarray) -> tuple[Prescribed, ...]:
    """Return the loops at prescribed speeds of the cart, with the limiter free if possible."""
    if leading_friction(flat)["friction.model"] == "none":
        return ()
    touched = bool(next(iter(limit_cases(flat).values())).touched[0])
    states = Members.joined([member(speed, touched=touched) for speed in PRESCRIBED_SPEEDS])
    stable = spectral_abscissa(flat, states) < 0
    return tuple(
        Prescribed(speed, response(flat, states[k], DriveTiming.of(flat))(omega), bool(stable[k]))
        for k, speed in enumerate(PRESCRIBED_SPEEDS)
    )


def _unstable(flat: Mapping[str, Any], members: Members, gains: str) -> tuple[Unstable, ...]:
    """Return the ranges of speed at which the stage is not stable, within states of a family.

    Each belongs to one state of the limiter and one direction.
    """
    sliding = members[~members.stuck]
    ranges = []
    for touched, backward in sorted({*zip(sliding.touched.tolist(), (~sliding.forward).tolist(), strict=True)}):
        alike = sliding[(sliding.touched == touched) & (sliding.forward != backward)]

        def stability(speed: np.ndarray, member: Members = alike[[0]]) -> np.ndarray:
            return -spectral_abscissa(flat, replace(member.repeated(len(speed)), speed=speed))

        for low, high in ranges_below(alike.speed, stability):
            before, after = steady_force(flat, np.array([low, high]), not backward)
            ranges.append(Unstable(low, high, touched, not backward, bool(after < before), gains))
    return tuple(ranges)
