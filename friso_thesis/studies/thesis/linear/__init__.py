"""Analyse the thesis's rig as a linear system: limit cases, loops and cart speeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from friso.frequency.margins import Margins
from friso.stage import Stage, loads
from friso.stage.controllers import CONTROLLER
from friso_thesis.studies.thesis.linear.loops import (
    SETTINGS,
    Contact,
    CrossoverLoops,
    identified_loop,
    loops_of,
    soft_contact,
)
from friso_thesis.studies.thesis.linear.plants import (
    LimitCase,
    Speeds,
    Springs,
    limit_cases_of,
    loop_over_speed,
    springs_of,
)
from friso_thesis.studies.thesis.studies import LOCKED

PLANT, FREE, LOCKED_LOOP = "limit cases", "loop, joint free", "loop, joint locked"


@dataclass(frozen=True)
class PartNeeded:
    """A part of the linear analysis, or an experiment, that a judge may need.

    `outside` are the tables of the stage file on which it does not depend. `locked` is true if its joint is locked, so
    that the joint's own damping does not matter.
    """

    outside: tuple[str, ...]
    locked: bool = False


NEEDS: Mapping[str, PartNeeded] = MappingProxyType(
    {
        PLANT: PartNeeded(("motion.", f"{CONTROLLER}.")),
        FREE: PartNeeded(("motion.",)),
        LOCKED_LOOP: PartNeeded(("motion.",), locked=True),
    }
)


@dataclass(frozen=True)
class Linear:
    """A rig as a linear system.

    - `plants`: by limit case; "-series" after a name marks the formula that Table 1 prints for a touched limiter.
    - `springs`: stiffness of joint and bristles, and of both in series.
    - `free`, `locked`: loops by state of the joint, tuned to several crossovers.
    - `speeds`: stability of the loop tuned to 8 Hz, over the speed of the cart.
    - `identified`: margins with the masses that the thesis identified, joint free.
    - `contact`: the loop tuned to 48 Hz, joint locked by a softer contact.
    """

    plants: Mapping[str, LimitCase]
    springs: Springs
    free: CrossoverLoops
    locked: CrossoverLoops
    speeds: Speeds
    identified: Margins
    contact: Contact


def analysed(stage: Stage) -> Linear:
    """Return the linear analysis of a rig with its joint free.

    Results are cached, because every reproduction needs the same rigs.
    """
    return _analysed(stage.to_toml())


@lru_cache(maxsize=8)
def _analysed(stage_file: str) -> Linear:
    stage = loads(stage_file)
    return Linear(
        plants=limit_cases_of(stage.flat()),
        springs=springs_of(stage.flat()),
        free=loops_of(stage, (SETTINGS[0],)),
        locked=loops_of(stage.replace(dict(LOCKED)), SETTINGS),
        speeds=loop_over_speed(stage.flat()),
        identified=identified_loop(stage),
        contact=soft_contact(stage),
    )
