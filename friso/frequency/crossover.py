"""Find the crossovers at which a stage is stable, and has the required modulus margin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, faster
from friso.frequency.drive import DriveTiming
from friso.frequency.family import (
    PoleStability,
    bare_loops,
    distance_to_lines,
    frequency_grid,
    scan_stability,
    stability_by_poles,
)
from friso.frequency.members import Members, concatenate_families, family, limit_cases
from friso.frequency.ranges import Range, ranges_below, shared
from friso.frequency.settings import settings
from friso.frequency.system import Complex

WANTED = 0.5
"""Modulus margin that counts as comfortable: a peak sensitivity of 2, 6 dB."""


@dataclass(frozen=True)
class Limits:
    """Crossovers [Hz] at which a stage is stable, and those with a `comfortable` margin.

    They are ranges within `searched_crossovers`, valid in all limit cases: stuck under any bias force or sliding fast,
    limiter free or touched.

    For both kinds, one range contains the stage's own crossover, or is the next one below it (or the lowest).
    `highest_stable` and `highest_comfortable` are the upper ends of these ranges, None without a range. `first_lost` is
    the state that becomes unstable just above `highest_stable`. `closest` is the state that comes closest to -1 just
    above `highest_comfortable`. Each is None if its range ends with the search. Without a range, both states are given
    at the stage's own crossover. For a controller given by gains all values are factors of its bandwidth.
    """

    searched: Range
    stable: tuple[Range, ...]
    comfortable: tuple[Range, ...]
    highest_stable: float | None
    highest_comfortable: float | None
    first_lost: Members | None
    closest: Members | None

    @property
    def open_ended(self) -> bool:
        """Tell whether the stage is still stable at the end of the search."""
        return self.highest_stable == self.searched[1]


def limits(flat: Mapping[str, Any]) -> Limits:
    """Find the crossovers at which a stage is stable, and those with a comfortable margin.

    `flat` has the stage's keys in SI.
    """
    search = _Search(flat, settled_members(flat))
    ends, crossover = search.ends, _stated(flat)
    stable = search.stable()
    close = ranges_below(search.at, lambda f: WANTED - search.distance(f).min(axis=1))
    comfortable = shared(close, stable)
    highest, calm = (range_end(ranges, crossover) for ranges in (stable, comfortable))
    above, beyond = (np.array([end * (1 + settings.crossover_nudge) if end else crossover]) for end in (highest, calm))
    return Limits(
        ends,
        stable,
        comfortable,
        highest,
        calm,
        first_lost=None if highest == ends[1] else search.members[int(search.abscissa(above)[0].argmax())],
        closest=None if calm == ends[1] else search.members[int(search.distance(beyond)[0].argmin())],
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


def searched_crossovers(flat: Mapping[str, Any]) -> Range:
    """Return the range of crossovers [Hz] that is searched.

    The range ends below half the sampling frequency of a drive. For a controller that states no crossover, it is a
    range of factors of its bandwidth.
    """
    drive = DriveTiming.of(flat)
    if bandwidth(flat) is None:
        return 1 / 100.0, 1000.0
    return settings.lowest_crossover, min(settings.highest_crossover, 0.999 * drive.highest / (2 * np.pi))


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
    return concatenate_families([*limit_cases(flat).values(), members[members.stuck]])


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
        grids = [frequency_grid(_at(self.flat, np.array(end)), settings.search_density) for end in self.ends]
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
