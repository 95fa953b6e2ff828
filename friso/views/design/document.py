"""The JSON document of a design: SI, the unit in the key's suffix; what is not known or not finite is null."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.design.choice import Confirmed
from friso.design.edges import Corners
from friso.design.front import Candidate
from friso.design.geometry import Geometry
from friso.design.method import SLOW, Design, NoDesign
from friso.design.relax import Relaxation
from friso.design.verification import Outcome
from friso.stage.stage import numeric_keys
from friso.views.design.control import parallel_gains
from friso.views.design.window import lower, upper
from friso.views.documents import plain_json


def design_document(found: Design) -> dict[str, Any]:
    """All but the files."""
    document = {
        "stage": found.given.name,
        "spec": found.spec.name,
        "feasible": found.meets,
        "relax": _relax(found.unmet),
        "needed": found.needed,
        "machine_limit_hz": found.spec.limit,
        "without": _corners(found.without, found),
        "joint": _joint(found),
        "leaves": _leaves(found),
        "front": _front(found),
        "controller": _controller(found),
        "verification": _verification(found),
    }
    return plain_json(document)


def refused_document(stage: str, spec: str, failure: NoDesign) -> dict[str, Any]:
    """What there is to say where no design meets the specification."""
    told = {"stage": stage, "spec": spec, "feasible": False, "reason": failure.reason}
    return plain_json(told | {"relax": _relax(failure.relaxed)})


def _relax(relaxed: Sequence[Relaxation]) -> list[dict[str, Any]]:
    return [
        {"key": it.key, "requirement": it.requirement, "from": it.value, "to": it.needed, "unit": it.unit}
        for it in relaxed
    ]


def _corners(it: Corners, found: Design) -> dict[str, Any]:
    units = {key: field.unit for key, field in numeric_keys(found.stage.flat()).items()}
    worst = it.population.of(it.worst)
    return {
        "hunts": it.hunts,
        "highest_edge_hz": it.highest if it.hunts else None,
        "corners": it.population.count,
        "unknown_corners": it.unknown,
        "searched_hz": list(it.searched),
        "edges_hz": np.where(it.edges > 0, it.edges, np.nan),
        "worst_corner": {f"{key.replace('.', '_')}{_suffix(units[key])}": value for key, value in worst.items()},
    }


def _joint(found: Design) -> dict[str, Any]:
    it = found.fitted.choice.beams
    edges = _corners(found.edges, found)
    return {
        "stiffness_n_per_m": it.drive[0],
        "stroke_m": found.fitted.task.stroke,
        "force_at_stroke_n": it.forces[-1],
        "least_static_friction_n": found.fitted.task.friction,
        **edges,
    }


def _leaves(found: Design) -> dict[str, Any]:
    choice, it = found.fitted.choice, found.fitted.choice.beams
    wanted = [{"name": each.name, "key": each.ways[0].key} for each in choice.requirements]
    return {
        **_sizes(choice.geometry),
        "drive_stiffness_n_per_m": it.drive[0],
        "first_interfering_hz": choice.frequency,
        "max_stress_pa": it.stress,
        "clamp_stress_pa": it.clamp_stress,
        "yield_margin": it.yield_margin,
        "fatigue_margin": it.fatigue_margin,
        "load_n": found.fitted.task.load,
        "buckling_load_n": it.buckling,
        "requirements": [{**each, "excess": excess} for each, excess in zip(wanted, choice.excess, strict=True)],
        "passed_over": list(choice.passed_over),
    }


def _sizes(it: Geometry) -> dict[str, Any]:
    return {
        "count": int(it.sheet.leaves),
        "length_m": it.length,
        "width_m": it.width,
        "thickness_m": it.sheet.thickness,
        "spacing_m": it.spacing,
        "material": it.sheet.material,
    }


def _front(found: Design) -> list[dict[str, Any]]:
    """Every candidate, with what beams say of it where they were asked."""
    known = {each.candidate: each for each in found.confirmed}
    return [_candidate(each, known.get(each)) for each in found.candidates]


def _candidate(it: Candidate, beams: Confirmed | None) -> dict[str, Any]:
    return {
        **_sizes(it.geometry),
        "drive_stiffness_n_per_m": it.stiffness,
        "frequency_hz": it.frequency,
        "beams_n_per_m": beams.stiffness if beams else None,
        "beams_hz": beams.frequency if beams else None,
        "failure": beams.failure or None if beams else None,
    }


def _controller(found: Design) -> dict[str, Any]:
    it, gains = found.controller, found.controller.gains
    kp, ki, kd = parallel_gains(found)
    return {
        "crossover_hz": it.crossover,
        "bounds_above_hz": [{"value": each.value, "reason": each.reason} for each in upper(found)],
        "bounds_below_hz": [{"value": each.value, "reason": each.reason} for each in lower(found)],
        "k_p_n_per_m": gains.k_p,
        "tau_z_s": gains.tau_z,
        "tau_i_s": gains.tau_i,
        "tau_p_s": gains.tau_p,
        "kp_n_per_m": kp,
        "ki_n_per_m_s": ki,
        "kd_n_s_per_m": kd,
        "modulus_margin": it.margin,
        "least_modulus_margin": it.corners.min(),
        "joint_dampings_n_s_per_m": it.damping.tried,
        "modulus_margins": it.damping.margins,
        "joint_damping_worth_n_s_per_m": it.damping.tried[it.damping.worth],
    }


def _verification(found: Design) -> dict[str, Any]:
    it, wanted = found.verification, found.spec.position.settling_time
    met = None if wanted is None else it.free.slower_than(SLOW) <= wanted
    return {**_outcome(it.free), "settling_time_met": met, "locked": _outcome(it.locked)}


def _outcome(it: Outcome) -> dict[str, Any]:
    low, high = it.interval
    return {
        "moves": it.tried,
        "not_completed": len(it.completed) - it.tried,
        "hunting": it.hunting,
        "probability_low": low,
        "probability_high": high,
        "settling_median_s": it.slower_than(0.5),
        "settling_95_s": it.slower_than(0.05),
    }


def _suffix(unit: str) -> str:
    """A unit as a key ends with it: "_n_s_per_m"."""
    return f"_{unit.lower().replace('/', '_per_').replace('*', '_')}" if unit else ""
