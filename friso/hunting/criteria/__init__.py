"""Define the terms of hunting as criteria on arrays.

`stage_verdict` has the verdict on a stage, and `run_outcome` the outcome of a run. `settling` has the settling time,
and `peak_count` the thesis's peak count of a run.
"""

from friso.hunting.criteria.peak_count import (
    COUNTED_ABOVE,
    COUNTED_AFTER,
    DISTINCT_CRITERION,
    LEAST_PEAK_SEPARATION,
    LEAST_VALLEY_DEPTH,
    PEAK_CRITERION,
    PEAK_RULE,
    counted_peaks,
    distinct_peaks,
    peaks_in_traces,
)
from friso.hunting.criteria.run_outcome import (
    CREEPS,
    FAILED,
    LASTING_RATIO,
    OUTCOME_CRITERION,
    OUTCOMES,
    REST_BAND,
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
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "CREEPS",
    "DISTINCT_CRITERION",
    "FAILED",
    "LASTING_RATIO",
    "LEAST_PEAK_SEPARATION",
    "LEAST_VALLEY_DEPTH",
    "OUTCOMES",
    "OUTCOME_CRITERION",
    "PEAK_CRITERION",
    "PEAK_RULE",
    "RESTS",
    "REST_BAND",
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
