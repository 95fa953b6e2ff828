"""Files of a command: all of them or none, in a folder that is the command's to write into."""

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import typer
from filelock import FileLock
from inside import friso_inside
from refusals import refused
from systems import posix

from friso.cli.app import command_line
from friso.errors import InputError
from friso.interface import drafts as drafts_module
from friso.interface.drafts import DRAFTS, Drafts, made
from friso.interface.output_folder import (
    MARKER,
    UNFINISHED,
    OutputFolder,
    _check_writable,
    check_store_folder,
    write,
    write_file,
)
from friso.shown.files import Content
from friso.stage import load

EXAMPLES = Path(__file__).parent.parent / "examples"
RIG, DRIVE, LEAVES = (EXAMPLES / f"thesis_{name}.toml" for name in ("rig", "drive", "leaves"))

NEEDS: dict[str, tuple[object, ...]] = {
    "check": (RIG,),
    "simulate": (RIG,),
    "bode": (RIG,),
    "boundary": (RIG, "--x", "controller.crossover=4 Hz..8 Hz"),
    "map": (RIG, "--x", "controller.crossover=4 Hz, 8 Hz"),
    "flexure": (LEAVES,),
    "design": (RIG, EXAMPLES / "specs" / "thesis.toml"),
    "logs": (RIG,),
    "export": (RIG,),
    "identify": (RIG,),
    "rig": ("stiffness", DRIVE),
    "compare": (DRIVE,),
    "tune": (RIG,),
    "reproduce": (),
    "guideline": (),
}
"""Commands that write into a folder, with what they need to get as far as looking at it."""

OF_ONE_FILE: dict[str, tuple[object, ...]] = {"init": ("a.toml",), "example": ("thesis_rig", "a.toml")}
"""Commands that write a single file, which the user names."""


def commands_with(option: str) -> set[str]:
    """The commands of friso that take an option."""
    group = typer.main.get_command(command_line())
    return {name for name, command in group.commands.items() if option in {o for p in command.params for o in p.opts}}


def tree(folder: Path) -> dict[str, bytes | None]:
    """Return all entries of a folder by relative path: a file's content, or None for a folder."""
    return {str(path.relative_to(folder)): None if path.is_dir() else path.read_bytes() for path in folder.rglob("*")}


def test_every_command_that_writes_can_be_told_to_overwrite() -> None:
    assert commands_with("--overwrite") == {*NEEDS, *OF_ONE_FILE}
    assert commands_with("--out") <= commands_with("--overwrite")


