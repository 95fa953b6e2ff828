"""Show `friso rig measured-cycles`: Fig. 27 of the thesis, and what slows cycles down."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.quantities import percent
from friso.questions.rig.experiments.hunting import CRITERIA, runs_document, share_document
from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Axis, Band, Figure, Limit, Map, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, INK, VERMILLION
from friso.shown.drawing.prefixes import with_unit
from friso.studies.rig.moves_on_rails import RailRuns
from friso.studies.rig.outcome import Outcome
from friso_thesis.studies.rig.measured_cycles import (
    AS_SLOW,
    BINS,
    COULOMB_FACTORS,
    MOTORS,
    SIMILAR_SWING,
    STATIC_FACTORS,
    CycleComparison,
)

AREA = "#cfdfee"
COUNTED_FROM = 10.0
"""Time [s] from which cycles are drawn and counted."""

ASYMMETRY = "Difference of friction between the two sides"


def sentences(outcome: Outcome) -> list[str]:
    """Say how the cycle on an even rail looks, and what varied rails and other causes change."""
    result: CycleComparison = outcome.result
    even = result.even
    if not even.swings[0]:
        return ["On an even rail the stage does not swing at the end of the run, so there is no cycle to compare with."]
    return [
        f"On an even rail the cycle swings {with_unit(float(even.swing[0]), 'm')} peak to peak with a period "
        f"of {with_unit(float(even.period[0]), 's')}; from cycle to cycle its period scatters by "
        f"{percent(float(even.period_scatter[0]), 3)}.",
        _field(result),
        _asymmetry(result),
        _rolling(result),
        _irregular(result),
        _levels(result),
        _other_changes(result),
    ]


def _field(result: CycleComparison) -> str:
    """Say how many rails with random friction give cycles as slow as the measured ones."""
    as_slow, done = result.as_measured(result.field), int((~result.field.failed).sum())
    swings = int(result.field.swings.sum())
    slowest = np.nanmax(result.slower(result.field)) if swings else np.nan
    return (
        f"On rails with a random field {swings} of {done} runs still swing at their end; {int(as_slow.sum())} of them "
        f"have at least {AS_SLOW:g} times that period at a similar swing (within a factor of {SIMILAR_SWING:g}); the "
        "slowest "
        f"has {slowest:.3g} times."
    )


def _asymmetry(result: CycleComparison) -> str:
    """Say how a difference in friction between both sides of the target slows and ends cycles."""
    rows = [(low, high, *row) for low, high, row in zip(BINS[:-1], BINS[1:], result.by_asymmetry, strict=True)]
    low, high, even, slow = rows[0]
    parts = [
        f"{percent(even.probability)} keep swinging where it differs by less than {percent(high)} (period "
        f"{slow:.3g} times)"
    ]
    for low, high, share, slow in rows[1:]:
        if np.isfinite(share.probability):
            upper = f"{percent(low)} to {percent(high)}" if np.isfinite(high) else f"more than {percent(low)}"
            times = f" ({slow:.3g} times)" if np.isfinite(slow) else ""
            parts.append(f"{percent(share.probability)} at {upper}{times}")
    return (
        "A difference in friction between the two places where the stage sticks slows a cycle down, and ends it: "
        f"{', '.join(parts)}."
    )


def _rolling(result: CycleComparison) -> str:
    swings = result.rolling.swings.mean(axis=1)
    parts = [f"{percent(share)} at {percent(size)}" for share, size in zip(swings, result.harmonics, strict=True)]
    return (
        f"With rolling elements of {with_unit(result.pitch, 'm')} pitch, the following shares keep swinging, by first "
        f"harmonic: {', '.join(parts)}."
    )


def _irregular(result: CycleComparison) -> str:
    """Say whether cycles on varied rails are lopsided, and whether they repeat."""
    swings = result.field.swings & np.isfinite(result.field.rising)
    if not swings.any():
        return "No cycle on a varied rail lasts long enough to show how regular it is."
    above, below = result.field.above[swings], result.field.below[swings]
    sides = np.median(np.maximum(above, below) / np.minimum(above, below))
    scatter, heights = (
        np.median(values[swings]) for values in (result.field.period_scatter, result.field.height_scatter)
    )
    return (
        f"Such cycles are lopsided: one side is {sides:.2g} times as high as the other (median). From cycle to cycle "
        f"they repeat: the period scatters by {percent(scatter, 3)}, the heights by {percent(heights, 3)} of the "
        "swing. Friction at a given place is the same every time, so a varying rail does not make a cycle irregular; "
        "what changes from cycle to cycle is not in the model."
    )


def _levels(result: CycleComparison) -> str:
    """Say whether other friction levels, or a weaker motor, make the cycle as slow as measured."""
    slow, swing = result.slower(result.levels), result.larger(result.levels)
    matches = np.argwhere(result.as_measured(result.levels))
    if not len(matches):
        best = np.unravel_index(np.nanargmax(slow), slow.shape)
        return (
            "On an even rail none of the friction levels tried makes the cycle that slow; the slowest has "
            f"{slow[best]:.3g} times the period at {swing[best]:.3g} times the swing ({_level(*best)})."
        )
    closest = sorted(map(tuple, matches), key=lambda cell: abs(np.log(swing[cell])) + abs(np.log(slow[cell] / 2)))
    named = [f"{_level(*cell)} ({slow[cell]:.3g} and {swing[cell]:.3g})" for cell in closest[:3]]
    return (
        f"On an even rail {len(matches)} of {slow.size} other motors and friction levels make it that slow; closest to "
        f"twice the period at the same swing (period and swing over those of the file): {'; '.join(named)}."
    )


def _level(motor: Any, row: Any, column: Any) -> str:
    named = f"static friction times {STATIC_FACTORS[row]:g}, Coulomb friction times {COULOMB_FACTORS[column]:g}"
    return named if MOTORS[motor] == 1 else f"motor giving {MOTORS[motor]:.2g} of its force, {named}"


def _other_changes(result: CycleComparison) -> str:
    parts = []
    for name, runs in result.others.items():
        slow, swing = float(result.slower(runs)[0]), float(result.larger(runs)[0])
        parts.append(f"{name}: {f'{slow:.3g} and {swing:.3g}' if np.isfinite(slow) else 'no cycle'}")
    return f"Other changes on an even rail, period and swing over those of the file: {'; '.join(parts)}."


def figures(outcome: Outcome) -> list[Figure]:
    """Draw Fig. 27, maps over kinds of rails, cycles on lopsided rails, and friction levels."""
    result: CycleComparison = outcome.result
    if not result.even.swings[0]:
        return [_cycles(result)]
    return [_cycles(result), _maps(result), _by_asymmetry(result), _level_maps(result)]


def _cycles(result: CycleComparison) -> Figure:
    """Draw the cycle on an even rail, and the slowest one on a rail that varies."""
    even, varied = result.traces
    lines = [Series(*_late(even.time, even.deviation), "even rail", BLUE)]
    if varied is not None:
        assert result.slowest is not None
        deviation, length, rail = result.slowest
        label = f"deviation {percent(deviation)} over {with_unit(length, 'm')}, rail {rail:.0f}"
        lines.append(Series(*_late(varied.time, varied.deviation), label, VERMILLION))
    panel = Panel("", Axis("Time", "s"), Axis("Position minus reference", "m"), tuple(lines))
    caption = "The slowest cycle of a similar swing among the rails that vary (Fig. 27: measured and simulated)."
    return Figure("measured_cycles", "Cycles on an even rail and on one that varies", caption, (panel,))


def _late(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    late = time >= COUNTED_FROM
    return time[late], values[late]


def _maps(result: CycleComparison) -> Figure:
    """Draw maps over the correlation length and the deviation of friction along the rail."""
    lengths, deviations = (
        [with_unit(length, "m") for length in result.lengths],
        [percent(length) for length in result.deviations],
    )
    x, y = Axis("Correlation length", "", words=(*lengths,)), Axis("Deviation of friction", "", words=(*deviations,))
    columns, rows = (np.arange(float(len(words))) for words in (lengths, deviations))
    shares = result.field.swings.mean(axis=2)
    slow = _medians(result.slower(result.field))
    quantities = (
        ("Share of rails still swinging", shares, (0.0, 1.0)),
        ("Period over that of the even rail", slow, None),
    )
    panels = tuple(
        Panel("", x, y, maps=(Map(columns, rows, values, name, "", limits=limits),))
        for name, values, limits in quantities
    )
    caption = (
        f"{result.field.swings.shape[2]} rails in each cell; the period is the median of those that keep swinging."
    )
    return Figure("measured_cycles_rails", "Rails with a random field of friction", caption, panels, columns=2)


def _medians(values: np.ndarray) -> np.ndarray:
    """Return medians over the last axis, ignoring NaN; NaN where all values are NaN."""
    defined = np.asarray(np.isfinite(values).any(axis=-1))
    return np.where(defined, np.nanmedian(np.where(defined[..., None], values, 0.0), axis=-1), np.nan)


def _by_asymmetry(result: CycleComparison) -> Figure:
    """Draw how often and how slowly cycles swing, over the asymmetry of friction.

    Asymmetry is the difference of static friction, in the logarithm, between both sides of the target.
    """
    size, slow = np.abs(result.asymmetry).ravel(), result.slower(result.field).ravel()
    alive = np.isfinite(slow)
    largest = float(size.max())
    points = Markers(size[alive], slow[alive], "rails that keep swinging", BLUE)
    rows = [
        (low, min(high, largest), row[0]) for low, high, row in zip(BINS, BINS[1:], result.by_asymmetry, strict=False)
    ]
    rows = [row for row in rows if np.isfinite(row[2].probability)]
    middle = np.array([(low + high) / 2 for low, high, _ in rows])
    ends = ("probability", "low", "high")
    share, low, high = (np.array([getattr(estimate, name) for *_, estimate in rows]) for name in ends)
    axis = Axis(ASYMMETRY, "")
    shares = Panel(
        "share that keeps swinging", axis, Axis("Share of rails", "", (-0.03, 1.03)),
        (Series(middle, share, "in each class", BLUE),), bands=(Band(middle, low, high, "95 % interval", AREA),),
    )  # fmt: skip
    periods = Panel(
        "period of those", axis, Axis("Period over that of the even rail", ""), markers=(points,),
        limits=(Limit((AS_SLOW,), "nearly twice", INK),),
    )  # fmt: skip
    caption = (
        "The natural logarithm of static friction half a swing to one side of the target, minus that to the other."
    )
    return Figure(
        "measured_cycles_asymmetry", "What slows a cycle down and ends it", caption, (shares, periods), columns=2
    )


def _level_maps(result: CycleComparison) -> Figure:
    """Draw maps of period and swing over the levels of static and Coulomb friction."""
    x, y = Axis("Static friction over the file's", ""), Axis("Coulomb friction over the file's", "")
    quantities = (
        ("Period over the file's", result.slower(result.levels)),
        ("Swing over the file's", result.larger(result.levels)),
    )
    panels = tuple(
        Panel(
            _motor(motor),
            x,
            y,
            maps=(Map(np.array(STATIC_FACTORS), np.array(COULOMB_FACTORS), values[row].T, name, ""),),
        )
        for row, motor in enumerate(MOTORS)
        for name, values in quantities
    )
    return Figure(
        "measured_cycles_levels",
        "Even rail, other friction levels",
        "Empty: no cycle after the move or any of the releases tried.",
        panels,
        columns=2,
    )


def _motor(share: float) -> str:
    return "motor as assumed" if share == 1 else f"motor giving {share:.2g} of its force"


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return all results; arrays of runs have the shapes of `CycleComparison`."""
    result: CycleComparison = outcome.result
    classes = [
        {"from": low, "to": high, **share_document(share), "period_over_even": slow}
        for low, high, (share, slow) in zip(BINS, BINS[1:], result.by_asymmetry, strict=False)
    ]
    field = {"deviations": result.deviations, "correlation_lengths_m": result.lengths, "asymmetry": result.asymmetry}
    rolling = {"harmonics": result.harmonics, "pitch_m": result.pitch, "asymmetry": result.rolling_asymmetry}
    levels = {
        "motors": np.array(MOTORS),
        "static_over_file": np.array(STATIC_FACTORS),
        "coulomb_over_file": np.array(COULOMB_FACTORS),
    }
    return {
        "criteria": CRITERIA,
        "even_rail": _cycle_document(result.even),
        "field": field | _cycle_document(result.field),
        "by_asymmetry": classes,
        "rolling": rolling | _cycle_document(result.rolling),
        "levels": levels | _cycle_document(result.levels),
        "others": {name: _cycle_document(runs) for name, runs in result.others.items()},
    }


def _cycle_document(runs: RailRuns) -> dict[str, Any]:
    sides = {"above_m": runs.above, "below_m": runs.below, "rising_share": runs.rising}
    scatter = {"period_scatter": runs.period_scatter, "height_scatter": runs.height_scatter}
    return runs_document(runs) | sides | scatter


VIEW = OutcomeView(sentences, figures, numbers)
