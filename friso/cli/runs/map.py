"""Run `friso map`: results go into a store, with the figure and the page beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from friso.cli.asking import Shown, named_as_options, show
from friso.cli.progress import ProgressBar
from friso.interface.question import Question
from friso.progress import Progress


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Run or resume a study."""
    from friso.axis import speak_of
    from friso.interface.output_folder import output_folder, write

    (source,) = about
    store, elsewhere = shown.out or Path(f"{source.stem}_map.zarr"), None
    if source.is_dir():
        store, elsewhere = None, output_folder(question.name, shown.out, shown.overwrite)
    options = {**options, "overwrite": shown.overwrite, "out": store}
    with ProgressBar() as progress, named_as_options(question.options):
        answer = question.function(source, **options, beside=elsewhere is None, progress=progress)
    speak_of(answer.axis_kind)
    place = answer.store or source

    def written(progress: Progress) -> list[Path]:
        """Write figure and page, and return their paths.

        The files go beside the store, or into a folder given by --out.
        """
        if elsewhere is not None:
            return elsewhere.write(answer.files(), progress)
        return write(answer.files_beside(), shown.overwrite, progress)

    show(answer, shown, written, f"the runs are in {place}, but no figure was written")
