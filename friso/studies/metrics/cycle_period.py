"""Period of the hunting cycle"""

import numpy as np

from friso.studies.metric import Metric
from friso.studies.metrics.attractor import CRITERION

METRIC = Metric(
    "Period of what attracts",
    lambda stage: np.where(stage.attracted.certain, stage.attracted.period, np.nan),
    source="survey",
    unit="s",
    usual=True,
    place=62,
    criterion=CRITERION,
    reasons="attractor",
    answered_by="attractor",
)
