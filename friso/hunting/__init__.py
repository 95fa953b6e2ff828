"""Offer what other packages may import from friso.hunting (docs/hunting.md).

They may also import from `friso.hunting.criteria` and `friso.hunting.measures`. Everything else in this folder may
change.
"""

from friso.hunting.attractors import Target
from friso.hunting.attractors.survey import Swinging
from friso.hunting.basin import Kick, MoveShare, displacements_that_hunt, moves_that_hunt, pushes_that_hunt
from friso.hunting.boundary import (
    END_OF_RANGE,
    Bifurcation,
    Branch,
    Curve,
    Diagram,
    KeyRange,
    LocatedPoint,
    Plane,
    Point,
    Space,
    diagram,
    plane,
)
from friso.hunting.cases import (
    LONG_RUN_RTOL,
    Case,
    Solver,
    check,
    check_given,
    least_breakaway_force,
    needed_kernels,
)
from friso.hunting.cycle.ensemble import Ensemble, stuck, wait
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, Multipliers, find_cycles, multipliers
from friso.hunting.cycle.guess import ReturnMap
from friso.hunting.cycle.hunting import DITHERS, Cycle, Hunting, HuntingDoubt, Swing, cannot_hunt, hunting
from friso.hunting.cycle.shooting import Orbits
from friso.hunting.feeding import Decline, Feeding
from friso.hunting.loop import LoopState, LowerGains, unstable
from friso.hunting.many_stages import (
    StageAttractors,
    can_hunt,
    find_attractors,
    find_swings,
    judge_many,
    judge_runs,
    kernels_to_judge,
    loops_unstable,
    sketch_attractors,
)
from friso.hunting.margin import Margin, find_margin
from friso.hunting.motions import Motions, resting, rests_off
from friso.hunting.path import MORE_WORK, SEARCH_LIMITS, AttractionEnd, BandwidthWindow, LossKind
from friso.hunting.return_map.settings import ReturnMapSettings
from friso.hunting.stage_margins import BandwidthAdvice, ParameterMargin, advised, joint_margins
from friso.hunting.tracking import (
    Dwell,
    StickSlipSpeeds,
    Tracking,
    dwells,
    dwells_of_trace,
    is_moved_evenly,
    lasting_swings,
    tracking,
)
from friso.hunting.verdict import CheckPart, Judgement

__all__ = [
    "CYCLE_RTOL",
    "DITHERS",
    "END_OF_RANGE",
    "LONG_RUN_RTOL",
    "MORE_WORK",
    "SEARCH_LIMITS",
    "AttractionEnd",
    "BandwidthAdvice",
    "BandwidthWindow",
    "Bifurcation",
    "Branch",
    "Case",
    "CheckPart",
    "Curve",
    "Cycle",
    "Cycles",
    "Decline",
    "Diagram",
    "Dwell",
    "Ensemble",
    "Feeding",
    "Hunting",
    "HuntingDoubt",
    "Judgement",
    "KeyRange",
    "Kick",
    "LocatedPoint",
    "LoopState",
    "LossKind",
    "LowerGains",
    "Margin",
    "Motions",
    "MoveShare",
    "Multipliers",
    "Orbits",
    "ParameterMargin",
    "Plane",
    "Point",
    "ReturnMap",
    "ReturnMapSettings",
    "Solver",
    "Space",
    "StageAttractors",
    "StickSlipSpeeds",
    "Swing",
    "Swinging",
    "Target",
    "Tracking",
    "advised",
    "can_hunt",
    "cannot_hunt",
    "check",
    "check_given",
    "diagram",
    "displacements_that_hunt",
    "dwells",
    "dwells_of_trace",
    "find_attractors",
    "find_cycles",
    "find_margin",
    "find_swings",
    "hunting",
    "is_moved_evenly",
    "joint_margins",
    "judge_many",
    "judge_runs",
    "kernels_to_judge",
    "lasting_swings",
    "least_breakaway_force",
    "loops_unstable",
    "moves_that_hunt",
    "multipliers",
    "needed_kernels",
    "plane",
    "pushes_that_hunt",
    "resting",
    "rests_off",
    "sketch_attractors",
    "stuck",
    "tracking",
    "unstable",
    "wait",
]
