"""Judge Fig. 12: friction forces, and alpha and beta, of the locked rig."""

from __future__ import annotations

import numpy as np

from friso.equations.controllers.van_dijk import ALPHA, BETA
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, beside, judges
from friso_thesis.studies.thesis.maps import (
    begins,
    free_square,
    limit_error,
    overlap,
    peak_counts,
    sizes,
    trend,
    trend_text,
    verdict_table,
)
from friso_thesis.studies.thesis.reading import reading

_GAP = 1.0
"""Gap between static and Coulomb friction from which hunting was seen [N] (claim F12A)."""


@judges("F12A", figure="12A", needs=("friction",))
def gap_makes_hunting(evidence: Evidence) -> Finding:
    """Judge how static minus Coulomb friction decides on hunting.

    The finding has the smallest such gap at which runs keep moving, and how the peak count depends on it.
    """
    words = reading()
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
    return Finding(
        (
            Part(
                f"the smallest gap F_s - F_c at which the stage keeps moving is about {_GAP:g} N (from "
                f"{_GAP / words.about:.2g} to "
                f"{_GAP * words.about:.2g} N)",
                bool(_GAP / words.about <= smallest <= _GAP * words.about),
                f"smallest gap {smallest:.2g} N" if moving.any() else "no cell keeps moving",
                printed=_GAP,
                read=smallest,
                undecided=beside(smallest, (_GAP / words.about, _GAP * words.about), error),
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
    words = reading()
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
    return Finding(
        (
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
                f"with alpha {trend_text(with_alpha)} over those that keep moving, "
                f"{trend_text(with_alpha_all)} over all",
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
    )


def _mean_rank_correlation(x: np.ndarray, y: np.ndarray, moving: np.ndarray) -> float:
    """Return the mean rank correlation of the rows of x and y, over the cells that keep moving.

    All arrays have one shape. The result is NaN if no row has a correlation.
    """
    trends = np.array([trend(*pair) for pair in ((a[h], b[h]) for a, b, h in zip(x, y, moving, strict=True))])
    return float(trends[np.isfinite(trends)].mean()) if np.isfinite(trends).any() else np.nan
