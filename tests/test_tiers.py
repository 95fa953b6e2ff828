"""The choice of the tests that a plain pytest runs, and the faults that tell what tests catch."""

import ast
from pathlib import Path

import numpy as np

from benchmarks.faults import faults
from benchmarks.tiers import TIERS, Candidate, choose

TESTS = Path(__file__).parent

SOURCE = '''
def settles(error: float, limit: float = 2.5, "words": str = "é") -> bool:
    """Tell whether 1 < 2."""
    return not (error > limit + 1 or f"{error + 1}" == "é" and error is None)
'''.replace('"words": str', "words: str")


def test_each_fault_changes_one_part_and_can_be_read() -> None:
    some = faults("settles.py", SOURCE, {2, 4})
    assert {fault.after for fault in some} >= {
        "(error <= limit + 1)",
        "(limit - 1)",
        "(3.75)",
        "(error is not None)",
        "(2)",
    }
    for fault in some:
        assert ast.dump(ast.parse(fault.seeded(SOURCE))) != ast.dump(ast.parse(SOURCE))
    assert not any("error - 1" in fault.after for fault in some)  # not within formatted text
    assert faults("settles.py", SOURCE, {3}) == []


def test_the_first_tier_executes_most_for_its_time() -> None:
    """New lines count more than lines that other tests execute, and shared fixtures are paid once."""
    shared = ("test_a.py", "runs")
    tests = {
        "cheap": Candidate(1.0, [], np.arange(1000)),
        "copy": Candidate(1.0, [], np.arange(500)),
        "shared": Candidate(1.0, [shared], np.arange(2000, 10_000)),
        "again": Candidate(1.0, [shared], np.arange(2000, 6000)),
        "dear": Candidate(50.0, [], np.arange(10_000, 12_000)),
    }
    assert list(choose(tests, {shared: 5.0}, 12_000, 9.0)) == ["shared", "again", "cheap", "copy"]
    assert list(choose(tests, {shared: 5.0}, 12_000, 8.0)) == ["shared", "again", "cheap"]


def test_tests_with_marks_exist() -> None:
    """Names of removed tests leave the list, so that a new test of that name is run."""
    named = {line.split(" ", 2)[2].partition("[")[0] for line in TIERS.read_text("utf-8").splitlines()}
    functions = {
        f"tests/{path.relative_to(TESTS).as_posix()}::{node.name}"
        for path in TESTS.rglob("test_*.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }
    assert named - functions == set()
