"""The answer in words and numbers, and what the template of its page names."""

from friso.shown.blocks import AnswerBlock
from friso.shown.text import with_unit
from friso_resting.resting.question import RestingAnswer


def blocks(answer: RestingAnswer) -> list[AnswerBlock]:
    """The distance."""
    says = f"Friction may hold the stage up to {with_unit(answer.result, 'm')} from its target."
    return [AnswerBlock(sentences=[says], numbers=lambda: {"distance_m": answer.result})]
