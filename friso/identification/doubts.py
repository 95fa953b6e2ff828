"""How good a fit of moves is, and what speaks against believing it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.identification.causes import UNKNOWN, causes, fragment
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.log import Log
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.quality import Quality, halves, whole_error
from friso.quantities import percent, plain_factor

CLEARLY = 0.5
"""Times what an inverse model without a cause leaves, below which a whole model is better without that cause."""

POOR = 0.3
"""Relative error of the force from which on a model does not describe the record."""

UNSETTLED = 0.1
"""Share of the force that a fit and the best explanation of what it leaves may both leave unexplained."""

CONTRADICTS, FINE = 1.5, 0.01
"""A whole model whose steady friction leaves so many times what the inverse model leaves contradicts the record, unless
that is less than this share of the force."""

NONE_LEFT = 1e-3
"""Share of the force below which Coulomb friction is no friction of a bearing."""

WITHOUT_FRICTION = ". The stage file says that there is no friction: with a table [friction], friction is identified"
"""What to do where the structure that was told leaves friction out."""

WORDS = {"mass": "the mass", "viscous": "viscous friction", "coulomb": "Coulomb friction"}
"""What the inverse model identifies, in sentences."""


def quality_of(log: Log, inverse: InverseModel, fit: OutputErrorFit, noise: float, cart_share: float) -> Quality:
    """How good a fit is, with what is wrong with it in sentences.

    Of a stage that sticks much of the time, which the inverse model cannot know, the whole model may describe a record
    that is `beyond` the inverse one; a cause is no doubt then if the whole model is `CLEARLY` better than it."""
    left = fit.left
    noise_left = noise * fit.problem.passes
    flat, unit = fit.stage, log.unit("force")
    doubts = [sentence for sentence in (fragment(log),) if sentence]
    plain = Quality(noise, left, noise_left, inverse.error, whole_error(flat, inverse), tuple(doubts))
    if fit.problem.closed and fit.explains(noise):
        return plain
    force = float(np.sqrt(np.mean(log["force"][log.longest][fit.problem.counted > 0] ** 2)))
    beyond = inverse.error > POOR and left < UNSETTLED * force
    poor = inverse.error > POOR and not beyond
    reasons = causes(log, inverse, cart_share) if plain.lacks_something or poor else []
    if beyond:
        reasons = [cause for cause in reasons if cause.without is None or CLEARLY * cause.without.error * force < left]
    worse = not beyond and plain.whole_error > max(CONTRADICTS * inverse.error, FINE)
    rejected = worse and plain.lacks_something and not poor
    if rejected:
        doubts.append(
            f"The whole model contradicts the record: on the moves it leaves {percent(plain.whole_error, 3)} of the "
            f"force, a plain mass with friction {percent(inverse.error, 3)}. What follows is from the latter alone"
            f"{''.join(f'; {cause.sentence}' for cause in reasons)}"
            f"{WITHOUT_FRICTION if flat['friction.model'] == 'none' else ''}"
        )
    if poor:
        why = "; ".join(cause.sentence for cause in reasons) or UNKNOWN
        doubts.append(f"A mass with friction leaves {percent(inverse.error, 3)} of the force unexplained: {why}")
    elif not rejected and plain.lacks_something:
        doubts.append(
            f"The fit leaves {left:.3g} {unit} unexplained, {plain_factor(plain.ratio)} times what the noise of the "
            f"record would leave: the model lacks something, for which the intervals allow"
            f"{''.join(f'; {cause.sentence}' for cause in reasons)}"
        )
    doubts += [sentence for sentence in (little_friction(inverse, unit),) if sentence]
    differing = tuple(halves(inverse)) if plain.lacks_something else ()
    for one in () if poor else differing:
        unit_of_it = next(estimate.unit for estimate in inverse.estimates if estimate.name == one.name)
        values = f"{one.first:.4g} and {one.second:.4g} {unit_of_it}"
        doubts.append(f"The halves of the record differ in {WORDS[one.name]}: {values}; its interval holds both")
    without = tuple(cause.without for cause in reasons if cause.without)
    best = min([inverse.error, *(model.error for model in without)])
    unsettled = plain.lacks_something and min(left / force, best) > UNSETTLED
    return replace(
        plain,
        doubts=tuple(doubts),
        rejected=rejected,
        failed=poor and plain.whole_error > POOR,
        halves=differing,
        without=without,
        spoilt=unsettled or any(cause.spoils for cause in reasons),
        unsettled=unsettled,
    )


def little_friction(inverse: InverseModel, unit: str) -> str:
    """A sentence on Coulomb friction that is none, or as that of no bearing can be; "" elsewhere."""
    value, least = inverse.value("coulomb"), NONE_LEFT * float(np.std(inverse.measured))
    if value >= least:
        return ""
    one = next(estimate for estimate in inverse.estimates if estimate.name == "coulomb")
    if not one.determined:
        says, does = ("which helps the motion", "exceeds") if value <= -least else ("next to nothing", "may hide")
        return (
            f"Coulomb friction and the constant force are {value:.2g} {unit} together, {says}: the log moves in one "
            f"direction only, and gravity, or an offset of the channel, {does} friction"
        )
    if value > -least:
        return (
            f"Coulomb friction is estimated as {value:.2g} {unit}, next to nothing: no friction in this force, a wrong "
            "--scale, or friction that a drive compensates"
        )
    interval = f"{value:.3g} {unit} ({one.low:.3g} to {one.high:.3g})"
    if one.high >= 0:
        return f"The log does not tell Coulomb friction from none: it is estimated as {interval}"
    return (
        f"Coulomb friction is estimated as {interval}, negative, as that of no bearing is: the force leaves out what a "
        "drive adds against friction, or more, another channel is taken for it, or the stage hardly slides"
    )
