"""How well a model of the response tells the output of another record."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from friso.errors import InputError
from friso.identify.response.records import ResponseRecord, spectra


def relative_error(
    model: Callable[[np.ndarray], np.ndarray],
    record: ResponseRecord,
    band: tuple[float, float],
    period: float | None = None,
) -> float:
    """||G U - Y|| / ||Y|| over the excited lines in `band` [Hz] of a periodic record that the model has not seen.

    `model` gives complex responses at frequencies [Hz]; U and Y are averaged over periods. `period` [s] is about how
    long one is (default: found). Raises InputError where the record is not periodic or no line lies in the band.
    """
    measured = spectra(record, period)
    inside = measured.excited & (measured.frequency >= band[0]) & (measured.frequency <= band[1])
    if not inside.any():
        raise InputError("band", f"{band[0]:g} to {band[1]:g} Hz", "a band that holds excited lines", "3 to 20 Hz")
    force, reaction = measured.input.mean(axis=0)[inside], measured.output.mean(axis=0)[inside]
    return float(np.linalg.norm(model(measured.frequency[inside]) * force - reaction) / np.linalg.norm(reaction))
