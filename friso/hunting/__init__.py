"""What the numbers mean for hunting: peak count, hunting cycles, what starts them, margins, verdict."""

from friso.hunting.basin import Kick, MoveShare
from friso.hunting.check import Case, Solver, check
from friso.hunting.criteria import COUNTED_ABOVE, COUNTED_AFTER
from friso.hunting.cycle.hunting import Cycle, Hunting, Swing, hunting
from friso.hunting.margin import Margin
from friso.hunting.measures import BANDS, Measures, measure_runs
from friso.hunting.verdict import Judgement

__all__ = [
    "BANDS",
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "Case",
    "Cycle",
    "Hunting",
    "Judgement",
    "Kick",
    "Margin",
    "Measures",
    "MoveShare",
    "Solver",
    "Swing",
    "check",
    "hunting",
    "measure_runs",
]
