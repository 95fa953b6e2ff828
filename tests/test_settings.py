"""Settings: every tuning number is a field with its unit and reason, other values can be given for a block of code."""

import ast
import copy
import pickle
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

import friso
import friso_thesis
from friso.settings import Settings, setting, settings_classes

LITERALS = {
    "friso/app": 19,
    "friso/cli": 8,
    "friso/design_method": 5,
    "friso/drives": 10,
    "friso/engine": 22,
    "friso/equations": 26,
    "friso/frequency": 16,
    "friso/hunting": 12,
    "friso/identification": 31,
    "friso/interface": 4,
    "friso/leaf_springs": 13,
    "friso/platform": 11,
    "friso/questions": 86,
    "friso/remedies": 8,
    "friso/shown": 37,
    "friso/stage": 15,
    "friso/studies": 92,
    "friso/virtual_rig": 1,
    "friso": 11,
    "friso_thesis/questions": 19,
    "friso_thesis/studies": 191,
}
"""Number of constants that each folder's modules may still define outside its settings.

A folder with settings keeps here only constants of physics, mathematics and formats; no entry may grow.
"""

SHORTEST_REASON = 20
"""Characters of a reason that says anything."""


@dataclass(frozen=True)
class RunSettings(Settings):
    """Settings of a room that is made up."""

    longest_run: float = setting(2.0, "s")
    """Longer runs show nothing new; shorter ones miss the third swing."""


def test_other_values_hold_for_the_block_alone() -> None:
    assert RunSettings.current().longest_run == 2.0
    with RunSettings(longest_run=1.0).in_use(), RunSettings(longest_run=3.0).in_use():
        assert RunSettings.current().longest_run == 3.0
    assert RunSettings.current().longest_run == 2.0


def test_an_object_of_settings_reads_the_values_in_use_and_can_be_copied() -> None:
    live = RunSettings.live()
    for one in (live, copy.deepcopy(live), pickle.loads(pickle.dumps(live))):
        assert one.longest_run == 2.0
        with RunSettings(longest_run=1.0).in_use():
            assert one.longest_run == 1.0


@pytest.mark.cases(first=25)
@pytest.mark.parametrize("settings", settings_classes(), ids=lambda settings: settings.__name__)
def test_every_setting_has_a_reason(settings: type[Settings]) -> None:
    rows = settings.rows()
    assert rows
    assert [row.name for row in rows if len(row.reason) < SHORTEST_REASON] == []
    assert [row.name for row in rows if "_" not in row.name] == []


@pytest.mark.slow
def test_tuning_numbers_are_settings() -> None:
    """A room names no more numbers of its own than it did, and fewer lower the list."""
    counts = Counter(dict.fromkeys(LITERALS, 0))
    for package in (friso, friso_thesis):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            if path.name != "settings.py":
                parts = path.relative_to(root.parent).parts
                counts["/".join(parts[:2]) if len(parts) > 2 else parts[0]] += len(
                    named_numbers(path.read_text("utf-8"))
                )
    assert {room: count for room, count in counts.items() if count} == LITERALS


@pytest.mark.slow
def test_names_of_numbers_say_what_they_are() -> None:
    """One word, such as MOST or NEAR, stands for another number in every module."""
    short = [
        f"{path}: {name}"
        for package in (friso, friso_thesis)
        for path in Path(str(package.__file__)).parent.rglob("*.py")
        if path.name != "settings.py"
        for name in named_numbers(path.read_text("utf-8"))
        if name.isupper() and not re.search(r"[A-Z]_|\d", name)
    ]
    assert short == []


def named_numbers(source: str) -> list[str]:
    """Return the names in a module that stand for numbers, or for tuples, lists and arrays of numbers alone."""
    pairs: list[tuple[ast.expr, ast.expr]] = []
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            target, value = targets[0], node.value
            several = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            pairs += zip(target.elts, value.elts, strict=True) if several else [(target, value)]
    return [ast.unparse(target) for target, value in pairs if is_number(value)]


def is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.UnaryOp):
        return is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return is_number(value.left) and is_number(value.right)
    if isinstance(value, ast.Call) and ast.unparse(value.func).startswith("np."):
        return bool(value.args) and all(map(is_number, value.args))
    if isinstance(value, ast.Tuple | ast.List):
        return bool(value.elts) and all(map(is_number, value.elts))
    return (
        isinstance(value, ast.Constant) and isinstance(value.value, int | float) and not isinstance(value.value, bool)
    )
