"""Map numbers to colours, with one scale for both renderers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from friso.shown.drawing.figure import Array, Coloured

# viridis (van der Walt & Smith, 2015), every 28th or so of its colours: even in lightness, for any colour vision.
VIRIDIS = (
    "#440154",
    "#482878",
    "#3e4989",
    "#31688e",
    "#26828e",
    "#1f9e89",
    "#35b779",
    "#6ece58",
    "#b5de2b",
    "#fde725",
)

MORE = VIRIDIS[::-1]
"""Colours from little to much. Little is as light as the cells that rest, which lie beside it."""


@dataclass(frozen=True)
class ColourScale:
    """Colours of the drawn numbers from `low` to `high`.

    With `steps`, each colour fills an equal part of the range; otherwise the colours blend into each other. `ticks`
    (drawn numbers) and `texts` are written at the colour bar; without them the renderer chooses.
    """

    low: float
    high: float
    colours: tuple[str, ...]
    steps: bool = False
    ticks: tuple[float, ...] = ()
    texts: tuple[str, ...] = ()

    @property
    def stops(self) -> list[tuple[float, str]]:
        """Return the colours with their places between 0 and 1; a step has two places."""
        count = len(self.colours)
        if self.steps:
            return [((i + end) / count, colour) for i, colour in enumerate(self.colours) for end in (0, 1)]
        return [(i / (count - 1), colour) for i, colour in enumerate(self.colours)]


def painted(field: Coloured) -> Array:
    """Return the numbers of a map or cloud to which the colours belong.

    These are z, or on a logarithmic scale log10(z), with z raised to the lower limit.
    """
    if not field.log:
        return field.z
    low, _ = _limits(field)
    return np.log10(np.maximum(field.z, low))


def scale(field: Coloured) -> ColourScale:
    """Return the colour scale of a map or cloud."""
    if field.colours:
        count = len(field.colours)
        ticks = tuple(range(0, count, -(-count // 12)))
        return ColourScale(-0.5, count - 0.5, field.colours, True, ticks, tuple(map(str, ticks)))
    low, high = _limits(field)
    if not field.log:
        return ColourScale(low, high, field.ramp or MORE)
    low, high = math.log10(low), math.log10(high)
    step = max(1, math.ceil((high - low) / 6))
    decades = range(math.ceil(low + 0.3), math.floor(high + 1e-9) + 1, step)
    # `painted` raises lower numbers to the limit
    texts = (f"≤ {10.0**low:.2g}", *(f"{10.0**decade:g}" for decade in decades))
    return ColourScale(low, high, field.ramp or MORE, False, (low, *decades), texts)


def ramp(count: int) -> tuple[str, ...]:
    """Return `count` colours evenly along viridis, without its darkest and lightest parts."""
    table = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in VIRIDIS])
    places = np.linspace(0.5, len(VIRIDIS) - 1.2, count)
    mixed = [np.interp(places, np.arange(len(VIRIDIS)), table[:, i]).round().astype(int) for i in range(3)]
    return tuple(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in zip(*mixed, strict=True))


def _limits(field: Coloured) -> tuple[float, float]:
    """Return the range of the colours [unit], which is never empty."""
    if field.limits is not None:
        low, high = field.limits
    else:
        finite = field.z[np.isfinite(field.z)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if high > low:
        return low, high
    return (low / 2, high * 2) if field.log else (low - (abs(low) / 2 or 0.5), high + (abs(high) / 2 or 0.5))
