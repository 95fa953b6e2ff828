"""Give the blocks of `friso logs`: one for each file."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from friso.identification.contents import LogContent
from friso.questions.logs.figures import logs_figures
from friso.questions.logs.words import (
    COLUMNS,
    channel_rows,
    conclusions,
    file_sentences,
    logs_document,
    next_command,
    open_questions,
    sampled_note,
)
from friso.shown.blocks import AnswerBlock


def blocks(contents: Sequence[LogContent]) -> list[AnswerBlock]:
    """Return a block for each file, the first with all figures and the document."""
    files = [
        AnswerBlock(title=item.path.name, sentences=file_sentences(item), columns=COLUMNS, rows=channel_rows(item))
        for item in contents
    ]
    return [*files, AnswerBlock(draw=partial(logs_figures, contents), numbers=partial(logs_document, contents))]


def page_values(contents: Sequence[LogContent]) -> dict[str, Any]:
    """Return what the page shows file by file: what is open, the channels, and how the file was read."""
    files = [
        {
            "name": content.path.name,
            "rows": channel_rows(content),
            "open": open_questions(content),
            "command": next_command(content),
            "read": content.read,
            "warnings": (*sampled_note(content), *content.warnings),
            "figure": f"logs_{number}",
        }
        for number, content in enumerate(contents, 1)
    ]
    verdicts = [verdict for content in contents for verdict in conclusions(content)]
    return {"verdicts": verdicts, "columns": COLUMNS, "files": files}
