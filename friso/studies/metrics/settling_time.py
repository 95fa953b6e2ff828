"""Time until a run stays within 1 µm of its reference"""

from friso.hunting.measures import BANDS
from friso.studies.metric import Metric

METRIC = Metric(
    "Settling time into 1 µm",
    lambda run: run.measures.settling_time[0],
    unit="s",
    usual=True,
    place=30,
    band=BANDS[0],
    missing="does not stay within 1 µm",
)
