"""Multiplier of the hunting cycle"""

import numpy as np

from friso.studies.metric import Metric
from friso.studies.metrics.attractor import CRITERION

METRIC = Metric(
    "Multiplier of the cycle that attracts",
    lambda stage: np.where(stage.attracted.certain, stage.attracted.multiplier, np.nan),
    source="survey",
    unit="1",
    usual=True,
    place=60,
    criterion=CRITERION,
    reasons="attractor",
    limits=(-1.0, 1.0),
    answered_by="attractor",
)
