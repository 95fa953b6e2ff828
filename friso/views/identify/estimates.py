"""Estimates as they stand in the JSON document."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.identify.estimate import Estimate
from friso.identify.stage_file import written


def ends_document(it: Estimate) -> dict[str, Any]:
    return {"value": it.value, "low": it.low, "high": it.high}


def estimate_document(it: Estimate) -> dict[str, Any]:
    about = {"unit": it.unit, **ends_document(it), "shown": it.shown, "method": it.method, "reason": it.reason or None}
    return {"name": it.name, **about}


def key_document(it: Estimate) -> dict[str, Any]:
    """An estimate of a key of the stage file, with the text that stands there."""
    told = estimate_document(it)
    text = written(it) if np.isfinite([it.low, it.high]).all() and it.high > it.low else None
    return {"key": told.pop("name"), **told, "written": text}
