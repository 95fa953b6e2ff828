"""Derive the design guideline: groups that govern hunting, and laws of its edge.

The groups are dimensionless. The edge is swept over the groups. Laws are fitted to it, and their errors are taken from
samples that were not used for the fit.
"""
