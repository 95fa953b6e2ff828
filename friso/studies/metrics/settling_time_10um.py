"""Time until a run stays within 10 µm of its reference"""

from friso.hunting.measures import BANDS
from friso.studies.metric import Metric

METRIC = Metric(
    "Settling time into 10 µm",
    lambda run: run.measures.settling_time[1],
    unit="s",
    usual=True,
    place=31,
    band=BANDS[1],
    missing="does not stay within 10 µm",
)
