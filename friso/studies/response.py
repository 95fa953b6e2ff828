"""One run of a stage, measured as the runs of a sweep are."""

from __future__ import annotations

from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting.measures import Measures, measure, options
from friso.stage import Stage


def measured_run(stage: Stage, rtol: float = 1e-6) -> Measures:
    """What the run of a stage's motion does, arrays of shape (1,); whatever the sampling interval of a time response,
    the turning points of the run itself decide. Raises ValueError for a tolerance that is not usable."""
    flat = stage.flat()
    (runs,) = run_chunks(kernel(structure(flat)), flat, 1, options(rtol))
    return measure(flat, runs)
