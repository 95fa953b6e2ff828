"""Judge the isolated rig: joint, limiter and stroke (Fig. 14, 16), masses and friction (15).

Fig. 16, crossover and stroke, is judged at both stiffnesses of the joint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friso.equations.controllers.pid import CROSSOVER
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, Response, beside, judges
from friso_thesis.studies.thesis.maps import (
    begins,
    ends,
    limit_error,
    overlap,
    overlap_text,
    sizes,
    trend,
    trend_text,
    verdict_table,
)
from friso_thesis.studies.thesis.reading import words
from friso_thesis.studies.thesis.studies import SOFT, STUDIES, thesis_rig

if TYPE_CHECKING:
    import xarray as xr

_AXES = (CROSSOVER, "joint.stroke")


@judges("F16A", figure="16A", needs=("isolator-crossover",))
def isolated_rig_needs_crossover(evidence: Evidence) -> Finding:
    """Judge the crossover below which the isolated rig keeps moving, at each stroke."""
    runs = evidence.maps["isolator-crossover"]
    crossover, stroke, moving, valid = verdict_table(runs, *_AXES)
    limits = ends(crossover, moving, sizes(runs, *_AXES))
    long, longest = stroke >= words.long * stroke[-1], stroke >= (1 + words.long) / 2 * stroke[-1]
    shorter, longer = limits[long & ~longest].mean(), limits[longest].mean()
    error = limit_error(crossover, int(longest.sum())) / shorter * 2**0.5
    error = np.hypot(error, 2 * np.hypot(_mean_error(limits[long & ~longest]), _mean_error(limits[longest])) / shorter)
    below = (crossover[:, None] < limits[None, :]) & long[None, :] & valid
    return Finding.of(
        Part(
            f"at every stroke of the upper {percent(1 - words.long)} of the range it keeps moving at some "
            "crossover, and at none from a higher one on",
            bool(moving[:, long].any(axis=0).all() and not moving[-1, long].any()),
            f"mean limit {limits[long].mean():.3g} Hz ({limits[long].min():.3g} to {limits[long].max():.3g} Hz); "
            f"{overlap_text(moving, below)} of the cells below it keep moving",
        ),
        Part(
            "the mean limits over the lower and over the upper half of these strokes differ by at most "
            f"{percent(words.same)}, and the limit of stroke 0 is higher than both",
            bool(abs(shorter - longer) <= words.same * shorter and limits[0] > max(shorter, longer)),
            f"{shorter:.3g} Hz over the lower and {longer:.3g} Hz over the upper half, a difference of "
            f"{percent(abs(shorter - longer) / shorter)} (± {percent(error)}); {limits[0]:.3g} Hz at stroke 0",
            undecided=beside(abs(shorter - longer) / shorter, [words.same], error),
        ),
    )


@judges("F16B", figure="16B", needs=("isolator-crossover", "isolator-crossover-soft"))
def softer_joint_lowers_the_limit(evidence: Evidence) -> Finding:
    """Judge whether a softer joint lowers the crossover from which on the rig comes to rest."""
    names = ("isolator-crossover", "isolator-crossover-soft")
    stiff, soft = (_limits(evidence.maps[name]) for name in names)
    stroke = verdict_table(evidence.maps[names[0]], *_AXES)[1]
    long = stroke >= words.long * stroke[-1]
    drop = (stiff - soft)[long]
    ratio = float(soft[long].mean() / stiff[long].mean())
    crossover = verdict_table(evidence.maps[names[0]], *_AXES)[0]
    error = limit_error(crossover, int(long.sum())) / stiff[long].mean() * 2**0.5
    error = np.hypot(error, 2 * _mean_error(drop) / stiff[long].mean())
    return Finding.of(
        Part(
            f"over the strokes of the upper {percent(1 - words.long)} of the range, the mean limit at "
            f"{SOFT['joint.stiffness']} is lower than at {thesis_rig().flat()['joint.stiffness']:g} N/m by more "
            f"than what is the same ({percent(words.same)})",
            ratio < 1 - words.same,
            f"{soft[long].mean():.3g} against {stiff[long].mean():.3g} Hz: a drop of {percent(1 - ratio)}; lower "
            f"at {percent((drop > 0).mean())} of the strokes, higher at {percent((drop < 0).mean())}",
            undecided=beside(ratio, [1 - words.same], error),
        )
    )


def _mean_error(values: np.ndarray) -> float:
    """Return the standard error of the mean of values, shape (n,), from their scatter."""
    return float(values.std(ddof=1) / len(values) ** 0.5) if len(values) > 1 else 0.0


def _limits(runs: xr.Dataset) -> np.ndarray:
    crossover, _, moving, _ = verdict_table(runs, *_AXES)
    return ends(crossover, moving, sizes(runs, *_AXES))


@judges("F15A", figure="15A", needs=("isolator-masses",))
def mass_ratio_hardly_matters(evidence: Evidence) -> Finding:
    """Judge whether nearly all pairs of masses behave as the thesis's evaluation point does."""
    cart, stage, moving, valid = verdict_table(evidence.maps["isolator-masses"], "masses.cart", "masses.stage")
    marker = STUDIES["isolator-masses"].marker
    row = int(np.argmin(np.abs(cart - marker["masses.cart"])))
    column = int(np.argmin(np.abs(stage - marker["masses.stage"])))
    other = moving != moving[row, column]
    ratio = cart[:, None] / stage[None, :]
    text = f"{percent(overlap(other, valid), 3)} of {valid.sum()} cells differ from the marker's; "
    text += f"cart-to-stage mass ratio {ratio.min():.2g} to {ratio.max():.2g}"
    if (other & valid).any():
        text += f"; the others at {ratio[other & valid].min():.2g} to {ratio[other & valid].max():.2g}"
    return Finding.of(
        Part(
            f"the marker's masses come to rest, and few cells (at most {percent(words.few)}) keep moving",
            bool(not moving[row, column] and overlap(other, valid) <= words.few),
            text,
        )
    )


