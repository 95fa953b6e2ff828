"""Write the files of a command, all of them or none.

The folder must be new, empty, a store of friso map, or the command's own from an earlier run, which a small marker file
shows. Otherwise the command refuses and names --overwrite; it does so, too, if a text in the folder was edited since. A
file that the user names must be new, too. No command ever replaces a file that it reads.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from friso.errors import InputError
from friso.interface.drafts import DRAFTS, Drafts, made
from friso.platform import paths
from friso.platform.interrupts import hold_interrupts
from friso.platform.system import cause_of, check_free, shell_word
from friso.progress import Progress, silent
from friso.quantities import as_toml
from friso.stage.tables_of_files import parsed, text_of
from friso.version import VERSION

if TYPE_CHECKING:
    from friso.shown.files import Content, Files

LOGGER = logging.getLogger("friso")

STORE_MAKER = "map, a store"
"""Maker recorded for a folder that is a store rather than a folder of files."""

MARKER = ".friso-output"
"""Name of the file that records which command made a folder, and which of its files are friso's."""

OVERWRITE, REPLACES = "--overwrite", "which replaces files of the same name"
"""Option by which a command may write among other files, and its effect in words."""

UNFINISHED = ".friso-unfinished"
"""Name of the folder in which a long command keeps finished parts until it has ended."""


Digests: TypeAlias = "dict[str, tuple[str, ...]]"
"""SHA-256 of the texts that friso wrote into a folder, by name: of the last one and the one before."""


