"""How many joint draws a claim gets: no more once its interval has decided, which keeps its level."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
from patched import patched

from friso.progress import Tally
from friso_thesis.studies.thesis.claims import Finding, Part, registered
from friso_thesis.studies.thesis.plausible import (
    DRAW_LOOKS,
    HALF_SHARE,
    RARE_SHARE,
    ClaimInSpace,
    _in_space,
    looks,
    plausible,
    work_of,
)
from friso_thesis.studies.thesis.space import Draw, draw

PLAUSIBLE: Any = import_module("friso_thesis.studies.thesis.plausible")

YES, NO = Finding((Part("a criterion", True, "1"),)), Finding((Part("a criterion", False, "1"),))
OPEN = Finding((Part("a criterion", True, "1", undecided="Beside its threshold."),))


def space_of(held: int, draws: int) -> ClaimInSpace:
    tried = [(draw(number), YES if number < held else NO) for number in range(draws)]
    return _in_space(registered()["S41"], tried, {})


@pytest.mark.parametrize("own", [YES, NO], ids=["holds at friso's choice", "fails there"])
@pytest.mark.parametrize("share", [0.02, 0.1, 0.24, 0.26, 0.45, 0.55, 0.9, 0.98])
def test_stopping_early_keeps_the_level_of_the_interval(own: Finding, share: float) -> None:
    """20 000 series of draws, each stopped by the rule: the interval at its end misses the share in at most 5 %."""
    random, series = np.random.default_rng(7), 20_000
    held, drawn, running = np.zeros(series, int), 0, np.ones(series, bool)
    missed, word = np.zeros(series, bool), np.full(series, "", dtype=object)
    for look in looks(51):
        held[running] += random.binomial(look - drawn, share, series)[running]
        drawn = look
        for count in np.unique(held[running]):
            space, those = space_of(int(count), look), running & (held == count)
            missed[those], word[those] = not space.holds.low <= share <= space.holds.high, space.judged(own)
            running[those] = not space.settled(own)
    assert missed.mean() <= 0.05
    wrong = "holds" if own is YES and share < HALF_SHARE else "differs" if own is NO else "nothing"
    assert (word == wrong).mean() <= 0.05 or share < RARE_SHARE


def test_a_claim_that_has_decided_is_drawn_no_further() -> None:
    """Seven draws that hold, and seventeen that do not; where draws cannot turn the word, none is made."""
    often = {"F15A": lambda number: True, "F12A": lambda number: False, "F11A": lambda number: bool(number % 2)}
    often |= {"F16A": lambda number: True, "F20": lambda number: True, "F26": lambda number: bool(number % 2)}
    own = {"F15A": YES, "F12A": NO, "F11A": YES, "F16A": OPEN, "F20": YES, "F26": YES}
    entries = {name: registered()[name] for name in often}
    asked: list[tuple[int, frozenset[str]]] = []

    def judged(group: Any, one: Draw) -> dict[str, Finding]:
        asked.append((one.number, frozenset(group)))
        return {name: YES if often[name](one.number) else NO for name in group}

    steps: list[tuple[int, int]] = []
    tally = Tally(lambda done, total, label: steps.append((done, total)), work_of(entries, 51))
    with patched({PLAUSIBLE: {"_judged": judged}}):
        space = plausible(entries, own, 51, tally=tally)
    assert {name: one.draws for name, one in space.claims.items()} == {
        "F15A": 7, "F20": 7, "F12A": 17, "F26": 17, "F11A": 51,
    }  # fmt: skip
    assert len(asked) == 51  # all claims of a draw at once, so that what several need is computed once
    words = {name: one.judged(own[name]) for name, one in space.claims.items()}
    assert words == {"F15A": "holds", "F20": "holds", "F12A": "differs", "F26": "depends", "F11A": "depends"}
    assert steps[-1][0] == steps[-1][1] < work_of(entries, 51)


def test_the_looks() -> None:
    assert DRAW_LOOKS == looks(51) == (7, 17, 51)
    assert (looks(0), looks(2), looks(17), looks(20)) == ((), (2,), (7, 17), (7, 17, 20))
    assert space_of(7, 7).settled(YES)
    assert not space_of(6, 7).settled(YES)
    assert not space_of(0, 7).settled(NO)
    assert space_of(0, 17).settled(NO)
    assert space_of(1, 51).judged(NO) == "differs"
