"""What the whole model lacks, in the intervals of its estimates; and the inverse model's estimates in its place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.inverse_model import InverseModel
from friso.identification.output_error.identifiable import BRISTLES
from friso.identification.output_error.parameters import is_free
from friso.identification.quality import Quality
from friso.identification.slow_records import without
from friso.quantities import non_negative, positive
from friso.stage import numeric_keys


def _of_inverse(flat: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
    """The quantity of the inverse model behind a key, and the key over it."""
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


def all_with_model_error(
    estimates: Sequence[Estimate], inverse: InverseModel, flat: Mapping[str, Any], quality: Quality
) -> tuple[Estimate, ...]:
    """The estimates of a rigid stage with intervals that allow for what the model lacks. Of moves in one direction the
    model leaves out the constant force, which the stage turns against where it overshoots: none is narrower than that
    of the inverse model. What the inverse model does not know has intervals twice as wide where the fit lacks
    something."""
    if is_free(flat):
        return tuple(estimates)
    sources, plain = _of_inverse(flat), {estimate.name: estimate for estimate in inverse.estimates}
    plainly_left = float(np.sqrt(np.mean((inverse.measured - inverse.fitted) ** 2)))
    alike = min(1.0, quality.left / plainly_left) if plainly_left > 0 and plain["coulomb"].determined else 1.0
    return tuple(
        with_model_error(estimate, plain[sources[estimate.name][0]], sources[estimate.name][1], quality.lacking, alike)
        if estimate.name in sources
        else _wider(estimate, TWICE if quality.lacks_something else 1.0)
        for estimate in estimates
    )


def _wider(estimate: Estimate, times: float) -> Estimate:
    more = (times - 1) * estimate.half_width
    return replace(estimate, low=estimate.low - more, high=estimate.high + more) if estimate.determined else estimate


def without_bristles(
    estimates: Sequence[Estimate], correlation: np.ndarray, quality: Quality
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The estimates, and the correlation of the shown ones, without the bristles where the fit lacks something or a
    coupling seems to bend: that, a delay and the like pass for them.

    Of a load behind a coupling of 40 Hz, and of a force 2 ms early, their stiffness came out at half of the truth, with
    an interval that did not hold it when it was twice as wide as its noise allowed."""
    if not (quality.lacks_something or quality.compliant):
        return tuple(estimates), correlation
    return without(estimates, correlation, dict.fromkeys(BRISTLES, IMITATED))


