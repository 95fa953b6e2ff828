"""Largest force of the actuator in a run"""

from friso.studies.metric import Metric

METRIC = Metric("Largest actuator force", lambda run: run.measures.largest_force, unit="N", usual=True, place=40)
