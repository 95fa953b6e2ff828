"""Read frequency responses from another instrument, given as columns of a table."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from friso.errors import LogError
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.roles import words
from friso.identification.logs.sniff import NUMBER
from friso.identification.logs.units import RESPONSES, channel_words, of_decibels, spelled, unit_factor
from friso.quantities import Quantity, any_sign

_KEYS = channel_words()["response"]
"""Words in headings that identify the columns of a response."""


@dataclass(frozen=True)
class MeasuredResponse:
    """A frequency response from another instrument, at rising frequencies [Hz].

    Complex values, and coherence or None, have the shape (n,). `unit` is that of the values: SI if the file states a
    unit, "" if it states none.
    """

    frequency: np.ndarray
    response: np.ndarray
    coherence: np.ndarray | None
    name: str
    read: tuple[str, ...] = ()
    unit: str = ""


def column_kind(name: str) -> str | None:
    """Return what a column of a response holds, such as "phase", by its heading, or None.

    Others are coherence, imaginary and real part, magnitude and frequency. Text before brackets counts first ("FRF
    (real)", "Magnitude (re 1 N)").
    """
    order = ("coherence", "phase", "imaginary", "real", "magnitude", "frequency")
    shown = (set(words(text)) for text in (re.sub(r"[(\[][^()\[\]]*[)\]]$", "", name), name))
    return next((kind for parts in shown for kind in order if parts & _KEYS[kind]), None)


def is_response(names: Iterable[str]) -> bool:
    """Tell whether headings describe a frequency response.

    The headings must name a frequency, and magnitude with phase or real with imaginary part.
    """
    kinds = {column_kind(name) for name in names}
    return "frequency" in kinds and ({"magnitude", "phase"} <= kinds or {"real", "imaginary"} <= kinds)


def response_of(table: ChannelTable, path: Path) -> MeasuredResponse:
    """Build a frequency response from the columns of a table.

    Raises LogError for columns that are missing, doubled, or of different lengths.
    """
    by_kind: dict[str, list[Channel]] = {}
    for channel in table.channels:
        if column_kind(channel.name) is not None:
            by_kind.setdefault(str(column_kind(channel.name)), []).append(channel)
    for kind, channels in by_kind.items():
        if len(channels) > 1:
            names = ", ".join(channel.name for channel in channels)
            raise LogError(kind, f"{len(channels)} columns: {names}", "one column", "", str(path))
    if not is_response(channel.name for channel in table.channels):
        names = ", ".join(channel.name for channel in table.channels)
        expected = "frequency, and magnitude and phase or real and imaginary part"
        raise LogError("log", names, expected, "f [Hz];magnitude [dB];phase [deg]", str(path))
    columns = {kind: channels[0] for kind, channels in by_kind.items()}
    if len({channel.values.size for channel in columns.values()}) > 1:
        actual = ", ".join(f"{channel.values.size} of {channel.name}" for channel in columns.values())
        raise LogError("log", f"columns of different lengths: {actual}", "a value in every cell", "", str(path))
    frequency = _frequency(columns["frequency"], path)
    if {"real", "imaginary"} <= set(columns):
        real, imaginary = columns["real"], columns["imaginary"]
        scale, unit, quantities = response_unit(real.unit or imaginary.unit)
        scale_of_other, unit_of_other, _ = response_unit(imaginary.unit or real.unit)
        if unit_of_other != unit:
            actual = f"{real.name} in {real.unit} and {imaginary.name} in {imaginary.unit}"
            raise LogError("log", actual, "both in one unit", "f [Hz];Re [m/N];Im [m/N]", str(path))
        response = real.values + 1j * imaginary.values * (scale_of_other / scale)
        quantities = f"real and imaginary part {quantities}"
    else:
        response, scale, unit, quantities = _polar(columns["magnitude"], columns["phase"], path)
    coherence = columns["coherence"].values if "coherence" in columns else None
    read = (*table.read, quantities, f"{frequency.size} frequencies, {frequency.min():g} Hz to {frequency.max():g} Hz")
    with np.errstate(all="ignore"):  # NaN is reported below
        response = response * scale
    return check_response(MeasuredResponse(frequency, response, coherence, path.stem, read, unit), path)


def _frequency(column: Channel, path: Path) -> np.ndarray:
    """Return frequencies in Hz.

    Raises LogError for a column without a unit.
    """
    value = unit_factor(column.unit, "Hz") if column.unit else None
    if value is None:
        actual = f"{column.name} in {column.unit}" if column.unit else f"{column.name} without a unit"
        raise LogError("frequency", actual, "Hz or rad/s in the heading", "f [Hz]", str(path))
    return column.values * value


def _polar(magnitude: Channel, phase: Channel, path: Path) -> tuple[np.ndarray, float, str, str]:
    """Build complex values from magnitude and phase.

    Returns the values, the factor that converts them to SI, the SI unit, and a description of both units in words.
    Raises LogError for a phase without a unit.
    """
    turn = unit_factor(phase.unit, "rad") if phase.unit else None
    if turn is None:
        raise LogError("phase", f"{phase.name} without a unit", "deg or rad in the heading", "phase [deg]", str(path))
    angle = np.exp(1j * turn * phase.values)
    text = spelled(magnitude.unit)
    unit = of_decibels(text)
    if unit is not None or re.search(r"(?<![A-Za-z])dB(?![A-Za-z])", magnitude.name, re.IGNORECASE):
        reference = re.fullmatch(rf"(?P<number>{NUMBER})?\s*(?P<unit>.*)", text if unit is None else unit)
        scale, si, _ = response_unit(reference["unit"] if reference else "")
        scale *= float((reference and reference["number"]) or 1)
        in_words = f"magnitude in {'dB' if unit is None else magnitude.unit}, phase in {phase.unit}"
        with np.errstate(over="ignore"):
            return 10 ** (magnitude.values / 20) * angle, scale, si, in_words
    scale, si, unit_in_words = response_unit(magnitude.unit)
    return magnitude.values * angle, scale, si, f"magnitude {unit_in_words}, phase in {phase.unit}"


def response_unit(text: str) -> tuple[float, str, str]:
    """Return factor to SI, SI unit, and a description; unknown units keep their text, factor 1."""
    text = spelled(text)
    for si in (*RESPONSES, "m"):
        if text and unit_factor(text, si) is not None:
            return Quantity(si, any_sign, "").factor(text), si, f"in {text}"
    return 1.0, text, f"in {text}" if text else "without a unit"


def check_response(measured: MeasuredResponse, path: Path) -> MeasuredResponse:
    """Check a response; return it as a response of position, without lines at 0 Hz or below.

    Raises LogError for too few or falling frequencies, for NaN, and for a force over a motion.
    """
    positive = measured.frequency > 0
    if not positive.all():
        arrays = [a if a is None else a[positive] for a in (measured.frequency, measured.response, measured.coherence)]
        read = (*measured.read, f"left out: {np.count_nonzero(~positive)} lines at 0 Hz or below")
        measured = replace(measured, frequency=arrays[0], response=arrays[1], coherence=arrays[2], read=read)
    frequency = measured.frequency
    if measured.unit and any(unit_factor(measured.unit, si) is not None for si in ("N/m", "N*s/m", "kg")):
        expected = "a position, a velocity or an acceleration over the force"
        raise LogError("response", f"a force over a motion, in {measured.unit}", expected, "mag [m/N]", str(path))
    if frequency.size < 3:
        raise LogError("log", f"{frequency.size} frequencies", "at least 3", "", str(path))
    for name, values in (("frequency", frequency), ("response", measured.response), ("coherence", measured.coherence)):
        if values is not None and not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0]) + 1
            raise LogError(name, f"no number in row {row}", "finite numbers in every row", "", str(path))
    measured = _of_position(measured)
    falling = np.flatnonzero(np.diff(frequency) <= 0)
    if falling.size:
        actual = f"{frequency[falling[0] + 1]:g} Hz after {frequency[falling[0]]:g} Hz"
        raise LogError("frequency", actual, "rising frequencies", "", str(path))
    return measured


def _of_position(measured: MeasuredResponse) -> MeasuredResponse:
    """Convert a response of velocity or acceleration to a response of position."""
    rate = re.fullmatch(r"(?P<place>m|rad)/s(?P<twice>\^2)?/(?P<force>.+)", measured.unit)
    if rate is None:
        return measured
    times, name = (2, "acceleration") if rate["twice"] else (1, "velocity")
    response = measured.response / (2j * np.pi * measured.frequency) ** times
    read = (*measured.read, f"the response is that of the {name}; that of the position follows by integration")
    return replace(measured, response=response, unit=f"{rate['place']}/{rate['force']}", read=read)
