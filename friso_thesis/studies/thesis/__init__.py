"""Reproduce the thesis: its studies and its claims."""
