"""Choose the tests that a plain `pytest` runs: `python -m benchmarks.tiers FOLDER --measure`.

`--measure` runs every test but the thorough ones and keeps what it needs in FOLDER: how long each test takes, in units
of a calibrating loop, and which lines of friso it executes (by the package coverage). The choice is greedy: the next
test is the one that executes most lines for its time, where a line counts half as much each time that a chosen test
executes it already. A test function counts as some lines of its own, and each of its cases as one, as they assert
something that no line shows. Two budgets [units] end the first tier and the one that every landing runs. The others
get their marks, `slow` and `thorough`, by tests/tiers.txt. A test that is in no list is run, so new ones need none.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.faults import PACKAGES, ROOT

TIERS = ROOT / "tests" / "tiers.txt"
FOLDER_VARIABLE = "FRISO_TIMES_DIR"
FUNCTION_LINES = 20.0
"""Lines that a test function counts as."""


def unit() -> float:
    """Return the CPU time of a calibrating loop, the sum of ten million numbers, the least of five [s].

    Coverage does not slow it down, as it does what Python interprets.
    """

    def once() -> float:
        begin = time.process_time()
        sum(range(10_000_000))
        return time.process_time() - begin

    return min(once() for _ in range(5))


# What follows is a plugin of the measuring run: `pytest -p benchmarks.tiers`.


def _cpu() -> float:
    """Return the CPU time of this process and of its ended children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _write(**row: Any) -> None:
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    with (Path(os.environ[FOLDER_VARIABLE]) / f"{worker}.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps(row) + "\n")


def pytest_sessionstart() -> None:
    if FOLDER_VARIABLE in os.environ:
        _write(unit=unit())


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None]:
    begin, cpu = time.monotonic(), _cpu()
    yield
    fixtures = list(getattr(item, "fixturenames", ()))
    _write(test=item.nodeid, cpu=_cpu() - cpu, wall=time.monotonic() - begin, fixtures=fixtures)


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest) -> Generator[None]:
    cpu = _cpu()
    yield
    if fixturedef.scope != "function" and not hasattr(request, "param"):
        first = str(getattr(request, "_pyfuncitem").nodeid)  # noqa: B009 (the request is the fixture's own, not a test's)
        _write(fixture=fixturedef.argname, scope=fixturedef.scope, first=first, cpu=_cpu() - cpu)


# The choice.


@dataclass
class Candidate:
    """A test: its own cost [units], the shared fixtures it needs, and the lines it executes, by number."""

    cost: float
    shared: list[tuple[str, str]]
    lines: np.ndarray = field(default_factory=lambda: np.array([], int))


def measured(folder: Path) -> tuple[dict[str, Candidate], dict[tuple[str, str], float], dict[tuple[str, str], str]]:
    """Return the tests of a measuring run, the costs of shared fixtures [units], and the tests that set them up.

    A test costs its CPU time, but at least half of the time for which it occupies a worker. A fixture is named by
    its file and name; one of the whole session costs nothing, as some test needs it anyway.
    """
    tests: dict[str, dict[str, Any]] = {}
    costs: dict[tuple[str, str], float] = {}
    first: dict[tuple[str, str], str] = {}
    for path in folder.glob("*.jsonl"):
        rows = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
        scale = 1 / next(row["unit"] for row in rows if "unit" in row)
        for row in rows:
            if "test" in row:
                tests[row["test"]] = {**row, "cpu": scale * max(row["cpu"], row["wall"] / 2)}
        for row in rows:
            if "fixture" in row and row["first"] in tests:
                tests[row["first"]]["cpu"] -= scale * row["cpu"]
                if row["scope"] != "session":
                    name = (row["first"].partition("::")[0], row["fixture"])
                    costs[name], first[name] = scale * row["cpu"], row["first"]
    result = {}
    for name, row in tests.items():
        shared = [key for fixture in row["fixtures"] if (key := (name.partition("::")[0], fixture)) in costs]
        result[name] = Candidate(max(row["cpu"], 0.01), shared)
    return result, costs, first


