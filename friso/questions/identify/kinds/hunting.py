"""Show the cycles in a log of hunting, beside the cycle that friso predicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.identification.experiments.hunting import HuntingLog
from friso.identification.kind import Source
from friso.questions.identify.kind_view import TIME, Facts, KindView
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Figure, Limit, Markers, Panel, Series
from friso.shown.drawing.palette import INK, VERMILLION
from friso.shown.drawing.prefixes import with_unit


def _facts(result: HuntingLog) -> Facts:
    """List count, period, amplitude and symmetry of the cycles, and the predicted cycle."""
    period = f"{result.period:.3g} s (standard deviation {result.period_deviation:.2g} s)"
    scatter = with_unit(result.amplitude_deviation, "m")
    amplitude = f"±{with_unit(result.amplitude, 'm')} (standard deviation {scatter})"
    sides = f"{with_unit(result.above, 'm')} above the reference, {with_unit(result.below, 'm')} below"
    facts = [
        ("Whole cycles", str(result.count)),
        ("Period", period),
        ("Amplitude", amplitude),
        ("Peaks", sides),
    ]
    if cycle := result.predicted:
        slower, larger = result.period / cycle.period, result.amplitude / cycle.amplitude
        facts.append(("Predicted cycle", f"±{with_unit(cycle.amplitude, 'm')} every {cycle.period:.3g} s"))
        facts.append(("Measured over predicted", f"{slower:.3g} times the period, {larger:.3g} times the amplitude"))
    return tuple(facts)


def _numbers(result: HuntingLog) -> dict[str, Any]:
    """Return the cycles and the predicted one, for the document."""
    numbers = entries(result, "period_s", "period_deviation_s", "amplitude_m", "amplitude_deviation_m", "warnings")
    predicted = result.predicted and entries(result.predicted, "amplitude_m", "period_s")
    return {**numbers, **entries(result, "above_m", "below_m"), "cycles": result.count, "predicted": predicted}


def _figures(result: HuntingLog, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw the deviation over time with the peaks of the cycles, and the predicted amplitude."""
    limits = ()
    if result.predicted:
        size = result.predicted.amplitude
        limits = (Limit((-size, size), "predicted amplitude", VERMILLION, "dashed"),)
    panel = Panel(
        "",
        TIME,
        Axis("Position minus reference", "m"),
        (Series(result.time, result.deviation, "as logged", INK, width=1.0),),
        (Markers(result.time[result.peaks], result.deviation[result.peaks], "peaks", VERMILLION),),
        limits,
    )
    return [Figure(f"{name}_record", "Hunting", "From the last change of the reference on.", (panel,))]


def _headline(result: HuntingLog) -> str:
    """Say with which amplitude and period the stage hunts, and how many cycles were seen."""
    return f"It hunts: ±{with_unit(result.amplitude, 'm')} every {result.period:.3g} s, {result.count} cycles."


VIEW = KindView[HuntingLog]("Hunting", _facts, _numbers, _figures, headline=_headline, longest=True)
