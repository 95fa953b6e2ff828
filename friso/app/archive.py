"""What a command would write, in one archive: nothing is written anywhere else."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from friso.stage import Stage

if TYPE_CHECKING:
    from friso.answers.answer import Answer


def archive(answer: Answer, stage: Stage, stem: str) -> bytes:
    """A ZIP file of the files of an answer, its document as JSON, and the stage file."""
    held = io.BytesIO()
    packing = zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED)
    with tempfile.TemporaryDirectory(prefix="friso-app-") as folder, packing as file:
        for path in answer.report(Path(folder) / "out"):
            file.write(path, path.name)
        file.writestr(f"{answer.command}.json", json.dumps(answer.to_dict(), indent=1, allow_nan=False))
        file.writestr(f"{stem}.toml", stage.to_toml())
    return held.getvalue()
