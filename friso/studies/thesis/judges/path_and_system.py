"""Fig. 11: path, and crossover and mass, of the locked rig."""

from __future__ import annotations

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.studies.thesis.claims import ABOUT, FEW, TREND, Evidence, Finding, Part, judges
from friso.studies.thesis.maps import ends, free_square, share, share_text, table, trend, trend_text
from friso.studies.thesis.studies import STUDIES

_ENDS = 20.0
"""Crossover above which the thesis saw no hunting [Hz] (Sec. 4.1)."""


@judges("F11A", figure="11A", needs=("path",))
def path_is_no_cure(evidence: Evidence) -> Finding:
    """Scattered cells that settle below a hyperbola of acceleration and its time, none above it."""
    acceleration, time, hunts, valid = table(evidence.maps["path"], "motion.acceleration", "motion.acceleration_time")
    moved = (acceleration > 0)[:, None] & (time > 0)[None, :] & valid
    lines = [*hunts[acceleration > 0][:, time > 0], *hunts[acceleration > 0][:, time > 0].T]
    free_lines = sum(not line.any() for line in lines)
    square = free_square(hunts, moved)
    speed = acceleration[:, None] * time[None, :]
    settles = moved & ~hunts
    bound = float(speed[settles].max(initial=0.0))
    above = share(speed > bound, moved)
    return Finding(
        (
            Part(
                "every acceleration and every acceleration time that moves the stage hunts somewhere, and the largest "
                f"square without hunting covers few cells (at most {FEW:.0%})",
                free_lines == 0 and square <= FEW,
                f"{share(hunts, moved):.0%} of the paths that move hunt; {free_lines} lines and a square of "
                f"{square:.1%} are free of hunting",
            ),
            Part(
                "above some hyperbola, acceleration times its time constant, every path hunts; below it some settle; "
                "and at least half of the paths that move lie above it",
                bool(settles.any() and above >= 0.5),
                f"all hunt above {bound:.2g} m/s, {above:.0%} of the paths; "
                f"{share_text(hunts, moved & (speed <= bound))} hunt below",
            ),
        )
    )


@judges("F11B", figure="11B", needs=("system",))
def crossover_and_mass_end_hunting(evidence: Evidence) -> Finding:
    """The highest crossover that hunts, over all masses and for each."""
    crossover, mass, hunts, _ = table(evidence.maps["system"], CROSSOVER, "mass")
    by_mass = ends(crossover, hunts)
    highest, falls = by_mass.max(), trend(mass, by_mass)
    marker = hunts[:, np.argmin(np.abs(mass - STUDIES["system"].marker["mass"]))]
    ended = marker & ~hunts[:, -1]
    return Finding(
        (
            Part(
                f"the limit above which no mass hunts is about {_ENDS:g} Hz (from {_ENDS / ABOUT:.3g} to "
                f"{_ENDS * ABOUT:.3g} Hz)",
                bool(_ENDS / ABOUT <= highest <= _ENDS * ABOUT),
                f"limit {highest:.3g} Hz",
            ),
            Part(
                "some crossovers that hunt with the marker's mass settle with the heaviest, and the limit falls with "
                f"the mass (rank correlation at most {-TREND:g})",
                bool(ended.any() and falls <= -TREND),
                f"{ended.sum()} of {marker.sum()} crossovers; rank correlation {trend_text(falls)}: limit "
                f"{by_mass[0]:.3g} Hz at {mass[0]:g} kg, {by_mass[-1]:.3g} Hz at {mass[-1]:g} kg",
            ),
        )
    )
