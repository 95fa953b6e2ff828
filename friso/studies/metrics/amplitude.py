"""Amplitude of the hunting cycle"""

from friso.studies.metrics.attractor import of_attractor

METRIC = of_attractor("Amplitude of what attracts", "amplitude", unit="m", place=61)
