"""What `friso rig measured-cycles` shows: Fig. 27 of the thesis, and what makes simulated cycles as slow as those."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.studies.rig.experiments.measured_cycles import (
    AS_SLOW,
    BINS,
    COULOMB,
    MOTORS,
    SIMILAR,
    STATIC,
    CycleComparison,
)
from friso.studies.rig.hunted import Hunted
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import BLUE, INK, VERMILLION, Axis, Band, Figure, Limit, Map, Markers, Panel, Series
from friso.views.drawing.prefixes import with_unit
from friso.views.rig.experiments.hunting import CRITERIA, runs_document, share_document
from friso.views.rig.outcome_view import OutcomeView

AREA = "#cfdfee"
LATE = 10.0
"""From where the cycles are shown [s], as those that count."""

ASYMMETRY = "Difference of friction between the two sides"


def sentences(outcome: Outcome) -> list[str]:
    """The even rail's cycle, what rails that vary make of it, and what else makes it as slow."""
    comparison: CycleComparison = outcome.result
    even = comparison.even
    if not even.swings[0]:
        return ["On an even rail this stage does not swing when the run ends: there is nothing to compare with."]
    return [
        f"On an even rail the cycle swings by {with_unit(float(even.swing[0]), 'm')} from peak to peak with a period "
        f"of {with_unit(float(even.period[0]), 's')}; from cycle to cycle its period scatters by "
        f"{float(even.period_scatter[0]):.1%}.",
        _field(comparison),
        _asymmetry(comparison),
        _rolling(comparison),
        _irregular(comparison),
        _levels(comparison),
        _others(comparison),
    ]


def _field(comparison: CycleComparison) -> str:
    found, done = comparison.as_measured(comparison.field), int((~comparison.field.failed).sum())
    swings = int(comparison.field.swings.sum())
    slowest = np.nanmax(comparison.slower(comparison.field)) if swings else np.nan
    return (
        f"On rails with a random field {swings} of {done} runs still swing at their end; {int(found.sum())} of them "
        f"have at least {AS_SLOW:g} times that period at a similar swing (within a factor of {SIMILAR:g}); the slowest "
        f"has {slowest:.3g} times."
    )


def _asymmetry(comparison: CycleComparison) -> str:
    """What ends hunting on rails that vary."""
    rows = [(low, high, *row) for low, high, row in zip(BINS[:-1], BINS[1:], comparison.by_asymmetry, strict=True)]
    low, high, even, slow = rows[0]
    parts = [f"{even.probability:.0%} keep swinging where it differs by less than {high:.0%} (period {slow:.3g} times)"]
    for low, high, share, slow in rows[1:]:
        if np.isfinite(share.probability):
            upper = f"{low:.0%} to {high:.0%}" if np.isfinite(high) else f"more than {low:.0%}"
            times = f" ({slow:.3g} times)" if np.isfinite(slow) else ""
            parts.append(f"{share.probability:.0%} at {upper}{times}")
    return (
        "What slows a cycle down, and ends it, is a difference of friction between the two places where the stage "
        "sticks: "
        f"{', '.join(parts)}."
    )


def _rolling(comparison: CycleComparison) -> str:
    swings = comparison.rolling.swings.mean(axis=1)
    parts = [f"{share:.0%} at {size:.0%}" for share, size in zip(swings, comparison.harmonics, strict=True)]
    return (
        f"With rolling elements of {with_unit(comparison.pitch, 'm')} pitch, the following shares keep swinging, by first "
        "harmonic: "
        f"{', '.join(parts)}."
    )


