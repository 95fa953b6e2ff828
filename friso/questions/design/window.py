"""Compute the range of allowed crossovers of a design, and which bounds limit it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.design_method.method import Design
from friso.frequency.bode import COMFORTABLE_MARGIN, Range, searched_crossovers


@dataclass(frozen=True)
class CrossoverBound:
    """A bound of the crossover [Hz] and its reason."""

    value: float
    reason: str


def comfortable(design: Design) -> Range:
    """Return the range of crossovers [Hz] around the chosen one with a modulus margin above 0.5."""
    below = [window for window in design.fitted.comfortable if window[0] <= 1.01 * design.controller.crossover]
    return below[-1]


def stiffest(design: Design) -> float:
    """Return the highest crossover [Hz] that leaf springs on the Pareto front allow.

    Leaf springs allow a fixed fraction of the frequency of their first mode that interferes with control. The highest
    such frequency on the front counts.
    """
    return max(candidate.frequency for candidate in design.candidates) / design.spec.safety.parasitic


def limit_name(design: Design) -> str:
    """Name the limit of the crossover: the machine's own, unless it is only the present crossover."""
    return "your crossover of now" if design.need.limit_is_present else "the machine's limit"


def upper(design: Design) -> list[CrossoverBound]:
    """Return the upper bounds of the crossover, the lowest first."""
    multiple = design.spec.safety.parasitic
    front = f"the highest first interfering frequency of the front over {multiple:g}"
    bounds = [
        CrossoverBound(design.spec.limit, limit_name(design)),
        CrossoverBound(stiffest(design), front),
        CrossoverBound(comfortable(design)[1], f"above it the modulus margin is below {COMFORTABLE_MARGIN:g}"),
    ]
    return sorted((bound for bound in bounds if np.isfinite(bound.value)), key=lambda bound: bound.value)


def lower(design: Design) -> list[CrossoverBound]:
    """Return the lower bounds of the crossover, the highest first."""
    factor, edges = design.spec.safety.hunting, design.edges
    low = comfortable(design)[0]
    bounds = (
        [CrossoverBound(low, f"below it the modulus margin is below {COMFORTABLE_MARGIN:g}")]
        if low > searched_crossovers(design.fitted.stage.flat())[0]
        else []
    )
    if edges.hunts:
        bounds.append(CrossoverBound(factor * edges.highest, f"{factor:g} times the edge of hunting"))
    return sorted(bounds, key=lambda bound: -bound.value)


def view(design: Design) -> Range:
    """Return the range of crossovers [Hz] that the figure of the window shows."""
    crossover = design.controller.crossover
    edges = np.concatenate([design.without.edges, design.edges.edges])
    edges = edges[np.isfinite(edges) & (edges > 0)]
    top = max(crossover, design.spec.limit, *edges.tolist())
    return float(min(crossover / 10, *edges.tolist(), crossover) / 1.3), float(3 * top)
