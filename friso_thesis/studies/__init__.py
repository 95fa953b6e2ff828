"""Compute the thesis's studies, claims, guideline and own experiments of the rig."""
