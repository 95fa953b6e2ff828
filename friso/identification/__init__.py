"""Identify a stage from measured logs: reading, frequency responses, experiments, fits of the whole model."""
