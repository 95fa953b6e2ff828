"""Widen intervals of the whole model by its unexplained part, or replace its estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.doubt import IMITATED, KeyCase, RaisedDoubt
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import InverseModel
from friso.identification.output_error.parameters import BRISTLES, is_free

SLOW_FRICTION = ("friction.static", "friction.stribeck_velocity", "friction.stribeck_exponent")
"""Keys of friction at low speed, which a fit that leaves much can trade for what the model lacks."""

NOT_DESCRIBED = "neither a mass with friction nor the whole model describes the record"
"""Reason given where nothing is reported from a fit."""

SPOILT = "what is wrong with the record would pass for it"
"""Reason given where a record with a delay, a filter or a similar fault only gives the inverse model's quantities."""

CONTRADICTED = "the whole model contradicts the record"
"""Reason given where a fit is replaced by the inverse model."""


def allowed_for(case: KeyCase) -> KeyCase:
    """Widen the intervals of a log's estimates by the model error and the causes found.

    If the fit does not describe the record, nothing is reported; if the fit contradicts the record, the inverse model's
    estimates replace it. Effects that the model lacks can look like bristles: with a load behind a coupling of 40 Hz,
    and with a force 2 ms early, the fitted stiffness was half of the true one, outside an interval twice as wide as by
    noise.
    """
    quality = case.quality
    if quality.failed:
        nothing = {one.name: one.withheld(NOT_DESCRIBED) for one in case.estimates}
        case = case.with_answers(RaisedDoubt(answers=nothing))
    elif quality.rejected:
        estimates, correlation = of_inverse_model(case.inverse, case.flat, case.estimates)
        case = replace(case, estimates=estimates, correlation=correlation)
    elif not is_free(case.flat):
        case = case.with_answers(RaisedDoubt(answers=_with_model_error(case)))
    imitated: dict[str, str] = dict.fromkeys(BRISTLES, IMITATED) if quality.may_imitate_bristles else {}
    imitated |= dict.fromkeys(SLOW_FRICTION, IMITATED) if quality.lacks_something else {}
    case = case.with_answers(RaisedDoubt(refuses={**imitated, **case.refused}))
    if is_free(case.flat):
        return case
    case = case.with_answers(RaisedDoubt(answers=_with_causes(case), refuses=_imitated_by_causes(case)))
    return case.with_answers(RaisedDoubt(answers=_reaching(case)))


