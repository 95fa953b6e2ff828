"""Write the page of `friso logs`: one file that opens offline and prints.

Every run of the command gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence

from friso.identification.contents import LogContent
from friso.questions.logs.figures import logs_figures
from friso.questions.logs.words import COLUMNS, channel_rows, conclusions, next_command, open_questions
from friso.shown.files import Content
from friso.shown.pages import Report


def logs_files(contents: Sequence[LogContent]) -> dict[str, Content]:
    """Return the page, and every figure in all formats."""
    files = [
        {
            "name": content.path.name,
            "rows": channel_rows(content),
            "open": open_questions(content),
            "command": next_command(content),
            "read": content.read,
            "warnings": content.warnings,
            "figure": f"logs_{number}",
        }
        for number, content in enumerate(contents, 1)
    ]
    return Report.of_stage(
        "logs",
        None,
        logs_figures(contents),
        ", ".join(content.path.name for content in contents),
        verdicts=[sentence for content in contents for sentence in conclusions(content)],
        columns=COLUMNS,
        files=files,
    ).files()
