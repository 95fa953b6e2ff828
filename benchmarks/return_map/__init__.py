"""Compare what the return map and the search show about hunting.

Run by `python -m benchmarks.return_map`.
"""
