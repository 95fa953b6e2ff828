"""Keep answers for later, because the same machine is often asked about again.

For example, a tab is opened again, a change is undone, a machine is pinned, or the files of an answer are downloaded.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

from friso.app.machine import Machine
from friso.app.work import Work
from friso.interface.answer import Answer

KEPT_ANSWERS = 4
"""Number of latest answers that are kept of each function. An answer with a Bode plot takes 20 MB."""


class KeptAnswers:
    """Answers of friso's functions about machines, with the warnings that came with each.

    Only the latest answers are kept. Several threads may use the object.
    """

    def __init__(self) -> None:
        self._kept: dict[Callable[..., Answer], OrderedDict[tuple[Machine, str], tuple[Answer, list[str]]]] = {}
        self._turn = Lock()

    def answer(
        self,
        function: Callable[..., Answer],
        machine: Machine,
        work: Work,
        options: Mapping[str, Any] | None = None,
        compute: Callable[[], Answer] | None = None,
    ) -> Any:
        """Return a function's answer about a machine, computed now or kept from before.

        `options` are those of the function. `compute` computes the same answer from what is there already. The warnings
        that came with a kept answer are added to the `work` again.
        Raises whatever the function raises.
        """
        place = _place(machine, options)
        with self._turn:
            kept = self._kept.setdefault(function, OrderedDict())
            if there := kept.get(place):
                kept.move_to_end(place)
                work.notes += there[1]
                return there[0]
        before = len(work.notes)
        answer = compute() if compute else function(machine.stage, **(options or {}), progress=work.progress)
        with self._turn:
            kept[place] = answer, work.notes[before:]
            while len(kept) > KEPT_ANSWERS:
                kept.popitem(last=False)
        return answer

    def holds(
        self, function: Callable[..., Answer], machine: Machine, options: Mapping[str, Any] | None = None
    ) -> bool:
        """Tell whether a function's answer about a machine, with these `options`, is kept."""
        with self._turn:
            return _place(machine, options) in self._kept.get(function, ())


def _place(machine: Machine, options: Mapping[str, Any] | None) -> tuple[Machine, str]:
    return machine, json.dumps(options or {}, sort_keys=True)
