"""Give the blocks of `friso compare`: the options, what the numbers are, and the machines."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import Any

from friso.axis import axis_shown
from friso.equations.bandwidth import bandwidth
from friso.hunting.criteria import DISTINCT_CRITERION as PEAKS
from friso.hunting.criteria import OUTCOME_CRITERION as OUTCOME
from friso.quantities import percent
from friso.questions.compare import words
from friso.questions.compare.figures import compare_figures
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.studies.compare.options import DEADBAND_SHARE, MODEL_ERROR
from friso.studies.compare.study import LONGER_FACTOR, Comparison, OptionResult

UNSHAKEN = (
    "The stage file has no [floor]: the in-position RMS shows whether the machines are at rest, not how still they "
    "would stand in a real room. "
)


def basis(comparison: Comparison) -> str:
    """Say on which machines the options were compared, and with which deadband and model error."""
    return (
        f" on a drive as built, seed {comparison.seed}; deadband {DEADBAND_SHARE:g} tolerances, model error "
        f"{percent(MODEL_ERROR)}"
    )


def blocks(comparison: Comparison) -> list[AnswerBlock]:
    """Return the blocks of the answer, the recommendation first."""
    meanings = (
        "Probabilities have 95 % intervals (Clopper, Pearson). Times, root mean squares and margins are medians over "
        "the machines, with intervals from order statistics. Settling times count from the last corner of the "
        "reference; there and back, it is the longer one of both ends, and none where a machine is not in position "
        "when it returns; the in-position RMS is that of the last quarter of the run, the force RMS that of the whole "
        f'run. {"" if comparison.shaken else UNSHAKEN}Margins are those of linear loops without the cable. "Later" '
        f"is the last half of a run {LONGER_FACTOR} times as long, on the first machines."
    )
    return [
        AnswerBlock(
            title=comparison.stage.name,
            sentences=words.answer(comparison),
            columns=axis_shown().named(words.COLUMNS),
            rows=words.table_rows(comparison),
            draw=partial(compare_figures, comparison),
            numbers=partial(compare_document, comparison),
        ),
        AnswerBlock(
            title="The options", details=[f"{label}: {text}" for label, text in words.options_rows(comparison)]
        ),
        AnswerBlock(title="What the numbers are", caption=meanings, details=words.details(comparison)),
        AnswerBlock(
            title="Compared with a, machine by machine",
            columns=axis_shown().named((*words.PAIRED, *([words.STANDSTILL] if comparison.shaken else []))),
            rows=words.paired_rows(comparison),
        ),
        AnswerBlock(
            title="The machines",
            details=[*words.population(comparison), *(f"note: {note}" for note in comparison.notes)],
        ),
    ]


def compare_document(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON document in SI, with the unit as suffix of each key.

    A time that is infinite, because a machine never settles, becomes null.
    """
    machines = comparison.machines
    conclusion, *details = words.sentences(comparison)
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
