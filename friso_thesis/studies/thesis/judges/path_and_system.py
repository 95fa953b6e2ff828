"""Judge the locked rig: path, crossover and mass (Fig. 11), friction, alpha, beta (Fig. 12)."""

from __future__ import annotations

import numpy as np

from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER
from friso.equations.motions import CRUISE
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, beside, judges
from friso_thesis.studies.thesis.maps import (
    begins,
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
from friso_thesis.studies.thesis.reading import words
from friso_thesis.studies.thesis.studies import STUDIES

HUNTING_GAP = 1.0
"""Gap between static and Coulomb friction from which hunting was seen [N] (claim F12A)."""


@judges("F12A", figure="12A", needs=("friction",))
def gap_makes_hunting(evidence: Evidence) -> Finding:
    """Judge how static minus Coulomb friction decides on hunting.

    The finding has the smallest such gap at which runs keep moving, and how the peak count depends on it.
    """
    axes = ("friction.static", "friction.coulomb")
    static, coulomb, moving, _ = verdict_table(evidence.maps["friction"], *axes)
    peaks = peak_counts(evidence.maps["friction"], *axes)
    gap = static[:, None] - coulomb[None, :]
    smallest, error = smallest_gap(evidence)
    rises = trend(gap[moving], peaks[moving])
    at_static = _mean_rank_correlation(gap, peaks, moving)
    at_coulomb = _mean_rank_correlation(gap.T, peaks.T, moving.T)
    at_fixed = {"F_s": at_static, "F_c": at_coulomb}
    flat = ", ".join(
        f"{name} (mean rank correlation {correlation:.2f})"
        for name, correlation in at_fixed.items()
        if correlation < words.trend
    )
    return Finding.of(
        Part(
            f"the smallest gap F_s - F_c at which the stage keeps moving is about {HUNTING_GAP:g} N (from "
            f"{HUNTING_GAP / words.about:.2g} to {HUNTING_GAP * words.about:.2g} N)",
            bool(HUNTING_GAP / words.about <= smallest <= HUNTING_GAP * words.about),
            f"smallest gap {smallest:.2g} N" if moving.any() else "no cell keeps moving",
            printed=HUNTING_GAP,
            read=smallest,
            undecided=beside(smallest, (HUNTING_GAP / words.about, HUNTING_GAP * words.about), error),
        ),
        Part(
            "over the cells that keep moving, the count rises with the gap (rank correlation at least "
            f"{words.trend:g})",
            rises >= words.trend,
            f"rank correlation {trend_text(rises)}; at fixed F_s {trend_text(at_static)}, at fixed F_c "
            f"{trend_text(at_coulomb)}",
            why=f"The count has no rising trend with the gap at fixed {flat}." if flat else "",
        ),
    )


def smallest_gap(evidence: Evidence) -> tuple[float, float]:
    """Return the smallest gap F_s - F_c [N] at which a run keeps moving, over all values of F_c, and its error.

    Limits in F_s are interpolated. The gap is NaN if no run keeps moving.
    """
    axes = ("friction.static", "friction.coulomb")
    runs = evidence.maps["friction"]
    static, coulomb, moving, _ = verdict_table(runs, *axes)
    some = moving.any(axis=0)
    smallest = float((begins(static, moving, sizes(runs, *axes)) - coulomb)[some].min()) if some.any() else np.nan
    return smallest, limit_error(static)


@judges("F12B", figure="12B", needs=("control",))
def control_is_no_cure(evidence: Evidence) -> Finding:
    """Judge how alpha and beta change the peak count, and whether either ends all hunting."""
    axes = (ALPHA, BETA)
    alpha, beta, moving, valid = verdict_table(evidence.maps["control"], *axes)
    peaks = peak_counts(evidence.maps["control"], *axes)
    ones = np.ones(moving.shape)
    with_beta, with_beta_all = (_mean_rank_correlation(beta[None, :] * ones, peaks, cells) for cells in (moving, valid))
    with_alpha, with_alpha_all = (
        _mean_rank_correlation((alpha[:, None] * ones).T, peaks.T, cells.T) for cells in (moving, valid)
    )
    free_lines = float(np.mean(~np.concatenate([moving.any(axis=0), moving.any(axis=1)])))
    square = free_square(moving, valid)
    rest = "The trend is one of the cells that keep moving alone, and not of all, which Fig. 12B shows."
    return Finding.of(
        Part(
            "at fixed alpha the count falls with beta, over the cells that keep moving and over all (mean rank "
            f"correlation at most {-words.trend:g})",
            with_beta <= -words.trend and with_beta_all <= -words.trend,
            f"mean rank correlation with beta {trend_text(with_beta)} over those that keep moving, "
            f"{trend_text(with_beta_all)} over all",
            rest if with_beta <= -words.trend else "",
        ),
        Part(
            "at fixed beta the count rises with alpha, over the cells that keep moving and over all (mean rank "
            f"correlation at least {words.trend:g})",
            with_alpha >= words.trend and with_alpha_all >= words.trend,
            f"with alpha {trend_text(with_alpha)} over those that keep moving, {trend_text(with_alpha_all)} over all",
            rest if with_alpha >= words.trend else "",
        ),
        Part(
            "all but a few of the values of alpha and beta have cells that keep moving, and the largest square at "
            f"rest covers few cells (at most {percent(words.few)})",
            free_lines <= words.few and square <= words.few,
            f"{percent(overlap(moving, valid))} of the cells keep moving; {percent(free_lines)} of the lines and a "
            f"square of {percent(square, 3)} come to rest",
        ),
    )


def _mean_rank_correlation(x: np.ndarray, y: np.ndarray, moving: np.ndarray) -> float:
    """Return the mean rank correlation of the rows of x and y, over the cells that keep moving.

    All arrays have one shape. The result is NaN if no row has a correlation.
    """
    trends = np.array([trend(*pair) for pair in ((a[h], b[h]) for a, b, h in zip(x, y, moving, strict=True))])
    return float(trends[np.isfinite(trends)].mean()) if np.isfinite(trends).any() else np.nan


HUNTING_ENDS = 20.0
"""Crossover above which the thesis saw no hunting [Hz] (Sec. 4.1)."""

ACTUATOR_TRAVEL = 0.16
"""Travel of the rig's actuator [m] (Sec. 3.5). Longer paths of Fig. 11A exist in simulation only."""


@judges("F11A", figure="11A", needs=("path",))
def path_is_no_cure(evidence: Evidence) -> Finding:
    """Judge whether any path ends hunting, over acceleration and acceleration time."""
    acceleration, time, moving, valid = verdict_table(
        evidence.maps["path"], "motion.acceleration", "motion.acceleration_time"
    )
    cruise = evidence.rig.flat().get(CRUISE, 0.0)
    moved = (acceleration > 0)[:, None] & (time > 0)[None, :] & valid
    lines = [*moving[acceleration > 0][:, time > 0], *moving[acceleration > 0][:, time > 0].T]
    free_lines = float(np.mean([not line.any() for line in lines]))
    fits = moved & (acceleration[:, None] * time[None, :] ** 2 * (1 + cruise) <= ACTUATOR_TRAVEL)
    square, short_square = free_square(moving, moved), free_square(moving, fits)
    speed = acceleration[:, None] * time[None, :]
    resting = moved & ~moving
    bound = float(speed[resting].max(initial=0.0))
    above = overlap(speed > bound, moved)
    return Finding.of(
        Part(
            "all but a few of the accelerations and acceleration times that move the stage have cells that keep "
            f"moving, and the largest square at rest covers few cells (at most {percent(words.few)})",
            free_lines <= words.few and square <= words.few,
            f"{percent(overlap(moving, moved))} of the paths that move the stage keep it moving; "
            f"{percent(free_lines)} of the lines and a square of {percent(square, 3)} come to rest",
        ),
        Part(
            f"so it is among the paths that fit the {ACTUATOR_TRAVEL * 1e3:g} mm of the rig (Sec. 3.5): the largest "
            "square "
            "at rest covers few of them",
            bool(moving[fits].any() and short_square <= words.few),
            f"{percent(overlap(fits, moved))} of the paths fit; {percent(overlap(moving, fits))} of these keep it "
            f"moving, and a square of {percent(short_square, 3)} of them comes to rest",
            why="Most of the paths of Fig. 11A are longer than the rig is, and among the others a block comes to rest.",
        ),
        Part(
            "above some hyperbola, acceleration times its time constant, every path keeps the stage moving; below it "
            f"some do not; and at least {percent(words.half)} of the paths that move lie above it",
            bool(resting.any() and above >= words.half),
            f"all keep it moving above {bound:.2g} m/s, {percent(above)} of the paths; "
            f"{overlap_text(moving, moved & (speed <= bound))} keep it moving below",
        ),
    )


@judges("F11B", figure="11B", needs=("system",))
def crossover_and_mass_end_hunting(evidence: Evidence) -> Finding:
    """Judge the highest crossover at which the stage keeps moving, over all masses and for each."""
    runs = evidence.maps["system"]
    crossover, mass, moving, _ = verdict_table(runs, CROSSOVER, "mass")
    by_mass = ends(crossover, moving, sizes(runs, CROSSOVER, "mass"))
    highest, falls = by_mass.max(), trend(mass, by_mass)
    marker = moving[:, np.argmin(np.abs(mass - STUDIES["system"].marker["mass"]))]
    ended = marker & ~moving[:, -1]
    return Finding.of(
        Part(
            f"the limit above which no mass keeps moving is about {HUNTING_ENDS:g} Hz (from "
            f"{HUNTING_ENDS / words.about:.3g} to "
            f"{HUNTING_ENDS * words.about:.3g} Hz)",
            bool(HUNTING_ENDS / words.about <= highest <= HUNTING_ENDS * words.about),
            f"limit {highest:.3g} Hz{_at_the_limit(moving, peak_counts(runs, CROSSOVER, 'mass'))}; "
            f"median over the masses {np.median(by_mass):.3g} Hz",
            printed=HUNTING_ENDS,
            read=float(highest),
            undecided=beside(highest, (HUNTING_ENDS / words.about, HUNTING_ENDS * words.about), limit_error(crossover)),
        ),
        Part(
            "at some crossovers the stage keeps moving with the marker's mass and comes to rest with the "
            f"heaviest, and the limit falls with the mass (rank correlation at most {-words.trend:g})",
            bool(ended.any() and falls <= -words.trend),
            f"{ended.sum()} of {marker.sum()} crossovers; rank correlation {trend_text(falls)}: limit "
            f"{by_mass[0]:.3g} Hz at {mass[0]:g} kg, {by_mass[-1]:.3g} Hz at {mass[-1]:g} kg",
        ),
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
