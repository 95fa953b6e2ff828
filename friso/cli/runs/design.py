"""Run `friso design`; without a design, say which requirement to relax and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import typer

from friso.cli.asking import Shown, ask
from friso.cli.common import print_document, say
from friso.interface.question import Question


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Ask for a design. Raises typer.Exit with status 2 where there is none."""
    from friso.design_method.method import NoDesign
    from friso.interface.inputs import stage_of
    from friso.questions.design.blocks import refused_document
    from friso.questions.design.question import specification_of
    from friso.questions.design.words import refusal
    from friso.shown.text import unknown_condition

    try:
        ask(question, about, options, shown)
    except NoDesign as failure:
        stage = stage_of(about[0], options.get("set"))
        if shown.as_json:
            print_document(refused_document(stage, specification_of(stage, about[1]).name, failure))
        say(unknown_condition(stage) + refusal(failure))
        raise typer.Exit(2) from None
