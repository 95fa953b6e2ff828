"""Build the JSON document of `friso compare`: isolator or firmware."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from friso.axis import axis_shown
from friso.equations.bandwidth import bandwidth
from friso.hunting.criteria import DISTINCT_CRITERION as PEAKS
from friso.hunting.criteria import OUTCOME_CRITERION as OUTCOME
from friso.questions.compare.words import sentences
from friso.shown.documents import entries, plain_json
from friso.studies.compare.study import Comparison, OptionResult


def compare_document(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON document in SI, with the unit as suffix of each key.

    A time that is infinite, because a machine never settles, becomes null.
    """
    machines = comparison.machines
    conclusion, *details = sentences(comparison)
    return plain_json(
        {
            "conclusion": conclusion,
            "details": details,
            "stage": comparison.stage.name,
            "interrupted": bool(comparison.not_run),
            **entries(comparison, "seed", "within_m", "bandwidth_limit_hz"),
            "machines": machines.count,
            "criteria": {
                "swings": f"{OUTCOME}; band: {axis_shown().suffix('within_m')}",
                "distinct_peaks": axis_shown().text(PEAKS),
            },
            "needed_bandwidth_hz": comparison.turning,
            "deadband_m": comparison.options.deadband,
            "sample_time_s": comparison.stage.flat()["drive.sample_time"],
            "from_file": [*machines.from_file],
            "spreads_percent": dict(machines.spreads),
            "left_out_draws": machines.sample.left_out,
            "options": {result.letter: _option(comparison, result) for result in comparison.results},
            "left_out": dict(comparison.options.left_out),
            "standstill_compared": comparison.shaken,
            "notes": [*comparison.notes],
        }
    )


def _option(comparison: Comparison, result: OptionResult) -> dict[str, Any]:
    """Return the results of one option, alone and compared with option a, the first."""
    pair = comparison.paired(result)
    crossover = bandwidth(result.option.stage.flat())
    return {
        "name": result.option.kind.title,
        "crossover_hz": crossover,
        "bandwidth_factor": result.option.factor,
        **entries(result, "unstable", "failed", "rests"),
        "swings": asdict(result.swinging),
        "distinct_peaks": asdict(result.counted),
        "in_position": asdict(result.settled),
        "stays": asdict(result.stays) if result.later.done.size else None,
        "settling_time_s": asdict(result.settling),
        "in_position_rms_m": asdict(result.in_position),
        "force_rms_n": asdict(result.force),
        "modulus_margin": asdict(result.margin) | {"least": float(result.loops.margin.min())},
        "machines_in_position": result.in_position_count,
        "against_a": {
            "swings": asdict(pair.swinging),
            "sooner": asdict(pair.sooner),
            "later": asdict(pair.later),
            "alike": asdict(pair.alike),
            "in_position_rms": asdict(pair.in_position) if comparison.shaken else None,
            "force_rms": asdict(pair.force),
        },
    }
