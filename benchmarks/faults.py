"""Seed faults into friso, and tell which of them the tests catch: `python -m benchmarks.faults FOLDER`.

`--measure` runs every test but the thorough ones and writes to FOLDER which lines each executes (by the package
pytest-cov) and how long it takes. Of a fault, only the tests that execute its line are run, the quick ones first, until
one fails. A fault is one changed operator, comparison, condition or number in a line that some test executes, drawn
with a seed. Tests run in a copy of this checkout, in one process.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("friso", "friso_thesis")
FOLDER_VARIABLE = "FRISO_TIMES_DIR"
FEW = 20
"""Lines that fewer tests execute may be what a fixture or a cache computes once: the whole files of these tests run."""

SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


@dataclass(frozen=True)
class Fault:
    """A part of a source file, by the start and end [characters], and what replaces it."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str

    def seeded(self, source: str) -> str:
        """Return the source with the fault. Raises ValueError if the source is another one."""
        if source[self.start : self.end] != self.before:
            raise ValueError(f"{self.file}:{self.line} does not read {self.before!r}")
        return source[: self.start] + self.after + source[self.end :]


def faults(file: str, source: str, lines: set[int]) -> list[Fault]:
    """Return all faults of a file in these lines."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int, column: int) -> int:
        text = source[starts[line - 1] : starts[line]]
        return starts[line - 1] + len(text.encode()[:column].decode())

    result = []
    for node, after in _changes(ast.parse(source)):
        if node.lineno in lines and node.end_lineno is not None and node.end_col_offset is not None:
            start, end = place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)
            result.append(Fault(file, node.lineno, start, end, source[start:end], f"({ast.unparse(after)})"))
    return result


def _changes(tree: ast.Module) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield expressions, and a wrong one for each."""
    unread = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr | ast.AnnAssign | ast.arg)
        for child in ([node] if isinstance(node, ast.JoinedStr) else [node.annotation])
        if child is not None
        for part in ast.walk(child)
    }
    for node in ast.walk(tree):
        if id(node) in unread:
            continue
        match node:
            case ast.Compare(left=left, ops=[operator], comparators=right) if type(operator) in SWAPPED:
                yield node, ast.Compare(left, [_swapped(operator)], right)
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in SWAPPED:
                yield node, ast.BinOp(left, _swapped(operator), right)
            case ast.BoolOp(op=operator, values=values):
                yield node, ast.BoolOp(_swapped(operator), values)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                yield node, operand
            case ast.IfExp(test=test, body=body, orelse=other):
                yield node, ast.IfExp(test, other, body)
            case ast.Constant(value=bool()):
                continue
            case ast.Constant(value=int(value)):
                yield node, ast.Constant(value + 1)
            case ast.Constant(value=float(value)):
                yield node, ast.Constant(1.5 * value or 1.0)


def _swapped(operator: Any) -> Any:
    return SWAPPED[type(operator)]()


