"""Say how far static friction, stroke or stiffness may change before the verdict does.

For a rigid stage, sentences say what an isolator would do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from friso.equations.bandwidth import breakaway, least_static_factor, static_frictions, with_static_friction
from friso.equations.structure import carrying_force
from friso.hunting import SEARCH_LIMITS, AttractionEnd, Case, ParameterMargin
from friso.quantities import percent, plain_factor
from friso.shown.text import listed, range_with_unit, rounded_down, rounded_up, with_unit
from friso.stage.controllers import FORCE_LIMIT

if TYPE_CHECKING:
    from friso.remedies.catalogue import Suggestion


def friction_sentences(case: Case) -> list[str]:
    """Say for which static friction the stage hunts, or does not.

    Nothing is said if this was not searched, or if the friction law does not separate static from Coulomb friction.
    """
    margin = case.static_friction
    if margin is None:
        return []
    pairs = static_frictions(case.stage.flat())
    static = case.stage.flat()[next(iter(pairs))] if len(pairs) == 1 else None
    thin = case.verdict != "settles" or bool(thin_margins(case))
    says = margin_sentence("static friction", margin, static, "N", ", with Coulomb friction held", thin)
    return [says, *_too_strong(case, margin)]


def _too_strong(case: Case, margin: ParameterMargin) -> list[str]:
    """Say that hunting ends with more static friction because the force limit no longer breaks the stage away.

    Empty if hunting ends for another reason, or does not end.
    """
    flat, end = case.stage.flat(), margin.above
    if not (margin.attracts and end and FORCE_LIMIT in flat):
        return []
    left = flat[FORCE_LIMIT] - abs(float(carrying_force(flat)))  # of the limit, beside the constant forces
    if breakaway(with_static_friction(flat, end.outside)) <= left:
        return []
    held = f"Static friction above {with_unit(left, 'N')} holds the stage where it sticks"
    return [f"{held}, because the force limit cannot break it away."]


def margin_sentence(
    name: str, margin: ParameterMargin, own: float | None = None, unit: str = "", remark: str = "", thin: bool = False
) -> str:
    """Say over which range of a parameter a stage hunts, or does not.

    `name` is the parameter in words, `own` its value [SI `unit`] (None: multiples are told), and `remark` is added.
    A margin that is `thin`, or close to its end, is not called robust.
    """
    open_ones = {side: f"{_side(side)} yours it was not determined" for side in margin.open_sides}
    doubts = [] if margin.sure and all(end.certain for end in (margin.below, margin.above) if end) else ["not certain"]
    doubt = f" ({'; '.join([*doubts, *open_ones.values()])})" if doubts or open_ones else ""
    low, high = (_kept_to(margin, side) for side in (-1, 1))
    distance = SEARCH_LIMITS.edge_distance
    thin = thin or any(max(end.outside, 1 / end.outside) < distance for end in (margin.below, margin.above) if end)
    quiet = "No hunting was found" if doubts or open_ones else "No hunting" if thin else "Robust: no hunting"
    does = "Hunts" if margin.attracts else quiet
    if len(open_ones) == 2:
        return f"Whether another {name} {'ends' if margin.attracts else 'starts'} hunting was not determined."
    least, most = 1.0 if -1 in open_ones else low, 1.0 if 1 in open_ones else high
    extent, ways = _extent(least, most, own, unit), listed(margin_ways(margin), "or")
    changes = f"; it {'ends' if margin.attracts else 'begins'} {ways}" if ways and extent.startswith("as yours") else ""
    again = [
        f"again from {_value(begins.outside, own, unit)} {'up' if side > 0 else 'down'}"
        for side, begins in margin.again.items()
    ]
    also = f", and {listed(again, 'and')}" if again else ""
    return f"{does} for {name} {extent}{also}{remark}{changes}{doubt}."


def _kept_to(margin: ParameterMargin, side: int) -> float:
    """Return the multiple of a parameter up to which nothing changes on a side, rounded towards the stage's own."""
    end = margin.end(side)
    if end is None:
        return margin.range[max(side, 0)]
    return (rounded_up if side < 0 else rounded_down)(margin.same(end))


def _extent(low: float, high: float, own: float | None, unit: str) -> str:
    """Write a range of multiples of a parameter whose value is `own` [SI `unit`]; of multiples if that is None.

    Ends are rounded towards the stage's own value. An end that rounds past it is that value, "yours".
    """
    yours = "yours" if own is None else f"yours ({with_unit(own, unit)})"
    least, most = (low, high) if own is None else (rounded_up(low * own) / own, rounded_down(high * own) / own)
    if least < 1 < most and own is not None:
        return range_with_unit(least * own, most * own, unit)
    if least < 1 < most:
        return f"{plain_factor(least)} to {_value(most, own, unit)}"
    if least < 1:
        return f"from {_value(least, own, unit)} up to {yours}"
    return f"from {yours} up to {_value(most, own, unit)}" if most > 1 else f"as {yours}"


