"""Simulate one run: the response of a stage to its motion, or a cell of a study.

One sentence says what the run does, and one block of `friso simulate` shows it. A time response is written into files.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import SIMULATION_RTOL
from friso.equations.motion import ends_evenly, rests
from friso.errors import InputError
from friso.hunting.criteria import CREEPS, OUTCOME_CRITERION, RESTS, SWINGS
from friso.hunting.measures import LAST_QUARTER, Measures, measured_run
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, StageLike, TimeLike, Tolerance
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive
from friso.shown.blocks import AnswerBlock, Content, Files, image_files
from friso.shown.documents import dwells_document, plain_json
from friso.shown.motion_words import dwell_sentences, motion_sentences, off_its_reference
from friso.shown.text import listed, swing_with_unit, with_unit
from friso.stage import Stage
from friso.stage.rig import AS_BUILT, is_as_built

if TYPE_CHECKING:
    import os

    import xarray as xr

    from friso.hunting import Dwell
    from friso.studies.study import Study


GROWTH_RATIO = 1.1
"""Ratio of errors in the last quarter of a run and before it, above which the run counts as diverging."""


def conclusion(
    name: str, measures: Measures, deviation: np.ndarray, moves_on: bool = False, evenly: bool = True
) -> str:
    """Say what the run of a stage does.

    `moves_on` is true if the reference moves at the end, and `evenly` if its velocity is then constant. `deviation` has
    evenly timed samples of the deviation from the reference [m], shape (n,).
    """
    before, late = np.split(np.abs(deviation), [int(LAST_QUARTER * len(deviation))])
    middle = 0.0 if moves_on else _value(measures.offset)
    grows = bool(late.max() > GROWTH_RATIO * before.max(initial=0.0))
    clauses = {
        SWINGS: lambda: (
            f"swings {swing_with_unit(_value(measures.peak_to_peak) / 2, middle, 'm')} every "
            f"{with_unit(_value(measures.period), 's')} at the end of the run{', and ever farther' if grows else ''}"
        ),
        CREEPS: lambda: _restless(float(late.max()), float(late[-1]), _value(measures.peak_to_peak), grows),
        RESTS: lambda: f"rests {_settling(measures)}",
    }
    outcome = str(measures.outcome[0])
    if outcome not in clauses:
        return f"{name}: the run was not completed ({Status(int(measures.status[0])).text})."
    if moves_on:
        swings = f"; its deviation {clauses[SWINGS]()}" if outcome == SWINGS and evenly else ""
        return f"{name} {off_its_reference(float(late.max()), float(np.sqrt(np.mean(late**2))))}{swings}."
    return f"{name}: {clauses[outcome]()}."


def built_sentence(stage: Stage) -> str:
    """Say which properties of the machine as built the run includes."""
    tables = listed([f"[{name}]" for name in AS_BUILT if getattr(stage, name)], "and")
    what = f", with {tables}" if tables else ""
    return f"The drive ran as built, sample by sample{what}; --continuous leaves that out."


def _restless(farthest: float, final: float, moved: float, grows: bool) -> str:
    """Describe a run that is off its reference at the end but does not swing.

    In the last quarter, the stage was off by at most `farthest` [m], and its peak-to-peak motion was `moved` [m]. At
    the end it is off by `final` [m]. `grows` is true if the deviation keeps growing.
    """
    if grows:
        return (
            f"goes ever farther off its reference, by up to {with_unit(farthest, 'm')} in the last quarter of the run"
        )
    end = f"{with_unit(final, 'm')} off its reference at the end of the run, without a lasting swing"
    return f"creeps: {end}" if moved < final else f"does not come to rest: {end}"


def _settling(measures: Measures) -> str:
    """Write how long after the last corner of the reference the stage stays within the bands.

    Settling at the far end of a move there and back is named if it takes longer.
    """
    (fine, coarse), (last_fine, last_coarse) = (
        tuple(map(_value, times)) for times in (measures.settling_time, measures.in_the_end)
    )
    small, wide = (with_unit(band, "m") for band in measures.bands)
    text = f"within {wide} of its reference, {with_unit(last_coarse, 's')} after its last corner"
    if not np.isnan(last_fine):
        text = f"{text}; within {small} after {with_unit(last_fine, 's')}"
    if np.isnan(coarse):
        return f"{text}; not within {wide} at the far end before it returned"
    if np.isnan(fine) and not np.isnan(last_fine):
        return f"{text}; not within {small} at the far end before it returned"
    far = f"{with_unit(coarse, 's')} and {with_unit(fine, 's')}" if fine > last_fine else with_unit(coarse, "s")
    return f"{text} (at the far end {far})" if coarse > last_coarse or fine > last_fine else text


def _value(array: np.ndarray) -> float:
    """Return the only number of an array."""
    return float(array[0])


def simulate_document(
    response: xr.Dataset, measures: Measures, name: str, conclusion: str, dwells: Sequence[Dwell]
) -> dict[str, Any]:
    """Return the JSON document of a run: what it does, and how the solver fared.

    `name` is the name of the stage.
    """
    into_fine, into_coarse = measures.settling_time
    return plain_json(
        {
            "conclusion": conclusion,
            "stage": name,
            "outcome": measures.outcome[0],
            "criterion": OUTCOME_CRITERION,
            "peak_to_peak_m": measures.peak_to_peak[0],
            "period_s": measures.period[0],
            "bands_m": measures.bands,
            "settling_time_s": into_fine[0],
            "settling_time_10um_s": into_coarse[0],
            **({"dwells": dwells_document(dwells)} if dwells else {}),
            "solver": {key: response.attrs[key] for key in ("status", "steps", "rejected", "rtol")},
        }
    )


class SimulateAnswer(Answer):
    """A time response; `result` is the Dataset over `time` [s].

    A variable is read as ``answer["position"]``.
    """

    stage: Stage
    name: str
    of_cell: bool

    @property
    def data(self) -> xr.Dataset:
        """Return the response over time: position, error, force, friction and more."""
        return self.result

    @property
    def as_built(self) -> bool:
        """Tell whether the drive ran as built, sample by sample, in the machine's surroundings."""
        return "as_built" in self.result.attrs

    @cached_property
    def measures(self) -> Measures:
        """Return measures of the run's end, such as outcome, swing and settling time."""
        if self.as_built:
            from friso.virtual_rig.run import measured_response

            return measured_response(self.stage, self.result)
        return measured_run(self.stage, self.result.attrs["rtol"])

    @cached_property
    def dwells(self) -> Sequence[Dwell]:
        """Return how the stage settles at each standstill of its reference, if it has more than two."""
        from friso.equations.motion import stands
        from friso.hunting import dwells, dwells_of_trace

        if len(stands(self.stage.flat())) <= 2 or self.failure:
            return ()
        if self.as_built:
            deviation = (self.result["position"] - self.result["reference"]).to_numpy()
            return dwells_of_trace(self.stage, self.result["time"].to_numpy(), deviation)
        return dwells(self.stage, self.result.attrs["rtol"])

    @property
    def failure(self) -> str:
        """Say that the run stopped early; empty if it did not."""
        done = self.result.attrs["status"] == Status.DONE.text
        return "" if done else "the computation could not be completed; see the status above"

    @property
    def subject(self) -> SimulateAnswer:
        """Return the answer itself, which measures the response."""
        return self

    def files(self) -> Files:
        """Return NetCDF, CSV and the figure; for a cell, its stage file as well."""

        files = simulate_files(self.result, f"{self.name}_response")
        return {**files, f"{self.name}.toml": self.stage.to_toml()} if self.of_cell else files


