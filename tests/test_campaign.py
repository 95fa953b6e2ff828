"""A small part of `python -m benchmarks.trust`: the same cases every time, and how a failure is shown."""

import random
from pathlib import Path

import pytest

from benchmarks.trust.campaign import failure, failures, reading
from benchmarks.trust.commands import interrupted, short_of_disk
from benchmarks.trust.damage import damaged
from benchmarks.trust.readers import READERS

CASES = {"binary-logs": 6, "logs": 40}


@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_read_or_refused(name: str) -> None:
    assert [*failures(name, reading(name), 3, range(CASES.get(name, 100)))] == []


@pytest.mark.parametrize("number", range(2))
def test_an_interrupted_command_leaves_files_whole_or_none(number: int) -> None:
    assert failure("interrupted", interrupted, 3, number) is None


@pytest.mark.parametrize("number", range(2))
def test_a_command_without_room_leaves_files_whole_or_none(number: int) -> None:
    assert failure("short-of-disk", short_of_disk, 3, number) is None


def test_the_same_case_is_the_same_damage() -> None:
    content = READERS["stages"].contents()[0]
    once, again, other = (damaged(content, random.Random(seed)) for seed in ("a", "a", "b"))
    assert once == again != content
    assert other != once


def test_a_crash_is_a_failure() -> None:
    def crash(rng: random.Random, folder: Path) -> None:
        raise ZeroDivisionError("of case")

    assert failure("crash", crash, 1, 1) == "ZeroDivisionError: of case"
    assert [number for number, _ in failures("crash", crash, 1, range(3))] == [0, 1, 2]
