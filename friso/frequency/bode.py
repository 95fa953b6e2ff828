"""Analyse a stage linearly: limit cases, states between them, highest bandwidth, cascades.

The loops of a cascade are each opened where a drive's Bode plot opens them. The plant leads from the commanded force to
the velocity at the encoder. The velocity loop is cut where the velocity is fed back, with the position loop open. The
position loop is cut where the position is fed back, with the velocity loop closed (Gross, Hamann, Wiegaertner 2001,
Electrical Feed Drives, chapters 3 and 4). With loops at several rates both are characteristic loci
(`friso.frequency.loops`), which do not depend on the place of the cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.equations.settings import named_gains
from friso.errors import InputError
from friso.frequency.crossover import Limits, Range, limits, ranges_below
from friso.frequency.family import Scan, closed_loop_poles, loops, plant_poles, scan_stability, spectral_abscissa
from friso.frequency.loops import lifted_loop, locus_of, poles, response
from friso.frequency.margins import Margins, margins, margins_of, with_resonances
from friso.frequency.members import (
    Members,
    family,
    limit_cases,
    limiter_in_series,
    member,
    steady_force,
)
from friso.frequency.parts import FORCE, STAGE, VELOCITY, plant
from friso.frequency.settings import settings
from friso.frequency.system import Complex, DriveTiming
from friso.stage import Stage
from friso.stage.controllers import controller_of
from friso.stage.tables import leading_friction

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


def _seen(rates: Complex) -> np.ndarray:
    """Return which poles of a velocity loop its feedback can move, shape (n,).

    `rates` are the poles [rad/s], shape (1, n).
    """
    sizes = np.abs(rates[0])
    return sizes > settings.unseen_pole * sizes[np.isfinite(sizes)].max(initial=0.0)


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
    omega = with_resonances(np.geomspace(low, high, settings.curve_points) * 2 * np.pi, resonant)
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
    return float(places.min()) / settings.shown_beyond, min(
        float(places.max()) * settings.shown_beyond, DriveTiming.of(flat).highest / (2 * np.pi)
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
