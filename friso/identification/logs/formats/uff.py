"""Universal files, dataset 58 (functions at nodal degrees of freedom): time histories and frequency responses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from friso.errors import LogError
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.measured_response import MeasuredResponse, check_response, response_unit
from friso.identification.logs.read import LogFormat, content_by, cut_short
from friso.identification.logs.units import unit_factor

TIME_RESPONSE, FREQUENCY_RESPONSE, COHERENCE_TYPE = 1, 4, 6
"""Function types in record 6 of a dataset 58."""
_SYSTEMS = {
    1: ("m", "N"),
    2: ("ft", "lbf"),
    3: ("m", "kgf"),
    5: ("mm", "mN"),
    6: ("cm", "cN"),
    7: ("in", "lbf"),
    8: ("mm", "kgf"),
    10: ("mm", "N"),
}
"""Units of length and force by the code in dataset 164."""
_KINDS = {8: "{0}", 11: "{0}/s", 12: "{0}/s^2", 9: "{1}", 13: "{1}"}
"""Units of the data by their kind in record 9: displacement, velocity, acceleration, reaction and excitation force."""


def is_uff(head: bytes) -> bool:
    """Tell whether a file begins as a universal file: a line with -1, then a dataset's number."""
    lines = [line.strip() for line in head[:400].splitlines() if line.strip()]
    return len(lines) > 1 and lines[0] == b"-1" and lines[1][:4].rstrip(b"bB ").isdigit()


def sets_58(path: Path) -> list[dict[str, Any]]:
    """Return the datasets of type 58 of a universal file, each with its `units_code`.

    Raises LogError for none.
    """
    file = content_by("pyuff", "UFF", path)
    sets, systems = file["sets"], {*file["units"]}
    if not sets:
        raise LogError("log", "a UFF file without a dataset 58", "time histories or responses", "", str(path))
    code = systems.pop() if len(systems) == 1 else None
    return [{**data, "units_code": code} for data in sets]


def label(data: dict[str, Any], key: str) -> str:
    """Return a text field of a dataset; "" if the file says NONE."""
    text = str(data.get(key, "") or "").strip()
    return "" if text.upper() == "NONE" else text


def read_uff(path: Path) -> ChannelTable:
    """Read the time histories of a universal file.

    Raises LogError for a file without time histories.
    """
    times = [data for data in sets_58(path) if data["func_type"] == TIME_RESPONSE]
    if not times:
        raise LogError("log", "a UFF file without time histories", "function type 1 in a dataset 58", "", str(path))
    headings = [label(d, "id1") or f"node {d['rsp_node']} direction {d['rsp_dir']}" for d in times]
    channels = tuple(
        Channel(name, _unit(d), np.real(d["data"]).astype(float), _seconds(d), "dataset 58")
        for name, d in zip(headings, times, strict=True)
    )
    code = times[0]["units_code"]
    foreign = [f"units of code {code} are unknown"] if code is not None and code not in _SYSTEMS else []
    short = cut_short(channels, [data.get("num_pts") for data in times])
    return ChannelTable(channels, {}, ("format: UFF, dataset 58", f"{len(channels)} time histories", *foreign, *short))


def _unit(data: dict[str, Any]) -> str:
    """Return the unit of a time history, by its label or else by the kind of its data."""
    system = _SYSTEMS.get(data["units_code"])
    kind = _KINDS.get(int(data.get("ordinate_spec_data_type") or 0))
    return label(data, "ordinate_axis_units_lab") or (kind.format(*system) if system and kind else "")


def _seconds(data: dict[str, Any]) -> np.ndarray:
    """Return the instants in seconds, converted if their label states another unit of time."""
    return _axis(data) * (unit_factor(label(data, "abscissa_axis_units_lab"), "s") or 1.0)


def _axis(data: dict[str, Any]) -> np.ndarray:
    """Return the abscissa of a dataset, as stored or from its start and step."""
    stored = np.asarray(data.get("x", ()), dtype=float)
    if stored.size == np.size(data["data"]):
        return stored
    return data["abscissa_min"] + data["abscissa_inc"] * np.arange(np.size(data["data"]))


def frequency_sets(path: Path) -> tuple[dict[str, Any], np.ndarray, np.ndarray | None]:
    """Return the frequency response of a universal file, its frequencies [Hz] and coherence.

    The coherence is None if the file has none. Raises LogError for a file without a response, or with several.
    """
    sets = sets_58(path)
    responses = [data for data in sets if data["func_type"] == FREQUENCY_RESPONSE]
    if len(responses) != 1:
        actual = f"{len(responses)} frequency responses: {', '.join(label(d, 'id1') for d in responses)}".rstrip(": ")
        raise LogError("log", actual, "a file with one frequency response", "", str(path))
    axis = _axis(responses[0])
    fitting = [d for d in sets if d["func_type"] == COHERENCE_TYPE and np.size(d["data"]) == axis.size]
    coherence = np.real(fitting[0]["data"]).astype(float) if len(fitting) == 1 else None
    return responses[0], axis, coherence


def read_response_uff(path: Path) -> MeasuredResponse:
    """Read the response in a universal file.

    Raises LogError for a file without a usable response, or with several.
    """
    data, frequency, coherence = frequency_sets(path)
    above, below = label(data, "ordinate_axis_units_lab"), label(data, "orddenom_axis_units_lab")
    scale, unit, unit_in_words = response_unit(f"{above}/({below})" if above and below else above)
    read = ("format: UFF, dataset 58", f"frequency response {unit_in_words}", f"{frequency.size} frequencies")
    response = np.asarray(data["data"], dtype=complex) * scale
    name = label(data, "id1") or path.stem
    return check_response(MeasuredResponse(frequency, response, coherence, name, read, unit), path)


FORMAT = LogFormat(
    "UFF",
    lambda head: is_uff(head.start),
    read_uff,
    holds_response=lambda path: any(data["func_type"] == FREQUENCY_RESPONSE for data in sets_58(path)),
    read_response=read_response_uff,
)