@question
def simulate(
    stage: Sequence[int | str] | StageLike | None = None,
    rtol: Tolerance | None = None,
    sample_time: TimeLike | None = None,
    *,
    set: Changes = None,
    cell: str | os.PathLike[str] | None = None,
    continuous: bool = False,
    progress: Progress = silent,
) -> SimulateAnswer:
    """What does one run do: the time response of a stage to its motion, as NetCDF, CSV and a plot.

    A stage with [drive], [rail], [cable] or [floor] runs as built: the drive samples, waits and saturates, and friction
    varies along the rail.

    Parameters
    ----------
    stage : Stage, path or dict
        The stage, its file, or its tables; with --cell, the numbers of the cell: 3 4.
    rtol : float, optional
        Relative tolerance of the solver; default: 1e-9, of a drive as built 1e-4, or that of the study.
    sample_time : str or float, optional
        Sampling interval, "1 ms" or a number [s], of a drive as built a whole number of its samples; default: about
        the duration over 20 000.
    cell : path, optional
        Run a single cell of this study again.
    continuous : bool
        Run the controller in continuous time, without [drive], [rail], [cable] and [floor].

    Returns
    -------
    SimulateAnswer
        The response over `time` [s], an xarray.Dataset: ``answer["position"]``, ``answer.data``.

    Raises
    ------
    InputError
        For a stage, a cell or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> response = friso.simulate(friso.example("lugre_stick_slip"), sample_time="10 ms")
    >>> response["position"].attrs["units"]
    'm'
    """
    interval = (
        None if sample_time is None else inputs.quantity_of(sample_time, "sample_time", Quantity("s", positive, "1 ms"))
    )
    tolerance = None if rtol is None else inputs.tolerance_of(rtol)
    if cell is None:
        source: Any = stage
        if isinstance(stage, list | tuple) and len(stage) == 1:
            source = stage[0]  # as given on the command line
        if source is None or isinstance(source, list | tuple):
            raise InputError(
                "STAGE.toml", " ".join(map(str, source or [])), "one stage file", "friso simulate rig.toml"
            )
        left_out = AS_BUILT if continuous else ()
        chosen, name, usual = inputs.read_stage(source, set, leaves_out=left_out), inputs.stem_of(source), None
    else:
        from friso.studies.cells import runs_as_built

        if not isinstance(stage, list | tuple | None):
            raise InputError(
                "STAGE.toml", "a stage beside --cell", "the numbers of a cell", "friso.simulate([3, 4], cell=...)"
            )
        index = list(stage or ())
        chosen, name, study = _cell(Path(cell), [str(number) for number in index], set)
        continuous = continuous or not runs_as_built(chosen, study.metrics)  # as the study ran it
        usual = study.rtol if continuous else None
    from friso.engine.batch import simulate as simulated

    inputs.mention_unstable_loop(chosen)
    if is_as_built(chosen) and not continuous:
        from friso.virtual_rig.run import response as run_as_built

        response = run_as_built(chosen, tolerance or usual, interval)
    else:
        response = simulated(chosen, tolerance or usual or SIMULATION_RTOL, interval)
    return SimulateAnswer(response, stage=chosen, name=name, of_cell=cell is not None)


def _cell(store: Path, numbers: list[str], changes: Changes) -> tuple[Stage, str, Study]:
    """Return the stage of a cell with the user's `changes`, a name for its files, and its study.

    Raises InputError for `numbers` that name no cell of the study.
    """
    from friso.studies.store import read_store
    from friso.studies.study import study_of

    study = study_of(read_store(store))
    sizes = ", ".join(f"{name} 0 to {size - 1}" for name, size in zip(study.names, study.shape, strict=True))
    index = [int(text) if text.isascii() and text.isdigit() else -1 for text in numbers]
    inside = len(index) == len(study.shape) and all(0 <= k < n for k, n in zip(index, study.shape, strict=True))
    if not inside:
        raise InputError(f"--cell {store}", " ".join(numbers), f"one number per axis: {sizes}", "3 4")
    name = f"{store.with_suffix('').name}_cell_{'_'.join(numbers)}"
    return inputs.stage_of(study.cell_stage(index), changes), name, study


def blocks(run: SimulateAnswer) -> list[AnswerBlock]:
    """Return the block that says what the run does, and how it settles at each standstill."""
    from friso.questions.check.figures import response_figure  # xarray takes long to import

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
    from friso.questions.check.figures import response_figure  # as above

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