def add_lines(tests: dict[str, Candidate], first: dict[tuple[str, str], str], coverage: Path) -> int:
    """Give all tests the lines they execute, with those of their shared fixtures; return the number of lines."""
    data = import_module("coverage").CoverageData(str(coverage))
    data.read()
    by_phase: dict[tuple[str, str], list[int]] = defaultdict(list)
    number = 0
    for file in data.measured_files():
        if not set(PACKAGES) & set(Path(file).parts):
            continue
        for contexts in data.contexts_by_lineno(file).values():
            number += 1
            for context in contexts:
                test, _, phase = context.partition("|")
                by_phase[test, phase].append(number - 1)
    for name, test in tests.items():
        lines = set(by_phase[name, "run"])
        for setter in [name, *(first[key] for key in test.shared)]:
            lines.update(by_phase[setter, "setup"])
        test.lines = np.array(sorted(lines), int)
    return number


def _function(name: str) -> str:
    """Return the name of a test without its parameters."""
    return name.partition("[")[0]


def choose(
    tests: dict[str, Candidate], costs: dict[tuple[str, str], float], lines: int, budget: float
) -> Iterator[str]:
    """Yield the tests to run, by what they add for their cost, within the budget [units]."""
    weight, paid, chosen, spent = np.ones(lines), set[tuple[str, str]](), set[str](), 0.0
    function_weight = dict.fromkeys((_function(name) for name in tests), FUNCTION_LINES)

    def cost(test: Candidate) -> float:
        return test.cost + sum(costs[key] for key in test.shared if key not in paid)

    def value(name: str) -> float:
        return float(1 + function_weight[_function(name)] + weight[tests[name].lines].sum()) / cost(tests[name])

    waiting = [(-np.inf, name) for name in tests]
    while waiting:
        _, name = heapq.heappop(waiting)
        if name in chosen or spent + cost(tests[name]) > budget:
            continue
        if waiting and -value(name) > waiting[0][0]:
            heapq.heappush(waiting, (-value(name), name))
            continue
        spent += cost(tests[name])
        weight[tests[name].lines] *= 0.5
        function_weight[_function(name)] *= 0.5
        chosen.add(name)
        yield name
        if new := {key for key in tests[name].shared if key not in paid}:
            paid |= new
            for other, test in tests.items():  # which cost less from now on
                if other not in chosen and new & set(test.shared):
                    heapq.heappush(waiting, (-value(other), other))


def main() -> None:
    """Measure the tests if asked to, choose the tiers, and write the marks of the others."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--first", type=float, default=1500.0, help="units of the first tier")
    parser.add_argument("--landing", type=float, default=9000.0, help="units of the tests of every landing")
    arguments = parser.parse_args()
    folder: Path = arguments.folder.absolute()
    if arguments.measure:
        folder.mkdir(parents=True)
        (folder / "coveragerc").write_text(f"[run]\nparallel = true\ndata_file = {folder / 'coverage'}\n", "utf-8")
        covered = [f"--cov={package}" for package in PACKAGES]
        options = ["--cov-context=test", "--cov-report=", f"--cov-config={folder / 'coveragerc'}"]
        plugin = ["-p", "benchmarks.tiers", "-m", "not thorough", "--max-worker-restart=0"]
        command = [sys.executable, "-m", "pytest", *plugin, *covered, *options]
        subprocess.run(command, cwd=ROOT, env={**os.environ, FOLDER_VARIABLE: str(folder)}, check=True)
    tests, costs, first = measured(folder)
    number = add_lines(tests, first, folder / "coverage")
    first_tier = set(choose(tests, costs, number, arguments.first))
    landing = first_tier | set(choose(tests, costs, number, arguments.landing))
    marked = {name: "slow" if name in landing else "thorough" for name in sorted(set(tests) - first_tier)}
    TIERS.write_text("".join(f"{mark} {tests[name].cost:.1f} {name}\n" for name, mark in marked.items()), "utf-8")
    for tier, names in {"first": first_tier, "landing": landing, "all": set(tests)}.items():
        executed = np.unique(np.concatenate([tests[name].lines for name in names]))
        shared = {key for name in names for key in tests[name].shared}
        units = sum(tests[name].cost for name in names) + sum(costs[key] for key in shared)
        print(f"{tier}: {len(names)} tests, {units:.0f} units, {len(executed)} lines")


if __name__ == "__main__":
    main()
