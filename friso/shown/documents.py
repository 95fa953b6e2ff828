"""What JSON documents share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friso.axis import axis_shown


def plain_json(value: Any) -> Any:
    """What JSON knows: plain numbers, texts, lists and tables; null for infinite and undefined numbers. The units with
    which keys end are those of the axis that is spoken of: "amplitude_m" is "amplitude_rad" on a rotary one."""
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
    """How a key of a document ends by its unit: "_n_s_per_m" for "N*s/m", nothing for a number without one."""
    return f"_{unit.lower().replace('*', '_').replace('/', '_per_').replace('^', '')}" if unit else ""
