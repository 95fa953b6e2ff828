"""Compare what the return map and the search show about hunting: `python -m benchmarks.return_map`."""
