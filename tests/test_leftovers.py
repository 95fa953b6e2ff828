"""Folders that are locked for as long as they are used, and those that killed processes left."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock
from systems import posix

from friso.platform.leftovers import is_leftover, locked_folder, remove_leftovers

LOCK = "lock"


@posix
@pytest.mark.parametrize("locked", [False, True])
def test_a_folder_that_is_removed_while_it_is_locked_is_made_anew(
    locked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process may remove a folder that looks like a leftover until it is locked.

    filelock then creates it again, readable by others.
    """
    real, folders = FileLock.acquire, []

    def acquire(lock: FileLock, *arguments: Any, **named: Any) -> Any:
        folders.append(Path(lock.lock_file).parent)
        if len(folders) == 1 and not locked:
            folders[0].rmdir()
        held = real(lock, *arguments, **named)
        if len(folders) == 1 and locked:
            (folders[0] / LOCK).unlink()
            folders[0].rmdir()
        return held

    monkeypatch.setattr(FileLock, "acquire", acquire)
    before = os.umask(0o022)
    try:
        with locked_folder(tmp_path, "a-", LOCK) as folder:
            assert [folder] == [*tmp_path.iterdir()] == folders[1:]
            assert folder.stat().st_mode & 0o777 == 0o700
            assert not is_leftover(folder, LOCK)
    finally:
        os.umask(before)
    assert [*tmp_path.iterdir()] == []


def test_a_folder_removed_while_filelock_makes_it_again_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Filelock then raises FileExistsError, because what exists is no folder when it looks."""
    real, folders = FileLock.acquire, []

    def acquire(lock: FileLock, *arguments: Any, **named: Any) -> Any:
        folders.append(Path(lock.lock_file).parent)
        if len(folders) == 1:
            raise FileExistsError(errno.EEXIST, "File exists", str(folders[0]))
        return real(lock, *arguments, **named)

    monkeypatch.setattr(FileLock, "acquire", acquire)
    with locked_folder(tmp_path, "a-", LOCK) as folder:
        assert [folder] == [*tmp_path.iterdir()] == folders[1:]


@posix
def test_what_another_user_left_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A leftover of root stays as well. Nothing, such as a lock, is created in such a folder."""
    left = tmp_path / "a-left"
    left.mkdir(mode=0o700)
    with monkeypatch.context() as patch:
        patch.setattr(os, "geteuid", lambda: left.stat().st_uid + 1)
        assert not is_leftover(left, LOCK)
        remove_leftovers(tmp_path, "a-", LOCK)
        assert ([*tmp_path.iterdir()], [*left.iterdir()]) == ([left], [])
    with locked_folder(tmp_path, "a-", LOCK) as folder:  # a leftover of this user is removed by the next call
        assert [*tmp_path.iterdir()] == [folder]


def test_a_lock_decides_what_is_left_over(tmp_path: Path) -> None:
    """The age of a folder does not matter: a process that has not locked its folder yet creates another one."""
    for name in ("a-young", "a-old", "b-other"):
        (tmp_path / name).mkdir(mode=0o700)
    os.utime(tmp_path / "a-old", (0, 0))
    with locked_folder(tmp_path, "a-", LOCK) as folder:
        remove_leftovers(tmp_path, "a-", LOCK)
        assert {*tmp_path.iterdir()} == {folder, tmp_path / "b-other"}