def inverse_sources(flat: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
    """Return quantity of the inverse model, and factor from it to the key, by stage-file key."""
    bodies = [key for key in ("masses.cart", "masses.stage") if key in flat]
    total = sum(flat[key] for key in bodies)
    bias = "bias.cart" if "masses.cart" in flat else "bias.stage"
    shares = {key: ("mass", flat[key] / total) for key in bodies}
    return {
        **shares,
        "friction.coulomb": ("coulomb", 1.0),
        "friction.viscous": ("viscous", 1.0),
        bias: ("offset", -1.0),
    }


def of_inverse_model(
    inverse: InverseModel, flat: Mapping[str, Any], estimates: Sequence[Estimate]
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Return estimates of the keys by the inverse model, and their correlation (the identity).

    Keys that the inverse model does not show have no value. The correlation covers the keys with a value.
    """
    sources, answers = inverse_sources(flat), []
    for estimate in estimates:
        name, scale = sources.get(estimate.name, ("", 1.0))
        if name and not (is_free(flat) and estimate.name.startswith("masses.")):
            answers.append(replace(inverse.estimate(name).scaled(scale), name=estimate.name, unit=estimate.unit))
        else:
            answers.append(estimate.withheld(CONTRADICTED))
    return tuple(answers), np.eye(sum(answer.determined for answer in answers))


def with_model_error(
    estimate: Estimate, inverse: Estimate, scale: float, lacking: float, alike: float = 1.0
) -> Estimate:
    """Return an estimate of the whole model whose interval includes the model error.

    The interval is extended by the distance of its value from the inverse model's interval, times `lacking`, the
    fraction of the residual that is not noise. It is at least as wide as the inverse model's interval times `lacking`
    and `alike`. `alike` is the ratio of the two models' residuals, at most 1: with equal residuals, shared errors may
    move both.

    `scale` is the factor from the inverse model's quantity to the key. An estimate is returned unchanged if either
    model has no value.
    """
    if not (estimate.determined and inverse.determined):
        return estimate
    half = abs(scale) * inverse.half_width
    beyond = abs(estimate.value - scale * inverse.value) - half
    more = lacking * max(0.0, beyond) + max(0.0, lacking * alike * half - estimate.half_width)
    return replace(estimate.widened(more), systematic=estimate.systematic + more)


def _with_model_error(case: KeyCase) -> dict[str, Estimate]:
    """Return estimates of a rigid stage, by key, with intervals that include the model error.

    For moves in one direction the model leaves out the constant force, so no interval is narrower than that of the
    inverse model. Quantities that the inverse model does not have get wider intervals if the fit lacks something.
    """
    inverse, quality, sources = case.inverse, case.quality, inverse_sources(case.flat)
    plainly_left = float(np.sqrt(np.mean((inverse.measured - inverse.fitted) ** 2)))
    both_ways = plainly_left > 0 and inverse.estimate("coulomb").determined
    alike = min(1.0, quality.left / plainly_left) if both_ways else 1.0
    answers = {}
    for key, one in case.determined.items():
        name, scale = sources.get(key, ("", 1.0))
        if name:
            answers[key] = with_model_error(one, inverse.estimate(name), scale, quality.lacking, alike)
        else:
            answers[key] = _wider(one, quality.lacks_something)
    return answers


def _with_causes(case: KeyCase) -> dict[str, Estimate]:
    """Return estimates by key, whose intervals also cover the values without the fault's causes.

    For each cause of the fault, the inverse model of the log corrected for it gives these values. The result is empty
    unless the record has a fault.
    """
    if not case.quality.spoilt:
        return {}
    answers = {}
    for key, (name, scale) in inverse_sources(case.flat).items():
        one = case.determined.get(key)
        if one is not None:
            for model in case.quality.without:
                one = spanning(one, *_rid_of(model, case.inverse, name), scale)
            answers[key] = _wider(one, case.quality.unsettled)
    return answers


def _imitated_by_causes(case: KeyCase) -> dict[str, str]:
    """Return, by key, why a faulty record does not show keys that the inverse model lacks."""
    others = case.determined.keys() - inverse_sources(case.flat).keys() if case.quality.spoilt else ()
    return dict.fromkeys(others, SPOILT)


def _reaching(case: KeyCase) -> dict[str, Estimate]:
    """Return estimates by key, extended to the ranges that findings state for the inverse model."""
    answers = {}
    for finding in case.quality.findings:
        for key, (name, scale) in inverse_sources(case.flat).items():
            one = answers.get(key, case.determined.get(key))
            if one is not None and name in finding.reaches:
                answers[key] = one.reaching(*sorted(scale * end for end in finding.reaches[name]))
    return answers


WIDENING_WHERE_MUCH_IS_LEFT = 2.0
"""Factor on intervals if a large residual is unexplained, and on intervals of slow friction if any is. Without it,
intervals missed the truth by up to 1.8 half-widths on known machines with filtered signals."""


def _wider(estimate: Estimate, much: bool) -> Estimate:
    """Return an estimate, its interval widened by a set factor if `much` is left unexplained."""
    return estimate.widened((WIDENING_WHERE_MUCH_IS_LEFT - 1) * estimate.half_width if much else 0.0)


def _rid_of(model: InverseModel, inverse: InverseModel, name: str) -> tuple[Estimate, float]:
    """Return a quantity of `model`, corrected for a cause, and how far it may still be off.

    `inverse` is the model before the correction. The correction may be incomplete: at most, as much as it changed may
    be missing again. The second result has a sign.
    """
    share = min(model.error / max(inverse.error - model.error, 1e-12), 1.0)
    return model.estimate(name), share * (model.value(name) - inverse.value(name))


def spanning(estimate: Estimate, other: Estimate, further: float, scale: float) -> Estimate:
    """Return an estimate whose interval also covers another estimate times `scale`.

    Both count, because it is undecided which is right. Before the scaling, the other's interval is extended by
    `further`, in its own unit.
    """
    if not (estimate.determined and other.determined):
        return estimate
    ends = (other.low + min(further, 0.0), other.high + max(further, 0.0))
    return estimate.reaching(*sorted(scale * end for end in ends))
