"""Say what an isolator would do for a rigid stage."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.shown.text import with_unit

if TYPE_CHECKING:
    from friso.remedies.catalogue import Suggestion

LITTLE_MARGIN = 0.5
"""Modulus margin below which the controller has to be tuned as well."""


def isolator_sentence(suggestion: Suggestion) -> str:
    """Say whether the stage would stop hunting on the suggested isolator."""
    flat = suggestion.stage.flat()
    joint = (
        f"an isolator of stiffness {with_unit(flat['joint.stiffness'], 'N/m')}, stroke "
        f"{with_unit(flat['joint.stroke'], 'm')} and damping {with_unit(flat['joint.damping'], 'N*s/m')}"
    )
    if not suggestion.settles:
        return f"It would not surely stop hunting on {joint}, or on any shorter stroke tried."
    low = "" if suggestion.margin >= LITTLE_MARGIN else ", too little: the controller has to be tuned as well"
    return f"On {joint} it would not hunt; its modulus margin would be {suggestion.margin:.2f}{low} (friso tune)."


def isolator_document(isolator: Suggestion) -> dict[str, Any]:
    """Return the suggested isolator, and whether the stage settles on it."""
    flat = isolator.stage.flat()
    return {
        "settles": isolator.settles,
        "stiffness_n_per_m": flat["joint.stiffness"],
        "stroke_m": flat["joint.stroke"],
        "damping_ns_per_m": flat["joint.damping"],
        "modulus_margin": isolator.margin,
    }