@judges("F15B", figure="15B", needs=("isolator-friction", "friction"))
def friction_does_not_bring_it_back(evidence: Evidence) -> Finding:
    """Judge whether the isolated rig comes to rest for nearly all pairs of friction forces."""
    axes = ("friction.static", "friction.coulomb")
    runs = evidence.maps["isolator-friction"]
    static, coulomb, moving, valid = verdict_table(runs, *axes)
    _, _, locked, _ = verdict_table(evidence.maps["friction"], *axes)
    back = moving & valid
    where = ""
    if back.any():
        s, c = static[np.nonzero(back)[0]], coulomb[np.nonzero(back)[1]]
        lasting = int((runs["lasts"].transpose(*axes).values & back).sum())
        where = f"Runs keep moving at F_s {s.min():.2g} to {s.max():.2g} N with F_c {c.min():.2g} to {c.max():.2g} N."
        if lasting < back.sum():
            where += f" Of these {back.sum()} runs {lasting} still swing at their end, the others are long transients."
    return Finding.of(
        Part(
            "with the isolator the stage comes to rest for all valid pairs of friction forces but a few (at most "
            f"{percent(words.few)})",
            overlap(back, valid) <= words.few,
            f"{back.sum()} of {valid.sum()} cells keep moving; of the {locked.sum()} that do with the joint locked "
            f"{percent(overlap(moving, locked), 3)}",
            where,
        )
    )


NEEDED_STROKE = 1e-4
"""Stroke [m] that the isolator needs with a strongly damped limiter (Sec. 4.1)."""

_SMALL_DAMPING = 1.0
"""Limiter damping [N s/m] below which the stroke is reported for comparison."""


@judges("F14A", figure="14A", needs=("isolator-stiffness", "locked"))
def stiffness_has_a_limit(evidence: Evidence) -> Finding:
    """Judge the stiffness above which the isolated rig keeps moving, at each stroke."""
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
        "The force at full stroke, on which the thesis bases its argument, does not set the limit: there the joint "
        f"carries {force.min():.2g} to {force.max():.2g} N at its stroke, with a static friction of {static:g} N. "
        f"Below {shortest:.2g} mm the stage keeps moving even with the softest joint of the range."
        if works.any()
        else ""
    )
    return Finding.of(
        Part(
            "at the largest stroke the stage comes to rest with the softest joint and keeps moving with the stiffest",
            bool(not moving[0, -1] and moving[-1, -1]),
            f"limit {limits[-1]:.0f} N/m" if moving[:, -1].any() else "comes to rest at every stiffness of the range",
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
    runs, axes = evidence.maps["isolator-damping"], ("joint.stroke", "joint.limiter_damping")
    stroke, damping, moving, _ = verdict_table(runs, *axes)
    needed = np.exp(ends(np.log(stroke), moving, sizes(runs, *axes)))
    large, small = needed[damping >= words.large], needed[damping < _SMALL_DAMPING]
    at_large = float(np.median(large))
    locked = evidence.responses["locked"].cell
    amplitude = float(locked["peak_to_peak"])
    ratio = at_large / amplitude if bool(locked["keeps_moving"]) else np.nan
    return Finding.of(
        Part(
            f"with limiter damping of {words.large:g} N s/m and more, the median stroke from which the stage comes to "
            f"rest is about {NEEDED_STROKE * 1e3:g} mm (from {NEEDED_STROKE / words.about * 1e3:.2g} to "
            f"{NEEDED_STROKE * words.about * 1e3:.2g} mm)",
            bool(NEEDED_STROKE / words.about <= at_large <= NEEDED_STROKE * words.about),
            f"stroke needed {at_large * 1e3:.2g} mm{_stripe(stroke, damping, moving)}; with damping below "
            f"{_SMALL_DAMPING:g} N s/m {np.median(small) * 1e3:.2g} mm",
            printed=NEEDED_STROKE,
            read=at_large,
            undecided=beside(
                np.log(at_large),
                np.log((NEEDED_STROKE / words.about, NEEDED_STROKE * words.about)),
                limit_error(np.log(stroke), int((damping >= words.large).sum())),
            ),
        ),
        Part(
            "that stroke is far below the amplitude of the locked rig's cycle, peak to peak: “the full range of a "
            f"hunting cycle”, as in Fig. 27 (at most {1 / words.order:.2g} of it)",
            ratio <= 1 / words.order,
            f"{ratio:.2g} of the amplitude of {amplitude * 1e3:.3g} mm peak to peak; of half of it, the other reading "
            f"of amplitude, {2 * ratio:.2g}"
            if np.isfinite(ratio)
            else "the locked rig does not hunt",
        ),
        table=_by_decade(damping, needed),
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
