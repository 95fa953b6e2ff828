"""Plain loops: what they compute, compiled, is what plain Python does."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from friso.engine.machine_code import Loops, argument_kind, load_object, object_code
from friso.engine.scalar_code import scalar_llvm, take_next

HALF, WAYS = 0.5, (1, -1)


class Inner(NamedTuple):
    least: float
    table: np.ndarray


class Given(NamedTuple):
    count: int
    inner: Inner
    square: np.ndarray
    share: float


def drawn_arguments(seed: int) -> tuple[Given, np.ndarray, np.ndarray, np.ndarray]:
    """Numbers, arrays of all types, and room for results."""
    rng = np.random.default_rng(seed)
    inner = Inner(float(rng.normal()), rng.integers(-9, 9, (2, 3, 4)))
    numbers = Given(int(rng.integers(3, 7)), inner, rng.normal(size=(7, 4)), float(rng.uniform()))
    return numbers, rng.normal(size=40), rng.integers(-50, 50, 40), rng.random(40) < 0.5


def compiled(function: Callable[..., None], *arguments: Any) -> Loops:
    kinds = [argument_kind(argument) for argument in arguments]
    return Loops(load_object(object_code(scalar_llvm(function, kinds)), ["run"])["run"], kinds)


def arithmetic(g, x, whole, marks):
    for i in range(g.count):
        x[i] = g.share * i - g.square[i, 1] / (1 + i) + 7 / 2 - HALF
        whole[i] = 3 * i - (i & 5) + (whole[i] >> 2) | 1
        marks[i] = x[i] > g.inner.least
    x[9] = -x[8] + abs(x[7]) + float(whole[3]) + int(x[2] * 10.0)
    whole[9] = -whole[8] + marks[3] + 2


def choices(g, x, whole, marks):
    for i in range(whole.size):
        if whole[i] < -10 or (i > 0 and x[i - 1] > 0.0 and not marks[i]):
            x[i] = 1
        elif whole[i] == 7:
            x[i] = -np.inf
        else:
            x[i] = 0.25 if whole[i] > 20 else i
        marks[i] = (x[i] > 0.0) == marks[i]
        whole[i] = max(min(whole[i], 9), -9) if x[i] != 1.0 else min(max(i, 3), whole[i])


def loops(g, x, whole, marks):
    k, total = 0, 0.0
    while True:
        k += 1
        if marks[k]:
            continue
        total += x[k]
        if k > 30:
            break
    for m in range(g.count - 1, -1, -1):
        total = 0.5 * total + g.square[m, 2]
    for m in range(1, 12, 3):
        whole[m] = k
        m += 100
    x[0], x[1] = total, k


def of_parts(g, x, whole, marks):
    """Rows and named tuples under other names, and passed on."""
    inner, row = g.inner, g.square[2]
    for i in range(inner.table.shape[0]):
        for j in range(inner.table.shape[1]):
            whole[3 * i + j] = last_of(inner.table[i], j) + inner.table.shape[2]
    row[1], row[2] = row[2], row[1]
    x[0] = least_of(g.square[3], inner)


def last_of(table, j):
    return table[j, table.shape[1] - 1]


def least_of(row, inner):
    least = inner.least
    for i in range(row.size):
        if row[i] < least:
            least = row[i]
    return least


def with_returns(g, x, whole, marks):
    for i in range(20):
        x[i] = first_beyond(x, g.share * i)
        marks[i] = positive(x[i])
        set_if(whole, i, x[i] > 2.0)


def first_beyond(x, level):
    for way in WAYS:
        for k in range(20, 40):
            if way * x[k] > level:
                return x[k] if way == 1 else -level
    return np.nan


def positive(x):
    return x > 0.0


def set_if(whole, i, condition):
    if not condition:
        return
    whole[i] = 1000


def of_a_queue(g, x, whole, marks):
    whole[0] = 5
    for i in range(1, 5):
        whole[i] = take_next(whole)


CODE = [arithmetic, choices, loops, of_parts, with_returns, of_a_queue]


@pytest.mark.parametrize("function", CODE)
def test_compiled_loops_do_what_plain_python_does(function: Callable[..., None]) -> None:
    run = compiled(function, *drawn_arguments(0))
    for seed in range(20):
        plain, fast = drawn_arguments(seed), drawn_arguments(seed)
        function(*plain)
        run(*fast)
        for one, other in zip((plain[0].square, *plain[1:]), (fast[0].square, *fast[1:]), strict=True):
            assert other == pytest.approx(one, rel=1e-14, abs=1e-14, nan_ok=True)


def changing_kind(g, x, whole, marks):
    k = 0
    k = x[0]
    x[1] = k


def sliced(g, x, whole, marks):
    x[:3] = 0.0


def called(g, x, whole, marks):
    x[0] = np.sin(x[0])


def of_floats(g, x, whole, marks):
    whole[0] = x[0]


def unknown_field(g, x, whole, marks):
    x[0] = g.most


def with_otherwise(g, x, whole, marks):
    while x[0] > 0.0:
        x[0] -= 1.0
    else:
        x[1] = 0.0


REFUSED = [changing_kind, sliced, called, of_floats, unknown_field, with_otherwise]


@pytest.mark.parametrize("function", REFUSED)
def test_what_the_language_does_not_have_is_refused(function: Callable[..., None]) -> None:
    with pytest.raises(TypeError, match="not in the language of plain loops"):
        compiled(function, *drawn_arguments(0))


def test_other_arguments_than_those_compiled_for_are_refused() -> None:
    numbers, x, whole, marks = drawn_arguments(0)
    run = compiled(arithmetic, numbers, x, whole, marks)
    for others in (
        (numbers, x.astype(np.float32), whole, marks),
        (numbers, x[::2], whole, marks),
        (numbers, x[None], whole, marks),
        (numbers._replace(share=1), x, whole, marks),
        (numbers._replace(count=1.0), x, whole, marks),
        (numbers._replace(inner=(1.0,)), x, whole, marks),
        (numbers, x, whole),
    ):
        with pytest.raises((TypeError, ValueError)):
            run(*others)
    with pytest.raises(TypeError, match="not given"):
        argument_kind("a word")
