"""Amplitude of the hunting cycle"""

import numpy as np

from friso.studies.metric import Metric
from friso.studies.metrics.attractor import CRITERION

METRIC = Metric(
    "Amplitude of what attracts",
    lambda stage: np.where(stage.attracted.certain, stage.attracted.amplitude, np.nan),
    source="survey",
    unit="m",
    usual=True,
    place=61,
    criterion=CRITERION,
    reasons="attractor",
    answered_by="attractor",
)
