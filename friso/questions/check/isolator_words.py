"""Say what an isolator would do for a rigid stage."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from friso.hunting import SEARCH_LIMITS
from friso.questions.check.margin_words import other_static_friction
from friso.shown.drawing.prefixes import with_unit

if TYPE_CHECKING:
    from friso.remedies.catalogue import Suggestion

LITTLE_MARGIN = 0.5
"""Modulus margin below which the controller has to be tuned as well."""


def isolator_sentence(suggestion: Suggestion) -> str:
    """Say whether the stage would stop hunting on the suggested isolator."""
    flat = suggestion.stage.flat()
    joint = (
        f"an isolator of k_j = {with_unit(flat['joint.stiffness'], 'N/m')}, stroke "
        f"{with_unit(flat['joint.stroke'], 'm')} and damping {with_unit(flat['joint.damping'], 'N*s/m')}"
    )
    if not suggestion.settles:
        return f"It would not surely stop hunting on {joint}, or on any shorter stroke tried."
    low = "" if suggestion.margin >= LITTLE_MARGIN else ": too little, so that the controller has to be tuned as well"
    friction = other_static_friction(flat)
    masses = [with_unit(flat[f"masses.{part}"], "kg") for part in ("cart", "stage")]
    kept = f"1/{SEARCH_LIMITS.edge_distance:g} of this bandwidth{friction and f', or {friction}'}"
    return (
        f"On {joint} between {masses[0]} on the cart and {masses[1]} on the stage it would not hunt: nothing was found "
        f"to attract it down to {kept}. Its modulus margin would be {suggestion.margin:.2f}{low}. How soon moves "
        "settle on it was not computed: friso tune finds the best isolator and tells for which moves it holds."
    )


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
