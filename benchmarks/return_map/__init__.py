"""Compares what the return map shows of hunting with what today's search shows: `python -m benchmarks.return_map`."""
