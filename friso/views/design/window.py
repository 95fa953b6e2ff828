"""Where the crossover of a design may be: what bounds it from below and above, and which bound decided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.design.method import Design
from friso.frequency.crossover import WANTED
from friso.frequency.ranges import Range


@dataclass(frozen=True)
class Bound:
    """A bound of the crossover [Hz] and its reason."""

    value: float
    reason: str


def comfortable(found: Design) -> Range:
    """The range of crossovers [Hz] with a modulus margin above 0.5 that holds the one chosen."""
    below = [each for each in found.fitted.limits.comfortable if each[0] <= 1.01 * found.controller.crossover]
    return below[-1]


def stiffest(found: Design) -> float:
    """The crossover [Hz] that the front allows: a share of the highest first interfering frequency on it."""
    return max(each.frequency for each in found.candidates) / found.spec.safety.parasitic


def upper(found: Design) -> list[Bound]:
    """What bounds the crossover from above, the lowest first."""
    multiple = found.spec.safety.parasitic
    front = f"the highest first interfering frequency of the front over {multiple:g}"
    bounds = [
        Bound(found.spec.limit, "the machine's limit"),
        Bound(stiffest(found), front),
        Bound(comfortable(found)[1], f"above, the modulus margin is under {WANTED:g}"),
    ]
    return sorted((each for each in bounds if np.isfinite(each.value)), key=lambda each: each.value)


def lower(found: Design) -> list[Bound]:
    """What bounds the crossover from below, the highest first."""
    factor, edges = found.spec.safety.hunting, found.edges
    low = comfortable(found)[0]
    bounds = (
        [Bound(low, f"below, the modulus margin is under {WANTED:g}")] if low > found.fitted.limits.searched[0] else []
    )
    if edges.hunts:
        bounds.append(Bound(factor * edges.highest, f"{factor:g} times the edge of hunting"))
    return sorted(bounds, key=lambda each: -each.value)


def view(found: Design) -> Range:
    """The crossovers [Hz] that a figure of the window shows."""
    crossover = found.controller.crossover
    edges = np.concatenate([found.without.edges, found.edges.edges])
    edges = edges[np.isfinite(edges) & (edges > 0)]
    top = max(crossover, found.spec.limit, *edges.tolist())
    return float(min(crossover / 10, *edges.tolist(), crossover) / 1.3), float(3 * top)
