"""Files of a command: each whole or not there, in a folder that is new or empty."""

import errno
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
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
from friso.interface import output_folder
from friso.interface.output_folder import DRAFTS, UNFINISHED, OutputFolder, check_store_folder, write, write_file
from friso.shown.blocks import Content
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
def test_a_folder_that_is_not_new_is_refused_before_anything_is_computed(command: str, tmp_path: Path) -> None:
    """It has files of others or of an earlier run, or cannot be written to."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("precious")
    OutputFolder(command, tmp_path / "earlier", False).write({"page.html": "its page"})
    before = tree(tmp_path)
    for out, words in (("out", "--overwrite"), ("earlier", "--overwrite"), *UNWRITABLE):
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

    monkeypatch.setattr(output_folder, "name_new_file", full)
    done = friso_inside(tmp_path, *("export", RIG, "--json", "--out", "out"))
    assert (done.returncode, json.loads(done.stdout)["files"]) == (1, [])
    assert f"no file was written: {words}" in " ".join(done.stderr.split())
    assert tree(tmp_path) == {"out": None}


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
    (tmp_path / "a.zarr" / ".friso").mkdir(parents=True)
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


def test_a_place_may_be_new_or_empty(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    new = place(out)
    assert not (tmp_path / "a").exists()  # looking leaves nothing
    assert new.write({"page.html": "1", "logs/a.csv": b"2"}) == [out / "page.html", out / "logs" / "a.csv"]
    new.write({"more.txt": ""})  # as a command may do twice
    before = tree(out)
    with pytest.raises(InputError, match=r"page\.html[\s\S]*--overwrite"):
        place(out)
    assert tree(out) == before
    (out / "mine.txt").write_text("mine")
    place(out, overwrite=True).write({"page.html": "3", "logs/a.csv": None, "more.txt": None})
    left = {name: content for name, content in tree(out).items() if content is not None}
    assert left == {"page.html": b"3", "mine.txt": b"mine"}
    empty = tmp_path / "empty"
    (empty / UNFINISHED).mkdir(parents=True)
    place(empty).write({"page.html": ""})
    OutputFolder("identify", out, False, kept=["page.html", "logs", "mine.txt"]).write({"machine.toml": ""})


def test_unfinished_work_is_kept_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / UNFINISHED).symlink_to(tmp_path)
    with pytest.raises(InputError, match="link"):
        OutputFolder("reproduce", tmp_path / "out", False)


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_while_others_are_drawn_stays(
    tmp_path: Path, links: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that others create meanwhile stays, even if it is a link to nothing."""
    out = tmp_path / "out"

    def appears(draft: Path) -> None:
        draft.write_text("new")
        (out / "b.txt").symlink_to("nothing") if links else (out / "b.txt").write_text("mine")

    if not links:
        monkeypatch.setattr(os, "link", failing(os.link, 2, OSError(errno.EOPNOTSUPP, "no links")))
    with pytest.raises(FileExistsError, match=r"b\.txt"):
        place(out).write({"a.txt": "new", "b.txt": appears})
    assert ((out / "a.txt").read_text(), (out / "b.txt").is_symlink()) == ("new", links)
    assert links or (out / "b.txt").read_text() == "mine"


@pytest.mark.parametrize("overwrite", [False, True])
def test_what_is_read_is_never_replaced(tmp_path: Path, overwrite: bool) -> None:
    place(tmp_path / "out").write({"stage.toml": "read"})
    stage = tmp_path / "out" / "stage.toml"
    with refused("--out"):
        place(tmp_path / "out", overwrite, (stage,)).write({"stage.toml": ""})
    (tmp_path / "other.toml").write_text("read too")
    other = OutputFolder("check", tmp_path, True, (tmp_path / "other.toml",))
    with pytest.raises(InputError):
        other.write({"other.toml": ""})
    assert (stage.read_text(), (tmp_path / "other.toml").read_text()) == ("read", "read too")


# each whole or not there


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
    return write(files, overwrite=True)


def contents(folder: Path, **others: Content) -> dict[Path, Content]:
    return {folder / name: others.get(Path(name).stem, "new") for name in NAMES}


@pytest.mark.parametrize("number", range(len(NAMES)))
@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_an_error_while_a_file_is_written_leaves_it_as_it_was(folder: Path, number: int, error: Any) -> None:
    def half(path: Path) -> None:
        path.write_text("half")
        raise error

    before = tree(folder)
    with pytest.raises(type(error)):
        write_over(contents(folder, **{Path(NAMES[number]).stem: half}))
    new = dict.fromkeys(NAMES[:number], b"new")
    assert {name: text for name, text in tree(folder).items() if text is not None} == {
        name: text for name, text in (before | new).items() if text is not None
    }


def failing(real: Callable[..., Any], after: int, error: BaseException) -> Callable[..., Any]:
    calls = [0]

    def call(*arguments: Any, **named: Any) -> Any:
        calls[0] += 1
        if calls[0] == after:
            raise error
        return real(*arguments, **named)

    return call


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
    assert [both for k, both in enumerate(seen) if both not in seen[:k]] == [
        ["old", "old"],
        ["new", "old"],
        ["new", "new"],
    ]
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


def test_files_that_are_there_are_replaced(folder: Path) -> None:
    assert write_over(contents(folder, a=None)) == [folder / name for name in NAMES[1:]]
    written = {name: content for name, content in tree(folder).items() if content is not None}
    assert written == dict.fromkeys(NAMES[1:], b"new")


def test_a_folder_in_the_way_is_not_moved(folder: Path) -> None:
    (folder / "a.txt").mkdir()
    before = tree(folder)
    with pytest.raises(OSError, match=r"a\.txt"):
        write_over(contents(folder))
    assert tree(folder) == before


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


@pytest.mark.thorough
def test_files_are_written_though_nobody_reads_the_answer(tmp_path: Path) -> None:
    """A pager that was left while a command computed took the files with it."""
    read, full = os.pipe()
    os.close(read)
    program = [sys.executable, "-m", "friso", "bode", str(RIG), "--out", str(tmp_path / "answer")]
    done = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    os.close(full)
    assert done.returncode == 1
    assert (tmp_path / "answer" / "bode.html").exists()
