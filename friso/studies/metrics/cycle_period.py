"""Period of the hunting cycle"""

from friso.studies.metrics.attractor import of_attractor

METRIC = of_attractor("Period of what attracts", "period", unit="s", place=62)
