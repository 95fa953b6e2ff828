"""Compare friso's answers with facts about hunting from other sources.

Run by `python -m benchmarks.oracles`.
"""
