"""Give the one block of `friso design`, and its stage files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from friso.design_method.method import Design, NoDesign, UnfinishedDesign
from friso.design_method.requirements import Candidate, Confirmed, Relaxation
from friso.design_method.settings import settings
from friso.design_method.spec import Geometry
from friso.design_method.verification import Corners, MachineOutcomes
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.questions.design.figures import design_figures
from friso.questions.design.steps import requirement_rows, steps
from friso.questions.design.window import lower, upper
from friso.questions.design.words import need_words, refusal, so_far, verdicts
from friso.shown.blocks import AnswerBlock, Content
from friso.shown.documents import entries, plain_json, unit_suffix
from friso.shown.text import unknown_condition
from friso.stage import Stage

LEAVES_STEP = 2
"""Number of the step that shows the drawing and the requirements."""

NOT_VERIFIED = "design-not-verified.toml"
"""Name of the stage file of an unfinished design."""


def blocks(design: Design | UnfinishedDesign) -> list[AnswerBlock]:
    """Return the block of the answer: verdicts and steps, or what is decided of an unfinished design."""
    numbers = partial(design_document, design)
    if isinstance(design, UnfinishedDesign):
        return [AnswerBlock(sentences=so_far(design), numbers=numbers)]
    colours, sentences = zip(*verdicts(design), strict=True)
    titled = [f"{step.title}: {' '.join(step.sentences)}" for step in steps(design)]
    details = [f"{number}. {text}" for number, text in enumerate(titled, 1)]
    draw = partial(design_figures, design)
    return [AnswerBlock(sentences=sentences, colours=colours, details=details, draw=draw, numbers=numbers)]


def page_values(design: Design) -> dict[str, Any]:
    """Return the steps that the page shows, with how much of each requirement is used."""
    return {
        "spec": design.spec,
        "steps": steps(design),
        "leaves": LEAVES_STEP,
        "requirements": requirement_rows(design),
    }


def further_files(design: Design) -> dict[str, Content]:
    """Return the stage files: the design, and the worst machine that was tried with it."""
    return {
        NOT_VERIFIED: None,
        "design.toml": design.stage.to_toml(),
        "worst.toml": design.verification.worst.to_toml(),
    }


def design_document(design: Design | UnfinishedDesign) -> dict[str, Any]:
    """Return the whole design except its files; what an unfinished design has not decided is null."""
    if isinstance(design, UnfinishedDesign):
        return plain_json(
            {
                "conclusion": " ".join(so_far(design)),
                "interrupted": design.interrupted,
                **dict.fromkeys(("feasible", "relax", "without", "front", "verification")),
                "stage": design.original.name,
                "spec": design.spec.name,
                "needed": design.need.isolator,
                "machine_limit_hz": design.spec.limit,
                "leaves": _sizes(design.fitted.choice.geometry),
                "joint": {"stroke_m": design.fitted.task.stroke},
                "controller": {"crossover_hz": design.stage.flat()[CROSSOVER]},
            }
        )
    document = {
        "conclusion": need_words(design.need),
        "stage": design.original.name,
        "spec": design.spec.name,
        "feasible": design.meets,
        "relax": _relax(design.unmet),
        "needed": design.needed,
        "machine_limit_hz": design.spec.limit,
        "without": _corners(design.without, design),
        "joint": _joint(design),
        "leaves": _leaves(design),
        "front": _front(design),
        "controller": _controller(design),
        "verification": _verification(design),
    }
    return plain_json(document)


def refused_document(stage: Stage, spec: str, failure: NoDesign) -> dict[str, Any]:
    """Return the reason why no design meets the specification, and what to relax."""
    conclusion = unknown_condition(stage) + refusal(failure)
    document = {"conclusion": conclusion, "stage": stage.name, "spec": spec, "feasible": False}
    document["reason"] = failure.reason
    return plain_json(document | {"relax": _relax(failure.relaxed)})


def _relax(relaxed: Sequence[Relaxation]) -> list[dict[str, Any]]:
    """Return the requirements to relax, from which value to which."""
    return [
        {**entries(relaxation, "key", "requirement", "unit"), "from": relaxation.value, "to": relaxation.needed}
        for relaxation in relaxed
    ]


def _corners(corners: Corners, design: Design) -> dict[str, Any]:
    """Return the edge of hunting at the extremes of friction and masses, and the worst of them."""
    units = {key: field.unit for key, field in design.stage.numeric_keys().items()}
    worst = corners.population.of(corners.worst)
    return {
        "hunts": corners.hunts,
        "highest_edge_hz": corners.highest if corners.hunts else None,
        "corners": corners.population.count,
        "unknown_corners": corners.unknown,
        "searched_hz": list(corners.searched),
        "edges_hz": np.where(corners.edges > 0, corners.edges, np.nan),
        "worst_corner": {f"{key.replace('.', '_')}{unit_suffix(units[key])}": value for key, value in worst.items()},
    }


def _joint(design: Design) -> dict[str, Any]:
    """Return the joint's stiffness, stroke and force, and the edge of hunting with it."""
    beams = design.fitted.choice.beams
    edges = _corners(design.edges, design)
    return {
        "stiffness_n_per_m": beams.drive[0],
        "stroke_m": design.fitted.task.stroke,
        "force_at_stroke_n": beams.forces[-1],
        "least_static_friction_n": design.fitted.task.friction,
        **edges,
    }


