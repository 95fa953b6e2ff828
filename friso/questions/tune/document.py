"""Build the JSON document of `friso tune`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from friso.questions.tune.words import answer, changes, explained, failing, unsure_why, why_unmet
from friso.remedies.method import Advice
from friso.remedies.verified import Performance, RemedyOutcome
from friso.shown.documents import entries, plain_json


def tune_document(tuning: Advice) -> dict[str, Any]:
    """Return the JSON document in SI, with the unit as suffix of each key.

    A settling time is null if it is never reached. The upper end of its interval is also null if the machines are too
    few to bound it.
    """
    goal = tuning.goal
    first, *further = answer(tuning)
    return plain_json(
        {
            "conclusion": first,
            "details": [*further, *explained(tuning), *failing(tuning)],
            "stage": tuning.stage.name,
            **entries(tuning, "interrupted", "needed", "seed"),
            "least_change": tuning.least.remedy.name if tuning.least else None,
            "machines": tuning.machines.count,
            "goal": {
                **entries(goal, "within_m", "settle_s", "force_limit_n", "bandwidth_limit_hz", "distance", "share"),
                "moves": None if goal.moves is None else asdict(goal.moves),
                "modulus_margin": goal.margin,
            },
            "as_is": _performance(tuning.present, tuning) | {"verdict": tuning.case.verdict, "doubts": [*tuning.unmet]},
            "ways": {outcome.remedy.name: _remedy(outcome, tuning) for outcome in tuning.outcomes},
            "edge_moved_by_1_percent": dict(tuning.sensitivities.ranked()) if tuning.sensitivities else {},
        }
    )


def _remedy(outcome: RemedyOutcome, tuning: Advice) -> dict[str, Any]:
    """Return one remedy: whether it works, what it changes, and how machines perform with it."""
    if outcome.stage is None or outcome.measured is None:
        why = unsure_why(outcome) if outcome.interrupted else why_unmet(outcome, tuning)
        return {"works": outcome.certainty, "why": why}
    confirmation = outcome.confirmation
    return {
        "works": outcome.certainty,
        "doubts": [*outcome.doubts],
        "changes": changes(tuning.stage, outcome.stage),
        "keys_changed": tuning.size(outcome).keys,
        "factor": tuning.size(outcome).factor,
        "verdict": confirmation.verdict if confirmation else None,
        "certain": bool(confirmation and confirmation.certain and not outcome.stage.assumed_keys),
        **_performance(outcome.measured, tuning),
    }


def _performance(measured: Performance, tuning: Advice) -> dict[str, Any]:
    """Return fractions, settling times, force and margin of machines."""
    goal = tuning.goal
    return {
        "moves_m": measured.held_moves(goal),
        "meets_goal": asdict(measured.share(goal)),
        "slowest_twentieth_s": measured.slowest(goal),
        "slowest_twentieth_interval_s": measured.slowest_interval(goal),
        "median_s": measured.median,
        "force_n": measured.force(goal),
        "modulus_margin": measured.least_margin(goal),
        "own_margin": measured.own_margin,
        "stiffness_n_per_m": measured.stiffness,
    }
