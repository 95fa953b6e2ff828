"""Offer what other packages may import from friso.hunting (docs/hunting.md).

They may also import from `friso.hunting.criteria` and `friso.hunting.measures`. Everything else in this folder may
change.
"""

from friso.hunting.advice import BandwidthAdvice, advised
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
from friso.hunting.cases import LONG_RUN_RTOL, Case, Solver, check, check_given, needed_kernels
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, find_cycles
from friso.hunting.cycle.hunting import DITHERS, Cycle, Hunting, Swing, cannot_hunt, hunting
from friso.hunting.cycle.multipliers import Multipliers, multipliers
from friso.hunting.cycle.rest import stuck, wait
from friso.hunting.cycle.return_map import ReturnMap
from friso.hunting.cycle.shooting import Orbits
from friso.hunting.doubt import HuntingDoubt
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
from friso.hunting.motions import Motions, rests_off
from friso.hunting.path import AttractionEnd, BandwidthWindow, LossKind
from friso.hunting.return_map.settings import ReturnMapSettings
from friso.hunting.search_limits import MORE_WORK, SEARCH_LIMITS
from friso.hunting.sliding import StickSlipSpeeds, is_moved_evenly, lasting_swings
from friso.hunting.stage_margins import ParameterMargin, joint_margins
from friso.hunting.tracking import Dwell, Tracking, dwells, dwells_of_trace, tracking
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
    "loops_unstable",
    "moves_that_hunt",
    "multipliers",
    "needed_kernels",
    "plane",
    "pushes_that_hunt",
    "rests_off",
    "sketch_attractors",
    "stuck",
    "tracking",
    "unstable",
    "wait",
]
