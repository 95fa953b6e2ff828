"""Say which stage brings the machines to rest, and how soon.

The figures show how soon machines settle with each stage, and how many do not come to rest. Blocks hold the table, the
picture and the machines.
"""

from __future__ import annotations

import math
import textwrap
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from friso.axis import axis_shown
from friso.equations.motion import last_corner
from friso.hunting.criteria import OUTCOME_CRITERION as OUTCOME
from friso.hunting.criteria import RESTS, SWINGS
from friso.intervals import Share
from friso.questions.tune.words import changes
from friso.remedies.comparison import AS_IT_IS, FASTER, ISOLATOR, LOCKED, Compared, Comparison, Quantile
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Axis,
    Dash,
    Figure,
    Markers,
    Panel,
    Series,
)
from friso.shown.text import length_at_rest, listed, share_with_interval, spread_sentences, with_unit

COLOURS = (INK, BLUE, VERMILLION, GREEN, ORANGE, PINK, SKY)
DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotted")
"""Colours and dashes of the stages' curves, in their order; the dash changes where colours begin again."""

MARKER_DISTANCE = 0.16
"""Distance between the markers of one stage, relative to the distance between stages."""


def compare_figures(comparison: Comparison, title: str) -> list[Figure]:
    """Draw how soon the machines settle with each stage, and how many keep moving; the `title` is the answer."""
    caption = (
        f"{comparison.machines.count} machines drawn with seed {comparison.seed}, the same for all stages. The curve "
        "of a stage ends at the share of machines that settle at all. Bars are 95 % intervals."
    )
    panels = (_settling(comparison), _moving(comparison))
    return [Figure("compare", title, caption, panels, subject=comparison.stage.name)]


