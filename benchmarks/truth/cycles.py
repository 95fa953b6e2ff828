"""Follow with SciPy, from event to event, the cycles that friso closes by shooting.

It is asked whether they close, how large they are, and how a deviation grows. Simulations repeat this at two
tolerances.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.by_hand import INTEGRAL, RIGID, XC, X, by_hand
from benchmarks.truth.claims import Claim
from friso.hunting import Cycles, Ensemble

RTOL, BRUTE = 1e-9, (1e-7, 1e-9)
"""Tolerance of SciPy, and tolerances of the simulations by brute force."""

AWAY = 1e-4
"""Distance from its cycle at which a run begins, as a fraction of the distance at which the stage sticks."""

GAP, SIZE, GROWTH = 1e-5, 1e-4, 2e-3
"""Largest gap of an orbit, relative to its states' magnitudes; largest difference of amplitudes; and of multipliers."""

PERIODS, KEPT = 6, 0.02
"""Periods for which brute force follows a stable cycle, and the largest deviation from its amplitude."""


@dataclass(frozen=True)
class Shown:
    """A cycle of a claim, with what SciPy and brute force find.

    It has amplitude [m] and multiplier; SciPy's gap, its amplitude over friso's, and its multiplier (NaN where a
    limiter chatters); and the relative difference of the amplitude by brute force.
    """

    amplitude: float
    multiplier: float
    gap: float
    size: float
    growth: float
    brute: float

    @property
    def wrong(self) -> str:
        """Return what refutes the cycle; "" if nothing does."""
        reasons = []
        if not self.gap < GAP:
            reasons.append(f"it does not close, by {self.gap:.2g}")
        if not self.size < SIZE:
            reasons.append(f"its amplitude is off by {self.size:.2g}")
        if np.isfinite(self.growth) and not abs(self.growth - self.multiplier) < GROWTH + 0.01 * abs(self.multiplier):
            reasons.append(f"a deviation grows by {self.growth:.4g}")
        if not self.brute < KEPT:
            reasons.append(f"brute force is off by {self.brute:.2g}")
        return ", ".join(reasons)


@np.errstate(all="ignore")
def cycles_of(claim: Claim) -> Iterator[Shown]:
    """Yield the cycles of a claim, including unstable ones."""
    surveyed = claim.surveyed
    if surveyed is None:
        return
    families = [family for family in surveyed.families if family.closed[0] and not family.attracting[0]]
    closed = [m.cycles.take(np.array([m.number])) for m in surveyed.motions if m.cycles is not None]
    for cycle in (*closed, *families):
        yield _shown(claim, cycle)


def _shown(claim: Claim, cycle: Cycles) -> Shown:
    ensemble, equations = Ensemble.held(claim.stage.flat(), 1), by_hand(claim.stage.flat()).held()
    names, time, sign = ensemble.kernel.states, float(cycle.orbits.times[0]), cycle.sign
    at, start = equations.places(names), equations.state(names, cycle.states[0])
    one = equations.followed(start, time, RTOL)
    gap = np.max(np.abs(_on_section(one.states[-1], one.rates, sign, start) - start)[at] / equations.scales[at])
    high, low = (max(one.high, -one.low), min(one.low, -one.high)) if sign < 0 else (one.high, one.low)
    size, growth = (high - low) / 2 / float(cycle.amplitude[0]) - 1, np.nan
    if not ensemble.chatters:
        body = X if equations.numbers.joint == RIGID else XC
        away = AWAY * abs(start[body])
        aside = away * equations.state(names, cycle.direction[0])
        ends = [equations.followed(start + way * aside, time, RTOL).states[-1] for way in (1, -1)]
        off = [_on_section(other, one.rates, sign, start)[body] for other in ends]
        growth = float(off[0] - off[1]) / (2 * away)
    multiplier, brute = float(cycle.multiplier[0]), _brute(ensemble, cycle)
    return Shown(float(cycle.amplitude[0]), multiplier, float(gap), abs(size), growth, brute)


def _on_section(end: np.ndarray, rates: np.ndarray, sign: float, start: np.ndarray) -> np.ndarray:
    """Return where a run that ended beside the section crosses it.

    On the section the integrator's state equals that of the start, or of its mirror image for half a period.
    """
    return sign * end - sign * rates * (sign * end[INTEGRAL] - start[INTEGRAL]) / (sign * rates[INTEGRAL])


def _brute(ensemble: Ensemble, cycle: Cycles) -> float:
    """Return the largest difference of the amplitude after some periods, at two tolerances.

    It is 0 for an unstable cycle.
    """
    if not cycle.attracting[0]:
        return 0.0
    period, off = float(cycle.period[0]), []
    for rtol in BRUTE:
        results = ensemble.run(cycle.states, np.array([PERIODS * period]), rtol, interval=period / 2000)
        late = results.samples[0][-2001:, ensemble.kernel.position]
        off.append(abs(float(np.ptp(late)) / 2 / float(cycle.amplitude[0]) - 1))
    return max(off)