@pytest.mark.parametrize("command", NEEDS)
def test_a_folder_that_is_not_the_command_s_is_refused_before_anything_is_computed(
    command: str, tmp_path: Path
) -> None:
    """It has files of others, is of another command, or cannot be written to."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("precious")
    OutputFolder("another", tmp_path / "another", False).write({"page.html": "its page"})
    before = tree(tmp_path)
    for out, words in (("out", "--overwrite"), ("another", "friso another"), *UNWRITABLE):
        done = friso_inside(tmp_path, command, *NEEDS[command], "--out", out)
        assert (done.returncode, done.stdout) == (2, "")
        assert words in " ".join(done.stderr.split())
        assert tree(tmp_path) == before


UNWRITABLE = [("/proc/nowhere", "can be written (")] * (os.name == "posix")
"""Where not even root can write."""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "gains.html"), "No space left on device: gains.html"),
        (InputError("--out", "out, with notes in it", "another folder"), "out, with notes in it; expected: another"),
    ],
)
def test_an_answer_whose_files_cannot_be_written_is_told(
    error: Exception, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object) -> None:
        raise error

    monkeypatch.setattr(Drafts, "put_in_place", full)
    done = friso_inside(tmp_path, *("export", RIG, "--json", "--out", "out"))
    assert (done.returncode, json.loads(done.stdout)["files"]) == (1, [])
    assert f"no file was written: {words}" in " ".join(done.stderr.split())
    assert tree(tmp_path) == {}


@pytest.mark.parametrize("command", OF_ONE_FILE)
def test_a_file_that_is_there_is_refused(command: str, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("precious")
    done = friso_inside(tmp_path, command, *OF_ONE_FILE[command])
    assert (done.returncode, done.stdout) == (2, "")
    assert "--overwrite" in done.stderr
    assert tree(tmp_path) == {"a.toml": b"precious"}
    assert friso_inside(tmp_path, command, *OF_ONE_FILE[command], "--overwrite").returncode == 0
    assert len(load(tmp_path / "a.toml").name) > 0


def test_the_folder_of_a_map_is_its_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another command takes it for one that friso map made; beside files of others, no store is made."""
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr" / ".zattrs").write_text('{"equations": "1", "friso": "1"}')
    with pytest.raises(InputError, match="friso map"):
        place(tmp_path / "a.zarr")
    check_store_folder(tmp_path / "a.zarr")
    check_store_folder(tmp_path / "new.zarr")
    with monkeypatch.context() as patch:  # a folder that is write-protected: a store in it may be written all the same

        def protected(*arguments: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied")

        patch.setattr("friso.interface.output_folder._try_draft", protected)
        check_store_folder(tmp_path / "a.zarr")
        with pytest.raises(InputError, match=rf"new\.zarr[\s\S]*Permission denied: {re.escape(str(tmp_path))}\)"):
            check_store_folder(tmp_path / "new.zarr")
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="--overwrite"):
        check_store_folder(tmp_path)


def place(folder: Path, overwrite: bool = False, inputs: tuple[Path, ...] = ()) -> OutputFolder:
    return OutputFolder("check", folder, overwrite, inputs)