def with_causes(
    estimates: Sequence[Estimate],
    correlation: np.ndarray,
    inverse: InverseModel,
    flat: Mapping[str, Any],
    quality: Quality,
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The estimates with intervals that reach as far as what the log says once it is rid of what may be wrong, and the
    correlation of the shown ones; nothing of what a spoilt record says beyond the inverse model."""
    if not quality.spoilt or is_free(flat):
        return tuple(estimates), correlation
    sources, kept, answers = _of_inverse(flat), [], []
    for estimate in estimates:
        name, scale = sources.get(estimate.name, ("", 1.0))
        answer = estimate
        if not name and estimate.determined:
            answer = Estimate.unknown(estimate.name, estimate.unit, estimate.method, SPOILT)
        for model in quality.without if name else ():
            answer = spanning(answer, *_rid_of(model, inverse, name), scale)
        answer = _wider(answer, TWICE if quality.unsettled else 1.0)
        kept += [answer.determined] if estimate.determined else []
        answers.append(answer)
    return tuple(answers), correlation[np.ix_(kept, kept)]


def _rid_of(model: InverseModel, inverse: InverseModel, name: str) -> tuple[Estimate, float]:
    """A quantity by the inverse model of a log rid of a cause, and by how much it would move on if what is still left
    had the same cause, at most as far again."""
    one = next(estimate for estimate in model.estimates if estimate.name == name)
    share = min(model.error / max(inverse.error - model.error, 1e-12), 1.0)
    return one, share * (model.value(name) - inverse.value(name))


def spanning(estimate: Estimate, other: Estimate, further: float, scale: float) -> Estimate:
    """An estimate whose interval reaches as far as that of another one, and `further`, times `scale`: of two that
    differ by a cause that nobody has settled."""
    if not (estimate.determined and other.determined):
        return estimate
    low, high = sorted((scale * (other.low + min(further, 0.0)), scale * (other.high + max(further, 0.0))))
    return replace(estimate, low=min(estimate.low, low), high=max(estimate.high, high))


def with_halves(estimates: Sequence[Estimate], flat: Mapping[str, Any], quality: Quality) -> tuple[Estimate, ...]:
    """The estimates of a rigid stage, with intervals that hold what either half of the record says where the halves
    differ: a load that changes, friction that rises."""
    differing = {} if is_free(flat) else {one.name: one for one in quality.halves}
    answers = []
    for estimate in estimates:
        name, scale = _of_inverse(flat).get(estimate.name, ("", 1.0))
        if estimate.determined and name in differing:
            ends = sorted((scale * differing[name].low, scale * differing[name].high))
            estimate = replace(estimate, low=min(estimate.low, ends[0]), high=max(estimate.high, ends[1]))
        answers.append(estimate)
    return tuple(answers)


def with_possible_values(
    estimates: Sequence[Estimate], correlation: np.ndarray, flat: Mapping[str, Any]
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The estimates with intervals of values that their keys may have, and the correlation of the shown ones: what
    cannot be negative is not, and not told at all where its interval is, and what cannot be zero, but by its interval
    might, is bounded from above alone."""
    bounds = {key: declared.bound for key, declared in numeric_keys(flat).items()}
    answers, kept = [], []
    for estimate in estimates:
        bound, answer = bounds.get(estimate.name), estimate
        if estimate.determined and estimate.high < 0 and bound in (non_negative, positive):
            answer = Estimate.unknown(estimate.name, estimate.unit, estimate.method, NEGATIVE, 0.0)
        elif estimate.determined and estimate.low < 0 and bound is non_negative:
            answer = replace(estimate, value=max(estimate.value, 0.0), low=0.0)
        elif estimate.determined and estimate.low <= 0 and bound is positive:
            answer = _at_most(estimate)
        kept += [answer.determined] if estimate.determined else []
        answers.append(answer)
    return tuple(answers), correlation[np.ix_(kept, kept)]


def _at_most(estimate: Estimate) -> Estimate:
    return Estimate.unknown(estimate.name, estimate.unit, estimate.method, NOT_ABOVE_ZERO, 0.0, estimate.high)


def not_described(estimates: Sequence[Estimate]) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Nothing of what a fit to a record says that no model describes."""
    answers = (Estimate.unknown(one.name, one.unit, one.method, NOT_DESCRIBED) for one in estimates)
    return tuple(answers), np.zeros((0, 0))


def of_inverse_model(
    inverse: InverseModel, flat: Mapping[str, Any], estimates: Sequence[Estimate]
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """What the inverse model shows, where the whole model contradicts the record; all else is not shown."""
    sources, plain = _of_inverse(flat), {estimate.name: estimate for estimate in inverse.estimates}
    answers = []
    for estimate in estimates:
        name, scale = sources.get(estimate.name, ("", 1.0))
        if name and not (is_free(flat) and estimate.name.startswith("masses.")):
            one = plain[name]
            ends = sorted((scale * one.low, scale * one.high))
            answers.append(
                replace(one, name=estimate.name, unit=estimate.unit, value=scale * one.value, low=ends[0], high=ends[1])
            )
        else:
            answers.append(Estimate.unknown(estimate.name, estimate.unit, estimate.method, CONTRADICTED))
    certain = [answer for answer in answers if answer.determined]
    return tuple(answers), np.eye(len(certain))


NOT_ABOVE_ZERO = "its interval reaches down to zero"
"""Why there is no value of what cannot be zero."""

NEGATIVE = "it comes out negative, which it cannot be"
"""Why there is no value of what its interval says is negative."""

NOT_DESCRIBED = "neither a mass with friction nor the whole model describes the record"
"""Why nothing at all is taken from a fit."""

TWICE = 2.0
"""How many times as wide intervals are where much is left that nothing explains, and those of slow friction where
anything is: of records of known machines with a filtered position or velocity, a reference in its place, a resampled
force and the like, intervals of the mass and of the Stribeck velocity missed the truth without, by up to 1.8
half-widths."""

IMITATED = "what the model lacks would pass for it"
"""Why bristles are not taken from a record that the model does not describe to its noise."""

SPOILT = "what is wrong with the record would pass for it"
"""Why nothing but what the inverse model shows is taken from a record with a delay, a filter and the like."""

CONTRADICTED = "the whole model contradicts the record"
"""Why nothing but what the inverse model shows is taken from a fit."""


def with_model_error(
    estimate: Estimate, inverse: Estimate, scale: float, lacking: float, alike: float = 1.0
) -> Estimate:
    """An estimate of the whole model whose interval allows for what the model lacks, by the share of what is left that
    is not noise (`lacking`): as much wider as it lies outside of the inverse model's interval, and no narrower than
    that where both models leave `alike` much, 1 for as much as the inverse model: what both lack moves both. `scale` is
    the key over the inverse model's quantity."""
    if not (estimate.determined and inverse.determined):
        return estimate
    half = abs(scale) * inverse.half_width
    beyond = abs(estimate.value - scale * inverse.value) - half
    more = lacking * max(0.0, beyond) + max(0.0, lacking * alike * half - estimate.half_width)
    return replace(estimate, low=estimate.low - more, high=estimate.high + more, systematic=estimate.systematic + more)
