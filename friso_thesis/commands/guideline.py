"""Run `friso guideline`, keeping finished parts of its sweeps until all are done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from friso.cli.asking import Shown, ask
from friso.interface.question import Question
from friso_thesis.commands.unfinished import kept_until_done


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Compute the guideline, and show it; an interrupted run is continued."""
    from friso.interface.output_folder import UNFINISHED
    from friso_thesis.studies.guideline.compute import checked_samples
    from friso_thesis.studies.guideline.sweeps import Keep

    assert shown.out is not None  # it has a default
    checked_samples(options["samples"])
    keep = Keep(shown.out / UNFINISHED)
    with kept_until_done(keep, "part of the sweeps", "parts of the sweeps"):
        ask(question, about, options, shown, folder=keep.folder)