def test_a_place_may_be_new_empty_or_its_own(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    new = place(out)
    assert not (tmp_path / "a").exists()  # looking leaves nothing
    assert new.write({"page.html": "1", "logs/a.csv": b"2"}) == [out / "page.html", out / "logs" / "a.csv"]
    new.write({"more.txt": ""})  # as a command may do twice
    place(out).write({"page.html": "3", "logs/a.csv": None, "more.txt": None})
    assert {name for name, content in tree(out).items() if content is not None} == {"page.html", MARKER}
    assert (out / "page.html").read_text() == "3"
    empty = tmp_path / "empty"
    (empty / UNFINISHED).mkdir(parents=True)
    place(empty).write({"page.html": ""})


def test_a_folder_in_which_a_killed_process_was_writing_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:

        def killed(*arguments: object) -> None:
            raise OSError("killed")

        patch.setattr(drafts_module, "name_new_file", failing(drafts_module.name_new_file, 3, OSError("killed")))
        patch.setattr(drafts_module, "delete_file", killed)  # by which it would be undone
        with pytest.raises(OSError, match="killed"):
            place(tmp_path / "out").write({"a.txt": "1", "b.txt": "2"})
    assert {*tree(tmp_path / "out")} == {MARKER, "a.txt"}
    assert len(place(tmp_path / "out").write({"a.txt": "1", "b.txt": "2"})) == 2


def test_a_text_that_was_edited_is_not_replaced(tmp_path: Path) -> None:
    """The stage file that friso identify writes asks to be completed; a second run replaced what was entered."""
    machine = tmp_path / "out" / "machine.toml"

    def folder(overwrite: bool = False) -> OutputFolder:
        return OutputFolder("identify", machine.parent, overwrite)

    def is_refused(text: str) -> None:
        machine.write_text(text)
        with pytest.raises(InputError, match=r"machine\.toml was changed"):
            folder()
        assert machine.read_text() == text

    for number in (1, 2):
        folder().write({"machine.toml": f"a = {number}\n", "plot.png": b"1"})
    is_refused("a = 3\n")
    folder(overwrite=True).write({"machine.toml": "a = 4\n", "plot.png": b"4"})
    folder().write({"plot.png": b"5"})  # the text stays, with its digest
    is_refused("a = 6\n")


def test_a_file_that_friso_has_not_written_stays(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A file of the user stays even in a folder that friso made, unless `overwrite` is set."""
    place(tmp_path / "out").write({"page.html": ""})
    (tmp_path / "out" / "figure.png").write_text("mine")
    with refused("--out"):
        place(tmp_path / "out").write({"page.html": "", "figure.png": ""})
    assert (tmp_path / "out" / "figure.png").read_text() == "mine"
    place(tmp_path / "out", overwrite=True).write({"figure.png": "friso's"})
    assert "figure.png" in caplog.text
    assert (tmp_path / "out" / "figure.png").read_text() == "friso's"


def test_unfinished_work_is_kept_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / UNFINISHED).symlink_to(tmp_path)
    with pytest.raises(InputError, match="link"):
        OutputFolder("reproduce", tmp_path / "out", False)


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_while_others_are_drawn_stays(
    tmp_path: Path, links: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only files that existed before and may be replaced are replaced.

    A file that others create meanwhile stays, even if it is a link to nothing.
    """
    out = tmp_path / "out"
    place(out).write({"a.txt": "old"})

    def appears(draft: Path) -> None:
        draft.write_text("new")
        (out / "b.txt").symlink_to("nothing") if links else (out / "b.txt").write_text("mine")

    if not links:
        monkeypatch.setattr(os, "link", failing(os.link, 2, OSError(errno.EOPNOTSUPP, "no links")))
    with pytest.raises(FileExistsError, match=r"b\.txt"):
        place(out).write({"a.txt": "new", "b.txt": appears})
    assert ((out / "a.txt").read_text(), (out / "b.txt").is_symlink()) == ("old", links)
    with pytest.raises(InputError, match="--overwrite"):  # found before
        place(out).write({"b.txt": ""})


def test_overwriting_does_not_make_the_folder_friso_s(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    place(tmp_path, overwrite=True).write({"page.html": ""})
    assert {path.name for path in tmp_path.iterdir()} == {"mine.txt", "page.html"}
    with pytest.raises(InputError):
        place(tmp_path)


@pytest.mark.parametrize("overwrite", [False, True])
def test_what_is_read_is_never_replaced(tmp_path: Path, overwrite: bool) -> None:
    place(tmp_path / "out").write({"stage.toml": "read"})
    stage = tmp_path / "out" / "stage.toml"
    with refused("--out"):
        place(tmp_path / "out", overwrite, (stage,))
    (tmp_path / "other.toml").write_text("read too")
    other = OutputFolder("check", tmp_path, True, (tmp_path / "other.toml",))
    with pytest.raises(InputError):
        other.write({"other.toml": ""})
    assert (stage.read_text(), (tmp_path / "other.toml").read_text()) == ("read", "read too")


# all or nothing


NAMES = ("a.txt", "b.txt", "sub/c.txt", "new/folder/d.txt")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two of the files are there from an earlier run."""
    (tmp_path / "sub").mkdir()
    for name in ("b.txt", "sub/c.txt"):
        (tmp_path / name).write_text("old")
    return tmp_path


def write_over(files: dict[Path, Content]) -> list[Path]:
    """Write files, replacing existing ones."""
    return write(files, [*files])


def contents(folder: Path, **others: Content) -> dict[Path, Content]:
    return {folder / name: others.get(Path(name).stem, "new") for name in NAMES}


@pytest.mark.parametrize("number", range(len(NAMES)))
@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_an_error_while_a_file_is_written_leaves_all_as_it_was(folder: Path, number: int, error: Any) -> None:
    def half(path: Path) -> None:
        path.write_text("half")
        raise error

    before = tree(folder)
    with pytest.raises(type(error)):
        write_over(contents(folder, **{Path(NAMES[number]).stem: half}))
    assert tree(folder) == before


def failing(real: Callable[..., Any], after: int, error: BaseException) -> Callable[..., Any]:
    calls = [0]

    def call(*arguments: Any, **named: Any) -> Any:
        calls[0] += 1
        if calls[0] == after:
            raise error
        return real(*arguments, **named)

    return call


@pytest.mark.parametrize(
    ("owner", "method", "after"),
    [*((Path, method, k) for method in ("replace", "mkdir") for k in (1, 2)), (drafts_module, "name_new_file", 1)],
)
def test_an_error_while_files_get_their_names_is_undone(
    folder: Path, owner: Any, method: str, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two files that are replaced, one that gets a name, two folders to make."""
    before = tree(folder)
    with Drafts() as drafts:
        files = contents(folder, a=None)
        for path, content in files.items():
            drafts.add(path, content)
        monkeypatch.setattr(owner, method, failing(getattr(owner, method), after, OSError("no")))
        with pytest.raises(OSError, match="no"):
            drafts.put_in_place(files)
    assert tree(folder) == before


def test_drafts_left_where_there_was_no_folder_yet_are_removed(tmp_path: Path) -> None:
    """The next command that writes there removes them, once the folder exists."""
    write_over({tmp_path / "out" / "a" / "page.html": ""})
    left = [folder / f"{DRAFTS}left" for folder in (tmp_path, tmp_path / "out", tmp_path / "out" / "a")]
    for draft in left:
        draft.mkdir(mode=0o700)
        os.utime(draft, (0, 0))
    write_over({tmp_path / "out" / "a" / "page.html": None})
    assert not any(draft.exists() for draft in left)


@posix
def test_what_others_may_have_put_there_is_no_draft(tmp_path: Path) -> None:
    """A draft that is a link would lead to a lock being created, and data lost, in another folder of this user."""
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o700)
    (mine / "lock").write_text("precious")
    (tmp_path / f"{DRAFTS}link").symlink_to(mine)
    os.utime(tmp_path / f"{DRAFTS}link", (0, 0), follow_symlinks=False)
    (tmp_path / f"{DRAFTS}open").mkdir()
    (tmp_path / f"{DRAFTS}open").chmod(0o777)
    os.utime(tmp_path / f"{DRAFTS}open", (0, 0))
    write_over({tmp_path / "page.html": ""})
    assert (mine / "lock").read_text() == "precious"
    assert [*(tmp_path / f"{DRAFTS}open").iterdir()] == []


def test_a_name_always_has_a_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is the earlier or the new one whenever the process is killed, also on a disk without hard links."""
    real, seen = Path.replace, []

    def replace(path: Path, target: Path) -> Path:
        seen.append([(folder / name).read_text() for name in ("b.txt", "sub/c.txt")])
        return real(path, target)

    def no_links(*arguments: object, **named: object) -> None:
        raise OSError(errno.EOPNOTSUPP, "no links")

    monkeypatch.setattr(Path, "replace", replace)
    write_over(contents(folder))
    assert seen == [["old", "old"], ["new", "old"]]
    monkeypatch.setattr(os, "link", no_links)
    assert write_over(contents(folder)) == [folder / name for name in NAMES]


def test_drafts_that_a_killed_process_left_are_removed(folder: Path) -> None:
    """Drafts of a process that still runs stay."""
    left, alive = (folder / f"{DRAFTS}{name}" for name in ("left", "alive"))
    for draft in (left, alive):
        draft.mkdir(mode=0o700)
        (draft / "0.txt").write_text("half")
    with FileLock(alive / "lock"):
        for draft in (left, alive):
            os.utime(draft, (0, 0))
        write_over(contents(folder))
    assert (left.exists(), alive.exists()) == (False, True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_files_get_their_names_waits(
    folder: Path, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All files have their names when the signal is handled."""
    seen: list[int] = []
    real = Path.replace

    def replace(path: Path, target: Path) -> Path:
        signal.raise_signal(number)
        return real(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    before = signal.signal(number, lambda number, frame: seen.append(number))
    try:
        write_over(contents(folder))
    finally:
        signal.signal(number, before)
    assert seen == [number]
    assert {(folder / name).read_text() for name in NAMES} == {"new"}


def test_an_interrupt_at_any_line_leaves_all_files_or_none(tmp_path: Path) -> None:
    """Ctrl-C at each line of the code that makes folders and gives drafts their names, one after the other."""
    folder, line = tmp_path / "new" / "out", 0
    while _interrupted_at(line := line + 1, lambda: OutputFolder("check", folder, False).write({"a": "1"})):
        assert {path.name for path in folder.rglob("*")} in (set(), {"a", MARKER}), line
        assert folder.exists() or [*tmp_path.iterdir()] == [], line
        shutil.rmtree(tmp_path / "new", ignore_errors=True)
    assert line > 50


def _interrupted_at(number: int, work: Callable[[], object]) -> bool:
    """Do some work with Ctrl-C at a line of the functions that make something; whether there are as many."""
    left = number
    functions = (made, _check_writable, Drafts.add, Drafts._spare, Drafts.put_in_place, Drafts.__exit__)
    making = {function.__code__ for function in functions}

    def trace(frame: Any, event: str, argument: object) -> Any:
        nonlocal left
        if frame.f_code not in making:
            return None
        left -= event == "line"
        if left == 0 and event == "line":
            signal.raise_signal(signal.SIGINT)
        return trace

    before, handler = sys.gettrace(), signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        sys.settrace(trace)
        with suppress(KeyboardInterrupt):
            work()
    finally:
        sys.settrace(before)
        signal.signal(signal.SIGINT, handler)
    return left <= 0


def test_files_that_are_there_are_replaced(folder: Path) -> None:
    assert write_over(contents(folder, a=None)) == [folder / name for name in NAMES[1:]]
    written = {name: content for name, content in tree(folder).items() if content is not None}
    assert written == dict.fromkeys(NAMES[1:], b"new")


def test_a_folder_in_the_way_is_not_moved(folder: Path) -> None:
    (folder / "a.txt").mkdir()
    before = tree(folder)
    with pytest.raises(IsADirectoryError):
        write_over(contents(folder))
    assert tree(folder) == before


def test_a_command_that_fails_while_writing_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    monkeypatch.setattr(Drafts, "put_in_place", failing(lambda *named: None, 1, OSError("disk full")))
    done = friso_inside(tmp_path, "bode", RIG, "--out", "out")
    assert done.returncode == 1
    assert "disk full" in done.stderr
    assert tree(tmp_path) == {}


@posix
@pytest.mark.parametrize("content", [None, b"files = " + b"[" * 100_000, b"\xff", b"command = 3"])
def test_a_marker_of_others_marks_nothing(tmp_path: Path, content: bytes | None) -> None:
    if content is None:
        os.mkfifo(tmp_path / MARKER)
    else:
        (tmp_path / MARKER).write_bytes(content)
    with pytest.raises(InputError, match="--overwrite"):
        place(tmp_path)


@posix
def test_a_file_that_is_overwritten_keeps_its_permissions_and_its_link(tmp_path: Path) -> None:
    file, link = tmp_path / "elsewhere" / "a.txt", tmp_path / "a.txt"
    file.parent.mkdir()
    file.write_text("old")
    file.chmod(0o600)
    link.symlink_to(file)
    write_file("FILE", link, "new", True)
    assert (file.read_text(), file.stat().st_mode & 0o777, link.is_symlink()) == ("new", 0o600, True)
    assert [*file.parent.iterdir()] == [file]
    file.chmod(0o400)
    with pytest.raises(InputError, match="read-only"):
        write_file("FILE", link, "newer", True)
    assert file.read_text() == "new"


def test_files_are_written_though_nobody_reads_the_answer(tmp_path: Path) -> None:
    """A pager that was left while a command computed took the files with it."""
    read, full = os.pipe()
    os.close(read)
    program = [sys.executable, "-m", "friso", "bode", str(RIG), "--out", str(tmp_path / "answer")]
    done = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    os.close(full)
    assert done.returncode == 1
    assert (tmp_path / "answer" / "bode.html").exists()