class OutputFolder:
    """The folder that a command writes into; `inputs` are the files that it reads."""

    def __init__(self, command: str, folder: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> None:
        """Check the folder; with `overwrite`, other files and edited texts may be replaced.

        Raises InputError if the command must not write there, or cannot.
        """
        self.command, self.folder, self.overwrite, self.inputs = command, folder, overwrite, tuple(inputs)
        refuse_place("--out", folder)
        if self.unfinished.is_symlink():
            raise InputError(
                "--out", f"{folder}, where {UNFINISHED} is a link", "no link", f"rm {shell_word(str(self.unfinished))}"
            )
        _check_writable(folder)
        maker, self.files = marked(folder)
        self.is_marked = maker == command
        self.is_own = self.is_marked or not _entries(folder)
        if not self.is_own and (maker == STORE_MAKER or not overwrite):
            more = "" if maker == STORE_MAKER else f", or {OVERWRITE}, {REPLACES}"
            raise _of_others(folder, maker, f"one that friso {command} made{more}")
        own = [name for name in self.files if self.is_own]
        self.check(own)
        for name in own:
            self._check_free(name)
        self.digests = digests_of(folder) if self.is_own else {}
        edited = [name for name, digests in self.digests.items() if _is_edited(folder / name, digests)]
        if edited and not overwrite:
            actual = f"{folder}, where {_first_names(edited)} was changed after friso {command} had written it"
            raise InputError("--out", actual, f"another folder, or {OVERWRITE}", _beside(folder))

    @property
    def unfinished(self) -> Path:
        """Return the folder for finished parts of long work, from which the next run continues."""
        return self.folder / UNFINISHED

    def check(self, names: Iterable[str]) -> None:
        """Check names of files. Raises InputError if one of them must not be written."""
        existing = [name for name in names if os.path.lexists(self.folder / name)]
        for name in existing:
            if any(_are_one(self.folder / name, file) for file in self.inputs):
                actual = f"{self.folder}, where {name} is read"
                raise InputError("--out", actual, "another folder", _beside(self.folder))
        others = [name for name in existing if name not in self.files]
        if others and not self.overwrite:
            actual = f"{self.folder}, with {_first_names(others)}, which friso {self.command} has not written"
            raise InputError("--out", actual, f"another folder, or {OVERWRITE}", _beside(self.folder))

    def _check_free(self, name: str) -> None:
        """Raise InputError for a file that cannot be replaced because another program holds it open."""
        try:
            if (self.folder / name).exists():
                check_free(self.folder / name)
        except OSError as error:
            actual = f"{self.folder}, where {name} cannot be replaced ({cause_of(error)})"
            raise InputError("--out", actual, "that file closed, or another folder", _beside(self.folder)) from None

    def write(
        self, files: Files, progress: Progress = silent, beside: Mapping[Path, Content] | None = None
    ) -> list[Path]:
        """Write the files, and some `beside` the inputs, all of them or none.

        Returns the paths in the folder. Raises InputError if one must not be written, and OSError if one cannot.
        """
        self.check(files)
        others = [name for name in files if name not in self.files and os.path.lexists(self.folder / name)]
        earlier = [name for name in self.files if name not in files and os.path.lexists(self.folder / name)]
        contents = {self.folder / name: content for name, content in files.items()}
        own = contents if self.overwrite else [self.folder / name for name in self.files]
        own = [*own, *filter(Path.is_file, beside or ()), *([self.folder / MARKER] if self.is_marked else ())]
        gone = {name for name, content in files.items() if content is None}
        names = [name for name in dict.fromkeys([*self.files, *files]) if name not in gone]
        leaving = [name for name in gone if os.path.lexists(self.folder / name)]
        # After a kill, a text may be the earlier one or the new one; neither was edited.
        new = {name: digest(content) for name, content in files.items() if isinstance(content, str)}
        digests = self.digests | {name: (one, *self.digests.get(name, ())[:1]) for name, one in new.items()}
        # The marker comes first: if the process is killed, the next run knows which files are its own.
        write({**self._marker([*names, *leaving], digests), **contents, **(beside or {})}, own, progress)
        if self.is_own:
            self.is_marked, self.files, self.digests = True, tuple(names), digests
        if leaving:
            write(self._marker(names, digests), [self.folder / MARKER])
        if others:
            LOGGER.warning(f"replaced (--overwrite): {', '.join(others)}")
        if earlier:
            LOGGER.warning(f"{_first_names(earlier)} in {self.folder} are of an earlier run, and were left there")
        return written(contents)

    def _marker(self, names: Iterable[str], digests: Digests) -> dict[Path, Content]:
        """Return the marker file's path and content; empty if the folder is not the command's own.

        The marker names the files that the command wrote, with `digests` of its texts (see `marker`).
        """
        return {self.folder / MARKER: marker(self.command, names, digests)} if self.is_own else {}


def refuse_place(option: str, path: Path) -> None:
    """Check that something can be written to a path.

    Raises InputError for unusable paths (`paths.unwritable`), and for paths inside a store, which takes only its own
    files.
    """
    from friso.studies.store_files import is_store

    example = f"{option} report" if option.startswith("--") else ""
    if why := paths.unwritable(path):
        raise InputError(option, *why, example)
    if any(is_store(folder) for folder in Path(os.path.abspath(path)).parents):
        raise InputError(option, f"{path}, in a store of friso map", "a place outside of it", example)


def check_store_folder(folder: Path) -> None:
    """Check that a folder can become a store, or is one.

    Raises InputError if it holds anything else, or cannot be made. A store is the whole folder, so --overwrite does not
    put one beside other files.
    """
    maker, _ = marked(folder)
    if _entries(folder):
        if maker != STORE_MAKER:
            raise _of_others(folder, maker, f"or a store that friso map made; {OVERWRITE} replaces stores alone")
        return
    try:
        _try_draft(folder.parent / MARKER)
    except OSError as error:
        expected = f"a place in a folder that can be written ({cause_of(error)}: {folder.parent})"
        raise InputError("--out", str(folder), expected, "--out study.zarr") from None


def check_file(
    option: str,
    path: Path,
    overwrite: bool,
    inputs: Sequence[Path | None] = (),
    is_own: bool = False,
    example: str = "",
) -> None:
    """Check that a file named by the user may be written.

    Raises InputError if it is among the `inputs`, which are read, or exists already. An existing file is allowed if it
    `is_own` or may be overwritten. The message suggests another name, or the `example`.
    """
    refuse_place(option, path)
    another = f"{path.stem}-2{path.suffix}"
    example = example or (f"{option} {another}" if option.startswith("--") else another)
    if any(file and _are_one(path, file) for file in inputs):
        raise InputError(option, f"{path}, which is read", "another file; nothing was overwritten", example)
    if os.path.lexists(path) and not ((is_own or overwrite) and path.is_file()):
        expected = f"a new file, or {OVERWRITE}; nothing was overwritten"
        raise InputError(option, f"{path}, which already exists", expected, example)
    try:
        if path.exists():
            check_free(path)
        _try_draft(path)
    except OSError as error:
        raise _unwritable(option, path, error, example) from None


def write_file(option: str, path: Path, content: Content, overwrite: bool) -> None:
    """Write a file that the user names, whole or not at all.

    Raises InputError if it cannot be written, or exists already and `overwrite` is not set.
    """
    check_file(option, path, overwrite)
    place = Path(os.path.realpath(path))  # a link stays a link
    try:
        path.parent.stat()  # a missing folder is a mistake, and is not made
        write({place: content}, [place] if overwrite else ())
    except OSError as error:
        raise _unwritable(option, path, error, path.name) from None


def _unwritable(option: str, path: Path, error: OSError, example: str) -> InputError:
    expected = f"a new file in a folder that can be written ({cause_of(error)}); nothing was overwritten"
    return InputError(option, str(path), expected, example)


def output_folder(
    command: str, folder: Path | None, overwrite: bool, inputs: Sequence[Path] = ()
) -> OutputFolder | None:
    """Return the folder that a command writes into; None if no `folder` was named.

    Raises InputError if the command must not write there, even with `overwrite`, or cannot.
    """
    return None if folder is None else OutputFolder(command, folder, overwrite, inputs)


def write(files: Mapping[Path, Content], may_replace: Collection[Path], progress: Progress = silent) -> list[Path]:
    """Write files so that at any moment all or none are in place, and return their paths.

    Files that are not in `may_replace` must be new. Raises FileExistsError if one exists, and another OSError if one
    cannot be written.
    """
    with drafts_of(files, progress) as drafts:
        drafts.put_in_place(may_replace)
    return written(files)


@contextmanager
def drafts_of(files: Mapping[Path, Content], progress: Progress = silent) -> Iterator[Drafts]:
    """Provide the drafts of some files, which are deleted unless put in place.

    Raises OSError if a draft cannot be written.
    """
    with Drafts() as drafts:
        for number, (path, content) in enumerate(files.items()):
            progress(number, len(files), "files")
            drafts.add(path, content)
        yield drafts


def written(files: Mapping[Path, Content]) -> list[Path]:
    """Return the files that exist after writing; a file without content is deleted."""
    return [path for path, content in files.items() if content is not None]


def _are_one(path: Path, other: Path) -> bool:
    """Tell whether two paths lead to the same file."""
    return path.exists() and other.exists() and path.samefile(other)


def digest(text: str) -> str:
    """Return the SHA-256 of a text."""
    return sha256(text.encode()).hexdigest()


def marker(command: str, names: Iterable[str], digests: Digests) -> str:
    """Return the text of the marker file: the command, the files that it wrote, and digests of its texts."""
    lines = [f'command = "{command}"', f'version = "{VERSION}"', "files = [", *(f"  {as_toml(n)}," for n in names), "]"]
    lines += ["", "[digests]", *(f"{as_toml(name)} = {as_toml(' '.join(of))}" for name, of in digests.items())]
    return "\n".join(["# Made by friso, which replaces these files when the command is run again.", *lines, ""])


def marked(folder: Path) -> tuple[str, tuple[str, ...]]:
    """Return the command that made a folder, and the files that it wrote there.

    Both are empty for a folder that no command of friso made.
    """
    try:
        document = parsed(text_of(folder / MARKER, "a marker"), "a marker")
    except InputError:
        from friso.studies.store_files import is_store

        return (STORE_MAKER if folder.is_dir() and is_store(folder) else ""), ()
    command, files = document.get("command"), document.get("files")
    if not (isinstance(command, str) and isinstance(files, list)):
        return "", ()
    return command, tuple(str(name) for name in files)


def digests_of(folder: Path) -> Digests:
    """Return the digests of the texts in a folder, by its marker; empty without a marker that has them."""
    try:
        table = parsed(text_of(folder / MARKER, "a marker"), "a marker").get("digests")
    except InputError:
        return {}
    entries = table.items() if isinstance(table, dict) else ()
    return {str(name): tuple(of.split()) for name, of in entries if isinstance(of, str)}


def _is_edited(text: Path, digests: Sequence[str]) -> bool:
    """Tell whether the file `text` differs from all that friso wrote, by their `digests`.

    The result is False if the file cannot be read.
    """
    try:
        return sha256(text.read_bytes()).hexdigest() not in digests
    except OSError:
        return False


def _of_others(folder: Path, maker: str, expected: str) -> InputError:
    """Build the refusal of a folder that is not new, empty or the command's own.

    `maker` is the command that made the folder ("": none), and `expected` says what else the folder may be.
    """
    made = f"made by friso {maker}" if maker else f"with {_first_names(_entries(folder))} in it"
    holds = "a store of friso map" if maker == STORE_MAKER else made
    return InputError("--out", f"{folder}, {holds}", f"a new or empty folder, {expected}", _beside(folder))


def _beside(folder: Path) -> str:
    """Return a suggested `--out` option: the name of a folder that is taken, with "-2"."""
    return f"--out {shell_word(f'{folder}-2' if folder.name.strip('.') else 'report')}"


def _entries(folder: Path) -> list[str]:
    """Return what is in a folder, except friso's own files of unfinished runs."""
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    return [name for name in names if name != UNFINISHED and not name.startswith(DRAFTS)]


def _first_names(names: Sequence[str]) -> str:
    """Write the first of some names, and how many more there are."""
    more = len(names) - MOST_LISTED
    return ", ".join(names[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "")


MOST_LISTED = 8


def _check_writable(folder: Path) -> None:
    """Raise InputError if no file can be written into the folder, or it cannot be made."""
    try:
        with hold_interrupts():
            for path in reversed(made(folder)):
                path.rmdir()  # for now: the folder appears with the written files
        _try_draft(folder / MARKER)
    except OSError as error:
        expected = f"a folder that can be written ({cause_of(error)})"
        raise InputError("--out", str(folder), expected, "--out report") from None


def _try_draft(path: Path) -> None:
    """Raise OSError if no draft of a file can be made.

    On Windows and on network shares, only trying shows whether a file can be written.
    """
    with Drafts() as drafts:
        drafts.add(path, "")
