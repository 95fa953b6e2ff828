"""Show `friso rig stroke-crossover`: Fig. 26 of the thesis, fractions of rails with peaks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from friso.hunting.criteria import PEAK_CRITERION
from friso.questions.map.words import QUIET
from friso.questions.rig.experiments.hunting import CRITERIA, runs_document, share_document
from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.colours import ramp
from friso.shown.drawing.figure import Axis, Figure, Map, Panel, Series
from friso.shown.drawing.palette import INK
from friso.shown.drawing.prefixes import with_unit
from friso.studies.rig.outcome import Outcome
from friso_thesis.studies.rig.stroke_crossover import StrokeCrossover


def sentences(outcome: Outcome) -> list[str]:
    """Say from which crossover and which stroke on no rail has any counted peaks."""
    counts: StrokeCrossover = outcome.result
    count, cells = len(counts.rails), counts.share
    shown = np.isfinite(cells) & (cells > 0)
    if not shown.any():
        return [f"On none of {count} rails are peaks counted, at any stroke or crossover."]
    first = (
        f"In {shown.sum()} of {shown.size} cells peaks are counted on at least one of {count} rails, in "
        f"{(cells >= 0.5).sum()} on at least half of them."
    )
    return [first, *_needed(counts)]


def _limit(counts: StrokeCrossover, row: int) -> str:
    limit = counts.limits[row]
    if limit == 0:
        return "no peaks"
    return "peaks up to the highest crossover" if np.isinf(limit) else f"none above {limit:.3g} Hz"


def _needed(counts: StrokeCrossover) -> list[str]:
    """Say where counted peaks end, in crossover by stroke, and in stroke at the own crossover."""
    named = [f"{with_unit(float(stroke), 'm')} {_limit(counts, row)}" for row, stroke in enumerate(counts.strokes)]
    lines = [f"Counted peaks by stroke: {'; '.join(named)}."]
    rows = np.flatnonzero(counts.share[:, counts.nearest] > 0)
    if len(rows) and rows[-1] + 1 < len(counts.strokes):
        least = float(counts.strokes[rows[-1] + 1])
        lines.append(
            f"At {counts.crossovers[counts.nearest]:.3g} Hz no peaks are counted from a stroke of "
            f"{with_unit(least, 'm')} up."
        )
    return lines


def figures(outcome: Outcome) -> list[Figure]:
    """Draw the map of rails with counted peaks, over stroke and crossover."""
    counts: StrokeCrossover = outcome.result
    finite = np.isfinite(counts.limits) & (counts.limits > 0)
    border = Series(counts.strokes[finite], counts.limits[finite], "no counted peaks above", INK, width=2.0)
    panel = replace(rails_panel(counts), series=(border,))
    caption = f"Each cell: {len(counts.rails)} rails, one move each, {PEAK_CRITERION} (Fig. 26: of one run)."
    return [Figure("stroke_crossover", "Joint free: rails with counted peaks", caption, (panel,))]


def rails_panel(counts: StrokeCrossover) -> Panel:
    """Return the map of the number of rails with counted peaks.

    Lighter cells have fewer such rails; cells without any have the colour of rest.
    """
    count = len(counts.rails)
    label, colours = f"Rails with counted peaks, of {count}", (QUIET, *ramp(count)[::-1])
    field = Map(counts.strokes, counts.crossovers, count * counts.share.T, label, "", colours=colours)
    return Panel("", Axis("Stroke", "m", log=True), Axis("Crossover", "Hz"), (), maps=(field,))


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return all results for the JSON document.

    Arrays have the shape (strokes, crossovers, rails); fractions of rails have the shape (strokes, crossovers).
    """
    counts: StrokeCrossover = outcome.result
    shares = [
        [share_document(counts.runs.share((row, column))) for column in range(len(counts.crossovers))]
        for row in range(len(counts.strokes))
    ]
    axes = {"strokes_m": counts.strokes, "crossovers_hz": counts.crossovers, "rail_seeds": counts.rails}
    return {"criteria": CRITERIA, **axes, "counted": shares, "limits_hz": counts.limits, **runs_document(counts.runs)}


VIEW = OutcomeView(sentences, figures, numbers)
