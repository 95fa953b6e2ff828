"""Give the one block of `friso simulate`, and the files of a time response."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from friso.equations.motion import ends_evenly, rests
from friso.questions.check.figures import response_figure
from friso.questions.simulate.words import built_sentence, conclusion, simulate_document
from friso.shown.blocks import AnswerBlock, Content, image_files
from friso.shown.motion_words import dwell_sentences, motion_sentences

if TYPE_CHECKING:
    from friso.questions.simulate.question import SimulateAnswer


def blocks(run: SimulateAnswer) -> list[AnswerBlock]:
    """Return the block that says what the run does, and how it settles at each standstill."""
    response, flat = run.result, run.stage.flat()
    deviation = (response["position"] - response["reference"]).to_numpy()
    name = run.name if run.of_cell else run.stage.name or run.name
    does = conclusion(name, run.measures, deviation, moves_on=not rests(flat), evenly=ends_evenly(flat))
    further = [*dwell_sentences(run.dwells), *motion_sentences(run.stage)]
    return [
        AnswerBlock(
            sentences=[does, *further, *([built_sentence(run.stage)] if run.as_built else [])],
            details=[f"{response.attrs['steps']} steps of the solver, {response.attrs['rejected']} rejected"],
            draw=lambda: [response_figure(response)],
            numbers=lambda: simulate_document(response, run.measures, run.stage.name, does, run.dwells),
        )
    ]


def simulate_files(response: xr.Dataset, stem: str) -> dict[str, Content]:
    """Return NetCDF with everything, CSV with the samples, and PNG with the plot, named `stem`."""
    return {
        f"{stem}.nc": lambda path: response.to_netcdf(path, engine="scipy"),
        f"{stem}.csv": partial(_write_samples, response),
        **image_files(response_figure(response), stem, ["png"]),
    }


def _write_samples(response: xr.Dataset, path: Path) -> None:
    """Write the samples of a response as CSV, with units in the header."""
    samples = response.drop_dims("turning_point", errors="ignore").to_dataframe()
    units = {name: f"{name} [{response[name].attrs['units']}]" for name in samples}
    samples.rename(columns=units).to_csv(path, index_label="time [s]")
