"""Several things computed at once: their order, and what ends them."""

from threading import Event
from time import monotonic

import numpy as np
import pytest

from friso.engine import side_by_side as module
from friso.engine.overtaken import Overtaken, ended_by, go_on
from friso.engine.side_by_side import cores_to_use, side_by_side


@pytest.mark.parametrize("cores", [1, 2])
def test_results_come_in_the_order_of_the_tasks(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With two cores the first waits for the second."""
    monkeypatch.setattr(module, "usable_cores", lambda: cores)
    second = Event()
    if cores == 1:
        second.set()
    assert side_by_side([lambda: second.wait(10) and "first", lambda: second.set() or "second"]) == ["first", "second"]


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


def test_a_task_takes_the_cores_of_those_that_have_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "usable_cores", lambda: 4)
    asked, seen = Event(), []

    def first() -> None:
        asked.wait(10)

    def second() -> None:
        seen.append(cores_to_use())
        asked.set()
        end = monotonic() + 10
        while cores_to_use() == 2 and monotonic() < end:
            go_on()
        seen.append(cores_to_use())

    side_by_side([first, second])
    assert [*seen, cores_to_use()] == [2, 4, 4]
