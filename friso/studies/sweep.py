"""Parameter sweeps: every combination of the given values of stage-file keys, as an xarray Dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import Runs, run_chunks
from friso.engine.kernel import kernel
from friso.engine.tolerance import checked_rtol
from friso.equations.structure import Structure, structure
from friso.hunting.measures import BANDS, Measures, measure, options
from friso.quantities import Number, Quantity, StageError
from friso.stage import Stage, numeric_keys, violations
from friso.version import VERSION

if TYPE_CHECKING:
    import xarray as xr

Values = Sequence[Any] | np.ndarray | tuple[Any, str]

UNITS = {
    "peaks": "1",
    "peak_to_peak": "m",
    "period": "s",
    "settling_time": "s",
    "settling_time_10um": "s",
    "largest_force": "N",
    "steps": "1",
    "rejected": "1",
}
"""The numeric variables of a sweep and their units."""


@dataclass(frozen=True)
class Axis:
    """A swept key: SI values (or texts and booleans) and their unit."""

    key: str
    values: np.ndarray
    unit: str
    numeric: bool


def sweep(stage: Stage, axes: Mapping[str, Values], rtol: float = 1e-4, threads: int | None = None) -> xr.Dataset:
    """Run every combination of the axes' values.

    An axis is a stage-file key with its values: an array with a unit, ``(np.linspace(1, 40, 41), "Hz")``, a list of
    texts with units, ``["0.1 mm", "0.3 mm"]``, or bare numbers, words and booleans where the key takes these. The
    result has one dimension per axis with SI coordinates, and the variables peaks, verdict, peak_to_peak [m], period
    [s], settling_time [s] into 1 um, settling_time_10um [s], largest_force [N], steps, rejected and status; a cell
    that no stage may have is "invalid", with the reason in its status. A verdict is as good as its tolerance: near a
    boundary, or with very stiff bristles, compare with a run at a tighter `rtol`. Raises StageError for an unknown
    key, a value of the wrong kind or an empty axis, ValueError for a tolerance that is not usable.
    """
    checked_rtol(rtol)
    if not axes:
        raise StageError(
            "axes", "none", "at least one key with its values", '{"controller.crossover": ["4 Hz", "8 Hz"]}'
        )
    read = [_axis(stage, key, values) for key, values in axes.items()]
    table = _Table(tuple(len(axis.values) for axis in read))
    for part, flat, cells in _numeric_parts(stage, read):
        table.invalidate(cells, flat)
        for shape, members in _by_structure(part, flat, table.valid(cells), cells):
            table.run(shape, members, cells, flat, rtol, threads)
    return _dataset(stage, read, table, rtol)


def _axis(stage: Stage, key: str, values: Values) -> Axis:
    """The axis in SI units. Raises StageError."""
    field = numeric_keys(stage.flat()).get(key)
    array_with_unit = isinstance(values, tuple) and len(values) == 2 and isinstance(values[1], str)
    if field is None:
        options = list(values)
        if not options:
            raise _empty(key)
        for value in options:
            stage.replace({key: value})
        return Axis(key, np.array(options), "", numeric=False)
    try:
        if array_with_unit:
            si = np.asarray(values[0], dtype=float) * _factor(field, values[1])
        else:
            si = np.array([float(field.read(value)) for value in values])
    except StageError as error:
        raise error.under(key) from None
    if si.ndim != 1 or not si.size:
        raise _empty(key)
    if not np.all(np.isfinite(si)):
        raise StageError(key, "values that are not finite", "finite numbers", '(np.linspace(1, 40, 41), "Hz")')
    return Axis(key, si, field.unit, numeric=True)


def _factor(field: Quantity | Number, unit: str) -> float:
    if isinstance(field, Quantity):
        return field.factor(unit)
    raise StageError("", f"the unit {unit}", "bare numbers, since the key has no unit", "[0.1, 0.2, 0.3]")


def _empty(key: str) -> StageError:
    return StageError(key, "no values", "a list or one-dimensional array of values", '["4 Hz", "8 Hz"]')


def _numeric_parts(stage: Stage, axes: Sequence[Axis]) -> Iterator[tuple[Stage, dict[str, Any], np.ndarray]]:
    """For each combination of the words and booleans swept: the stage, its swept flat form (one entry per cell of
    the numeric axes) and the numbers of these cells in the whole table."""
    shape = tuple(len(axis.values) for axis in axes)
    numbers = np.arange(int(np.prod(shape))).reshape(shape)
    other = [i for i, axis in enumerate(axes) if not axis.numeric]
    for choice in product(*(range(shape[i]) for i in other)):
        index: list[Any] = [slice(None)] * len(axes)
        for i, position in zip(other, choice, strict=True):
            index[i] = position
        cells = numbers[tuple(index)].ravel()
        words = {axes[i].key: axes[i].values[k].item() for i, k in zip(other, choice, strict=True)}
        part = stage.replace(words)
        places = np.unravel_index(cells, shape)
        swept = {axis.key: axis.values[places[i]] for i, axis in enumerate(axes) if axis.numeric}
        yield part, part.flat(swept), cells


def _by_structure(
    stage: Stage, flat: Mapping[str, Any], valid: np.ndarray, cells: np.ndarray
) -> Iterator[tuple[Structure, np.ndarray]]:
    """The places of the valid cells, grouped by the equations they need.

    Only a few keys decide on the structure, and only by being zero or a whole number; cells are told apart by those.
    """
    decisive = [
        key
        for key in ("joint.stroke", "controller.ki", "controller.kd", "controller.tau", "friction.stribeck_exponent")
        if np.ndim(flat.get(key, 0.0))
    ]
    groups: dict[Structure, list[np.ndarray]] = {}
    columns = np.stack([flat[key] for key in decisive], axis=1) if decisive else np.zeros((len(cells), 1))
    kinds, which = np.unique(columns, axis=0, return_inverse=True)
    for k in range(len(kinds)):
        members = np.flatnonzero((which.ravel() == k) & valid)
        if members.size:
            one = {**flat, **{key: kinds[k][i] for i, key in enumerate(decisive)}}
            groups.setdefault(structure(one), []).append(members)
    for shape, members in groups.items():
        yield shape, np.sort(np.concatenate(members))


class _Table:
    """The growing results of a sweep, one entry per cell."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        count = int(np.prod(shape))
        self.shape = shape
        self.numbers = {name: np.full(count, np.nan) for name in UNITS}
        self.verdict = np.full(count, "", dtype="<U8")
        self.status = np.full(count, Status.NOT_RUN.text, dtype=object)

    def invalidate(self, cells: np.ndarray, flat: Mapping[str, Any]) -> None:
        """Mark the cells that no stage may have."""
        for broken, why in violations(flat):
            which = cells[np.broadcast_to(broken, cells.shape)]
            self.verdict[which], self.status[which] = "invalid", f"invalid: {why}"

    def valid(self, cells: np.ndarray) -> np.ndarray:
        return self.verdict[cells] != "invalid"

    def run(
        self,
        shape: Structure,
        members: np.ndarray,
        cells: np.ndarray,
        flat: Mapping[str, Any],
        rtol: float,
        threads: int | None,
    ) -> None:
        """Run the cells `members` of a part and write their measures."""
        own = {key: value[members] if np.ndim(value) else value for key, value in flat.items()}
        for runs in run_chunks(kernel(shape), own, len(members), options(rtol, threads)):
            here = slice(runs.first, runs.first + len(runs.results.statuses))
            part = {key: value[here] if np.ndim(value) else value for key, value in own.items()}
            self.write(cells[members[here]], measure(part, runs), runs)

    def write(self, which: np.ndarray, found: Measures, runs: Runs) -> None:
        inner, outer = found.settling_time
        columns = (found.peaks, found.peak_to_peak, found.period, inner, outer, found.largest_force)
        for name, column in zip(UNITS, (*columns, found.steps, found.rejected), strict=True):
            self.numbers[name][which] = column
        self.verdict[which] = found.verdict
        self.status[which] = [Status(int(status)).text for status in found.status]


def _dataset(stage: Stage, axes: Sequence[Axis], table: _Table, rtol: float) -> xr.Dataset:
    import xarray as xr

    dims = tuple(axis.key for axis in axes)
    variables: dict[str, Any] = {
        name: (dims, column.reshape(table.shape), {"units": UNITS[name]}) for name, column in table.numbers.items()
    }
    variables["settling_time"][2]["band_m"] = BANDS[0]
    variables["settling_time_10um"][2]["band_m"] = BANDS[1]
    for name, words in (("verdict", table.verdict), ("status", table.status.astype(str))):
        variables[name] = (dims, words.reshape(table.shape))
    coords = {axis.key: (axis.key, axis.values, {"units": axis.unit}) for axis in axes}
    attrs = {"name": stage.name, "stage": stage.to_toml(), "friso": VERSION, "rtol": rtol}
    return xr.Dataset(variables, coords=coords, attrs=attrs)
