"""Run `friso reproduce`, keeping finished pieces until all are done.

If single claims are judged, the folder is named after them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from friso.cli.asking import Shown, ask
from friso.interface.question import Question
from friso_thesis.commands.unfinished import kept_until_done


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Judge the claims, show the answer, and continue from where an interrupted run left off."""
    from friso.interface.output_folder import UNFINISHED
    from friso_thesis.studies.thesis.kept import Kept

    claims = sorted({claim.upper() for claim in options.get("only", ())})
    folder = shown.out or Path("-".join(("reproduction", *claims)))
    kept = Kept(folder / UNFINISHED)
    with kept_until_done(kept, "piece of the work", "pieces of the work"):
        ask(question, about, options, replace(shown, out=folder), folder=kept.folder)
