"""Say how far static friction, stroke or stiffness may change before the verdict does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friso.equations.breakaway import breakaway
from friso.equations.scaled_friction import least_static_factor, static_frictions, with_static_friction
from friso.equations.structure import carrying_force
from friso.hunting import SEARCH_LIMITS, AttractionEnd, Case, ParameterMargin
from friso.quantities import percent, plain_factor
from friso.shown.drawing.prefixes import (
    digits_that_differ,
    listed,
    range_with_unit,
    rounded_down,
    rounded_up,
    with_unit,
)
from friso.stage.controllers import FORCE_LIMIT


def friction_sentences(case: Case) -> list[str]:
    """Say at which static friction hunting begins or ends.

    Nothing is said if this was not searched, or if the friction law does not separate static from Coulomb friction.
    """
    margin = case.static_friction
    if margin is None:
        return []
    lowest = "Coulomb friction" if margin.range[0] > 1 / SEARCH_LIMITS.most_friction else ""
    says = margin_sentence("static friction", margin, _forces(case, margin) or " (Coulomb friction held)", lowest)
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


def margin_sentence(name: str, margin: ParameterMargin, remark: str = "", lowest: str = "") -> str:
    """Say at which values of a parameter hunting begins or ends.

    `name` is the parameter in words, and `remark` is added to the sentence. `lowest` replaces the least multiple
    searched by a word, such as "no stroke".
    """
    does, starts = ("ends", "ends") if margin.attracts else ("begins", "starts")
    sure = margin.sure and all(end.certain for end in (margin.below, margin.above) if end)
    doubt = "" if sure else "; this is not certain"
    left = listed([_side(side) for side in margin.open_sides], "and")
    if left:
        doubt += f"; {left} yours it was not determined"
    if ways := margin_ways(margin):
        return f"Hunting {does} with {name} {listed(ways, 'or')}{remark}{doubt}."
    if left:
        return f"Whether {name} {left} yours {starts} hunting was not determined."
    low, high = margin.range
    return f"No {name} tried from {lowest or f'{low:.2g}'} to {high:g} times yours {starts} hunting{remark}{doubt}."


def joint_sentences(margins: Mapping[str, ParameterMargin]) -> list[str]:
    """Say at which stroke or stiffness of the joint hunting begins or ends.

    `margins` holds the margins by their keys.
    """
    return [margin_sentence(key.replace(".", " "), margin, " (joint free)") for key, margin in margins.items()]


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


def _forces(case: Case, margin: ParameterMargin) -> str:
    """Write static friction, and static minus Coulomb friction [N], where hunting begins or ends.

    The numbers follow from the rounded multiples that stand before them, so that a reader finds one from another.
    The text is empty for a stage with several friction laws, or unless hunting changes on one side only.
    """
    flat = case.stage.flat()
    pairs = static_frictions(flat)
    ends = [end for end in (margin.below, margin.above) if end]
    if len(pairs) != 1 or len(ends) != 1:
        return ""
    ((static, coulomb),) = pairs.items()
    (end,) = ends
    held = flat[coulomb]
    least, most = (max(flat[static] * factor, held) for factor in _factors(end))
    above = range_with_unit(least - held, most - held, "N")
    digits = digits_that_differ([least, most, held])
    at = range_with_unit(least, most, "N", digits)
    return f" ({at}: {above} above Coulomb friction, which is held at {with_unit(held, 'N', digits)})"
