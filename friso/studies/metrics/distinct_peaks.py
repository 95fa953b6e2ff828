"""Peaks counted as in the thesis, but without ripple of less than 1 µm"""

from friso.hunting.criteria import DISTINCT_CRITERION
from friso.studies.metric import MapFinding, Metric

METRIC = Metric(
    "Counted peaks, distinct ones",
    lambda run: run.measures.distinct_peaks,
    unit="1",
    usual=True,
    place=11,
    criterion=DISTINCT_CRITERION,
    counts=True,
    findings=(MapFinding("Peaks are counted"),),
)
