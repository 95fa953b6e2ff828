"""Metrics of a map: one module each, called as the metric, with `METRIC`."""