def _cpu() -> float:
    """Return the CPU time of this process and of its ended children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None]:
    """Write what a test takes, in the run of `measure`, whose plugin this module is."""
    begin = _cpu()
    yield
    worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
    with (Path(os.environ[FOLDER_VARIABLE]) / f"{worker}.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps({"test": item.nodeid, "cpu": _cpu() - begin}) + "\n")


def measure(folder: Path) -> None:
    """Run the tests and write to a new folder how long each takes and which lines it executes."""
    folder.mkdir(parents=True)
    (folder / "coveragerc").write_text(f"[run]\nparallel = true\ndata_file = {folder / 'coverage'}\n", "utf-8")
    covered = [f"--cov={package}" for package in PACKAGES]
    options = ["--cov-context=test", "--cov-report=", f"--cov-config={folder / 'coveragerc'}"]
    plugin = ["-p", "benchmarks.faults", "-m", "not thorough", "--max-worker-restart=0"]
    command = [sys.executable, "-m", "pytest", *plugin, *covered, *options]
    subprocess.run(command, cwd=ROOT, env={**os.environ, FOLDER_VARIABLE: str(folder)}, check=True)


def executing(coverage: Path) -> dict[str, dict[int, set[str]]]:
    """Return the tests that execute each line of each file, files relative to the checkout."""
    data = import_module("coverage").CoverageData(str(coverage))
    data.read()
    result: dict[str, dict[int, set[str]]] = {}
    for file in data.measured_files():
        if Path(file).suffix != ".py":  # a template
            continue
        parts = Path(file).parts
        package = next(k for k, part in enumerate(parts) if part in PACKAGES)
        result["/".join(parts[package:])] = {
            line: {context.partition("|")[0] for context in contexts if context}
            for line, contexts in data.contexts_by_lineno(file).items()
        }
    return result


def seconds_of_tests(folder: Path) -> dict[str, float]:
    """Return how long the tests of a measuring run took that still exist [s]."""
    lines = (line for path in folder.glob("*.jsonl") for line in path.read_text("utf-8").splitlines())
    rows = [row for row in map(json.loads, lines) if "test" in row]
    return {row["test"]: row["cpu"] for row in rows if f"def {_function(row['test'])}(" in _source(row["test"])}


def _function(test: str) -> str:
    return test.partition("[")[0].rpartition("::")[2]


@cache
def _source_of_file(file: str) -> str:
    return (ROOT / file).read_text("utf-8") if (ROOT / file).exists() else ""


def _source(test: str) -> str:
    return _source_of_file(test.partition("::")[0])


def drawn(tests: dict[str, dict[int, set[str]]], count: int, seed: int, root: Path) -> list[Fault]:
    """Return some faults: of a random line of the code, one of its possible ones."""
    by_line: dict[tuple[str, int], list[Fault]] = defaultdict(list)
    for file, lines in sorted(tests.items()):
        executed = {line for line, some in lines.items() if some}
        for fault in faults(file, (root / file).read_text("utf-8"), executed):
            by_line[file, fault.line].append(fault)
    random_numbers = random.Random(seed)
    places = random_numbers.sample(sorted(by_line), count)
    return [random_numbers.choice(by_line[place]) for place in places]


def outcome(fault: Fault, copy: Path, tests: list[str], limit: float) -> tuple[str, float]:
    """Return the first test that fails with a fault, and the seconds until then.

    The test is empty if none of them fails, "timeout" if they do not end within the limit [s]. Raises RuntimeError if a
    test is not there any more.
    """
    source = (copy / fault.file).read_text("utf-8")
    (copy / fault.file).write_text(fault.seeded(source), "utf-8")
    (copy / "chosen.txt").write_text("\n".join(tests), "utf-8")
    begin = time.monotonic()
    options = ["-n", "0", "-x", "-q", "-p", "no:cacheprovider", "--no-header"]
    command = [sys.executable, "-m", "pytest", *options, "-m", "", "@chosen.txt"]
    try:
        done = subprocess.run(
            command,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
            timeout=limit,
        )
        if "not found:" in done.stdout + done.stderr:
            raise RuntimeError(f"tests have changed since they were measured: {done.stdout}")
        failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        caught = failed[0].split()[1] if failed else "" if done.returncode in (0, 5) else f"exit {done.returncode}"
    except subprocess.TimeoutExpired:
        caught = "timeout"
    (copy / fault.file).write_text(source, "utf-8")
    return caught, time.monotonic() - begin


def chosen(fault: Fault, tests: dict[str, dict[int, set[str]]], cost: dict[str, float], budget: float) -> list[str]:
    """Return the tests that execute the line of a fault, the quick ones first, for so many seconds in sum."""
    some = tests.get(fault.file, {}).get(fault.line, set()) & set(cost)
    if len(some) < FEW:
        files = {test.partition("::")[0] for test in some}
        some = {test for test in cost if test.partition("::")[0] in files} | some
    result, total = [], 0.0
    for test in sorted(some, key=lambda test: (cost.get(test, 1.0), test)):
        total += cost.get(test, 1.0)
        if total > budget:
            break
        result.append(test)
    return result


def main() -> None:
    """Measure the tests if asked to, seed the faults one by one, and print which test catches each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--measure", action="store_true", help="fill the folder first")
    parser.add_argument("--checkout", type=Path, default=ROOT)
    parser.add_argument("--faults", type=Path, help="file with the faults; made if there is none")
    parser.add_argument("--only", type=Path, help="file with the names of tests, such as those of the first tier")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=240.0, help="seconds of tests a fault, by their times")
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.folder.absolute())
    tests = executing(arguments.folder / "coverage")
    cost = seconds_of_tests(arguments.folder)
    if arguments.faults and arguments.faults.exists():
        seeded = [Fault(**fault) for fault in json.loads(arguments.faults.read_text())]
    else:
        seeded = drawn(tests, arguments.count, arguments.seed, arguments.checkout)
        if arguments.faults:
            arguments.faults.write_text(json.dumps([vars(fault) for fault in seeded], indent=1))
    allowed = set(arguments.only.read_text().split("\n")) if arguments.only else None
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "main"
        shutil.copytree(arguments.checkout, copy, ignore=shutil.ignore_patterns(".git", "__pycache__"))
        (Path(folder) / "shared").symlink_to((arguments.checkout.parent / "shared").resolve())
        for fault in seeded:
            some = chosen(fault, tests, cost, arguments.budget)
            some = some if allowed is None else [test for test in some if test in allowed]
            caught, seconds = outcome(fault, copy, some, 3 * arguments.budget) if some else ("", 0.0)
            count += bool(caught)
            change = f"{fault.before} -> {fault.after}".replace("\n", " ")
            print(
                f"{fault.file}:{fault.line}\t{change}\t{len(some)}\t{caught or 'not caught'}\t{seconds:.0f}", flush=True
            )
    print(f"{count} of {len(seeded)} caught")


if __name__ == "__main__":
    main()
