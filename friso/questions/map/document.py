"""Build the JSON document of `friso map`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr

from friso.questions.map.findings import answers, loop_first, statements
from friso.questions.map.words import text_counts, word_counts
from friso.shown.documents import plain_json
from friso.studies.edges import MapEdges, OwnLine
from friso.studies.study import Study


def map_document(
    runs: xr.Dataset, study: Study, store: Path | None, metric: str, edges: MapEdges | None = None
) -> dict[str, Any]:
    """Return the axes and the results."""
    criteria = {name: text for name in map(str, runs.data_vars) if (text := runs[name].attrs.get("criterion"))}
    document = {
        "stage": study.stage.name,
        "store": str(store) if store else None,
        "axes": {
            axis.name: {
                "points": len(axis.values),
                "unit": axis.unit,
                "first": axis.values[0].item(),
                "last": axis.values[-1].item(),
            }
            for axis in study.axes
        },
        "cells": study.cells,
        "rtol": study.rtol,
        "conclusion": " ".join([*loop_first(study.stage), *answers(runs, metric, edges), *statements(runs, metric)]),
        "edges": [] if edges is None else [_own_line(line) for line in edges.own],
        "outcomes": word_counts(runs, "outcome"),
        "verdicts": word_counts(runs, "verdict") or None,
        "sketched_verdicts": word_counts(runs, "sketch") or None,
        "attractors": text_counts(runs, "attractor") or None,
        "criteria": criteria,
    }
    return plain_json(document)


def _own_line(line: OwnLine) -> dict[str, Any]:
    """Return where hunting begins and ends along an axis, at the stage's own value of the other: values in SI."""
    return {"axis": line.key, "own": line.own, "hunts": line.attracts, "changes": line.changes.tolist()}
