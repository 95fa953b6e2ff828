"""Judge Fig. 16: crossover and stroke of the isolated rig, at both stiffnesses of the joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, beside, judges
from friso_thesis.studies.thesis.maps import ends, limit_error, overlap_text, sizes, verdict_table
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.studies import SOFT, thesis_rig

if TYPE_CHECKING:
    import xarray as xr

_AXES = (CROSSOVER, "joint.stroke")


@judges("F16A", figure="16A", needs=("isolator-crossover",))
def isolated_rig_needs_crossover(evidence: Evidence) -> Finding:
    """Judge the crossover below which the isolated rig keeps moving, at each stroke."""
    words = reading()
    runs = evidence.maps["isolator-crossover"]
    crossover, stroke, moving, valid = verdict_table(runs, *_AXES)
    limits = ends(crossover, moving, sizes(runs, *_AXES))
    long, longest = stroke >= words.long * stroke[-1], stroke >= (1 + words.long) / 2 * stroke[-1]
    shorter, longer = limits[long & ~longest].mean(), limits[longest].mean()
    error = limit_error(crossover, int(longest.sum())) / shorter * 2**0.5
    error = np.hypot(error, 2 * np.hypot(_mean_error(limits[long & ~longest]), _mean_error(limits[longest])) / shorter)
    below = (crossover[:, None] < limits[None, :]) & long[None, :] & valid
    return Finding(
        (
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
    )


@judges("F16B", figure="16B", needs=("isolator-crossover", "isolator-crossover-soft"))
def softer_joint_lowers_the_limit(evidence: Evidence) -> Finding:
    """Judge whether a softer joint lowers the crossover from which on the rig comes to rest."""
    words = reading()
    names = ("isolator-crossover", "isolator-crossover-soft")
    stiff, soft = (_limits(evidence.maps[name]) for name in names)
    stroke = verdict_table(evidence.maps[names[0]], *_AXES)[1]
    long = stroke >= words.long * stroke[-1]
    drop = (stiff - soft)[long]
    ratio = float(soft[long].mean() / stiff[long].mean())
    crossover = verdict_table(evidence.maps[names[0]], *_AXES)[0]
    error = limit_error(crossover, int(long.sum())) / stiff[long].mean() * 2**0.5
    error = np.hypot(error, 2 * _mean_error(drop) / stiff[long].mean())
    return Finding(
        (
            Part(
                f"over the strokes of the upper {percent(1 - words.long)} of the range, the mean limit at "
                f"{SOFT['joint.stiffness']} is lower than at {thesis_rig().flat()['joint.stiffness']:g} N/m by more "
                f"than what is the same ({percent(words.same)})",
                ratio < 1 - words.same,
                f"{soft[long].mean():.3g} against {stiff[long].mean():.3g} Hz: a drop of {percent(1 - ratio)}; lower "
                f"at {percent((drop > 0).mean())} of the strokes, higher at {percent((drop < 0).mean())}",
                undecided=beside(ratio, [1 - words.same], error),
            ),
        )
    )


def _mean_error(values: np.ndarray) -> float:
    """Return the standard error of the mean of values, shape (n,), from their scatter."""
    return float(values.std(ddof=1) / len(values) ** 0.5) if len(values) > 1 else 0.0


def _limits(runs: xr.Dataset) -> np.ndarray:
    crossover, _, moving, _ = verdict_table(runs, *_AXES)
    return ends(crossover, moving, sizes(runs, *_AXES))
