"""Simulate one run: the response of a stage to its motion, or a cell of a study."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.engine.arrays import Status
from friso.engine.batch import SIMULATION_RTOL
from friso.errors import InputError
from friso.hunting.measures import Measures, measured_run
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import Changes, StageLike, TimeLike, Tolerance
from friso.progress import Progress, silent
from friso.quantities import Quantity, positive
from friso.stage import Stage
from friso.stage.rig import AS_BUILT, is_as_built

if TYPE_CHECKING:
    import os

    import xarray as xr

    from friso.hunting import Dwell
    from friso.shown.blocks import Files
    from friso.studies.study import Study


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
        from friso.questions.simulate.blocks import simulate_files

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
