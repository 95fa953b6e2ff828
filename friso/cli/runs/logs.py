"""Run `friso logs`: report files that cannot be read beside those that can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from friso.cli.asking import Shown, named_as_options, show
from friso.cli.progress import ProgressBar
from friso.interface.question import Question


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Show what the files hold, and write the page if there is anything to show."""
    from friso.interface.output_folder import output_folder

    target = output_folder(question.name, shown.out, shown.overwrite, about[0])
    with ProgressBar(question.during) as progress, named_as_options(question.options):
        answer = question.function(*about, **options, folder=shown.out, partly=True, progress=progress)
    folder = target if answer.result else None
    shown = replace(shown, as_json=shown.as_json and not answer.errors)
    show(answer, shown, None if folder is None else lambda progress: folder.write(answer.files(), progress))
