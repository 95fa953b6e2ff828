"""The faults that tell what tests catch."""

import ast

from benchmarks.faults import faults

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