def _settling(comparison: Comparison) -> Panel:
    """Return the panel of the fraction of machines that have settled over the time since the move."""
    times = [np.sort(result.measures.settling) for result in comparison.results]
    flats = [result.stage.flat() for result in comparison.results]
    end = max(flat["motion.duration"] - float(last_corner(flat)) for flat in flats)
    first = min((float(ordered[0]) for ordered in times if np.isfinite(ordered[0])), default=end)
    start = max(first, 1e-3 * end) / 1.3
    series = []
    for number, (result, ordered) in enumerate(zip(comparison.results, times, strict=True)):
        settled = ordered[np.isfinite(ordered)]
        x = np.concatenate([[start], np.repeat(np.maximum(settled, start), 2), [end]])
        y = np.repeat(100 * np.arange(len(settled) + 1) / len(ordered), 2)
        dash = DASHES[number // len(COLOURS) % len(DASHES)]
        series.append(Series(x, y, result.name, COLOURS[number % len(COLOURS)], dash))
    axis = Axis("Time after the move", "s", (start, end), log=True, prefixed=False)
    within = with_unit(comparison.within, "m")
    return Panel(f"In position to stay, within {within}", axis, Axis("Share", "%", (-3.0, 103.0)), tuple(series))


def _moving(comparison: Comparison) -> Panel:
    """Return the panel of the machines that swing at the end, or are not in position."""
    kinds = (
        ("swings at the end", VERMILLION, [result.swinging for result in comparison.results]),
        ("not in position at the end", BLUE, [_other(result.resting) for result in comparison.results]),
    )
    series, markers = [], []
    for number, (name, colour, shares) in enumerate(kinds):
        x = np.arange(len(shares), dtype=np.float64) + (number - 0.5) * MARKER_DISTANCE
        bars = np.array([100 * end for share in shares for end in (share.low, share.high, np.nan)])
        series.append(Series(np.repeat(x, 3), bars, "", colour))
        markers.append(Markers(x, np.array([100 * share.probability for share in shares]), name, colour))
    names = tuple("\n".join(textwrap.wrap(result.name, 14)) for result in comparison.results)
    axis = Axis("", "", (-0.5, len(names) - 0.5), words=names)
    y = Axis("Share of machines", "%", (-3.0, 103.0))
    return Panel("Machines that do not come to rest", axis, y, tuple(series), tuple(markers))


def _other(share: Share) -> Share:
    """Return the probability that something does not happen, with its interval."""
    return Share(1 - share.probability, 1 - share.high, 1 - share.low)


MEANINGS = (
    "Fractions and times have 95 % intervals (Clopper, Pearson; order statistics). Settling times count from the last "
    "corner of the reference; there and back, the longer one of both ends counts, and none where a machine is not in "
    "position when it returns. The error is the largest deviation in the last quarter of the run."
)


def basis(comparison: Comparison) -> str:
    """Say how the machines were run, and with which seed."""
    drive = "on drives as built" if comparison.as_built else "with controllers in continuous time"
    return f" {drive}, seed {comparison.seed}"


def blocks(comparison: Comparison) -> list[AnswerBlock]:
    """Return the blocks of the answer: what to choose, what the stages are, and the machines."""
    first = comparison.results[0]
    differences = [(result, changes(first.stage, result.stage)) for result in comparison.results[1:]]
    spreads = spread_sentences(comparison.machines.from_file, comparison.machines.spreads)
    drawn = f"{comparison.machines.count} machines were drawn with seed {comparison.seed}, the same for all stages."
    return [
        AnswerBlock(
            title=comparison.stage.name,
            sentences=sentences(comparison),
            columns=[result.name for result in comparison.results],
            rows=rows(comparison),
            draw=partial(compare_figures, comparison, answer(comparison)),
            numbers=partial(compare_document, comparison),
        ),
        AnswerBlock(
            title=f"What differs from {first.name}",
            caption=MEANINGS,
            details=[
                f"{result.name}: {listed(texts, 'and') or 'nothing of the machine'}" for result, texts in differences
            ],
        ),
        AnswerBlock(title="The machines", details=[drawn, *spreads, *(f"note: {note}" for note in comparison.notes)]),
    ]


def answer(comparison: Comparison) -> str:
    """Say which stage settles the machines soonest, and how the best with the other kind of joint does, or the next."""
    best, *others = comparison.ranked
    count, within = comparison.machines.count, with_unit(comparison.within, "m")
    if math.isinf(best.settling.value):
        few = f"{best.settled} of {count} machines settle within {within} with {named(best)}"
        rest = np.count_nonzero(best.measures.outcome == RESTS)
        few += f", and {rest} are in position in the end" if rest > best.settled else ""
        return few if not others else f"None of these settles 95 % of the machines: {few}"
    text = f"{named(best)} settles {_number(best, count)} machines, 95 % of them in {_soon(best)}"
    other = next((one for one in others if one.isolated != best.isolated), others[0] if others else None)
    if other is not None:
        late = math.isinf(other.settling.value)
        text += f"; {named(other)} {f'settles {other.settled}' if late else f'needs {_soon(other)}'}"
    return f"{text[:1].upper()}{text[1:]}" if best.name in PROSE else text


def sentences(comparison: Comparison) -> list[str]:
    """Return the answer, and how many machines swing on with the stages."""
    swings = [(np.count_nonzero(result.measures.outcome == SWINGS), result) for result in comparison.results]
    swing = [f"{number} with {named(result)}" for number, result in swings if number]
    count, left = comparison.machines.count, listed(comparison.not_run, "and")
    return [
        *([f"Interrupted: this is the answer without {left}."] if left else []),
        f"{answer(comparison)}.",
        f"Of {count} machines, {listed(swing, 'and')} swing at the end." if swing else "No machine swings at the end.",
    ]


PROSE = {
    AS_IT_IS: "the stage as it is",
    LOCKED: "the locked joint",
    FASTER: "a faster controller",
    ISOLATOR: "the isolator",
}
"""Names within a sentence of a stage and its remedies. Names of files stand as they are."""


def named(result: Compared) -> str:
    """Return the name of a stage as it stands within a sentence."""
    return PROSE.get(result.name, result.name)


def _soon(result: Compared) -> str:
    return with_unit(result.settling.value, "s")


def _number(result: Compared, count: int) -> str:
    return f"all {count}" if result.settled == count else f"{result.settled} of {count}"


def rows(comparison: Comparison) -> list[tuple[str, list[str]]]:
    """Return the rows of the table, with a cell for each stage."""
    results = comparison.results
    return [
        ("swings at the end", [share_with_interval(result.swinging) for result in results]),
        ("in position at the end", [share_with_interval(result.resting) for result in results]),
        ("95 % settle in", [_quantile(result.settling, "s") for result in results]),
        (axis_shown().named(["largest {effort} of 95 %"])[0], [_quantile(result.force, "N") for result in results]),
        ("error at the end, 95 %", [length_at_rest(result.error.value) for result in results]),
    ]


def _quantile(of: Quantile, unit: str) -> str:
    """Write a quantile with its interval; "never" stands for a time that too few machines reach."""
    if math.isinf(of.value):
        return "never" if unit == "s" else "unknown"
    high = "more" if math.isinf(of.high) else with_unit(of.high, unit)
    return f"{with_unit(of.value, unit)} ({with_unit(of.low, unit)} to {high})"


def compare_document(comparison: Comparison) -> dict[str, Any]:
    """Return the JSON document in SI, with the unit as suffix of each key.

    A number that is infinite, because too few machines settle, becomes null.
    """
    conclusion, *details = sentences(comparison)
    return plain_json(
        {
            "conclusion": conclusion,
            "details": details,
            "stage": comparison.stage.name,
            "interrupted": bool(comparison.not_run),
            **entries(comparison, "seed", "within_m", "as_built"),
            "machines": comparison.machines.count,
            "criteria": {"swings": f"{OUTCOME}; band: {axis_shown().suffix('within_m')}"},
            "from_file": [*comparison.machines.from_file],
            "spreads_percent": dict(comparison.machines.spreads),
            "stages": {result.name: _stage(result) for result in comparison.results},
            "notes": [*comparison.notes],
        }
    )


def _stage(result: Compared) -> dict[str, Any]:
    """Return the results of one stage."""
    return {
        "swings": asdict(result.swinging),
        "in_position": asdict(result.resting),
        "settled": result.settled,
        "settling_time_s": asdict(result.settling),
        "largest_force_n": asdict(result.force),
        "error_m": asdict(result.error),
        "failed": result.failed,
    }
