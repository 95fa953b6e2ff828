"""Facts about hunting that nobody here made, beside what friso answers: `python -m benchmarks.oracles`."""
