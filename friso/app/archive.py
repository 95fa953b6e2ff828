"""Pack what a command would write into one archive, without writing any other file."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping

from friso.axis import speaking_of
from friso.interface.answer import Answer
from friso.platform.leftovers import temporary_folder
from friso.shown.blocks import pictures


def archive(answer: Answer, more: Mapping[str, str]) -> bytes:
    """Return a ZIP file with everything that an answer's command would write.

    The archive holds the files, the figures in all formats, and the answer as JSON. `more` adds text files by name.
    """
    held = io.BytesIO()
    packing = zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED)
    with temporary_folder("friso-app-") as folder, packing as file:
        out = folder / "out"
        written = answer.report(out)
        with speaking_of(answer.axis_kind):
            for name, save in pictures(answer.figures()).items():  # some commands show figures in their page alone
                if out / name not in written and callable(save):
                    save(out / name)
        for path in sorted(out.rglob("*")):
            file.write(path, path.relative_to(out))
        file.writestr(f"{answer.command}.json", json.dumps(answer.to_dict(), indent=1, allow_nan=False))
        for name, text in more.items():
            file.writestr(name, text)
    return held.getvalue()
