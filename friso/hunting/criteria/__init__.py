"""Define the terms of hunting as criteria on arrays.

`stage_verdict` has the verdict on a stage, and `run_outcome` the outcome of a run. `settling` has the settling time,
and `peak_count` the thesis's peak count of a run.
"""

from friso.hunting.criteria.peak_count import (
    COUNTED_ABOVE,
    COUNTED_AFTER,
    DISTINCT,
    DISTINCT_CRITERION,
    PEAK_CRITERION,
    PEAK_RULE,
    SEPARATION,
    counted_peaks,
    distinct_peaks,
    peaks_in_traces,
)
from friso.hunting.criteria.run_outcome import (
    BAND,
    CREEPS,
    FAILED,
    LASTING,
    OUTCOME_CRITERION,
    OUTCOMES,
    RESTS,
    SWINGS,
    End,
    end_of_traces,
    last_outside,
    lasts,
    outcomes,
)
from friso.hunting.criteria.settling import settling_in_the_end, settling_of_runs, settling_of_traces
from friso.hunting.criteria.stage_verdict import ATTRACTED, UNDECIDED, VERDICT_CRITERION, VERDICTS, Verdict, verdicts

__all__ = [
    "ATTRACTED",
    "BAND",
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "CREEPS",
    "DISTINCT",
    "DISTINCT_CRITERION",
    "FAILED",
    "LASTING",
    "OUTCOMES",
    "OUTCOME_CRITERION",
    "PEAK_CRITERION",
    "PEAK_RULE",
    "RESTS",
    "SEPARATION",
    "SWINGS",
    "UNDECIDED",
    "VERDICTS",
    "VERDICT_CRITERION",
    "End",
    "Verdict",
    "counted_peaks",
    "distinct_peaks",
    "end_of_traces",
    "last_outside",
    "lasts",
    "outcomes",
    "peaks_in_traces",
    "settling_in_the_end",
    "settling_of_runs",
    "settling_of_traces",
    "verdicts",
]
