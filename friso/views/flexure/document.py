"""The JSON document of a leaf-spring mechanism: SI, the unit in the key's suffix; what is not known is null."""

from __future__ import annotations

from typing import Any

from friso.flexure.evaluation import Evaluation
from friso.views.documents import plain_json
from friso.views.flexure.findings import Found, interferes


def flexure_document(found: Found) -> dict[str, Any]:
    """The figures that count, and beside them those of the closed forms."""
    head = {"stage": found.stage.name, "failure": found.failure or None}
    return {**head, **_evaluation(found.best), "closed_forms": _evaluation(found.closed)}


def _evaluation(it: Evaluation) -> dict[str, Any]:
    first = it.interfering
    plain = {
        "model": it.model,
        "stroke_m": it.stroke,
        "drive_stiffness_n_per_m": it.drive[0],
        "drive_stiffness_under_load_n_per_m": it.loaded_drive,
        "drive_stiffness_at_stroke_n_per_m": it.drive[-1],
        "nonlinearity": it.nonlinearity,
        "support_stiffness_n_per_m": {
            axis: {"zero": support[0], "full": support[-1]}
            for axis, support in (("x", it.support_x), ("y", it.support_y))
        },
        "eigenfrequencies_hz": [mode.frequency for mode in it.modes],
        "names": [mode.name for mode in it.modes],
        "interferes": [interferes(it, mode) for mode in it.modes],
        "first_interfering_hz": None if first is None else first.frequency,
        "max_stress_pa": it.stress,
        "clamp_stress_pa": it.clamp_stress,
        "stress_concentration": it.mechanism.stress_concentration,
        "yield_margin": it.yield_margin,
        "fatigue_margin": it.fatigue_margin,
        "shortening_m": it.shortening,
        "buckling_load_n": it.buckling,
        "buckling_load_per_leaf_n": it.buckling / it.mechanism.leaves,
        "buckling_margin": it.buckling_margin,
        "stiffness_zero": it.stiffness[0],
        "stiffness_full": it.stiffness[1],
        "deflections_m": it.deflections,
        "forces_n": it.forces,
    }
    return {key: plain_json(value) for key, value in plain.items()}
