"""Deviation of a run over its last quarter, peak to peak"""

from friso.studies.metric import Metric

METRIC = Metric("Peak to peak, last quarter", lambda run: run.measures.peak_to_peak, unit="m", usual=True, place=20)
