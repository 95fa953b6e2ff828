"""Compute the thesis's studies and claims, its guideline, and its own experiments of the rig."""
