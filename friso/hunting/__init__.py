"""What the numbers mean for hunting: the thesis's peak count, amplitude, period, settling, verdict."""

from friso.hunting.check import Case, Solver, check
from friso.hunting.measures import BANDS, COUNTED_ABOVE, COUNTED_AFTER, Measures, measure

__all__ = ["BANDS", "COUNTED_ABOVE", "COUNTED_AFTER", "Case", "Measures", "Solver", "check", "measure"]
