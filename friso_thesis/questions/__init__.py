"""The commands `guideline` and `reproduce` as functions, one folder each.

Each returns an `Answer`, as all functions of friso with a command do.
"""
