"""Say by how much machines drawn at random differ from each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


def spread_sentences(from_file: Sequence[str], spreads: Mapping[str, float]) -> list[str]:
    """Say which keys vary as the stage file says, and the default spreads [%] of others."""
    sentences = [f"Uncertain as in the stage file: {', '.join(from_file)}."] if from_file else []
    if spreads:
        listed = ", ".join(f"{key} ±{spread:g} %" for key, spread in spreads.items())
        sentences.append(f"Default spreads (95 % of the machines), as the stage file gives none: {listed}.")
    return sentences
