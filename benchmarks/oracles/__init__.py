"""Compare friso's answers with facts about hunting from other sources: `python -m benchmarks.oracles`."""
