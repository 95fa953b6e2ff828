"""What words and numbers on hunting mean, all on arrays: the verdict on a stage (`stage_verdict`), what a run did
(`run_outcome`), when it has settled (`settling`), and the thesis's peak count of a run (`peak_count`)."""

from friso.hunting.criteria.peak_count import (
    COUNTED_ABOVE,
    COUNTED_AFTER,
    SEPARATION,
    counted_peaks,
    distinct_peaks,
    peaks_in_traces,
)
from friso.hunting.criteria.run_outcome import BAND, OUTCOMES, End, end_of_traces, lasts, outcomes
from friso.hunting.criteria.settling import settling_in_the_end, settling_of_runs, settling_of_traces
from friso.hunting.criteria.stage_verdict import ATTRACTED, VERDICTS, Verdict, verdicts

__all__ = [
    "ATTRACTED",
    "BAND",
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "OUTCOMES",
    "SEPARATION",
    "VERDICTS",
    "End",
    "Verdict",
    "counted_peaks",
    "distinct_peaks",
    "end_of_traces",
    "lasts",
    "outcomes",
    "peaks_in_traces",
    "settling_in_the_end",
    "settling_of_runs",
    "settling_of_traces",
    "verdicts",
]
