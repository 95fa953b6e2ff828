"""What `friso map` is asked for and answers: the study, what it would cost, files, sentences, the JSON document."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.cli.common import key_values
from friso.errors import InputError
from friso.stage import Stage
from friso.studies.cells import BY_CYCLES, CYCLE_UNITS, USUAL
from friso.studies.execute import Crew
from friso.studies.refine import FINER, SHARE, finer
from friso.studies.request import Request
from friso.studies.samples import Samples
from friso.studies.study import Study, study_of

if TYPE_CHECKING:
    import xarray as xr

AXIS_EXAMPLE = '--x controller.crossover="1 Hz..40 Hz:41"'

BYTES = 8
"""Bytes of a number in a store, before they are compressed."""


@dataclass(frozen=True)
class Varied:
    """The options that say what is varied, as they were given."""

    x: str | None = None
    y: str | None = None
    more: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    samples: int | None = None
    latin: bool = False
    log: bool = False

    @property
    def axes(self) -> dict[str, str]:
        """Name to range of every axis. Raises InputError."""
        named = {"--x": self.x, "--y": self.y} | {f"--axis {k + 1}": text for k, text in enumerate(self.more)}
        return key_values([(option, text) for option, text in named.items() if text is not None], AXIS_EXAMPLE)

    @property
    def linked(self) -> dict[str, str]:
        """Key to expression of every link. Raises InputError."""
        return key_values([("--link", text) for text in self.links], '--link masses.cart="0.7 * mass"')


def study_for(stage: Stage, varied: Varied, metric: str, refine: bool, most: int | None, crew: Crew) -> Study:
    """The study asked for. Raises InputError, also if it has more than `most` cells: then with what it would cost."""
    axes, links = varied.axes, varied.linked
    if not axes:
        raise InputError("--x", "no axis", "one axis or more", AXIS_EXAMPLE)
    samples = None
    if varied.samples is not None and len(axes) == 1:
        raise InputError("--samples", "samples of one key", "two keys or more; for one, a range with its points")
    if varied.samples is not None:
        axes, samples = {}, Samples(axes, varied.samples, "latin" if varied.latin else "sobol")
    elif varied.latin:
        raise InputError("--latin", "no --samples beside it", "how many samples", "--samples 1024 --latin")
    request = Request(stage, axes, samples, links, varied.log)
    runs = int(request.size() * (SHARE * FINER ** len(axes) if refine else 1))
    if most is not None and runs > most:
        raise _too_large(runs, request.trial(), crew)
    wanted = (*USUAL, *CYCLE_UNITS) if metric in (*BY_CYCLES, "period") else USUAL
    wanted = (*wanted, "verdict") if metric == "verdict" else wanted
    study = _with_metric(request.study(wanted), metric)
    return finer(study) if refine else study


def stored_study(store: Path, metric: str) -> Study:
    """The study of a store that is gone on with. Raises InputError."""
    from friso.studies.store import read_store

    with read_store(store) as runs:
        return _with_metric(study_of(runs), metric)


def _with_metric(study: Study, metric: str) -> Study:
    """The study, if it has that metric. Raises InputError."""
    if metric not in study.metrics or metric == "status":
        expected = f"one of {', '.join(name for name in study.metrics if name != 'status')}"
        raise InputError("--metric", metric, expected, "--metric peak_to_peak")
    return study


def coloured_by(study: Study, metric: str) -> str:
    """The variable that colours the map: "period" is that of the hunting cycle, where the study has it."""
    return "cycle_period" if metric == "period" and study.cycles else metric


def _too_large(runs: int, trial: Study, crew: Crew) -> InputError:
    """What a study of so many runs would cost, by a trial of a few of its cells."""
    from friso.studies.execute import run_scattered

    run_scattered(trial, np.arange(crew.size), crew)  # has the kernels compiled
    start = time.perf_counter()
    run_scattered(trial, np.arange(trial.cells), crew)
    hours = (time.perf_counter() - start) / trial.cells * runs / 3600
    gigabytes = BYTES * len(trial.metrics) * runs / 1e9
    given = f"{runs:.3g} runs: about {hours:.2g} hours on this machine, and up to {gigabytes:.2g} GB of disk"
    return InputError("--yes", given, "--yes, or fewer points; nothing was run", "--yes")


def write_views(runs: xr.Dataset, store: Path, metric: str) -> list[Path]:
    """The figure and the page of a map, beside its store."""
    from friso.views.map.page import write_map_page

    paths = _view_paths(store)
    _save_figure(runs, metric, paths[:-1])
    write_map_page(runs, paths[-1], metric, f"friso simulate --cell {store} {{indices}}")
    return paths


def _save_figure(runs: xr.Dataset, metric: str, paths: list[Path]) -> None:
    from friso.views.drawing.matplotlib_renderer import save
    from friso.views.map.figures import map_figure

    figure = map_figure(runs, metric)
    for path in paths:
        save(figure, path)


def refuse_overwriting(store: Path, exports: list[Path]) -> None:
    """Refuse to write over files that are no earlier result of this study. Raises InputError."""
    for path in exports if store.exists() else [*_view_paths(store), *exports]:
        if path.exists() or path == store:
            raise InputError(
                "--out", f"{path} already exists", "another name; nothing was overwritten", "--out new.zarr"
            )


def _view_paths(store: Path) -> list[Path]:
    from friso.views.drawing.matplotlib_renderer import FORMATS

    stem = store.with_suffix("") if store.suffix == ".zarr" else store
    return [stem.with_name(f"{stem.name}.{form}") for form in (*FORMATS, "html")]


def write_exports(runs: xr.Dataset, paths: list[Path]) -> list[Path]:
    """The study as NetCDF or CSV, by the suffix."""
    from friso.studies.export import export

    for path in paths:
        export(runs, path)
    return paths


def sentences(runs: xr.Dataset, study: Study, metric: str) -> list[str]:
    """What was found, for the terminal: first what share of the map swings, and where."""
    from friso.views.map.findings import caveats, failures, headline, verification
    from friso.views.map.words import KINDS, word_counts

    words = "; ".join(
        ", ".join(f"{count} {word}" for word, count in counts.items())
        for name in KINDS
        if (counts := word_counts(runs, name))
    )
    size = " x ".join(map(str, study.shape))
    reasons = [f"{count} without result: {reason}" for reason, count in failures(runs).items()]
    extent = f"{study.stage.name or 'stage'}: {size} cells at rtol {study.rtol:g}: {words}"
    return [headline(runs, metric), extent, verification(runs), *caveats(runs, metric), *reasons]


def document(runs: xr.Dataset, study: Study, store: Path, metric: str, files: list[Path]) -> dict[str, Any]:
    """The JSON document of `map`."""
    from friso.views.map.findings import headline
    from friso.views.map.words import word_counts

    criteria = {name: text for name in map(str, runs.data_vars) if (text := runs[name].attrs.get("criterion"))}
    verified = {name: runs.attrs[f"verified_{name}"] for name in ("cells", "surviving", "rtol") if _verified(runs)}
    return {
        "stage": study.stage.name,
        "store": str(store),
        "axes": {
            axis.name: {"points": len(axis.values), "unit": axis.unit, "first": _plain(axis.values[0])}
            | {"last": _plain(axis.values[-1])}
            for axis in study.axes
        },
        "cells": study.cells,
        "rtol": study.rtol,
        "conclusion": headline(runs, metric),
        "outcomes": word_counts(runs, "outcome"),
        "verdicts": word_counts(runs, "verdict") or None,
        "criteria": criteria,
        "verified": verified or None,
        "files": [str(path) for path in files],
    }


def _verified(runs: xr.Dataset) -> bool:
    return "verified_cells" in runs.attrs


def _plain(value: Any) -> Any:
    plain = value.item()
    return plain if not isinstance(plain, float) or math.isfinite(plain) else None
