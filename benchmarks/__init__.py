"""Benchmarks: each is one command that compares alternatives in one run, and prints ratios."""
