"""A reference that was recorded, or made by another program: a channel of a file over time."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import field_validator

from friso.axis import axis_of
from friso.errors import InputError
from friso.quantities import Number, Quantity, Value, any_sign, as_toml, positive, quoted
from friso.stage.rig import DURATION, Motion, Piece, register_motion
from friso.stage.section import Rule
from friso.stage.tables import TIME_ROUNDING

FILE, REFERENCE, TIME, UNIT, SAMPLE_TIME, SCALE, BETWEEN = (
    f"motion.{name}" for name in ("file", "reference", "time", "unit", "sample_time", "scale", "between")
)

RecordedSamples = tuple[np.ndarray, np.ndarray]
"""Sample times [s] and reference [m], both beginning at 0."""


@register_motion
class Recorded(Motion):
    """A reference from a channel of a file: CSV, MAT, TwinCAT, or any other log.

    The first value counts as 0; the last value is held to the end.
    """

    kind: Literal["recorded"]
    file: str
    """Path of the file with the reference, relative to the stage file or absolute."""
    reference: str | None = None
    """Name of the reference's channel; by default the one named like a reference, or the only channel."""
    time: str | None = None
    """Name of the channel of sample times; by default the one named like a time, or the file's own times."""
    unit: str | None = None
    """Unit of the reference, for a file that states no unit or a wrong one."""
    sample_time: Annotated[Value | None, Quantity("s", positive, "1 ms")] = None
    """Time between samples, for a file that states no times."""
    scale: Annotated[float, Number(any_sign, "0.5")] = 1.0
    """Factor on the recorded reference."""
    between: Literal["linear", "hold"] = "linear"
    """Whether the reference is linear between samples, or held from each to the next."""
    duration: Annotated[Value | None, Quantity("s", positive, "20 s")] = None
    """Duration of the motion; by default the record's."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (FILE, DURATION),
            lambda f: _samples(f)[0][-1] <= f[DURATION] * (1 + TIME_ROUNDING),
            "a duration in which the record ends; left out, it is that of the record",
            'duration = "20 s"',
        ),
    )

    @field_validator("file")
    @classmethod
    def _is_found_from_anywhere(cls, file: str) -> str:
        return str(Path(file).absolute())

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the reference as one polynomial from each sample to the next; it stands at the end."""
        times, values = _samples(flat)
        scale = flat[SCALE]
        slopes = np.append(np.diff(values) / np.diff(times), 0.0) * (flat[BETWEEN] == "linear")
        return [(t, scale * r, scale * v, 0.0) for t, r, v in zip(times, values, slopes, strict=True)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the distance [m] between the highest and the lowest position of the reference."""
        return np.abs(flat[SCALE]) * np.ptp(_samples(flat)[1])

    @staticmethod
    def with_defaults(flat: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the record's duration as default of `duration`; {} if a duration is stated."""
        return {} if DURATION in flat else {DURATION: _samples(flat)[0][-1]}


def _samples(flat: Mapping[str, Any]) -> RecordedSamples:
    """Return the samples of a recorded reference.

    Raises InputError for a file without samples, or with gaps.
    """
    path = Path(flat[FILE])
    try:
        state = path.stat()
    except OSError:
        raise InputError(FILE, quoted(flat[FILE]), "a file with the reference over time", '"reference.csv"') from None
    sample_time = flat.get(SAMPLE_TIME)
    names = tuple(flat.get(key) for key in (REFERENCE, TIME, UNIT))
    return _read(path, state.st_mtime_ns, state.st_size, names, sample_time, axis_of(flat).name)


@lru_cache(maxsize=8)
def _read(
    path: Path, changed: int, size: int, names: tuple[str | None, ...], sample_time: float | None, axis: str
) -> RecordedSamples:
    """Read the samples of a recorded reference, cached until its file changes.

    Times [s] and values begin at 0. `changed` and `size` identify the state of the file; `names` are those of the
    reference, the time and the unit. Raises InputError for a file that cannot be used.
    """
    try:
        times, values = _signals(path, names, sample_time, axis)
        _check(times, values)
    except InputError as error:
        raise InputError(FILE, f"{path.name}: {error.actual}", error.expected, _in_keys(error.example)) from None
    return times - times[0], values - values[0]


def _signals(path: Path, names: tuple[str | None, ...], sample_time: float | None, axis: str) -> RecordedSamples:
    """Return sample times [s] and reference [m] as stored in a file.

    `names` has the channel of the reference, that of the time, and the unit of the reference; None leaves the choice to
    friso. Raises LogError for a file that cannot be read, or one without such channels.
    """
    from friso.identification.logs.gaps import check_gaps
    from friso.identification.logs.read import FORMATS, file_format, read_table
    from friso.identification.logs.roles import Mapping as Told
    from friso.identification.logs.roles import propose, role_of
    from friso.identification.logs.signals import Notes, Reading, instants, signal, with_user_units

    form, origin = FORMATS[file_format(path)], str(path)
    reference, time, unit = names
    roles = {role: name for role, name in (("reference", reference), ("time", time)) if name is not None}
    table = read_table(path)
    signals = [c.name for c in table.channels if c.name != time and (role_of(c.name, c.unit) or ("",))[0] != "time"]
    if reference is None and len(signals) == 1:
        roles["reference"] = signals[0]
    chosen = propose(table, roles, origin).chosen
    units = {chosen["reference"].channel.name: unit} if unit is not None and "reference" in chosen else {}
    mapping = Told(roles=roles, units=units, sample_time=sample_time, axis=axis)
    table = with_user_units(table, mapping, form.times, origin)
    reading, proposal = Reading(table, mapping, True, not form.units, origin), propose(table, roles, origin)
    check_gaps(reading, proposal, ("reference",))
    choice, notes = proposal.chosen["reference"], Notes()
    values = signal(choice, reading, notes)
    times = instants(choice, proposal.chosen.get("time"), reading, notes)
    assert times is not None  # check_gaps has made sure that times exist
    return times, values


def _check(times: np.ndarray, values: np.ndarray) -> None:
    """Check that a record has finite, increasing times and values.

    Raises InputError if it does not, or if it has gaps.
    """
    from friso.identification.logs.time_base import gaps

    if times.size < 2:
        raise InputError("", f"{times.size} sample{'' if times.size == 1 else 's'}", "a reference over time")
    if (lost := np.flatnonzero(~(np.isfinite(times) & np.isfinite(values)))).size:
        actual = f"no number in sample {lost[0] + 1} of {times.size}"
        raise InputError("", actual, "a number at every instant: fill the gap in the file")
    steps = np.diff(times)
    if (back := np.flatnonzero(steps <= 0)).size:
        at = back[0]
        actual = f"time that goes from {times[at]:.6g} s to {times[at + 1]:.6g} s behind sample {at + 1}"
        raise InputError("", actual, "instants that rise from sample to sample")
    if (holes := np.flatnonzero(gaps(steps))).size:
        at = holes[0]
        actual = f"a gap of {steps[at]:.4g} s behind {times[at]:.6g} s, where samples usually come every "
        expected = "a record without gaps: fill them in the file"
        raise InputError("", f"{actual}{np.median(steps):.4g} s", expected)


def _in_keys(example: str) -> str:
    """Rewrite an example of the options --map, --unit and --dt as keys of the table [motion]."""
    words = shlex.split(example)
    keys = []
    for option, value in zip(words[::2], words[1::2], strict=False):
        name, _, text = value.rpartition("=")
        if option == "--map":
            keys.append((name, text))
        elif option == "--dt":
            keys.append(("sample_time", text))
        elif option == "--unit":
            keys.append(("time", name) if text in ("s", "ms", "us", "ns") else ("unit", text))
    return ", ".join(f"{key} = {as_toml(text)}" for key, text in keys)
