"""Lay out the phases of complex responses for drawing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.shown.drawing.figure import Array

FIRST_TURN_FROM = -315.0
"""Lower end [deg] of the turn in which the first phase is plotted.

The end lies between the phases of whole numbers of integrations.
"""


def phases(responses: Sequence[np.ndarray]) -> list[Array]:
    """Return phases [deg] of complex responses (k,) without jumps of 360 degrees.

    The first phase begins between -315 and 45 degrees. The others are shifted by whole turns until they agree with the
    first at high frequencies, where all loops behave alike.
    """
    angles = [np.angle(response) for response in responses]
    lagging = [np.where(angle > np.pi - 1e-9, angle - 2 * np.pi, angle) for angle in angles]  # half a turn is a lag
    first, *others = [np.degrees(np.unwrap(angle)) for angle in lagging]
    first = first - 360 * np.floor((first[0] - FIRST_TURN_FROM) / 360)
    high = slice(len(first) // 2, None)
    return [first, *(phase + 360 * np.round(np.median(first[high] - phase[high]) / 360) for phase in others)]
