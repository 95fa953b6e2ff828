"""Judge Fig. 14: stiffness of the joint, damping of its limiter, and stroke."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, Response, beside, judges
from friso_thesis.studies.thesis.maps import begins, ends, limit_error, sizes, trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import reading

if TYPE_CHECKING:
    import xarray as xr

_NEEDED = 1e-4
"""Stroke [m] that the isolator needs with a strongly damped limiter (Sec. 4.1)."""

_SMALL_DAMPING = 1.0
"""Limiter damping [N s/m] below which the stroke is reported for comparison."""


@judges("F14A", figure="14A", needs=("isolator-stiffness", "locked"))
def stiffness_has_a_limit(evidence: Evidence) -> Finding:
    """Judge the stiffness above which the isolated rig keeps moving, at each stroke."""
    words = reading()
    runs = evidence.maps["isolator-stiffness"]
    stiffness, stroke, moving, _ = verdict_table(runs, "joint.stiffness", "joint.stroke")
    limits = begins(stiffness, moving, sizes(runs, "joint.stiffness", "joint.stroke"))
    works = ~moving[0]  # strokes at which the softest joint of the range comes to rest
    rises = trend(stroke[works], limits[works])
    shortest = stroke[works][0] * 1e3 if works.any() else np.nan
    span = f"{limits[works][0]:.0f} N/m at {shortest:.2g} mm, {limits[-1]:.0f} N/m at {stroke[-1] * 1e3:.2g} mm"
    force = limits[works] * stroke[works]
    static = evidence.rig.flat()["friction.static"]
    why = (
        f"The force at full stroke, on which the thesis bases its argument, does not set the limit: there the joint "
        f"carries {force.min():.2g} to {force.max():.2g} N at its stroke, with a static friction of {static:g} "
        "N. Below "
        f"{shortest:.2g} mm the stage keeps moving even with the softest joint of the range."
        if works.any()
        else ""
    )
    return Finding(
        (
            Part(
                "at the largest stroke the stage comes to rest with the softest joint and keeps moving with the "
                "stiffest",
                bool(not moving[0, -1] and moving[-1, -1]),
                f"limit {limits[-1]:.0f} N/m"
                if moving[:, -1].any()
                else "comes to rest at every stiffness of the range",
            ),
            Part(
                "the limit rises as the stroke gets smaller, over the strokes at which the stage comes to rest with "
                f"the softest joint (rank correlation with the stroke at most {-words.trend:g})",
                rises <= -words.trend,
                f"rank correlation {trend_text(rises)}: {span}"
                if works.any()
                else "comes to rest with the softest joint at no stroke",
                why if rises >= words.trend else "",
            ),
            _locked_at_no_stroke(runs, evidence.responses["locked"]),
        )
    )


def _locked_at_no_stroke(runs: xr.Dataset, locked: Response) -> Part:
    """Judge whether the rig with stroke 0 has as many counted peaks as the locked rig."""
    none = runs.sel({"joint.stroke": 0.0})
    peaks, same = int(locked.cell["count"]), none["keeps_moving"].values == locked.cell["keeps_moving"].item()
    counted = none["count"].values
    return Part(
        "at stroke 0 every cell has counted peaks where the locked rig has, and its count within one",
        bool(same.all() and np.nanmax(np.abs(counted - peaks), initial=0.0) <= 1),
        f"{percent(same.mean())} of the cells agree; counts {np.nanmin(counted):g} to {np.nanmax(counted):g} against "
        f"{peaks}"
        if np.isfinite(counted).any()
        else "no counts are known",
    )


@judges("F14B", figure="14B", needs=("isolator-damping", "locked"))
def damped_limiter_needs_stroke(evidence: Evidence) -> Finding:
    """Judge from which stroke runs come to rest with a strongly damped limiter.

    Also judge how this stroke compares with the amplitude of the locked rig.
    """
    words = reading()
    runs, axes = evidence.maps["isolator-damping"], ("joint.stroke", "joint.limiter_damping")
    stroke, damping, moving, _ = verdict_table(runs, *axes)
    needed = np.exp(ends(np.log(stroke), moving, sizes(runs, *axes)))
    large, small = needed[damping >= words.large], needed[damping < _SMALL_DAMPING]
    at_large = float(np.median(large))
    locked = evidence.responses["locked"].cell
    amplitude = float(locked["peak_to_peak"]) / 2
    ratio = at_large / amplitude if bool(locked["keeps_moving"]) else np.nan
    return Finding(
        (
            Part(
                f"with limiter damping of {words.large:g} N s/m and more, the median stroke from which the stage "
                f"comes to rest is "
                f"about {_NEEDED * 1e3:g} mm (from {_NEEDED / words.about * 1e3:.2g} to "
                f"{_NEEDED * words.about * 1e3:.2g} mm)",
                bool(_NEEDED / words.about <= at_large <= _NEEDED * words.about),
                f"stroke needed {at_large * 1e3:.2g} mm{_stripe(stroke, damping, moving)}; with damping below "
                f"{_SMALL_DAMPING:g} N s/m {np.median(small) * 1e3:.2g} mm",
                printed=_NEEDED,
                read=at_large,
                undecided=beside(
                    np.log(at_large),
                    np.log((_NEEDED / words.about, _NEEDED * words.about)),
                    limit_error(np.log(stroke), int((damping >= words.large).sum())),
                ),
            ),
            Part(
                "that stroke is far below the amplitude of the locked rig's cycle (at most "
                f"{1 / words.order:.2g} of it)",
                ratio <= 1 / words.order,
                f"{ratio:.2g} of the amplitude of {amplitude * 1e3:.2g} mm"
                if np.isfinite(ratio)
                else "the locked rig does not hunt",
            ),
        ),
        _by_decade(damping, needed),
    )


def _stripe(stroke: np.ndarray, damping: np.ndarray, moving: np.ndarray) -> str:
    """Say at which strokes runs keep moving although some shorter stroke brings them to rest.

    `stroke` [m] and `damping` [N s/m] are the axes, and `moving` has the shape (strokes, dampings). The text is "" if
    there are no such strokes.
    """
    rests = np.maximum.accumulate(~moving, axis=0)  # the first stroke at which they come to rest
    apart = moving & rests
    if not apart.any():
        return ""
    columns = apart.any(axis=0)
    first = float(np.median(stroke[np.argmax(rests[:, columns], axis=0)]))
    strokes, dampings = stroke[apart.any(axis=1)], damping[columns]
    return (
        f", because of a stripe that keeps moving at strokes of {_span(1e3 * strokes)} mm, damping "
        f"{_span(dampings)} N s/m, above strokes from {1e3 * first:.2g} mm on at which it comes to rest"
    )


def _span(values: np.ndarray) -> str:
    """Return the least and the greatest of the values, or a single value."""
    low, high = _rounded(values.min()), _rounded(values.max())
    return low if low == high else f"{low} to {high}"


def _rounded(value: float) -> str:
    """Write a number to two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def _by_decade(damping: np.ndarray, needed: np.ndarray) -> FindingTable:
    """Return a table of the stroke needed [m], (n,), by decade of limiter damping [N s/m]."""
    decades = np.floor(np.log10(damping * (1 + 1e-9))).clip(max=np.ceil(np.log10(damping[-1])) - 1)
    rows = []
    for decade in np.unique(decades):
        strokes, at = 1e3 * needed[decades == decade], damping[decades == decade]
        rows.append(
            (
                f"{10**decade:g} to {10 ** (decade + 1):g} N s/m",
                f"{np.median(strokes):.2g} mm",
                f"{strokes.min():.2g} mm, at {_rounded(at[strokes.argmin()])} N s/m",
                f"{strokes.max():.2g} mm, at {_rounded(at[strokes.argmax()])} N s/m",
            )
        )
    return FindingTable(("limiter damping", "stroke needed, median", "shortest", "longest"), tuple(rows))
