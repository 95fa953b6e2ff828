"""Recompute and judge the thesis behind friso, and its design guideline.

This package plugs into friso.
"""
