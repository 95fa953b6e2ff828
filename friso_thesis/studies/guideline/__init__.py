"""The design guideline: the dimensionless groups that govern hunting, sweeps of its edge over them, and laws fitted to
these, with their error on samples that were not used for the fit."""

from friso_thesis.studies.guideline.compute import SAMPLES, Fit, Guideline, guideline

__all__ = ["SAMPLES", "Fit", "Guideline", "guideline"]