def _irregular(comparison: CycleComparison) -> str:
    """How the cycles of varied rails are irregular."""
    swings = comparison.field.swings & np.isfinite(comparison.field.rising)
    if not swings.any():
        return "No cycle on a varied rail is long enough to tell how regular it is."
    above, below = comparison.field.above[swings], comparison.field.below[swings]
    sides = np.median(np.maximum(above, below) / np.minimum(above, below))
    scatter, heights = (
        np.median(each[swings]) for each in (comparison.field.period_scatter, comparison.field.height_scatter)
    )
    return (
        f"Such cycles are lopsided: one side is {sides:.2g} times as high as the other (median). From cycle to "
        f"cycle they repeat: the period scatters by {scatter:.1%}, the heights by {heights:.1%} of the swing. "
        "Friction at a given place is the same every time, so a varying rail does not make a cycle irregular; what "
        "changes from cycle to cycle is not in the model."
    )


def _levels(comparison: CycleComparison) -> str:
    """Whether other friction levels make the cycle as slow."""
    slow, swing = comparison.slower(comparison.levels), comparison.larger(comparison.levels)
    found = np.argwhere(comparison.as_measured(comparison.levels))
    if not len(found):
        best = np.unravel_index(np.nanargmax(slow), slow.shape)
        return (
            f"On an even rail none of the friction levels tried does that; the slowest has {slow[best]:.3g} times the "
            "period at "
            f"{swing[best]:.3g} times the swing ({_level(*best)})."
        )
    closest = sorted(map(tuple, found), key=lambda cell: abs(np.log(swing[cell])) + abs(np.log(slow[cell] / 2)))
    named = [f"{_level(*cell)} ({slow[cell]:.3g} and {swing[cell]:.3g})" for cell in closest[:3]]
    return (
        f"On an even rail {len(found)} of {slow.size} other motors and friction levels do; closest to twice the period "
        "at the same swing (period and swing over those of the file): "
        f"{'; '.join(named)}."
    )


def _level(motor: Any, row: Any, column: Any) -> str:
    named = f"static friction times {STATIC[row]:g}, Coulomb friction times {COULOMB[column]:g}"
    return named if MOTORS[motor] == 1 else f"motor giving {MOTORS[motor]:.2g} of its force, {named}"


def _others(comparison: CycleComparison) -> str:
    parts = []
    for name, runs in comparison.others.items():
        slow, swing = float(comparison.slower(runs)[0]), float(comparison.larger(runs)[0])
        parts.append(f"{name}: {f'{slow:.3g} and {swing:.3g}' if np.isfinite(slow) else 'no cycle'}")
    return f"Other changes on an even rail, period and swing over those of the file: {'; '.join(parts)}."


def figures(outcome: Outcome) -> list[Figure]:
    """Fig. 27, the maps of the rails with a field, the cycles by their asymmetry, and the friction levels."""
    comparison: CycleComparison = outcome.result
    if not comparison.even.swings[0]:
        return [_cycles(comparison)]
    return [_cycles(comparison), _maps(comparison), _by_asymmetry(comparison), _level_maps(comparison)]


def _cycles(comparison: CycleComparison) -> Figure:
    even, varied = comparison.traces
    lines = [Series(*_late(even.time, even.deviation), "even rail", BLUE)]
    if varied is not None:
        assert comparison.slowest is not None
        label = f"deviation {comparison.slowest[0]:.0%} over {with_unit(comparison.slowest[1], 'm')}, rail {comparison.slowest[2]:.0f}"
        lines.append(Series(*_late(varied.time, varied.deviation), label, VERMILLION))
    panel = Panel("", Axis("Time", "s"), Axis("Position minus reference", "m"), tuple(lines))
    caption = "The slowest cycle of a similar swing among the rails that vary (Fig. 27: measured and simulated)."
    return Figure("measured_cycles", "Cycles on an even rail and on one that varies", caption, (panel,))


