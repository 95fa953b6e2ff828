"""Benchmarks: each is one command, compares side by side in one run, and prints ratios."""
