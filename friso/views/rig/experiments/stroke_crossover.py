"""What `friso rig stroke-crossover` shows: Fig. 26 of the thesis with a share of rails in each cell."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.studies.rig.experiments.stroke_crossover import StrokeCrossover
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import INK, Axis, Figure, Map, Panel, Series
from friso.views.drawing.prefixes import with_unit
from friso.views.rig.experiments.hunting import runs_document, share_document
from friso.views.rig.outcome_view import OutcomeView


def sentences(outcome: Outcome) -> list[str]:
    """From which crossover and stroke on no rail hunts."""
    it: StrokeCrossover = outcome.result
    count, cells = len(it.rails), it.share
    hunting = np.isfinite(cells) & (cells > 0)
    if not hunting.any():
        return [f"No rail of {count} hunts at any stroke or crossover."]
    first = (
        f"In {hunting.sum()} of {hunting.size} cells at least one of {count} rails hunts, in {(cells >= 0.5).sum()} "
        "at least half of them do."
    )
    return [first, *_needed(it)]


def _limit(it: StrokeCrossover, row: int) -> str:
    limit = it.limits[row]
    if limit == 0:
        return "no rail hunts"
    return "rails hunt up to the highest crossover" if np.isinf(limit) else f"none hunts above {limit:.3g} Hz"


def _needed(it: StrokeCrossover) -> list[str]:
    """The crossover limits by stroke, and from which stroke on no rail hunts at the stage's own crossover."""
    named = [f"{with_unit(float(stroke), 'm')} {_limit(it, row)}" for row, stroke in enumerate(it.strokes)]
    found = [f"By stroke: {'; '.join(named)}."]
    hunting = np.flatnonzero(it.share[:, it.own] > 0)
    if len(hunting) and hunting[-1] + 1 < len(it.strokes):
        least = float(it.strokes[hunting[-1] + 1])
        found.append(f"At {it.crossovers[it.own]:.3g} Hz no rail hunts from a stroke of {with_unit(least, 'm')} on.")
    return found


def figures(outcome: Outcome) -> list[Figure]:
    """The map."""
    it: StrokeCrossover = outcome.result
    finite = np.isfinite(it.limits) & (it.limits > 0)
    border = Series(it.strokes[finite], it.limits[finite], "no rail hunts above", INK, width=2.0)
    field = Map(it.strokes, it.crossovers, it.share.T, "Share of rails that hunts", "", limits=(0.0, 1.0))
    panel = Panel("", Axis("Stroke", "m", log=True), Axis("Crossover", "Hz"), (border,), maps=(field,))
    caption = f"Each cell: {len(it.rails)} rails, one move each, the thesis's metric (Fig. 26 counts peaks of one run)."
    return [Figure("stroke_crossover", "Joint free: share of rails that hunts", caption, (panel,))]


def numbers(outcome: Outcome) -> dict[str, Any]:
    """All that was found; arrays have the shape (strokes, crossovers, rails), shares (strokes, crossovers)."""
    it: StrokeCrossover = outcome.result
    shares = [
        [share_document(it.runs.share((row, column))) for column in range(len(it.crossovers))]
        for row in range(len(it.strokes))
    ]
    axes = {"strokes_m": it.strokes, "crossovers_hz": it.crossovers, "rail_seeds": it.rails}
    return {**axes, "hunts": shares, "limits_hz": it.limits, **runs_document(it.runs)}


VIEW = OutcomeView(sentences, figures, numbers)
