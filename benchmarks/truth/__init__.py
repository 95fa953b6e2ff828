"""An adversary of friso's verdicts: `python -m benchmarks.truth` draws stages, checks them, tries to refute them."""