def _late(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    late = time >= LATE
    return time[late], values[late]


def _maps(comparison: CycleComparison) -> Figure:
    lengths, deviations = (
        [with_unit(length, "m") for length in comparison.lengths],
        [f"{length:.0%}" for length in comparison.deviations],
    )
    x, y = Axis("Correlation length", "", words=(*lengths,)), Axis("Deviation of friction", "", words=(*deviations,))
    columns, rows = (np.arange(float(len(words))) for words in (lengths, deviations))
    shares = comparison.field.swings.mean(axis=2)
    slow = _medians(comparison.slower(comparison.field))
    quantities = (
        ("Share of rails still swinging", shares, (0.0, 1.0)),
        ("Period over that of the even rail", slow, None),
    )
    panels = tuple(
        Panel("", x, y, maps=(Map(columns, rows, values, name, "", limits=limits),))
        for name, values, limits in quantities
    )
    caption = (
        f"{comparison.field.swings.shape[2]} rails in each cell; the period is the median of those that keep swinging."
    )
    return Figure("measured_cycles_rails", "Rails with a random field of friction", caption, panels, columns=2)


def _medians(values: np.ndarray) -> np.ndarray:
    """Medians over the last axis of what is known, NaN of nothing."""
    known = np.asarray(np.isfinite(values).any(axis=-1))
    return np.where(known, np.nanmedian(np.where(known[..., None], values, 0.0), axis=-1), np.nan)


def _by_asymmetry(comparison: CycleComparison) -> Figure:
    size, slow = np.abs(comparison.asymmetry).ravel(), comparison.slower(comparison.field).ravel()
    alive = np.isfinite(slow)
    largest = float(size.max())
    points = Markers(size[alive], slow[alive], "rails that keep swinging", BLUE)
    known = [
        (low, min(high, largest), row[0])
        for low, high, row in zip(BINS, BINS[1:], comparison.by_asymmetry, strict=False)
    ]
    known = [row for row in known if np.isfinite(row[2].probability)]
    middle = np.array([(low + high) / 2 for low, high, _ in known])
    ends = ("probability", "low", "high")
    share, low, high = (np.array([getattr(each, name) for *_, each in known]) for name in ends)
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


def _level_maps(comparison: CycleComparison) -> Figure:
    x, y = Axis("Static friction over the file's", ""), Axis("Coulomb friction over the file's", "")
    quantities = (
        ("Period over the file's", comparison.slower(comparison.levels)),
        ("Swing over the file's", comparison.larger(comparison.levels)),
    )
    panels = tuple(
        Panel(_motor(motor), x, y, maps=(Map(np.array(STATIC), np.array(COULOMB), values[row].T, name, ""),))
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
    """All that was found; arrays of runs have the shapes of `CycleComparison`."""
    comparison: CycleComparison = outcome.result
    classes = [
        {"from": low, "to": high, **share_document(share), "period_over_even": slow}
        for low, high, (share, slow) in zip(BINS, BINS[1:], comparison.by_asymmetry, strict=False)
    ]
    field = {
        "deviations": comparison.deviations,
        "correlation_lengths_m": comparison.lengths,
        "asymmetry": comparison.asymmetry,
    }
    rolling = {
        "harmonics": comparison.harmonics,
        "pitch_m": comparison.pitch,
        "asymmetry": comparison.rolling_asymmetry,
    }
    levels = {"motors": np.array(MOTORS), "static_over_file": np.array(STATIC), "coulomb_over_file": np.array(COULOMB)}
    return {
        "criteria": CRITERIA,
        "even_rail": _cycle_document(comparison.even),
        "field": field | _cycle_document(comparison.field),
        "by_asymmetry": classes,
        "rolling": rolling | _cycle_document(comparison.rolling),
        "levels": levels | _cycle_document(comparison.levels),
        "others": {name: _cycle_document(runs) for name, runs in comparison.others.items()},
    }


def _cycle_document(runs: Hunted) -> dict[str, Any]:
    sides = {"above_m": runs.above, "below_m": runs.below, "rising_share": runs.rising}
    scatter = {"period_scatter": runs.period_scatter, "height_scatter": runs.height_scatter}
    return runs_document(runs) | sides | scatter


VIEW = OutcomeView(sentences, figures, numbers)
