"""The questions that friso answers, one folder each.

A folder holds the question's function, and what its answer says, shows and writes.
"""
