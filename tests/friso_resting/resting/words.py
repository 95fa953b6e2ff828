"""The answer in words."""

from friso.shown.drawing.prefixes import with_unit
from friso_resting.resting.question import RestingAnswer


def sentences(answer: RestingAnswer) -> list[str]:
    """The distance in words."""
    return [f"Friction may hold the stage up to {with_unit(answer.result, 'm')} from its target."]
