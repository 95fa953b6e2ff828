"""A small part of `python -m benchmarks.trust`: the same cases every time, and how a failure is shown."""

import inspect
import random
from dataclasses import replace
from pathlib import Path

import pytest

import friso
from benchmarks.trust import campaign, commands
from benchmarks.trust.arguments import CALLS
from benchmarks.trust.campaign import failure, run_part
from benchmarks.trust.damage import damaged
from benchmarks.trust.readers import READERS
from friso.cli.app import COMMANDS as REGISTERED

CASES = {
    "app": 25,
    "arguments": 25,
    "options": 12,
    "drawn-stages": 40,
    **dict.fromkeys(campaign.BINARY_LOGS, 5),
    "logs": 40,
    "stores": 20,
    "store-faults": 8,
    "store-exchanges": 10,
    "store-versions": 20,
}


@pytest.mark.cases(first=1, slow=11)
@pytest.mark.parametrize(
    "name", [name for name in campaign.NAMES if name not in (*commands.COMMANDS, "computed-stages")]
)
def test_light_cases_pass(name: str) -> None:
    assert run_part(name, 3, range(CASES.get(name, 100))).failures == []


@pytest.mark.parametrize("number", range(2))
@pytest.mark.parametrize("name", ["interrupted", "short-of-disk", "computed-stages"])
@pytest.mark.thorough
def test_heavy_cases_pass(name: str, number: int) -> None:
    assert run_part(name, 3, range(number, number + 1)).failures == []


def test_the_same_case_is_the_same_damage() -> None:
    content = READERS["stages"].contents()[0]
    once, again, other = (damaged(content, random.Random(seed)) for seed in ("a", "a", "b"))
    assert once == again != content
    assert other != once


def test_a_crash_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(rng: random.Random, folder: Path) -> None:
        raise ZeroDivisionError("of case")

    assert failure("crash", crash, 1, 1) == "ZeroDivisionError: of case"
    monkeypatch.setitem(campaign.CASES, "crash", crash)
    assert [number for number, _ in campaign.run_part("crash", 1, range(3)).failures] == [0, 1, 2]


def test_a_case_that_cannot_be_run_here_is_counted_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands.shutil, "which", lambda name: None)
    part = campaign.run_part("small-disk", 1, range(3))
    assert (part.count, part.failures, len(part.left_out)) == (0, [], 3)


@pytest.mark.parametrize("name", ["logs", "stores"])
def test_who_refuses_everything_fails(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def refused(path: Path) -> None:
        raise friso.InputError("", "this", "that")

    if name == "stores":
        monkeypatch.setattr("benchmarks.trust.writing.read_store", refused)
        assert campaign.run_part(name, 3, range(20)).failures
    else:
        monkeypatch.setitem(READERS, name, replace(READERS[name], read=refused))
        with pytest.raises(friso.InputError):
            campaign.reading(name)


def test_every_function_and_command_is_tried() -> None:
    assert {*CALLS} == {name for name in dir(friso) if inspect.isfunction(getattr(friso, name))}


def test_every_command_that_writes_is_struck() -> None:
    functions = {name: REGISTERED[name].function for name in REGISTERED}
    writes = {name for name, function in functions.items() if "overwrite" in inspect.signature(function).parameters}
    assert {line[0] for line in commands.WRITING.values()} == writes
