"""Kinds of experiment, one file each: the analysis of its logs, and what it declares of itself as `KIND`."""
