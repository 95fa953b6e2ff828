"""Compare limit cycles from harmonic balance with simulated ones, to show its errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.equations.bandwidth import at_bandwidth
from friso.errors import InputError
from friso.hunting import CYCLE_RTOL, Cycles, Ensemble, find_cycles
from friso.stage import Stage
from friso.stage.arguments import check_arguments
from friso_thesis.studies.describing.balance import single_harmonic
from friso_thesis.studies.describing.function import checked_positive
from friso_thesis.studies.describing.multi import DONE, balanced

if TYPE_CHECKING:
    import xarray as xr

PERIOD_SAMPLES = 16_384
"""Samples per period of the simulated cycle from which balance with several harmonics starts."""

CYCLE = "the symmetric cycle, closed as an orbit: it attracts where the multiplier is below 1 in size, else it repels"
APPROXIMATION = "harmonic balance, an approximation"
PREDICTED = ("solutions", "least_residual")
"""Value of the attribute `of`, and the variables that balance with a single harmonic predicts."""

DEFAULT_HARMONICS = (1, 5, 25, 51, 75, 101, 151, 201, 301, 401)
"""Default orders of the highest harmonic of balance with several harmonics."""


@check_arguments
def harmonic_balance(
    stage: Stage,
    crossovers: Sequence[float] | np.ndarray,
    harmonics: Sequence[int] = DEFAULT_HARMONICS,
    rtol: float = CYCLE_RTOL,
) -> xr.Dataset:
    """Compare the symmetric hunting cycle of a stage by simulation and by harmonic balance.

    The result is a dataset over "crossover", the `crossovers` [Hz]. Balance with several harmonics is also over
    "highest", its highest harmonic, which takes each value of `harmonics`.

    - `period` [s], `amplitude` [m] and `multiplier`, over "crossover": the simulated cycle, attracting or not, closed
      by shooting. What attracts the stage is another question: see `friso.check`.
    - `solutions` and `least_residual`, over "crossover": the number of cycles that balance with a single harmonic
      predicts, and the least residual of that balance (see `friso_thesis.studies.describing.balance`).
    - `period_error` and `amplitude_error`, over both: relative errors of balance with several harmonics, which starts
      from the simulated cycle. They are NaN where balance does not close on a motion; `status` says so.

    Raises InputError for a stage without friction, one whose controller has no crossover, and one without a cycle that
    is its own mirror image.

    Examples
    --------
    >>> import friso, friso_thesis
    >>> locked = friso.load(friso.example("thesis_rig")).replace({"joint.locked": True})
    >>> friso_thesis.harmonic_balance(locked, [6.0, 8.0])  # doctest: +SKIP
    """
    import xarray as xr

    rates = checked_positive("crossovers", crossovers, "4 Hz")
    flat = stage.flat()
    key = stage.controller.bandwidth_key
    if key is None:
        raise InputError("controller", "gains", "a crossover", 'crossover = "8 Hz", alpha = 0.1, beta = 2')
    stages = Ensemble.held(at_bandwidth(flat, rates), len(rates))
    cycles = _symmetric(stages, rtol)
    singles = [single_harmonic(stage.replace({key: f"{rate!r} Hz"})) for rate in map(float, rates)]
    columns = {
        "period": (cycles.period, "s"),
        "amplitude": (cycles.amplitude, "m"),
        "multiplier": (cycles.multiplier, "1"),
    }
    columns |= {
        "solutions": (np.array([len(single.amplitudes) for single in singles]), "1"),
        "least_residual": (np.array([single.least for single in singles]), "1"),
    }
    variables: dict[str, Any] = {
        name: ("crossover", value, {"units": unit, "of": APPROXIMATION if name in PREDICTED else CYCLE})
        for name, (value, unit) in columns.items()
    }
    names, plane = ("period_error", "amplitude_error", "status"), ("crossover", "highest")
    rows = [_errors(stages, cycles, number, harmonics, rtol) for number in range(len(rates))]
    variables |= {
        name: (plane, [[cell[k] for cell in row] for row in rows], {"of": APPROXIMATION})
        for k, name in enumerate(names)
    }
    coords = {"crossover": ("crossover", rates, {"units": "Hz"}), "highest": list(harmonics)}
    return stage.axis_kind.with_units(xr.Dataset(variables, coords, {"stage": stage.to_toml(), "rtol": rtol}))


def _symmetric(stages: Ensemble, rtol: float) -> Cycles:
    """Return the symmetric cycle of every stage, closed as an orbit.

    Raises InputError if a stage has none.
    """
    if not np.all(stages.length > 0):
        raise InputError(
            "friction.model", "no friction to break away from", "a friction law that sticks", 'model = "lugre"'
        )
    cycles = find_cycles(stages, rtol)
    if cycles.sign >= 0 or not cycles.closed.all():
        why = "; ".join({str(reason) for reason in cycles.reasons if reason}) or "a cycle that is not symmetric"
        raise InputError("crossovers", why, "a stage with a symmetric hunting cycle at each", "4 Hz")
    return cycles


def _errors(
    stages: Ensemble, cycles: Cycles, number: int, harmonics: Sequence[int], rtol: float
) -> list[tuple[float, float, str]]:
    """Return errors of period and amplitude of harmonic balance, for stage `number`.

    Errors are relative to the simulated cycle. `harmonics` are the highest harmonics to try; for each, the result has
    the error of the period, that of the amplitude, and a status.
    """
    single, period = stages.take(np.array([number])), float(cycles.period[number])
    interval = period / PERIOD_SAMPLES
    run = single.run(cycles.states[[number]], np.array([period]), rtol, interval=interval)
    cart = run.samples[0, :PERIOD_SAMPLES, stages.sticking]
    flat = {key: value[0] if np.ndim(value) else value for key, value in single.flat.items()}
    cells = []
    for highest in harmonics:
        series = balanced(flat, np.arange(PERIOD_SAMPLES) * interval, cart, highest)
        errors = (series.period / period - 1, series.amplitude / float(cycles.amplitude[number]) - 1)
        cells.append((*(errors if series.status == DONE else (np.nan, np.nan)), series.status))
    return cells
