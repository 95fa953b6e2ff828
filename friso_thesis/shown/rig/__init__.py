"""Show outcomes of the thesis's own experiments, one module each."""
