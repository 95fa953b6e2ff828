"""Show `friso rig in-position`: Fig. 28 of the thesis, by disturbance and damping."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.quantities import percent
from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Axis, Figure, Limit, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, GREY, ORANGE, VERMILLION
from friso.shown.drawing.prefixes import with_unit
from friso.studies.rig.outcome import Outcome
from friso_thesis.studies.rig.in_position import CASES, FORCE_BITS, SETTLING_TIME, SOURCES, InPosition, Standstill

COLOURS = {"locked": VERMILLION, "free": BLUE}
PARTS = (GREEN, ORANGE, GREY)
"""Colours of the single disturbances, in order."""


def sentences(outcome: Outcome) -> list[str]:
    """Say how still the stage stands, what moves it, and what damping does."""
    result: InPosition = outcome.result
    locked, free = (result.runs[case, "all"].true[0] for case in CASES)
    floor = "the floor of the stage file" if result.own_floor else "a quiet laboratory's floor (assumed)"
    return [
        f"Settled at {result.crossover:.3g} Hz, the stage deviates by {with_unit(locked[0], 'm')} RMS "
        f"(peak {with_unit(locked[1], 'm')}) with the joint locked and by {with_unit(free[0], 'm')} RMS "
        f"(peak {with_unit(free[1], 'm')}) with it free: {result.ratio('all'):.2g} times as much.",
        f"Disturbances: {floor}, and force noise of the drive of {with_unit(result.amplifier, 'N')} RMS (assumed: "
        f"rounding to {FORCE_BITS} bits). Each one alone, RMS with the joint locked and free: "
        f"{'; '.join(_source(result, source) for source in SOURCES[:-1])}.",
        _damping(result),
        *_after(result),
    ]


def _source(result: InPosition, source: str) -> str:
    locked, free = (with_unit(result.runs[case, source].true[0, 0], "m") for case in CASES)
    return f"{source} {locked} and {free}"


def _damping(result: InPosition) -> str:
    """Say how much of the free joint's larger deviation at standstill more damping removes."""
    recovered = result.recovered
    best = int(np.argmax(recovered))
    factor = result.damping / result.own_damping
    ten = int(np.argmin(abs(np.log(factor / 10))))
    if recovered[best] < 0.01:
        return "More damping in the joint recovers none of the difference."
    return (
        f"Damping in the joint recovers little of the difference: {percent(recovered[ten])} at {factor[ten]:.3g} times "
        f"its own {with_unit(result.own_damping, 'N*s/m')}, and at most {percent(recovered[best])}, at "
        f"{with_unit(result.damping[best], 'N*s/m')}. The rest is due to stiffness: the locked stage is held by the "
        "sticking bearing, the free one only by the joint and the controller."
        if recovered[ten] < 0.5
        else f"Damping in the joint recovers {percent(recovered[ten])} of the difference at {factor[ten]:.3g} "
        f"times its own {with_unit(result.own_damping, 'N*s/m')}, and {percent(recovered[best])} at "
        f"{with_unit(result.damping[best], 'N*s/m')}."
    )


def _after(result: InPosition) -> list[str]:
    creeps = {case: abs(float(result.after_move[case].mean[0])) for case in CASES}
    parts = [f"{with_unit(value, 'm')} with the joint {case}" for case, value in creeps.items()]
    return [f"From {SETTLING_TIME:.3g} s after a move on, the mean position is still off by {' and '.join(parts)}."]


def figures(outcome: Outcome) -> list[Figure]:
    """Draw position over time, spectra, and RMS over the damping."""
    result: InPosition = outcome.result
    return [_over_time(result), _spectra(result), _over_damping(result)]


def _over_time(result: InPosition) -> Figure:
    lines = tuple(
        Series(*result.traces[case], f"joint {case}", COLOURS[case], width=0.8) for case in ("free", "locked")
    )
    panel = Panel("", Axis("Time", "s"), Axis("Position minus reference", "m"), lines)
    caption = "The true position, all disturbances (Fig. 28)."
    return Figure("in_position", f"Standstill at {result.crossover:.3g} Hz", caption, (panel,))


def _spectra(result: InPosition) -> Figure:
    """Draw the spectra of the position at a standstill, one panel for each case of the joint."""
    panels = []
    above = slice(1, None)
    for case, colour in COLOURS.items():
        lines = [
            Series(result.frequencies[above], result.runs[case, source].spectrum[0, above], source, line, width=width)
            for source, line, width in zip(SOURCES, (*PARTS, colour), (1.0, 1.0, 1.0, 1.6), strict=True)
        ]
        densities = Axis("Amplitude density", "m/Hz^0.5", (1e-14, 1e-6), log=True)
        panels.append(Panel(f"joint {case}", Axis("Frequency", "Hz", log=True), densities, tuple(lines)))
    title = "Effect of each disturbance on the position"
    return Figure("in_position_spectra", title, "One-sided spectra of the true position.", tuple(panels), columns=2)


def _over_damping(result: InPosition) -> Figure:
    """Draw the RMS position error at standstill over the damping of the joint.

    The values of the locked and the free joint are shown for comparison.
    """
    free = Series(result.damping, result.damped.true[:, 0], "joint free", BLUE)
    limits = (
        Limit((float(result.runs["locked", "all"].true[0, 0]),), "joint locked", VERMILLION),
        Limit(
            (float(result.runs["free", "all"].true[0, 0]),),
            f"joint free, its own {with_unit(result.own_damping, 'N*s/m')}",
            GREY,
        ),
    )
    y = Axis("RMS deviation", "m", (0.0, 1.2 * float(result.damped.true[:, 0].max())))
    panel = Panel("", Axis("Damping of the joint", "N*s/m", log=True), y, (free,), limits=limits)
    return Figure("in_position_damping", "What damping in the joint recovers", "All disturbances.", (panel,))


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return all results for the JSON document."""
    result: InPosition = outcome.result
    return {
        "crossover_hz": result.crossover,
        "amplifier_noise_n": result.amplifier,
        "floor_of_the_stage": result.own_floor,
        "runs": {case: {source: _document(result.runs[case, source]) for source in SOURCES} for case in CASES},
        "after_move": {case: _document(result.after_move[case]) for case in CASES},
        "frequencies_hz": result.frequencies,
        "spectra_m_per_root_hz": {case: result.runs[case, "all"].spectrum[0] for case in CASES},
        "damping_ns_per_m": result.damping,
        "damped_rms_m": result.damped.true[:, 0],
        "recovered": result.recovered,
    }


def _document(run: Standstill) -> dict[str, float]:
    names = ("rms_m", "peak_m")
    true = dict(zip(names, run.true[0], strict=True))
    read = {f"read_{name}": value for name, value in zip(names, run.read[0], strict=True)}
    return {**true, **read, "mean_m": float(run.mean[0])}


VIEW = OutcomeView(sentences, figures, numbers)
