"""Compute the time response of a stage with its real drive, for `friso simulate`.

The surroundings are included.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import axis_of
from friso.engine.allowance import checked_rtol
from friso.engine.arrays import STATISTICS, Status
from friso.engine.batch import checked_interval, time_axis, usual_interval
from friso.equations.as_built import AsBuilt
from friso.errors import InputError
from friso.hunting.measures import BANDS, Measures, SampledSolver, bands_of, measure_traces
from friso.stage import Stage
from friso.version import VERSION
from friso.virtual_rig.run import RecordedRuns, as_built_keys, run_flat
from friso.virtual_rig.settings import RigSettings
from friso.virtual_rig.task import own_motion

if TYPE_CHECKING:
    import xarray as xr

LOGGED = {"position": ("measured_position", "m", "position that the drive reads"), "force": ("command", "N", "command")}
"""Name, unit and label of each signal that the drive logs besides the true motion."""


def response(stage: Stage, rtol: float | None = None, sample_time: float | None = None, seed: int = 0) -> xr.Dataset:
    """Run a stage's own motion on its real drive, and return its time response.

    Variables over `time` [s] are those of `friso.engine.batch`, the encoder reading and the command. Samples
    coincide with the drive's; by default there are some twenty thousand. Noise is drawn from `seed`. Raises InputError
    for a sample time that is not a multiple of the drive's.
    """
    flat = as_built_keys(stage)
    settings = RigSettings.current()
    drive, duration = flat["drive.sample_time"], flat["motion.duration"]
    usual = max(1, round(usual_interval(duration) / drive)) * drive
    interval = usual if sample_time is None else checked_interval(sample_time, duration)
    tight = nullcontext() if rtol is None else replace(settings, rig_rtol=checked_rtol(rtol)).in_use()
    if (share := interval / drive) < 1 - 1e-9 or abs(share - round(share)) > 1e-6:
        expected = f"a whole number of samples of the drive, {drive:g} s each"
        raise InputError("sample_time", f"{interval:g} s", expected, f"{max(1, round(share)) * drive:g} s")
    with tight:
        (recorded,) = run_flat(flat, stage.floor, own_motion(stage), [seed], interval, outputs=True)
    return _dataset(stage, flat, recorded, settings.rig_rtol if rtol is None else rtol)


def measured_recording(flat: Any, recorded: RecordedRuns, bands: tuple[float, float] = BANDS) -> Measures:
    """Measure recorded runs of stages, given as flat keys: swing, settling into the `bands` [m], outcome and more.

    Where a measure needs the force, it is the one that the drive commanded.
    """
    attempted, rejected = (
        recorded.statistics[:, STATISTICS.index(name)].astype(np.int64) for name in ("attempted", "rejected")
    )
    deviation = recorded.true["position"] - recorded.logged["reference"]
    solver = SampledSolver(recorded.statuses, attempted, rejected)
    return measure_traces(flat, recorded.time, deviation, recorded.logged["force"], solver, bands)


def measured_response(stage: Stage, response: xr.Dataset) -> Measures:
    """Measure the run in a `response` of a stage: swing, settling, outcome and more."""
    time, status = response["time"].to_numpy(), {one.text: one for one in Status}[response.attrs["status"]]
    deviation = (response["position"] - response["reference"]).to_numpy()[None]
    counts = (np.array([value]) for value in (status, response.attrs["steps"], response.attrs["rejected"]))
    flat, command = stage.flat(), response["command"].to_numpy()[None]
    return measure_traces(flat, time, deviation, command, SampledSolver(*counts), bands_of(flat))


def _dataset(stage: Stage, flat: dict[str, Any], recorded: RecordedRuns, rtol: float) -> xr.Dataset:
    """Return the signals of a recorded run over time as a dataset, with units, names and status.

    `rtol` is the solver's relative tolerance, which is stored as an attribute.
    """
    import xarray as xr

    from friso.engine.kernel import kernel
    from friso.virtual_rig.run import METHOD

    kind, shape = axis_of(flat), kernel(AsBuilt.of(flat), method=METHOD)
    assert recorded.outputs is not None
    variables: dict[str, Any] = {
        name: ("time", recorded.outputs[name][0], {"units": kind.unit(unit), "long_name": label})
        for name, (unit, label) in shape.outputs.items()
    }
    for signal, (name, unit, label) in LOGGED.items():
        variables[name] = ("time", recorded.logged[signal][0], {"units": kind.unit(unit), "long_name": label})
    statistics = dict(zip(STATISTICS, recorded.statistics[0], strict=True))
    attrs = {
        "name": stage.name,
        "stage": stage.to_toml(),
        "friso": VERSION,
        "rtol": rtol,
        "status": Status(int(recorded.statuses[0])).text,
        "steps": int(statistics["attempted"]),
        "rejected": int(statistics["rejected"]),
        "as_built": 1,
    }
    return stage.axis_kind.with_units(xr.Dataset(variables, coords=time_axis(recorded.time), attrs=attrs))
