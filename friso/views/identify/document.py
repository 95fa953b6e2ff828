"""The JSON document of an identification: SI, the unit in the key's suffix or beside; what is not known is null."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from friso.identify.estimate import Estimate
from friso.identify.experiments.break_away import BreakAway
from friso.identify.experiments.friction_velocity import Direction
from friso.identify.experiments.presliding import Presliding
from friso.identify.experiments.slow_sliding import SlowSliding
from friso.identify.experiments.steps import StepStiffness
from friso.identify.experiments.stick_slip import StickSlip
from friso.identify.inverse_model import InverseModel
from friso.identify.logs.log import Log
from friso.identify.method import ConstantSpeed, Experiment, Identification, Prediction, Result, Source
from friso.identify.moves import Moves
from friso.identify.output_error.profile import Profile
from friso.identify.response.analysis import Bench
from friso.identify.response.departure import Drag
from friso.identify.response.mass_line import Line
from friso.identify.sources import Given
from friso.identify.stage_file import written
from friso.views.documents import plain_json

SUFFIXES = {"N": "n", "kg": "kg", "N*s/m": "n_s_per_m"}
"""Of keys, by unit, of what the inverse model tells."""


def identify_document(
    found: Identification, given: Sequence[Given], predictions: Sequence[Prediction]
) -> dict[str, Any]:
    """All but the files."""
    document = {
        "stage": found.stage.name if found.stage else None,
        "logs": [_log(each) for each in given],
        "estimates": [_key(each) for each in found.estimates],
        "experiments": [_experiment(each) for each in found.experiments],
        "predictions": [_prediction(each) for each in predictions],
        "warnings": list(found.warnings),
    }
    return plain_json(document)


def _log(it: Given) -> dict[str, Any]:
    return {
        "file": str(it.path),
        "kind": it.kind,
        "reason": it.reason,
        "mapping_file": None if it.kept is None else str(it.kept),
        **_held(it.source),
        "read": list(it.source.read),
    }


def _held(it: Source) -> dict[str, Any]:
    """What a file holds: signals over time, or a response."""
    if not isinstance(it, Log):
        return {"roles": {}, "lines": len(it.frequency), "unit": it.unit, "warnings": []}
    roles = {role: it.unit(role) for role in it.signals}
    return {
        "roles": roles,
        "samples": len(it.time),
        "sample_time_s": it.sample_time,
        "segments": len(it.segments),
        "warnings": list(it.warnings),
    }


def _ends(it: Estimate) -> dict[str, Any]:
    return {"value": it.value, "low": it.low, "high": it.high}


def _estimate(it: Estimate) -> dict[str, Any]:
    about = {"unit": it.unit, **_ends(it), "shown": it.shown, "method": it.method, "reason": it.reason or None}
    return {"name": it.name, **about}


def _key(it: Estimate) -> dict[str, Any]:
    """An estimate of a key of the stage file, with the text that stands there."""
    told = _estimate(it)
    text = written(it) if np.isfinite([it.low, it.high]).all() and it.high > it.low else None
    return {"key": told.pop("name"), **told, "written": text}


def _experiment(it: Experiment) -> dict[str, Any]:
    logs = [log.name for log in it.logs]
    return {"kind": it.kind, "logs": logs, **_result(it.result), "estimates": [_key(each) for each in it.estimates]}


def _result(it: Result) -> dict[str, Any]:
    if isinstance(it, Moves):
        return _moves(it)
    if isinstance(it, Bench):
        return _bench(it)
    if isinstance(it, StepStiffness):
        return _steps(it)
    if isinstance(it, StickSlip):
        return _stick_slip(it)
    if isinstance(it, Presliding):
        return _presliding(it)
    if isinstance(it, SlowSliding):
        return _slow_sliding(it)
    return _break_away(it) if isinstance(it, BreakAway) else _constant(it)


def _moves(it: Moves) -> dict[str, Any]:
    low, high = it.covered.gap
    parameters = {
        each.name: {"unit": each.unit, "value": it.fit.value(each.name)} for each in it.fit.problem.parameters
    }
    fitted = [it.fit.problem.parameters[number].name for number in it.fit.free]
    return {
        "inverse_model": _inverse(it.inverse),
        "inverse_model_by_direction": _inverse(it.by_direction),
        "output_error": {
            "loop": "follows the log" if it.loop is None else "closed",
            "fitted_in_loop": it.fit.problem.closed,
            "errors": asdict(it.errors),
            "residual": _residual(it),
            "parameters": parameters,
            "fitted": fitted,
            "profiles": {name: _profile(each) for name, each in it.profiles.items()},
        },
        "not_shown": [{"key": each.name, "reason": each.reason} for each in it.estimates if not each.shown],
        "no_steady_motion_m_per_s": [low, high],
        "samples_used": it.part.stop - it.part.start,
    }


def _inverse(it: InverseModel) -> dict[str, Any]:
    named = {f"{each.name.replace(' ', '_')}_{SUFFIXES[each.unit]}": _ends(each) for each in it.estimates}
    return {**named, "force_error": it.error, "bandwidth_hz": it.bandwidth}


def _residual(it: Moves) -> dict[str, Any]:
    left = it.residual
    return {
        "rms_n": left.rms,
        "mean_n": left.mean,
        "correlation_time_s": left.correlation_time,
        "white": left.white,
        "explained_by_position": left.by_position,
        "explained_by_velocity": left.by_velocity,
    }


def _profile(it: Profile) -> dict[str, Any]:
    ends = {"low": it.low, "high": it.high, "open_low": it.open_low, "open_high": it.open_high}
    return {**ends, "values": it.values, "mean_squares_n2": it.cost, "limit_n2": it.limit}


def _bench(it: Bench) -> dict[str, Any]:
    channels = it.driven.channels
    return {
        "input": {"name": channels.input, "unit": channels.input_unit},
        "output": {"name": channels.output, "unit": channels.output_unit},
        "estimator": it.driven.kind,
        "lines": len(it.driven.frequency),
        "band_hz": list(it.band),
        "mass_lines": [_line(each) for each in it.lines],
        "modes": [_estimate(each) for each in it.modes.estimates] if it.modes else [],
        "two_masses": [_estimate(each) for each in it.two_masses.estimates] if it.two_masses else [],
        "case": it.seen.case or None if it.seen else None,
        "seen": list(it.seen.words) if it.seen else [],
        "departure": _estimate(it.departs.frequency) if it.departs else None,
        "realisations_differ": it.departs.differ if it.departs else None,
        "friction": _drag(it.drag) if it.drag else None,
        "departure_left_by_friction": it.explanation.left if it.explanation else None,
        "aside": [{"log": name, "errors": list(errors)} for name, errors in it.aside],
        "warnings": list(it.warnings),
    }


def _line(it: Line) -> dict[str, Any]:
    band = {"kind": it.kind, "low_hz": it.low, "high_hz": it.high, "sign": it.sign}
    return {**band, "level": _estimate(it.level), "value": _estimate(it.value)}


def _drag(it: Drag) -> dict[str, Any]:
    several = {"mass": it.mass, "damping": it.damping, "stiffness": it.stiffness, "coulomb": it.coulomb}
    return {**{name: _estimate(each) for name, each in several.items()}, "warnings": list(it.warnings)}


def _steps(it: StepStiffness) -> dict[str, Any]:
    windows = [{"start_s": w.start, "end_s": w.end, "deflection_m": w.position, "force_n": w.force} for w in it.windows]
    several = {"stiffness": it.stiffness, "up": it.up, "down": it.down, "hysteresis": it.hysteresis}
    told = {name: _estimate(each) for name, each in several.items()}
    return {**told, "windows": windows, "cart_fixed": it.cart_fixed, "warnings": list(it.warnings)}


def _stick_slip(it: StickSlip) -> dict[str, Any]:
    several = {
        "static": it.static,
        "forward": it.forward,
        "backward": it.backward,
        "break_away_forward": it.break_away_forward,
        "break_away_backward": it.break_away_backward,
        "offset": it.offset,
        "stiffness": it.stiffness,
    }
    told = {name: _estimate(each) for name, each in several.items()}
    return {**told, "slips": len(it.times), "spread_n": list(it.spread), "warnings": list(it.warnings)}


def _break_away(it: BreakAway) -> dict[str, Any]:
    several = {"static": it.static, "forward": it.forward, "backward": it.backward}
    told = {name: _estimate(each) for name, each in several.items()}
    ramps = {"forces_n": it.forces, "rates_n_per_s": it.rates, "directions": it.directions}
    return {**told, **ramps, "warnings": list(it.warnings)}


def _presliding(it: Presliding) -> dict[str, Any]:
    several = {"stiffness": it.stiffness, "damping": it.damping, "mass": it.mass}
    return {
        **{name: _estimate(each) for name, each in several.items()},
        "unexplained": it.unexplained,
        "warnings": list(it.warnings),
    }


def _slow_sliding(it: SlowSliding) -> dict[str, Any]:
    named = {each.name.removeprefix("friction."): _estimate(each) for each in it.estimates}
    return {**named, "unexplained": it.unexplained, "warnings": list(it.warnings)}


def _constant(it: ConstantSpeed) -> dict[str, Any]:
    sides = {**it.velocity.directions, "both": it.velocity.both}
    passes = [
        {
            "velocity_m_per_s": each.velocity,
            "mean": _estimate(each.mean),
            "spread_n": each.spread,
            "correlation_length": _estimate(each.correlation_length),
            "steady": each.steady,
        }
        for each in it.position.passes
    ]
    return {
        "directions": {name: _direction(each) for name, each in sides.items()},
        "bias": _estimate(it.velocity.bias),
        "velocities_m_per_s": it.velocity.velocities,
        "forces_n": it.velocity.forces,
        "unsteady_m_per_s": it.velocity.unsteady,
        "passes": passes,
        "repeatability": _estimate(it.position.repeatability),
        "separated": it.position.separated,
        "verdict": it.position.verdict,
        "warnings": [*it.velocity.warnings, *it.position.warnings],
    }


def _direction(it: Direction) -> dict[str, Any]:
    several = {"coulomb": it.coulomb, "viscous": it.viscous, "static": it.static}
    several["stribeck_velocity"] = it.stribeck_velocity
    return {name: _estimate(each) for name, each in several.items()}


def _prediction(it: Prediction) -> dict[str, Any]:
    if it.errors is None:
        return {"log": it.log.name, "response_errors": list(it.response_errors)}
    return {"log": it.log.name, "errors": asdict(it.errors)}
