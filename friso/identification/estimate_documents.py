"""Convert estimates to what the JSON document holds of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.identification.estimate import Estimate
from friso.identification.stage_file import estimate_text
from friso.shown.documents import entries


def ends_document(estimate: Estimate) -> dict[str, Any]:
    """Return the ends of an interval, None where one is infinite."""
    return entries(estimate, "value", "low", "high")


def estimate_document(estimate: Estimate) -> dict[str, Any]:
    """Return an estimate with its interval, for the document.

    If there is no value, the reason is given.
    """
    about = {
        "unit": unit_shown(estimate.unit),
        **ends_document(estimate),
        "shown": estimate.determined,
        "method": axis_shown().text(estimate.method),
        "reason": axis_shown().text(estimate.reason) or None,
    }
    return {"name": estimate.name, **about}


def estimates_document(result: object, *names: str) -> dict[str, Any]:
    """Return estimates among the attributes of a result, by name, for the document."""
    return {name: estimate_document(getattr(result, name)) for name in names}


def key_document(estimate: Estimate) -> dict[str, Any]:
    """Return an estimate of a key of the stage file, with the text that the file has for it."""
    document = estimate_document(estimate)
    stands = np.isfinite([estimate.low, estimate.high]).all() and estimate.high > estimate.low
    text = estimate_text(replace(estimate, unit=unit_shown(estimate.unit))) if stands else None
    return {"key": document.pop("name"), **document, "written": text}
