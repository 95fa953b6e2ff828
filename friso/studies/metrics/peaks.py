"""Peaks of a run: maxima of the position that stand out late in it"""

from friso.hunting.criteria import PEAK_CRITERION
from friso.studies.metric import MapFinding, Metric

METRIC = Metric(
    "Counted peaks",
    lambda run: run.measures.peaks,
    unit="1",
    usual=True,
    place=10,
    criterion=PEAK_CRITERION,
    counts=True,
    findings=(MapFinding("Peaks are counted"),),
)
