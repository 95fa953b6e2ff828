"""The verdict on a stage: by the cycles that attract, and by where its own motion ends.

| verdict | a cycle attracts | the stage's own motion |
|---|---|---|
| hunts | yes | ends in it |
| bistable | yes | rests; a kick or another move starts hunting |
| transient | no | has not come to rest at its end |
| settles | no | has come to rest |
| undecided | perhaps | was completed; whether a cycle attracts, or where the motion ends, is not certain |
| failed | | was not completed |
| none | unknown | has a reference that keeps moving: of a single stage there is no verdict then |

Just one of them holds. A run alone gives no verdict (see `friso.hunting.criteria.run_outcome` for what a run did). What
attracts is a cycle that was closed as an orbit, or else, and then it is said ("observed"), a swing that long
simulations do not leave.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Verdict = Literal["hunts", "bistable", "transient", "settles", "undecided", "failed", "none"]

VERDICTS: tuple[Verdict, ...] = ("hunts", "bistable", "transient", "settles", "undecided", "failed")
"""All verdicts, the worst first."""

ATTRACTED: tuple[Verdict, ...] = ("hunts", "bistable")
"""Verdicts on stages with a stable limit cycle."""

UNDECIDED: tuple[Verdict, ...] = ("undecided", "failed")
"""Verdicts that leave open whether a stage has a stable limit cycle."""

VERDICT_CRITERION = "verdict on the stage, by its attracting cycles and where its own motion ends"


def verdicts(
    completed: np.ndarray, decided: np.ndarray, attracts: np.ndarray, ends_in_cycle: np.ndarray, rests: np.ndarray
) -> np.ndarray:
    """Return the verdict on every stage; all arrays have the shape (count,).

    `completed` is true if the run of the stage's own motion was, and `decided` if the following arguments are certain.
    `attracts` is true if the stage has a stable limit cycle. The end of its own motion is described by `ends_in_cycle`
    if it has one, else by `rests`.
    """
    hunting = np.where(ends_in_cycle, "hunts", "bistable")
    free = np.where(rests, "settles", "transient")
    word = np.where(decided, np.where(attracts, hunting, free), "undecided")
    return np.where(completed, word, "failed").astype(object)
