"""Judge Fig. 11 of the locked rig: path, and crossover and mass."""

from __future__ import annotations

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.equations.motions.there_and_back import CRUISE
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, beside, judges
from friso_thesis.studies.thesis.maps import (
    ends,
    free_square,
    limit_error,
    overlap,
    overlap_text,
    peak_counts,
    sizes,
    trend,
    trend_text,
    verdict_table,
)
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.studies import STUDIES

_ENDS = 20.0
"""Crossover above which the thesis saw no hunting [Hz] (Sec. 4.1)."""

TRAVEL = 0.16
"""Travel of the rig's actuator [m] (Sec. 3.5). Longer paths of Fig. 11A exist in simulation only."""


@judges("F11A", figure="11A", needs=("path",))
def path_is_no_cure(evidence: Evidence) -> Finding:
    """Judge whether any path ends hunting, over acceleration and acceleration time."""
    words = reading()
    acceleration, time, moving, valid = verdict_table(
        evidence.maps["path"], "motion.acceleration", "motion.acceleration_time"
    )
    cruise = evidence.rig.flat().get(CRUISE, 0.0)
    moved = (acceleration > 0)[:, None] & (time > 0)[None, :] & valid
    lines = [*moving[acceleration > 0][:, time > 0], *moving[acceleration > 0][:, time > 0].T]
    free_lines = float(np.mean([not line.any() for line in lines]))
    fits = moved & (acceleration[:, None] * time[None, :] ** 2 * (1 + cruise) <= TRAVEL)
    square, short_square = free_square(moving, moved), free_square(moving, fits)
    speed = acceleration[:, None] * time[None, :]
    resting = moved & ~moving
    bound = float(speed[resting].max(initial=0.0))
    above = overlap(speed > bound, moved)
    return Finding(
        (
            Part(
                "all but a few of the accelerations and acceleration times that move the stage have cells that keep "
                f"moving, and the largest square at rest covers few cells (at most {percent(words.few)})",
                free_lines <= words.few and square <= words.few,
                f"{percent(overlap(moving, moved))} of the paths that move the stage keep it moving; "
                f"{percent(free_lines)} of the lines and a square of {percent(square, 3)} come to rest",
            ),
            Part(
                f"so it is among the paths that fit the {TRAVEL * 1e3:g} mm of the rig (Sec. 3.5): the largest square "
                "at rest covers few of them",
                bool(moving[fits].any() and short_square <= words.few),
                f"{percent(overlap(fits, moved))} of the paths fit; {percent(overlap(moving, fits))} of these keep it "
                f"moving, and a square of {percent(short_square, 3)} of them comes to rest",
                why="Most of the paths of Fig. 11A are longer than the rig is, and among the others a block comes to "
                "rest.",
            ),
            Part(
                "above some hyperbola, acceleration times its time constant, every path keeps the stage "
                "moving; below it some do not; "
                f"and at least {percent(words.half)} of the paths that move lie above it",
                bool(resting.any() and above >= words.half),
                f"all keep it moving above {bound:.2g} m/s, {percent(above)} of the paths; "
                f"{overlap_text(moving, moved & (speed <= bound))} keep it moving below",
            ),
        )
    )


@judges("F11B", figure="11B", needs=("system",))
def crossover_and_mass_end_hunting(evidence: Evidence) -> Finding:
    """Judge the highest crossover at which the stage keeps moving, over all masses and for each."""
    words = reading()
    runs = evidence.maps["system"]
    crossover, mass, moving, _ = verdict_table(runs, CROSSOVER, "mass")
    by_mass = ends(crossover, moving, sizes(runs, CROSSOVER, "mass"))
    highest, falls = by_mass.max(), trend(mass, by_mass)
    marker = moving[:, np.argmin(np.abs(mass - STUDIES["system"].marker["mass"]))]
    ended = marker & ~moving[:, -1]
    return Finding(
        (
            Part(
                f"the limit above which no mass keeps moving is about {_ENDS:g} Hz (from {_ENDS / words.about:.3g} to "
                f"{_ENDS * words.about:.3g} Hz)",
                bool(_ENDS / words.about <= highest <= _ENDS * words.about),
                f"limit {highest:.3g} Hz{_at_the_limit(moving, peak_counts(runs, CROSSOVER, 'mass'))}; "
                f"median over the masses {np.median(by_mass):.3g} Hz",
                printed=_ENDS,
                read=float(highest),
                undecided=beside(highest, (_ENDS / words.about, _ENDS * words.about), limit_error(crossover)),
            ),
            Part(
                "at some crossovers the stage keeps moving with the marker's mass and comes to rest with the "
                f"heaviest, and the limit falls with the mass (rank correlation at most {-words.trend:g})",
                bool(ended.any() and falls <= -words.trend),
                f"{ended.sum()} of {marker.sum()} crossovers; rank correlation {trend_text(falls)}: limit "
                f"{by_mass[0]:.3g} Hz at {mass[0]:g} kg, {by_mass[-1]:.3g} Hz at {mass[-1]:g} kg",
            ),
        )
    )


def _at_the_limit(moving: np.ndarray, peaks: np.ndarray) -> str:
    """Say how many cells keep moving at the highest crossover at which any does.

    The text also gives the largest number of peaks counted in these cells. It is empty if no cell keeps moving.
    """
    rows = np.flatnonzero(moving.any(axis=1))
    if not rows.size:
        return ""
    row = rows[-1]
    counts = peaks[row][moving[row] & np.isfinite(peaks[row])]
    cells = int(moving[row].sum())
    most = f" of at most {counts.max():g} counted peaks" if counts.size else ""
    return f", set by {cells} {'cell' if cells == 1 else 'cells'}{most}"
