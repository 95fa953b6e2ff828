"""Provide what all JSON documents share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friso.axis import axis_shown


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


def unit_suffix(unit: str) -> str:
    """Return the suffix of a key for a unit: "_n_s_per_m" for "N*s/m", empty without a unit."""
    return f"_{unit.lower().replace('*', '_').replace('/', '_per_').replace('^', '')}" if unit else ""
