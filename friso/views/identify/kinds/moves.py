"""How moves are shown."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from friso.identify.experiments.moves import IdentifiedMoves, SimulatedLog
from friso.identify.inverse_model import InverseModel
from friso.identify.logs.log import Log
from friso.identify.output_error.profile import Profile
from friso.views.drawing.figure import Figure
from friso.views.drawing.prefixes import range_with_unit
from friso.views.identify.estimates import ends_document
from friso.views.identify.kind_view import Facts, KindView, PredictionView
from friso.views.identify.moves_figures import moves_figures, record_panels
from friso.views.identify.numbers import digits, listed, percent

SUFFIXES = {"N": "n", "kg": "kg", "N*s/m": "n_s_per_m"}
"""Of keys, by unit, of what the inverse model tells."""


def _sentences(moves: IdentifiedMoves) -> tuple[str, ...]:
    """How it was fitted, and what the motion covers."""
    low, high = moves.covered.gap
    along = "the machine was simulated along the position of the log: what is compared is the force that it takes."
    if moves.fit.problem.closed:
        how = "The machine was simulated in its own loop, on the reference of the log."
    elif moves.loop is not None:
        how = f"In its own loop the simulated machine gets out of step with the log. For the fit, {along}"
    else:
        how = f"{along[0].upper()}{along[1:]}"
    if not moves.covered.steady.size:
        return how, "The motion is nowhere steady for long enough to show friction at a speed."
    gap = range_with_unit(low, high, "m/s")
    return (
        how,
        f"The widest range of speeds without steady motion is {gap}: of friction there, the record says nothing.",
    )


def _facts(moves: IdentifiedMoves) -> Facts:
    """Both fits of the inverse model, the errors of the output-error fit, and what is left."""
    left = moves.residual
    alike = (
        "neighbouring samples do not resemble each other"
        if left.white
        else (f"alike over {digits(left.correlation_time, 's')}")
    )
    return (
        ("Inverse model", _inverse_text(moves.inverse)),
        ("Inverse model, per direction", _inverse_text(moves.by_direction)),
        ("Bandwidth of the motion", digits(moves.inverse.bandwidth, "Hz")),
        ("Relative errors of the simulation", _errors(moves)),
        ("Force left unexplained", f"{digits(left.rms, 'N')} (root mean square), {alike}"),
        ("Of its power, the mean explains", f"{percent(left.by_position)} over places along the rail, "
         f"{percent(left.by_velocity)} over speeds"),
    )  # fmt: skip


def _errors(moves: IdentifiedMoves) -> str:
    """The relative errors of the simulated record; along the log's position, that of the force alone says anything."""
    errors = moves.errors
    if moves.loop is None:
        return f"force {percent(errors.force)}"
    return (
        f"position {percent(errors.position)}, velocity {percent(errors.velocity)}, acceleration "
        f"{percent(errors.acceleration)}, force {percent(errors.force)}"
    )


def _inverse_text(model: InverseModel) -> str:
    return f"{listed(model.estimates)}; force error {percent(model.error)}"


def _numbers(moves: IdentifiedMoves) -> dict[str, Any]:
    low, high = moves.covered.gap
    parameters = {
        parameter.name: {"unit": parameter.unit, "value": moves.fit.value(parameter.name)}
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
            {"key": estimate.name, "reason": estimate.reason} for estimate in moves.estimates if not estimate.shown
        ],
        "no_steady_motion_m_per_s": [low, high],
        "samples_used": moves.part.stop - moves.part.start,
    }


def _inverse_numbers(model: InverseModel) -> dict[str, Any]:
    named = {
        f"{estimate.name.replace(' ', '_')}_{SUFFIXES[estimate.unit]}": ends_document(estimate)
        for estimate in model.estimates
    }
    return {**named, "force_error": model.error, "bandwidth_hz": model.bandwidth}


def _residual_numbers(moves: IdentifiedMoves) -> dict[str, Any]:
    left = moves.residual
    return {
        "rms_n": left.rms,
        "mean_n": left.mean,
        "correlation_time_s": left.correlation_time,
        "white": left.white,
        "explained_by_position": left.by_position,
        "explained_by_velocity": left.by_velocity,
    }


def _profile_numbers(profile: Profile) -> dict[str, Any]:
    ends = {"low": profile.low, "high": profile.high, "open_low": profile.open_low, "open_high": profile.open_high}
    return {**ends, "values": profile.values, "mean_squares_n2": profile.cost, "limit_n2": profile.limit}


def _prediction_sentence(simulated: SimulatedLog) -> str:
    errors = simulated.errors
    return (
        f"relative errors of position {percent(errors.position)}, velocity {percent(errors.velocity)}, acceleration "
        f"{percent(errors.acceleration)}, force {percent(errors.force)}."
    )


def _prediction_figures(log: Log, simulated: SimulatedLog, number: int) -> list[Figure]:
    """The log as measured and as simulated."""
    caption = (
        f"{log.name}: simulated with what was found in the other logs; relative error of the position "
        f"{percent(simulated.errors.position)}, of the force {percent(simulated.errors.force)}."
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
    longest=True,
    prediction=PredictionView[SimulatedLog](
        worst=lambda result: result.errors.force,
        sentence=_prediction_sentence,
        numbers=lambda result: {"errors": asdict(result.errors)},
        figures=_prediction_figures,
    ),
)
