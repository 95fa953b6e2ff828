"""Try to refute friso's verdicts on drawn stages.

Run by `python -m benchmarks.truth`.
"""