def _value(factor: float, own: float | None, unit: str) -> str:
    """Write a multiple of a parameter whose value is `own` [SI `unit`]; as a multiple if that is None."""
    return f"{plain_factor(factor)} times yours" if own is None else with_unit(factor * own, unit)


def joint_sentences(margins: Mapping[str, ParameterMargin]) -> list[str]:
    """Say at which stroke or stiffness of the joint hunting begins or ends.

    `margins` holds the margins by their keys.
    """
    return [margin_sentence(key.replace(".", " "), margin, remark=" (joint free)") for key, margin in margins.items()]


def margin_ways(margin: ParameterMargin) -> list[str]:
    """Return the ranges of multiples of a parameter within which the verdict changes, in words."""
    return [_way(end) for side in (-1, 1) if (end := margin.end(side))]


def other_static_friction(flat: Mapping[str, Any]) -> str:
    """Name the static friction that advice allows for, "with static friction 1.2 times as high or as low".

    `flat` has the stage's keys in SI. The text is empty for a law without static or Coulomb friction.
    """
    if not static_frictions(flat):
        return ""
    distance = SEARCH_LIMITS.edge_distance
    lower = "as low as Coulomb friction" if least_static_factor(flat) > 1 / distance else "as low"
    return f"with static friction {distance:g} times as high or {lower}"


def thin_margins(case: Case) -> list[str]:
    """List small margins of a stage that settles: what little change brings hunting back.

    A margin is small if it is less than the distance from the edge that advice keeps.
    """
    distance, thin = SEARCH_LIMITS.edge_distance, []
    edge, friction = case.judgement.margin, case.static_friction
    if edge and edge.quiet * distance > 1:
        thin.append(f"a bandwidth that is lower by {percent(1 - edge.factor)}")
    above = [window.low for window in case.judgement.windows if window.low and window.lies(1, 1.0)]
    again = min(above, key=lambda end: end.inside, default=None)
    if again and again.outside < distance:
        thin.append(f"a bandwidth that is higher by {percent(again.inside - 1)}")
    for side in (-1, 1):
        end = friction.end(side) if friction and not friction.attracts else None
        if end and max(end.outside, 1 / end.outside) < distance:
            thin.append(f"static friction {_way(end)}")
    return thin


def _side(side: int) -> str:
    """Return "above" for the side 1 of a parameter's own value, "below" for the side -1."""
    return "below" if side < 0 else "above"


def _way(end: AttractionEnd) -> str:
    """Say between which multiples of a parameter hunting begins or ends.

    One of them is 1 if it is not known how little change is enough.
    """
    low, high = _factors(end)
    return f"between {plain_factor(low)} and {plain_factor(high)} times yours"


def _factors(end: AttractionEnd) -> tuple[float, float]:
    """Return the multiples of a parameter between which hunting begins or ends, rounded as they are told."""
    low, high = sorted((end.inside, end.outside))
    return rounded_down(low), rounded_up(high)


LITTLE_MARGIN = 0.5
"""Modulus margin below which the controller has to be tuned as well."""


def isolator_sentence(suggestion: Suggestion) -> str:
    """Say whether the stage would stop hunting on the suggested isolator."""
    flat = suggestion.stage.flat()
    joint = (
        f"an isolator of stiffness {with_unit(flat['joint.stiffness'], 'N/m')}, stroke "
        f"{with_unit(flat['joint.stroke'], 'm')} and damping {with_unit(flat['joint.damping'], 'N*s/m')}"
    )
    if not suggestion.settles:
        return f"It would not surely stop hunting on {joint}, or on any shorter stroke tried."
    low = "" if suggestion.margin >= LITTLE_MARGIN else ", too little: the controller has to be tuned as well"
    return f"On {joint} it would not hunt; its modulus margin would be {suggestion.margin:.2f}{low} (friso tune)."


def isolator_document(isolator: Suggestion) -> dict[str, Any]:
    """Return the suggested isolator, and whether the stage settles on it."""
    flat = isolator.stage.flat()
    return {
        "settles": isolator.settles,
        "stiffness_n_per_m": flat["joint.stiffness"],
        "stroke_m": flat["joint.stroke"],
        "damping_ns_per_m": flat["joint.damping"],
        "modulus_margin": isolator.margin,
    }
