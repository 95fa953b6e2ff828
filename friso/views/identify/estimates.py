"""Estimates as they stand in the JSON document."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.stage_file import written


def ends_document(estimate: Estimate) -> dict[str, Any]:
    return {"value": estimate.value, "low": estimate.low, "high": estimate.high}


def estimate_document(estimate: Estimate) -> dict[str, Any]:
    about = {
        "unit": estimate.unit,
        **ends_document(estimate),
        "shown": estimate.determined,
        "method": estimate.method,
        "reason": estimate.reason or None,
    }
    return {"name": estimate.name, **about}


def key_document(estimate: Estimate) -> dict[str, Any]:
    """An estimate of a key of the stage file, with the text that stands there."""
    document = estimate_document(estimate)
    text = (
        written(estimate) if np.isfinite([estimate.low, estimate.high]).all() and estimate.high > estimate.low else None
    )
    return {"key": document.pop("name"), **document, "written": text}
