"""Provide the parts that all JSON documents share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from friso.axis import axis_shown, unit_of_key
from friso.hunting import Dwell, Tracking


def plain_json(value: Any) -> Any:
    """Return a value as JSON knows it: plain numbers, texts, lists and tables.

    Infinite and undefined numbers become null. Units at the end of keys follow the kind of axis: "amplitude_m" becomes
    "amplitude_rad" on a rotary one.
    """
    if isinstance(value, dict):
        axis = axis_shown()
        return {axis.suffix(key) if isinstance(key, str) else key: plain_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain_json(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def merged(documents: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Join documents into one; tables of the same key are joined, too."""
    whole: dict[str, Any] = {}
    for document in documents:
        for key, value in document.items():
            old = whole.get(key)
            whole[key] = merged([old, value]) if isinstance(old, dict) and isinstance(value, Mapping) else value
    return whole


def entries(source: object, *keys: str) -> dict[str, Any]:
    """Return attributes of an object by their keys in a document.

    A key is the attribute's name and its unit: "amplitude_m" is the amplitude [m].
    """
    return {key: getattr(source, unit_of_key(key)[0]) for key in keys}


def unit_suffix(unit: str) -> str:
    """Return the suffix of a key for a unit: "_n_s_per_m" for "N*s/m", "" without a unit."""
    return f"_{unit.lower().replace('*', '_').replace('/', '_per_').replace('^', '')}" if unit else ""


def dwells_document(dwells: Sequence[Dwell]) -> list[dict[str, Any]]:
    """Return how a stage settles at each place where its reference stands, the slowest first."""
    return [
        {
            "move": dwell.number,
            **entries(dwell, "position_m", "since_s"),
            "settling_time_s": dwell.settling[dwell.bands[0]],
            "settling_time_10um_s": dwell.settling[dwell.bands[1]],
        }
        for dwell in dwells
    ]


def tracking_document(tracking: Tracking) -> dict[str, Any]:
    """Return how a stage follows a reference that keeps moving."""
    return {
        "largest_error_m": tracking.largest,
        "rms_error_m": tracking.rms,
        "largest_force_n": tracking.largest_force,
        **entries(tracking, "period_s", "closed", "multiplier"),
        "reversals": [
            {"time_s": one.time, "position_m": one.position, "largest_error_m": one.error} for one in tracking.reversals
        ],
    }
