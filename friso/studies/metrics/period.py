"""Period of what a run does at its end; a map shows that of the hunting cycle"""

from friso.studies.metric import Metric

METRIC = Metric(
    "Period",
    lambda run: run.measures.period,
    unit="s",
    usual=True,
    place=21,
    missing="no period",
    shown_as="cycle_period",
)
