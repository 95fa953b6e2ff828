"""Integrate the velocity of a log that has no position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid

from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.physics import MotionReading, is_ramp
from friso.identification.logs.roles import Proposal, role_of, wanted_of
from friso.identification.logs.units import unit_factor

NOTE = (
    "position: the integral of the velocity, since no channel holds one; where the log begins counts as 0, after a gap "
    "as well, an offset of the velocity becomes a drift, and the first micrometres of a motion are not resolved"
)
"""Remark in the log on a position that is the integral of the velocity."""

LENGTHS = ("m", "rad")
"""Units of a position."""


def is_needed(
    table: ChannelTable, proposal: Proposal, needed: Sequence[str], best: MotionReading | None = None
) -> bool:
    """Tell whether a needed position must be computed as the integral of the velocity.

    This is never so if a channel has, or competes for, the role of position. Otherwise the `best` reading by mechanics
    decides, if there is one. Without it, there must be a velocity, which the user assigned, or beside which no other
    channel could be a position.
    """
    velocity = proposal.chosen.get("velocity")
    if "position" not in needed or "position" in {*proposal.chosen, *proposal.rivals}:
        return False
    if best is not None:
        return best.kind == "velocity"
    if velocity is None:
        return False
    taken = {id(choice.channel) for choice in proposal.chosen.values()}
    others = [channel for channel in table.channels if id(channel) not in taken]
    return velocity.by_user or not any(map(_may_be_a_position, others))


def _may_be_a_position(channel: Channel) -> bool:
    """Tell whether a channel may be a position.

    Such a channel has no role yet, changes, and has a fitting unit or none.
    """
    finite = channel.values[np.isfinite(channel.values)]
    if not finite.size or not np.ptp(finite) > 0 or role_of(channel.name) is not None or is_ramp(channel):
        return False
    if wanted_of(channel.name, channel.unit):
        return False
    return not channel.unit or any(unit_factor(channel.unit, unit) is not None for unit in LENGTHS)


def integrated(velocity: np.ndarray, sample_time: float, segments: Sequence[slice]) -> np.ndarray:
    """Integrate a velocity [m/s], (n,), over each segment by the trapezoidal rule [m]."""
    position = np.zeros(len(velocity))
    for part in segments:
        position[part] = cumulative_trapezoid(velocity[part], dx=sample_time, initial=0.0)
    return position
