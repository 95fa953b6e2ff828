"""Give the one block of `friso flexure`, with the drawing of the leaf springs."""

from __future__ import annotations

from functools import partial
from typing import Any

from friso.leaf_springs.beams import BothModels
from friso.leaf_springs.mechanism import Evaluation
from friso.questions.flexure.figures import COLOURS, flexure_figures
from friso.questions.flexure.numbers import rows
from friso.questions.flexure.words import sentences, warnings
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import GREEN, VERMILLION, Category


def basis(flexure: BothModels) -> str:
    """Say by which models the leaf springs were evaluated."""
    return (
        ": geometrically exact beams, corrected for what clamps do to a wide leaf, and closed forms (Soemers, Design "
        "Principles for Precision Mechanisms; Awtar, Slocum and Sevincer, doi:10.1115/1.2717231). Modes with the cart "
        "held and the leaves straight; a mode interferes with control where actuator and sensor both see it. The "
        "drawing is no substitute for one with tolerances"
    )


def blocks(flexure: BothModels) -> list[AnswerBlock]:
    """Return the block of the answer; what the joint can do is green, and warnings are red."""
    block = AnswerBlock(
        title=flexure.stage.name,
        sentences=sentences(flexure),
        colours=[GREEN, *(VERMILLION for _ in warnings(flexure))],
        columns=[Category(name, COLOURS[name]) for name in flexure.models],
        rows=rows(flexure),
        draw=partial(flexure_figures, flexure),
        numbers=partial(flexure_document, flexure),
    )
    return [block]


def flexure_document(flexure: BothModels) -> dict[str, Any]:
    """Return the results of the best model, and of the closed forms for comparison."""
    head = {"conclusion": sentences(flexure)[0], "stage": flexure.stage.name, "failure": flexure.failure or None}
    return {**head, **_evaluation(flexure.best), "closed_forms": _evaluation(flexure.closed)}


def _evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """Return stiffness, modes, stresses and margins by one model."""
    first = evaluation.interfering
    plain = {
        **entries(evaluation, "model", "stroke_m", "nonlinearity"),
        "drive_stiffness_n_per_m": evaluation.drive[0],
        "drive_stiffness_under_load_n_per_m": evaluation.loaded_drive,
        "drive_stiffness_at_stroke_n_per_m": evaluation.drive[-1],
        "support_stiffness_n_per_m": {
            axis: {"zero": support[0], "full": support[-1]}
            for axis, support in (("x", evaluation.support_x), ("y", evaluation.support_y))
        },
        "eigenfrequencies_hz": [mode.frequency for mode in evaluation.modes],
        "names": [mode.name for mode in evaluation.modes],
        "interferes": [evaluation.interferes(mode) for mode in evaluation.modes],
        "first_interfering_hz": None if first is None else first.frequency,
        "max_stress_pa": evaluation.stress,
        "stress_concentration": evaluation.mechanism.stress_concentration,
        **entries(evaluation, "yield_margin", "fatigue_margin", "shortening_m", "buckling_margin"),
        "buckling_load_n": evaluation.buckling,
        "buckling_load_per_leaf_n": evaluation.buckling / evaluation.mechanism.leaves,
        "stiffness_zero": evaluation.stiffness[0],
        "stiffness_full": evaluation.stiffness[1],
        **entries(evaluation, "clamp_stress_pa", "deflections_m", "forces_n"),
    }
    return {key: plain_json(value) for key, value in plain.items()}
