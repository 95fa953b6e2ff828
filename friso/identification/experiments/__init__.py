"""Kinds of experiment, one file each: the analysis of its logs, declared as `KIND`."""
