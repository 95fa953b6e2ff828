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


def _sentences(it: IdentifiedMoves) -> tuple[str, ...]:
    """How it was fitted, and what the motion covers."""
    low, high = it.covered.gap
    along = "the machine was simulated along the position of the log: what is compared is the force that it takes."
    if it.fit.problem.closed:
        how = "The machine was simulated in its own loop, on the reference of the log."
    elif it.loop is not None:
        how = f"In its own loop the simulated machine gets out of step with the log. For the fit, {along}"
    else:
        how = f"{along[0].upper()}{along[1:]}"
    if not it.covered.steady.size:
        return how, "The motion is nowhere steady for long enough to show friction at a speed."
    gap = range_with_unit(low, high, "m/s")
    return (
        how,
        f"The widest range of speeds without steady motion is {gap}: of friction there, the record says nothing.",
    )


def _facts(it: IdentifiedMoves) -> Facts:
    """Both fits of the inverse model, the errors of the output-error fit, and what is left."""
    left = it.residual
    alike = (
        "neighbouring samples do not resemble each other"
        if left.white
        else (f"alike over {digits(left.correlation_time, 's')}")
    )
    return (
        ("Inverse model", _inverse_text(it.inverse)),
        ("Inverse model, per direction", _inverse_text(it.by_direction)),
        ("Bandwidth of the motion", digits(it.inverse.bandwidth, "Hz")),
        ("Relative errors of the simulation", _errors(it)),
        ("Force left unexplained", f"{digits(left.rms, 'N')} (root mean square), {alike}"),
        ("Of its power, the mean explains", f"{percent(left.by_position)} over places along the rail, "
         f"{percent(left.by_velocity)} over speeds"),
    )  # fmt: skip


def _errors(it: IdentifiedMoves) -> str:
    """The relative errors of the simulated record; along the log's position, that of the force alone says anything."""
    errors = it.errors
    if it.loop is None:
        return f"force {percent(errors.force)}"
    return (
        f"position {percent(errors.position)}, velocity {percent(errors.velocity)}, acceleration "
        f"{percent(errors.acceleration)}, force {percent(errors.force)}"
    )


def _inverse_text(it: InverseModel) -> str:
    return f"{listed(it.estimates)}; force error {percent(it.error)}"


def _numbers(it: IdentifiedMoves) -> dict[str, Any]:
    low, high = it.covered.gap
    parameters = {
        each.name: {"unit": each.unit, "value": it.fit.value(each.name)} for each in it.fit.problem.parameters
    }
    fitted = [it.fit.problem.parameters[number].name for number in it.fit.free]
    return {
        "inverse_model": _inverse_numbers(it.inverse),
        "inverse_model_by_direction": _inverse_numbers(it.by_direction),
        "output_error": {
            "loop": "follows the log" if it.loop is None else "closed",
            "fitted_in_loop": it.fit.problem.closed,
            "errors": asdict(it.errors),
            "residual": _residual_numbers(it),
            "parameters": parameters,
            "fitted": fitted,
            "profiles": {name: _profile_numbers(each) for name, each in it.profiles.items()},
        },
        "not_shown": [{"key": each.name, "reason": each.reason} for each in it.estimates if not each.shown],
        "no_steady_motion_m_per_s": [low, high],
        "samples_used": it.part.stop - it.part.start,
    }


def _inverse_numbers(it: InverseModel) -> dict[str, Any]:
    named = {f"{each.name.replace(' ', '_')}_{SUFFIXES[each.unit]}": ends_document(each) for each in it.estimates}
    return {**named, "force_error": it.error, "bandwidth_hz": it.bandwidth}


def _residual_numbers(it: IdentifiedMoves) -> dict[str, Any]:
    left = it.residual
    return {
        "rms_n": left.rms,
        "mean_n": left.mean,
        "correlation_time_s": left.correlation_time,
        "white": left.white,
        "explained_by_position": left.by_position,
        "explained_by_velocity": left.by_velocity,
    }


def _profile_numbers(it: Profile) -> dict[str, Any]:
    ends = {"low": it.low, "high": it.high, "open_low": it.open_low, "open_high": it.open_high}
    return {**ends, "values": it.values, "mean_squares_n2": it.cost, "limit_n2": it.limit}


def _prediction_sentence(it: SimulatedLog) -> str:
    errors = it.errors
    return (
        f"relative errors of position {percent(errors.position)}, velocity {percent(errors.velocity)}, acceleration "
        f"{percent(errors.acceleration)}, force {percent(errors.force)}."
    )


def _prediction_figures(log: Log, it: SimulatedLog, number: int) -> list[Figure]:
    """The log as measured and as simulated."""
    caption = (
        f"{log.name}: simulated with what was found in the other logs; relative error of the position "
        f"{percent(it.errors.position)}, of the force {percent(it.errors.force)}."
    )
    panels = record_panels(log, it.part, it.simulated)
    return [Figure(f"identify_prediction{number}", f"Predicted: {log.name}", caption, panels)]


VIEW = KindView[IdentifiedMoves](
    "Moves",
    _facts,
    _numbers,
    lambda it, logs, name: moves_figures(it, name),
    sentences=_sentences,
    warnings=lambda it: (),
    longest=True,
    prediction=PredictionView[SimulatedLog](
        worst=lambda it: it.errors.force,
        sentence=_prediction_sentence,
        numbers=lambda it: {"errors": asdict(it.errors)},
        figures=_prediction_figures,
    ),
)
