"""Show the results of moves."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.log import Log
from friso.identification.moves import IdentifiedMoves, SimulatedLog
from friso.identification.output_error.profile import Profile
from friso.identification.output_error.settings import settings
from friso.quantities import percent
from friso.questions.identify.estimates import ends_document
from friso.questions.identify.kind_view import Facts, KindView, PredictionView
from friso.questions.identify.moves_figures import FORCE, moves_figures, record_panels
from friso.questions.identify.numbers import digits, estimates_in_words, with_interval, within
from friso.shown.documents import entries, unit_suffix
from friso.shown.drawing.figure import Figure
from friso.shown.drawing.prefixes import range_with_unit

FALLING = "viscous friction below zero: friction falls as the speed rises (Stribeck effect), which this model lacks"
"""Meaning of a negative viscous friction of the inverse model."""


def _sentences(moves: IdentifiedMoves) -> tuple[str, ...]:
    """Say how a log of moves was fitted, and what its motion covers."""
    low, high = moves.covered.gap
    along = "the machine was simulated along the logged position, and the forces were compared."
    if moves.fit.problem.closed:
        method = "The machine was simulated in closed loop on the logged reference."
    elif moves.loop is not None:
        method = f"In closed loop the simulated machine gets out of step with the log: {along}"
    else:
        method = f"{along[0].upper()}{along[1:]}"
    if not moves.covered.steady.size:
        return method, "No part of the motion is steady for long enough to show friction at a speed."
    gap = range_with_unit(low, high, "m/s")
    return (
        method,
        f"The widest gap in the steady speeds is {gap}: the record does not show friction there.",
    )


def _facts(moves: IdentifiedMoves) -> Facts:
    """List fits of the inverse model, errors of the simulation, and the residual force.

    The inverse model computes the force from the motion, for both directions together and for each.
    """
    residual = moves.residual
    correlation = (
        "uncorrelated from sample to sample"
        if residual.white
        else f"correlated over {digits(residual.correlation_time, 's')}"
    )
    return (
        ("Inverse model", _inverse_text(moves.inverse)),
        ("Inverse model, per direction", _inverse_text(moves.by_direction)),
        ("Bandwidth of the motion", digits(moves.inverse.bandwidth, "Hz")),
        ("Relative errors of the simulation", _errors(moves)),
        ("Residual force", f"{digits(residual.rms, moves.force_unit)} RMS, {correlation}"),
        ("Share of its power explained", f"{percent(residual.by_position, 3)} by position along the rail, "
         f"{percent(residual.by_velocity, 3)} by speed"),
    )  # fmt: skip


def _errors(moves: IdentifiedMoves) -> str:
    """Write the relative errors of the simulated record.

    If the model followed the logged position, only the error of the force has a meaning.
    """
    errors = moves.errors
    if moves.loop is None:
        return f"force {percent(errors.force, 3)}"
    return (
        f"position {percent(errors.position, 3)}, velocity {percent(errors.velocity, 3)}, acceleration "
        f"{percent(errors.acceleration, 3)}, force {percent(errors.force, 3)}"
    )


def _inverse_text(model: InverseModel) -> str:
    """Write the estimates of an inverse model, which computes the force from the motion."""
    text = f"{estimates_in_words(model.estimates)}; force error {percent(model.error, 3)}"
    falling = any(one.name.startswith("viscous") and one.high < 0 for one in model.estimates)
    return f"{text}; {FALLING}" if falling else text


def _numbers(moves: IdentifiedMoves) -> dict[str, Any]:
    """Return the inverse model and the simulated model of a log of moves, for the document."""
    low, high = moves.covered.gap
    parameters = {
        parameter.name: {"unit": unit_shown(parameter.unit), "value": moves.fit.value(parameter.name)}
        for parameter in moves.fit.problem.parameters
    }
    fitted = [moves.fit.problem.parameters[number].name for number in moves.fit.free]
    return {
        "inverse_model": _inverse_numbers(moves.inverse),
        "inverse_model_by_direction": _inverse_numbers(moves.by_direction),
        "output_error": {
            "loop": "follows the log" if moves.loop is None else "closed",
            "fitted_in_loop": moves.fit.problem.closed,
            "errors": asdict(moves.errors),
            "residual": _residual_numbers(moves),
            "parameters": parameters,
            "fitted": fitted,
            "profiles": {name: _profile_numbers(profile) for name, profile in moves.profiles.items()},
        },
        "not_shown": [
            {"key": estimate.name, "reason": axis_shown().text(estimate.reason)}
            for estimate in moves.estimates
            if not estimate.determined
        ],
        "no_steady_motion_m_per_s": [low, high],
        "samples_used": moves.part.stop - moves.part.start,
    }


def _inverse_numbers(model: InverseModel) -> dict[str, Any]:
    """Return an inverse model, which computes the force from the motion, for the document."""
    named = {
        f"{estimate.name.replace(' ', '_')}{unit_suffix(estimate.unit)}": ends_document(estimate)
        for estimate in model.estimates
    }
    return {**named, "force_error": model.error, "bandwidth_hz": model.bandwidth}


def _residual_numbers(moves: IdentifiedMoves) -> dict[str, Any]:
    """Return the residual force, for the document."""
    residual = moves.residual
    return {
        **entries(residual, "rms_n", "mean_n", "correlation_time_s", "white"),
        "explained_by_position": residual.by_position,
        "explained_by_velocity": residual.by_velocity,
    }


def _profile_numbers(profile: Profile) -> dict[str, Any]:
    """Return how much worse the fit becomes as one parameter is varied, for the document."""
    ends = entries(profile, "low", "high", "open_low", "open_high", "values")
    return {**ends, "mean_squares_n2": profile.cost, "limit_n2": profile.limit}


def _headline(moves: IdentifiedMoves) -> str:
    """Say what is identified from a log whose force is not in newtons; empty for newtons.

    Values are in units of that force. A stage file needs newtons, so the sentence says how to give the scale of the
    force.
    """
    if moves.force_unit == "N":
        return ""
    values = "; ".join(f"{within(estimate.name)} {with_interval(estimate)}" for estimate in moves.correlated)
    return (
        f"Identified, the force being in {moves.force_unit}: {values}. A stage file needs "
        f'--scale force="NUMBER {unit_shown("N")}/{moves.force_unit}".'
    )


def _prediction_sentence(simulated: SimulatedLog) -> str:
    """Say how well another log is predicted, by relative errors of its signals.

    The sentence also says how far the simulation of machines drawn from the estimates lies apart.
    """
    errors, apart = simulated.errors, simulated.apart
    farthest = f"differs from it by {percent(apart)} of the position" if np.isfinite(apart) else "runs away"
    return (
        f"relative errors of position {percent(errors.position, 3)}, velocity {percent(errors.velocity, 3)}, "
        f"acceleration {percent(errors.acceleration, 3)}, force {percent(errors.force, 3)}; of "
        f"{settings.machines_drawn} machines drawn from the intervals, and from the ranges of what is not identified, "
        f"the farthest {farthest}."
    )


def _prediction_figures(log: Log, simulated: SimulatedLog, number: int) -> list[Figure]:
    """Draw another log as measured and as simulated; `number` is that of the log."""
    caption = (
        f"{log.name}: simulated with the values identified from the other logs; relative error of the position "
        f"{percent(simulated.errors.position, 3)}, of the force {percent(simulated.errors.force, 3)}."
    )
    panels = record_panels(log, simulated.part, simulated.simulated)
    return [Figure(f"identify_prediction{number}", f"Predicted: {log.name}", caption, panels)]


VIEW = KindView[IdentifiedMoves](
    "Moves",
    _facts,
    _numbers,
    lambda result, logs, name: moves_figures(result, name),
    sentences=_sentences,
    warnings=lambda result: (),
    headline=_headline,
    longest=True,
    opening=FORCE,
    prediction=PredictionView[SimulatedLog](
        worst=lambda result: result.errors.force,
        sentence=_prediction_sentence,
        numbers=lambda result: {"errors": asdict(result.errors), "machines_within_intervals": result.apart},
        figures=_prediction_figures,
    ),
)