def _leaves(design: Design) -> dict[str, Any]:
    """Return the sizes, stiffness, stresses and margins of the leaf springs."""
    choice, beams = design.fitted.choice, design.fitted.choice.beams
    requirements = [{"name": requirement.name, "key": requirement.keys[0].key} for requirement in choice.requirements]
    return {
        **_sizes(choice.geometry),
        "drive_stiffness_n_per_m": beams.drive[0],
        "first_interfering_hz": choice.frequency,
        "max_stress_pa": beams.stress,
        **entries(beams, "clamp_stress_pa", "yield_margin", "fatigue_margin"),
        "load_n": design.fitted.task.load,
        "buckling_load_n": beams.buckling,
        "requirements": [
            {**requirement, "excess": excess} for requirement, excess in zip(requirements, choice.excess, strict=True)
        ],
        "passed_over": list(choice.passed_over),
    }


def _sizes(geometry: Geometry) -> dict[str, Any]:
    """Return the dimensions and material of leaf springs."""
    sheet = {"count": int(geometry.sheet.leaves), **entries(geometry.sheet, "thickness_m", "material")}
    return {**sheet, **entries(geometry, "length_m", "width_m", "spacing_m")}


def _front(design: Design) -> list[dict[str, Any]]:
    """Return all leaf springs on the Pareto front, with the beam model's results where computed."""
    confirmed = {confirmation.candidate: confirmation for confirmation in design.confirmed}
    return [_candidate(candidate, confirmed.get(candidate)) for candidate in design.candidates]


def _candidate(candidate: Candidate, beams: Confirmed | None) -> dict[str, Any]:
    """Return one set of leaf springs by closed forms and, if computed, by the beam model."""
    return {
        **_sizes(candidate.geometry),
        "drive_stiffness_n_per_m": candidate.stiffness,
        "frequency_hz": candidate.frequency,
        "beams_n_per_m": beams.stiffness if beams else None,
        "beams_hz": beams.frequency if beams else None,
        "failure": beams.failure or None if beams else None,
    }


def _controller(design: Design) -> dict[str, Any]:
    """Return crossover, bounds, gains and modulus margins of the controller."""
    controller, gains = design.controller, design.controller.gains
    kp, ki, kd, _ = gains.parallel.values()
    return {
        "crossover_hz": controller.crossover,
        "bounds_above_hz": [entries(bound, "value", "reason") for bound in upper(design)],
        "bounds_below_hz": [entries(bound, "value", "reason") for bound in lower(design)],
        **entries(gains, "k_p_n_per_m", "tau_z_s", "tau_i_s", "tau_p_s"),
        "kp_n_per_m": kp,
        "ki_n_per_m_s": ki,
        "kd_n_s_per_m": kd,
        "modulus_margin": controller.margin,
        "least_modulus_margin": controller.corners.min(),
        "joint_dampings_n_s_per_m": controller.damping.tried,
        "modulus_margins": controller.damping.margins,
        "joint_damping_worth_n_s_per_m": controller.damping.tried[controller.damping.worth],
    }


def _verification(design: Design) -> dict[str, Any]:
    """Return the outcome of the simulated moves with the joint free and locked."""
    verification, limit = design.verification, design.spec.position.settling_time
    met = None if limit is None else verification.free.slower_than(settings.slow_share) <= limit
    return {**_outcome(verification.free), "settling_time_met": met, "locked": _outcome(verification.locked)}


def _outcome(outcome: MachineOutcomes) -> dict[str, Any]:
    """Return how many moves fail to rest, with the probability and the settling times."""
    low, high = outcome.interval
    return {
        "moves": outcome.tried,
        "not_completed": len(outcome.completed) - outcome.tried,
        "not_at_rest": outcome.missed,
        "swinging": outcome.swinging,
        "probability_low": low,
        "probability_high": high,
        "settling_median_s": outcome.slower_than(0.5),
        "settling_95_s": outcome.slower_than(0.05),
    }
