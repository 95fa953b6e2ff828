"""Judge the locked rig: the terms of the force while it sticks (Fig. 13), its response (5).

The terms are compared at two friction gaps, static minus Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting.criteria import COUNTED_AFTER
from friso.hunting.measures import BANDS
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import NOTHING_TO_COMPARE, Evidence, Finding, Part, Response, judges
from friso_thesis.studies.thesis.reading import words

if TYPE_CHECKING:
    import xarray as xr


@judges("F5", figure="5", needs=("locked",))
def locked_rig_hunts(evidence: Evidence) -> Finding:
    """Judge whether peaks, period and amplitude of the locked rig are as in the thesis."""
    cell = evidence.responses["locked"].cell
    peaks, period, amplitude = int(cell["count"]), float(cell["period"]), float(cell["peak_to_peak"])
    size = f"amplitude {amplitude * 1e3:.3g} mm peak to peak" if amplitude > BANDS[0] else "no amplitude"
    return Finding.of(
        Part("at least one peak is counted after 10 s, as in every map", peaks >= 1, f"{peaks} peaks"),
        Part(
            f"the period lies between {1 / words.order:.2g} s and 10 s",
            1 / words.order <= period <= 10,
            f"period {period:.3g} s" if np.isfinite(period) else "no period",
        ),
        Part(
            f"the amplitude (peak to peak, as in Fig. 27) lies between {1 / words.order:.2g} and {words.order:.2g} mm",
            1e-3 / words.order <= amplitude <= 1e-3 * words.order,
            size,
        ),
    )


WIDE, NARROW = "F_c 0.5 N", "F_c 1.5 N"
"""Names of the responses at F_s 4 N with the wide and the narrow gap."""

STRIBECK_VELOCITY = 1.6e-3
"""Stribeck velocity of Table 2 [m/s]."""


LONGEST_REVERSAL = 0.05
"""Longest time [s] below the Stribeck velocity that still counts as a mere reversal."""


@dataclass(frozen=True)
class Sticking:
    """The times during which the stage sticks before it breaks away, arrays of shape (sticks,).

    `time` [s] is how long it sticks, `integral` the fraction of the integral action in the force at break-away, and
    `direction` that of break-away (1 or -1).
    """

    time: np.ndarray
    integral: np.ndarray
    direction: np.ndarray

    def mean(self, values: np.ndarray) -> float:
        """Return the mean over directions of the mean of `values`; NaN if one direction is missing.

        Sticks may alternate between long and short, because a cycle need not be symmetric.
        """
        return (
            float(np.mean([values[self.direction == direction].mean() for direction in (1, -1)]))
            if self.both
            else np.nan
        )

    @property
    def both(self) -> bool:
        """Tell whether there are break-aways in both directions."""
        return {1, -1} <= set(self.direction)

    def words(self, values: np.ndarray, written: Callable[[float], str]) -> str:
        """Return the overall mean and both directions' means as text, formatted by `written`."""
        if not self.both:
            return "no cycle"
        forward, back = (written(float(values[self.direction == direction].mean())) for direction in (1, -1))
        return f"{written(self.mean(values))} ({forward} and {back} in the two directions)"


@judges("F13", figure="13", needs=(WIDE, NARROW))
def narrow_gap_breaks_away_later(evidence: Evidence) -> Finding:
    """Judge whether the stage sticks longer at the narrow friction gap than at the wide one.

    Also judge whether the integral action has a larger fraction of the force at break-away.
    """
    wide, narrow = (sticking(evidence.responses[name]) for name in (WIDE, NARROW))
    undecided = "" if wide.both and narrow.both else NOTHING_TO_COMPARE
    return Finding.of(
        Part(
            "the mean time from stick (cart slower than the Stribeck velocity) to break-away (faster again) is "
            "longer with F_c 1.5 N than with 0.5 N",
            narrow.mean(narrow.time) > wide.mean(wide.time),
            f"{narrow.words(narrow.time, seconds)} against {wide.words(wide.time, seconds)}",
            undecided=undecided,
        ),
        Part(
            "the mean share of the integral action in the force at break-away is larger with F_c 1.5 N than with 0.5 N",
            narrow.mean(narrow.integral) > wide.mean(wide.integral),
            f"{narrow.words(narrow.integral, percent)} against {wide.words(wide.integral, percent)}",
            undecided=undecided,
        ),
    )


def sticking(response: Response) -> Sticking:
    """Return when the stage sticks and then breaks away, after peaks begin to count.

    A stick begins where the cart falls below the Stribeck velocity and ends where it exceeds it. The fraction of the
    integral action is taken where the friction force is largest within the stick, before it drops.
    """
    trace = response.trace
    time, force, integral, friction = (
        np.asarray(trace[name].values) for name in ("time", "force", "force_i", "friction_force")
    )
    spells = [(i, k) for i, k in slow_spells(trace) if time[k] >= COUNTED_AFTER]
    peaks = np.array([i + int(np.argmax(np.abs(friction[i : k + 1]))) for i, k in spells], dtype=int)
    lengths = np.array([time[k] - time[i] for i, k in spells])
    return Sticking(lengths, integral[peaks] / force[peaks], np.sign(force[peaks]).astype(int))


def slow_spells(trace: xr.Dataset) -> list[tuple[int, int]]:
    """Return first and last sample of each stick.

    A stick stays below the Stribeck velocity for longer than a reversal, and ends before the run does.
    """
    slow = np.abs(trace["cart_velocity"].values) < STRIBECK_VELOCITY
    edges = np.flatnonzero(np.diff(slow.astype(int)))
    spells = [(int(a) + 1, int(b)) for a, b in pairwise(edges) if slow[a + 1]]
    time = trace["time"].values
    return [(i, k) for i, k in spells if time[k] - time[i] > LONGEST_REVERSAL]


def seconds(time: float) -> str:
    """Write a time [s]."""
    return f"{time:.2f} s"
