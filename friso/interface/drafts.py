"""Write files that appear under their names together, or not at all.

Drafts are written first and renamed in the end.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Collection
from contextlib import ExitStack, suppress
from functools import partial
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from friso.platform.interrupts import hold_interrupts, raise_what_waits
from friso.platform.leftovers import locked_folder, remove_leftovers
from friso.platform.system import delete_file, name_new_file, once_free, replace_file

if TYPE_CHECKING:
    from friso.shown.files import Content

DRAFTS = ".friso-draft-"
"""Prefix of the folder of drafts.

A folder that a killed process left behind is deleted by the next command."""

_LOCK = "lock"

SEARCHED_LEVELS = 4
"""Number of parent folders in which leftover drafts are searched; no command writes deeper below its output folder."""


class Drafts:
    """Drafts of files, on the disk where the files are to be.

    Drafts are deleted at the end of the `with` block unless they were put in place.
    """

    def __init__(self) -> None:
        self.folders: dict[Path, Path] = {}
        self.made, self.held = ExitStack(), ExitStack()
        self.drafts: list[tuple[Path | None, Path]] = []
        self.tidied: set[Path] = set()
        self.numbers = count()

    def __enter__(self) -> Drafts:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self.held, hold_interrupts():
            self.made.close()

    def add(self, path: Path, content: Content) -> None:
        """Write the draft of a file; with the content None, an existing file is to be deleted."""
        if path.is_dir():
            raise IsADirectoryError(f"{path} is a folder")
        self._tidy(path)
        if content is None:
            self.drafts.append((None, path))
            return
        draft = self._spare(path)
        if callable(content):
            content(draft)
        else:
            draft.write_bytes(content.encode() if isinstance(content, str) else content)
        self.drafts.append((draft, path))

    def put_in_place(self, may_replace: Collection[Path] = ()) -> None:
        """Give all drafts their names; only files that `may_replace` names are replaced.

        After an error, all files are as before. Ctrl-C waits until the drafts are gone. At any moment, a name has
        either the earlier or the new file. Raises FileExistsError if another file has appeared meanwhile, or another
        OSError.
        """
        undo: list[Callable[[], object]] = []
        raise_what_waits()
        self.held.enter_context(hold_interrupts())
        try:
            for draft, path in self.drafts:
                undo += [folder.rmdir for folder in made(path.parent)]
                if path in may_replace and os.path.lexists(path):
                    spare = self._spare(path)
                    once_free(partial(_duplicate, path, spare))
                    undo.append(partial(replace_file, spare, path))
                    if draft is None:
                        delete_file(path)
                    else:
                        with suppress(FileNotFoundError):  # also for a link that leads nowhere
                            shutil.copymode(path, draft)
                        replace_file(draft, path)
                elif draft is not None:
                    name_new_file(draft, path)
                    undo.append(partial(delete_file, path))
        except BaseException:
            for step in reversed(undo):
                with suppress(OSError):  # continue undoing the rest
                    step()
            raise

    def _tidy(self, path: Path) -> None:
        """Remove drafts near `path` that killed processes left behind.

        Folders further up are searched as well, since the folder of the file may not have existed.
        """
        for folder in {*path.absolute().parents[:SEARCHED_LEVELS]} - self.tidied:
            self.tidied.add(folder)
            if folder.is_dir():
                remove_leftovers(folder, DRAFTS, _LOCK)

    def _spare(self, path: Path) -> Path:
        """Return a free path on the disk of `path`, with its suffix."""
        parents = path.absolute().parents
        root = next((folder for folder in parents if folder.exists()), parents[-1])  # the drive does not exist
        if root not in self.folders:
            with hold_interrupts():
                self.folders[root] = self.made.enter_context(locked_folder(root, DRAFTS, _LOCK))
        return self.folders[root] / f"{next(self.numbers)}{path.suffix}"


def _duplicate(path: Path, spare: Path) -> None:
    """Give a file a second name, `spare`, by a link or a copy; a symbolic link stays a link."""
    try:
        os.link(path, spare, follow_symlinks=False)
    except (OSError, NotImplementedError):  # the disk has no links
        shutil.copy2(path, spare, follow_symlinks=False)


def made(folder: Path) -> list[Path]:
    """Make a folder and the missing ones above it; return those made, the outermost first.

    Raises OSError, after removing the folders already made.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    done: list[Path] = []
    try:
        for path in reversed(missing):
            path.mkdir()
            done.append(path)
        if not folder.is_dir():
            raise NotADirectoryError(20, "Not a directory", str(folder))
    except BaseException:
        for path in reversed(done):
            path.rmdir()
        raise
    return done
