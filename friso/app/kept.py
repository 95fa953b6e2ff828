"""Answers that are kept for whoever comes back to a machine: a tab is opened again, a change is undone, a machine is
pinned, the files of what is shown are handed out."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from threading import Lock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from friso.app.machine import Machine
    from friso.app.work import Work
    from friso.interface.answer import Answer

MOST = 4
"""Answers that are kept of each function, those that were asked for last: a Bode plot takes 20 MB."""


class KeptAnswers:
    """The answers of functions of friso about machines, with what was noted about each."""

    def __init__(self) -> None:
        self._kept: dict[Callable[..., Answer], OrderedDict[tuple[Machine, str], tuple[Answer, list[str]]]] = {}
        self._turn = Lock()

    def answer(
        self, function: Callable[..., Answer], machine: Machine, work: Work, options: Mapping[str, Any] | None = None
    ) -> Any:
        """The answer of a function about a machine: the one that is kept, whose notes the work has then, too, or a new
        one. Raises whatever the function raises."""
        place = _place(machine, options)
        with self._turn:
            kept = self._kept.setdefault(function, OrderedDict())
            if there := kept.get(place):
                kept.move_to_end(place)
                work.notes += there[1]
                return there[0]
        before = len(work.notes)
        answer = function(machine.stage, **(options or {}), progress=work.progress)
        with self._turn:
            kept[place] = answer, work.notes[before:]
            while len(kept) > MOST:
                kept.popitem(last=False)
        return answer

    def holds(
        self, function: Callable[..., Answer], machine: Machine, options: Mapping[str, Any] | None = None
    ) -> bool:
        """Whether the answer of a function about a machine is kept."""
        with self._turn:
            return _place(machine, options) in self._kept.get(function, ())


def _place(machine: Machine, options: Mapping[str, Any] | None) -> tuple[Machine, str]:
    return machine, json.dumps(options or {}, sort_keys=True)
