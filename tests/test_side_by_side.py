"""Several things computed at once: their order, and what ends them."""

from functools import partial
from threading import Barrier, Event
from time import sleep

import numpy as np
import pytest
from patience import LIMIT, wait_until

from friso.engine import side_by_side as module
from friso.engine.side_by_side import Overtaken, cores_to_use, ended_by, go_on, side_by_side


@pytest.mark.parametrize("cores", [1, 2])
def test_results_come_in_the_order_of_the_tasks(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With two cores the first task waits for the second."""
    monkeypatch.setattr(module, "usable_cores", lambda: cores)
    second = Event()
    if cores == 1:
        second.set()
    assert side_by_side([lambda: second.wait(LIMIT) and "first", lambda: second.set() or "second"]) == [
        "first",
        "second",
    ]


def _until_ended(ended: list[bool]) -> None:
    try:
        while True:
            go_on()
    except Overtaken:
        ended.append(True)
        raise


def _fails() -> None:
    raise ValueError("this one")


def test_what_fails_ends_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 2)
    ended: list[bool] = []
    with pytest.raises(ValueError, match="this one"):
        side_by_side([lambda: _until_ended(ended), _fails])
    assert ended == [True]


def test_all_end_where_nobody_waits_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 2)
    ended: list[bool] = []
    flag = np.ones(1, np.int64)
    with ended_by(flag), pytest.raises(Overtaken):
        side_by_side([lambda: _until_ended(ended)] * 2)
    assert ended == [True, True]


def test_no_more_are_under_way_than_there_are_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 2)
    under_way, most = [], []

    def task(number: int) -> int:
        under_way.append(number)
        most.append(len(under_way))
        sleep(0.01)
        under_way.remove(number)
        return number

    assert side_by_side([partial(task, number) for number in range(5)]) == [0, 1, 2, 3, 4]
    assert max(most) == 2


def test_tasks_within_a_task_share_its_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 8)
    begun = Barrier(4)

    def inner() -> int:
        begun.wait(LIMIT)
        cores = cores_to_use()
        begun.wait(LIMIT)
        return cores

    assert side_by_side([lambda: side_by_side([inner, inner])] * 2) == [[2, 2], [2, 2]]


def test_a_task_takes_the_cores_of_those_that_have_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 4)
    asked, seen = Event(), []

    def first() -> None:
        asked.wait(LIMIT)

    def second() -> None:
        seen.append(cores_to_use())
        asked.set()
        wait_until(lambda: cores_to_use() > 2)
        seen.append(cores_to_use())

    side_by_side([first, second])
    assert [*seen, cores_to_use()] == [2, 4, 4]
