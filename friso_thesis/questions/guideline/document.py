"""Build the JSON document of `friso guideline`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from friso.shown.documents import plain_json
from friso.version import VERSION
from friso_thesis.questions.guideline.page import group_rows
from friso_thesis.questions.guideline.words import accuracy
from friso_thesis.studies.guideline.claims import judged_claims
from friso_thesis.studies.guideline.compute import Fit, Guideline
from friso_thesis.studies.guideline.edges import OF
from friso_thesis.studies.guideline.laws import FittedLaw
from friso_thesis.studies.guideline.worked import ThesisCase, WorkedDesign


def guideline_document(guideline: Guideline) -> dict[str, Any]:
    """Return laws, errors, checks and the worked steps, ready for JSON."""
    steps = guideline.worked
    return plain_json(
        {
            "conclusion": accuracy(guideline)[0],
            "friso": VERSION,
            "samples": guideline.samples,
            "interrupted": guideline.interrupted,
            "seconds_s": guideline.seconds,
            "cores": guideline.cores,
            "parts_resumed": guideline.resumed,
            "groups": {name: asdict(count) | {"groups": count.groups} for name, count in guideline.counts.items()},
            "ranges": {row["written"]: row["range"] for row in group_rows(guideline) if row["range"]},
            "laws": {"locked": _law(guideline.locked), "free": _law(guideline.free)},
            "thesis_rig": {
                "rates_hz": dict(steps.rates),
                "machines": [asdict(machine) for machine in steps.machines],
                "friction": [_case(case) for case in steps.friction],
                "highest_locked_edge_hz": steps.bound,
                "safe_factor": steps.safe,
                "designs": [[_designed(item) for item in designs] for designs in steps.designs],
                "studies": {name: [_case(case) for case in cases] for name, cases in steps.studies.items()},
            },
            "parasitic": [asdict(item) for item in guideline.parasitic],
            "claims": [asdict(claim) for claim in judged_claims(steps)],
        }
    )


def _designed(design: WorkedDesign) -> dict[str, Any]:
    return {
        "limit_hz": design.limit,
        "aim_hz": design.aim,
        "stiffness_n_per_m": design.stiffness,
        "stroke_m": design.stroke,
        "worst_edge_hz": design.worst,
        "modulus_margin": design.margin,
        "cases": [_case(case) for case in design.cases],
    }


def _case(case: ThesisCase) -> dict[str, Any]:
    return {"changes": dict(case.changes), "law_hz": case.law, "computed_hz": case.computed, "kind": case.kind}


def _law(fit: Fit) -> dict[str, Any]:
    return {
        "rates": _rates(fit.law),
        "validation": list(fit.law.path),
        "errors": {
            "fit": asdict(fit.on_fit),
            "held_out": asdict(fit.on_test),
            "locked_given": asdict(fit.on_computed_edge),
        },
        "edges_of": OF,
        "samples": dict(fit.kinds),
        "attracting_again": fit.again,
        "simulated": asdict(fit.checked),
    }


def _rates(law: FittedLaw) -> dict[str, Any]:
    return {
        rate.name: {"factor": law.factors[number], "base": dict(rate.base), "exponents": law.of(number)}
        for number, rate in enumerate(law.law.rates)
    }
