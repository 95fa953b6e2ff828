"""Steps of the solver in a run that were rejected"""

from friso.studies.metric import Metric

METRIC = Metric("Rejected solver steps", lambda run: run.measures.rejected, unit="1", usual=True, place=51)
