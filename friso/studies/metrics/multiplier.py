"""Multiplier of the hunting cycle"""

from friso.studies.metrics.attractor import of_attractor

METRIC = of_attractor("Multiplier of the cycle that attracts", "multiplier", unit="1", place=60, limits=(-1.0, 1.0))
