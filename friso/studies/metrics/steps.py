"""Steps of the solver in a run"""

from friso.studies.metric import Metric

METRIC = Metric("Solver steps", lambda run: run.measures.steps, unit="1", usual=True, place=50)
