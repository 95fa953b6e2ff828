"""Try to refute friso's verdicts: `python -m benchmarks.truth` draws stages, checks and attacks them."""
