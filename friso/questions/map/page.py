"""Write the page of a map, which opens offline.

A click on a cell shows its run and the command that repeats it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import xarray as xr

from friso.hunting.criteria import PEAK_RULE
from friso.questions.map.cells import SAMPLE, axes_of
from friso.questions.map.data import page_data, picked
from friso.questions.map.figures import map_figure
from friso.questions.map.findings import answers, caveats, failures, hatching, headline, meanings
from friso.questions.map.places import SHOWN, machine_of, with_places
from friso.questions.map.words import grouped, tallied, tally, variable
from friso.shown.drawing.figure import IMAGE_FORMATS, Figure
from friso.shown.drawing.images import ON_PAGE, Image, draw_beforehand, save
from friso.shown.drawing.packing import packed_json
from friso.shown.files import Content
from friso.shown.pages import Report, print_image, script
from friso.shown.unknown import unknown_condition
from friso.studies.edges import MapEdges
from friso.studies.traces import Traces

FORMS = (*IMAGE_FORMATS, "html")
"""Suffixes of the files of a map."""

PRINTED = ON_PAGE._replace(noted=False)
"""Image that the page shows when it is printed."""


def map_files(
    runs: xr.Dataset, metric: str, rerun: str, draw: Callable[[], Traces | None], edges: MapEdges | None = None
) -> dict[str, Content]:
    """Return the figure in all formats and the page of a map, by suffix in the order of `FORMS`.

    `rerun` is the command that repeats a run, with {indices} in place of the indices of its cell. `draw` computes the
    runs that the page shows, or None if they are too many. `edges` are those of a map of verdicts.
    """
    figure = marked_figure(runs, metric, edges)
    draw_beforehand([figure], [*map(Image, IMAGE_FORMATS), PRINTED])
    files: dict[str, Content] = {form: partial(save, figure) for form in FORMS[:-1]}
    return {**files, FORMS[-1]: map_html(runs, metric, rerun, draw(), figure, edges)}


def map_html(
    runs: xr.Dataset,
    metric: str,
    rerun: str,
    drawn: Traces | None = None,
    figure: Figure | None = None,
    edges: MapEdges | None = None,
) -> str:
    """Return the page of a sweep, which opens with the variable `metric`.

    `drawn` holds the runs of all cells; the page draws the run of the cell that is chosen. `rerun` is the command that
    repeats a run, with {indices} in place of the indices of its cell: "friso simulate --cell map.zarr {indices}".
    `figure` is the figure of the variable, if it is already drawn, and `edges` are those of its
    verdicts. Raises ValueError if {indices} is missing, or the runs lack axes or the metric.
    """
    if "{indices}" not in rerun:
        raise ValueError(
            f"rerun: got {rerun!r}, expected {{indices}} in it, e.g. 'friso simulate --cell x {{indices}}'"
        )
    figure = figure or marked_figure(runs, metric, edges)
    return Report(
        "map",
        runs.attrs.get("name") or "Unnamed stage",
        stage_file=runs.attrs.get("stage", ""),
        version=runs.attrs.get("friso", ""),
        scripted=True,
        condition=_condition(runs),
        values={
            "answers": answers(runs, metric, edges),
            "shares": headline(runs, metric),
            "hatching": hatching(runs, metric),
            "peak_rule": PEAK_RULE,
            "facts": _facts(runs, metric),
            "thinned": _thinned(runs),
            "undrawn": drawn is None,
            "data": packed_json(page_data(runs, metric, rerun, drawn, figure)),
            "figure": figure,
            "printed": print_image(figure, noted=PRINTED.noted),
            "script": script("map"),
            "rtol": f"{float(runs.attrs['rtol']):g}",
        },
    ).html()


def _condition(runs: xr.Dataset) -> str:
    """Write the condition under which a map holds; "" without unknown values."""
    return unknown_condition(machine_of(runs), [axis.key for axis in axes_of(runs)])


def marked_figure(runs: xr.Dataset, metric: str, edges: MapEdges | None = None) -> Figure:
    """Return the figure of a map; over two axes, with a mark where the swept machine lies."""
    figure, stage = map_figure(runs, metric, edges=edges), machine_of(runs)
    figure = replace(figure, note=_condition(runs) + figure.note)
    keys = [] if SAMPLE in runs.dims else [axis.key for axis in axes_of(runs)]
    return with_places(figure, [(SHOWN, stage)], keys) if stage and len(keys) == 2 else figure


def _facts(runs: xr.Dataset, metric: str) -> list[tuple[str, str]]:
    """Return the table under the map: what was varied, how accurately, and the results."""
    facts = [("Stage", name)] if (name := str(runs.attrs.get("name", ""))) else []
    facts += [(axis.quantity, f"{axis.span()} ({axis.key})") for axis in axes_of(runs)]
    facts.append(("Relative tolerance", f"{float(runs.attrs['rtol']):g}"))
    for name in tallied():
        facts += [(variable(name), words)] if (words := tally(runs, name)) else []
    facts += meanings(runs)
    facts += [("Criterion", text)] if (text := runs[metric].attrs.get("criterion")) and metric not in tallied() else []
    facts += [("Note", " ".join(notes))] if (notes := caveats(runs, metric)) else []
    links = json.loads(runs.attrs.get("links", "{}"))
    facts += [("Links", "; ".join(f"{key} = {text}" for key, text in links.items()))] if links else []
    facts += [(f"Without result: {grouped(number)}", reason) for reason, number in failures(runs).items()]
    return facts


def _thinned(runs: xr.Dataset) -> str:
    """Say which part of a map too large for a page the page holds; empty if it holds all."""
    sizes = [runs.sizes[SAMPLE]] if SAMPLE in runs.dims else [len(axis.places) for axis in axes_of(runs)]
    names = ["samples"] if SAMPLE in runs.dims else [axis.quantity for axis in axes_of(runs)]
    parts = [
        f"{len(indices)} of the {size} values of {name}"
        if name != "samples"
        else f"{len(indices)} of the {size} samples"
        for name, size, indices in zip(names, sizes, picked(runs), strict=True)
        if len(indices) < size
    ]
    return (
        f"In this page: {' and '.join(parts)}, evenly picked; the files of the map hold all of them." if parts else ""
    )
