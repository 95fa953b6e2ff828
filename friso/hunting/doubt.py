"""Name the reasons why an answer about hunting is not certain (docs/hunting.md lists their causes)."""

from enum import StrEnum

from friso.hunting.search_limits import MORE_WORK


class HuntingDoubt(StrEnum):
    """Reason why it is not certain what attracts a stage, or how its motion ends: a code, and its sentence."""

    WORK = f"deciding takes {MORE_WORK}"
    RUNS = "runs that had to decide were stopped, or contradict each other or orbits followed from other bandwidths"
    MOTION = "this motion was not seen to end at rest or in a swing that was found to attract"
    BEYOND = "swings smaller or larger than those searched may last"
    GROWTH = "without anti-windup swings may grow or die out beyond the force limit: a size is where a run was stopped"
    LOOP = "its loop is unstable, or its controller pushes ever harder at standstill as an integral does"
    LOAD = "friction grows with the drive's force, and no proof about its loop covers that"
    SWITCHES = "its controller switches the force by windows that remember, which feeds swings without an integral too"
