"""Write the files of a command, each whole or not at all.

The folder must be new or empty, and a file that the user names must be new: otherwise the command refuses before
anything is computed, and names --overwrite. No command ever replaces a file that it reads.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from friso.errors import InputError
from friso.platform import files
from friso.platform.interrupts import raise_what_waits
from friso.platform.leftovers import locked_folder, remove_leftovers
from friso.platform.system import cause_of, check_free, delete_file, name_new_file, replace_file, shell_word
from friso.progress import Progress, silent

if TYPE_CHECKING:
    from friso.shown.blocks import Content, Files

OVERWRITE, REPLACES = "--overwrite", "which replaces files of the same name"
"""Option by which a command may write among other files, and its effect in words."""

UNFINISHED = ".friso-unfinished"
"""Name of the folder in which a long command keeps finished parts until it has ended."""

DRAFTS = ".friso-draft-"
"""Prefix of the folder of a draft. One that a killed process left behind is deleted by the next command."""

SEARCHED_LEVELS = 4
"""Number of parent folders in which leftover drafts are searched."""

MOST_LISTED = 8


class OutputFolder:
    """The folder that a command writes into; `inputs` are the files that it reads."""

    def __init__(
        self,
        command: str,
        folder: Path,
        overwrite: bool,
        inputs: Sequence[Path] = (),
        kept: Collection[str] = (),
    ) -> None:
        """Check the folder: new, empty but for files of the names `kept`, or, with `overwrite`, no store.

        Raises InputError if the command must not write there, or cannot.
        """
        self.command, self.folder, self.overwrite, self.inputs = command, folder, overwrite, tuple(inputs)
        refuse_place("--out", folder)
        if (folder / UNFINISHED).is_symlink():
            example = f"rm {shell_word(str(folder / UNFINISHED))}"
            raise InputError("--out", f"{folder}, where {UNFINISHED} is a link", "no link", example)
        try:
            _try_draft(folder)
        except OSError as error:
            expected = f"a folder that can be written ({cause_of(error)})"
            raise InputError("--out", str(folder), expected, "--out report") from None
        names = [name for name in _entries(folder) if name not in kept]
        if _is_store(folder) or (names and not overwrite):
            more = "" if _is_store(folder) else f", or {OVERWRITE}, {REPLACES}"
            raise _of_others(folder, f"a new or empty folder{more}")

    def check(self, names: Iterable[str]) -> None:
        """Check names of files. Raises InputError if one of them must not be written."""
        existing = [name for name in names if os.path.lexists(self.folder / name)]
        for name in existing:
            if any(_are_one(self.folder / name, file) for file in self.inputs):
                raise _of_others(self.folder, f"another folder, because {name} is read")
        if existing and not self.overwrite:
            raise _of_others(self.folder, f"another folder, or {OVERWRITE}")

    def write(self, files: Files, progress: Progress = silent) -> list[Path]:
        """Write the files, each whole or not at all, and return their paths.

        Raises InputError if one must not be written, and OSError if one cannot.
        """
        self.check(files)
        return write({self.folder / name: content for name, content in files.items()}, self.overwrite, progress)


def refuse_place(option: str, path: Path) -> None:
    """Check that something can be written to a path.

    Raises InputError for unusable paths (`paths.unwritable`), and for paths inside a store, which takes only its own
    files.
    """
    example = f"{option} report" if option.startswith("--") else ""
    if why := files.unwritable(path):
        raise InputError(option, *why, example)
    if any(_is_store(folder) for folder in Path(os.path.abspath(path)).parents):
        raise InputError(option, f"{path}, in a store of friso map", "a place outside of it", example)


def check_store_folder(folder: Path) -> None:
    """Check that a folder can become a store, or is one.

    Raises InputError if it holds anything else, or cannot be made. A store is the whole folder, so --overwrite does not
    put one beside other files.
    """
    if _is_store(folder):
        return
    if _entries(folder):
        expected = f"a new or empty folder, or a store that friso map made; {OVERWRITE} replaces stores alone"
        raise _of_others(folder, expected)
    try:
        _try_draft(folder.parent)
    except OSError as error:
        expected = f"a place in a folder that can be written ({cause_of(error)}: {folder.parent})"
        raise InputError("--out", str(folder), expected, "--out study.zarr") from None


def check_file(option: str, path: Path, overwrite: bool, inputs: Sequence[Path | None] = (), example: str = "") -> None:
    """Check that a file named by the user may be written.

    Raises InputError if it is among the `inputs`, which are read, or exists already and `overwrite` is not set. The
    message suggests another name, or the `example`.
    """
    refuse_place(option, path)
    another = f"{path.stem}-2{path.suffix}"
    example = example or (f"{option} {another}" if option.startswith("--") else another)
    if any(file and _are_one(path, file) for file in inputs):
        raise InputError(option, f"{path}, which is read", "another file; nothing was overwritten", example)
    if os.path.lexists(path) and not (overwrite and path.is_file()):
        expected = f"a new file, or {OVERWRITE}; nothing was overwritten"
        raise InputError(option, f"{path}, which already exists", expected, example)
    try:
        if path.exists():
            check_free(path)
        _try_draft(path.parent)
    except OSError as error:
        raise _unwritable(option, path, error, example) from None


def write_file(option: str, path: Path, content: Content, overwrite: bool) -> None:
    """Write a file that the user names, whole or not at all.

    Raises InputError if it cannot be written, or exists already and `overwrite` is not set.
    """
    check_file(option, path, overwrite)
    try:
        path.parent.stat()  # a missing folder is a mistake, and is not made
        write({Path(os.path.realpath(path)): content}, overwrite)  # a link stays a link
    except OSError as error:
        raise _unwritable(option, path, error, path.name) from None


def output_folder(
    command: str, folder: Path | None, overwrite: bool, inputs: Sequence[Path] = ()
) -> OutputFolder | None:
    """Return the folder that a command writes into; None if no `folder` was named.

    Raises InputError if the command must not write there, even with `overwrite`, or cannot.
    """
    return None if folder is None else OutputFolder(command, folder, overwrite, inputs)


def write(files: Mapping[Path, Content], overwrite: bool = False, progress: Progress = silent) -> list[Path]:
    """Write files, each whole or not at all, and return the paths of those that have content.

    With `overwrite`, existing files are replaced, and those whose content is None deleted. Raises FileExistsError if
    one exists otherwise, and another OSError if one cannot be written.
    """
    for number, (path, content) in enumerate(files.items()):
        progress(number, len(files), "files")
        if content is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            with locked_folder(path.parent, DRAFTS, "lock") as folder:
                _write_draft(folder / path.name, content, path)
                raise_what_waits()
                (replace_file if overwrite else name_new_file)(folder / path.name, path)
        elif overwrite:
            delete_file(path)
    return [path for path, content in files.items() if content is not None]


def _write_draft(draft: Path, content: Content, path: Path) -> None:
    """Write the draft of a file, with the permissions of the one that is there."""
    if callable(content):
        content(draft)
    else:
        draft.write_bytes(content.encode() if isinstance(content, str) else content or b"")
    with suppress(FileNotFoundError):
        shutil.copymode(path, draft)


def _try_draft(folder: Path) -> None:
    """Raise OSError if nothing can be written into a folder, or it cannot be made.

    On Windows and on network shares, only trying shows whether a file can be written.
    """
    place = folder.absolute()
    missing = [one for one in (place, *place.parents) if not one.exists()]
    for parent in place.parents[:SEARCHED_LEVELS]:
        remove_leftovers(parent, DRAFTS, "lock")
    try:
        place.mkdir(parents=True, exist_ok=True)
        with locked_folder(place, DRAFTS, "lock"):
            pass
    finally:
        for one in missing:  # the folder appears with the files
            with suppress(OSError):
                one.rmdir()


def _unwritable(option: str, path: Path, error: OSError, example: str) -> InputError:
    expected = f"a new file in a folder that can be written ({cause_of(error)}); nothing was overwritten"
    return InputError(option, str(path), expected, example)


def _are_one(path: Path, other: Path) -> bool:
    """Tell whether two paths lead to the same file."""
    return path.exists() and other.exists() and path.samefile(other)


def _is_store(folder: Path) -> bool:
    from friso.studies.store_files import is_store

    return is_store(folder)


def _of_others(folder: Path, expected: str) -> InputError:
    """Build the refusal of a folder that is not new or empty; `expected` says what else it may be."""
    names = _entries(folder)
    first = ", ".join(names[:MOST_LISTED]) + (f" and {len(names) - MOST_LISTED} more" * (len(names) > MOST_LISTED))
    holds = "a store of friso map" if _is_store(folder) else f"with {first} in it"
    beside = f"{folder}-2" if folder.name.strip(".") else "report"
    return InputError("--out", f"{folder}, {holds}", expected, f"--out {shell_word(beside)}")


def _entries(folder: Path) -> list[str]:
    """Return what is in a folder, except friso's own files of unfinished runs."""
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    return [name for name in names if name != UNFINISHED and not name.startswith(DRAFTS)]
