"""Keep files that were dropped on the page in a folder of the server, while it runs."""

from __future__ import annotations

import re
import secrets
from collections.abc import AsyncIterable
from contextlib import ExitStack
from pathlib import Path

from friso.errors import InputError
from friso.platform.leftovers import temporary_folder
from friso.platform.system import name_refused, remove_folder

MOST_BYTES = 64_000_000
"""Largest size of a log in bytes."""

MOST_FILES = 50
"""Largest number of files kept."""


PREFIX = "friso-uploads-"
"""Prefix of the servers' folders."""


class Uploads:
    """Dropped files by the names under which the page knows them.

    The page can name no file that was not dropped. Names are random, so a page left open cannot reach files of a later
    server. Files that a killed server left behind are deleted by the next one.
    """

    def __init__(self) -> None:
        self.held = ExitStack()
        self.folder = self.held.enter_context(temporary_folder(PREFIX))
        self.files: dict[str, Path] = {}

    async def keep(self, name: str, chunks: AsyncIterable[bytes]) -> str:
        """Store a file as it arrives, and return the name under which it is asked for.

        Raises InputError for a file that is too large, or one file too many. Raises OSError if it cannot be written.
        """
        place = self.folder / secrets.token_hex(8)  # several may come at the same time
        if sum(1 for entry in self.folder.iterdir() if entry.is_dir()) >= MOST_FILES:
            most = f"at most {MOST_FILES}: Other files lets those go that are shown"
            raise InputError("file", f"more than {MOST_FILES} files", most)
        plain = plain_name(name, "log")
        place.mkdir()
        size = 0
        try:
            with open(place / plain, "wb") as file:
                async for chunk in chunks:
                    size += len(chunk)
                    if size > MOST_BYTES:
                        most = f"at most {MOST_BYTES / 1e6:g} MB; friso identify on the command line takes larger ones"
                        raise InputError(plain, f"more than {MOST_BYTES / 1e6:g} MB", most)
                    file.write(chunk)
        except BaseException:
            remove_folder(place)
            raise
        label = f"{place.name}/{plain}"
        self.files[label] = place / plain
        return label

    def path(self, name: object) -> Path:
        """Return where a dropped file is stored. Raises InputError for an unknown name."""
        path = self.files.get(name) if isinstance(name, str) else None
        if path is None:
            raise InputError("file", str(name)[:60], "a file that was dropped on the page while this server ran")
        return path

    def let_go(self, name: str) -> None:
        """Delete one dropped file. Raises InputError for an unknown name."""
        place = self.path(name).parent
        del self.files[name]
        remove_folder(place)

    def remove(self) -> None:
        """Delete all dropped files and their folder."""
        self.held.close()


_OUTSIDE = re.compile(r"[^\w.+ -]")

LONGEST_NAME = 150
"""Longest file name in bytes. File systems take 255, and names of accompanying files are longer."""


def plain_name(name: str, otherwise: str) -> str:
    """Return the last part of a path as a safe file name, or `otherwise` if nothing is left.

    The name cannot lead to another folder, hide the file, or read as an option of a command.
    """
    last = _OUTSIDE.sub("_", name.replace("\\", "/").rpartition("/")[2])
    plain = last.encode()[-LONGEST_NAME:].decode(errors="ignore").lstrip(".- ").rstrip(". ") or otherwise
    return f"_{plain}" if name_refused(Path(plain)) else plain
