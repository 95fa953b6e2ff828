"""Find how far above the crossover a joint's parasitic mode has to be, by linear analysis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.frequency import crossover
from friso.frequency.crossover import Range, limits
from friso.stage import Stage

FREQUENCIES = (100.0, 200.0, 300.0, 600.0, 1000.0)
"""Frequencies of parasitic modes [Hz]."""

DAMPING_RATIOS = (0.01, 0.001)
"""Damping ratios of the mode: that of the rig's stage file, and that of bare leaf springs."""

DRIVE = {"drive.sample_time": "50 us", "drive.delay": "50 us"}
"""Sample time of the thesis's drive (Sec. 3.5), and a delay of one sample."""


@dataclass(frozen=True)
class ParasiticLimits:
    """Range of crossovers that a parasitic mode allows, with the joint locked and free.

    The mode has a frequency [Hz] and a damping ratio. Each range [Hz] contains the stage's own crossover. In it the
    modulus margin is at least 0.5 in the limit cases, and in all states stuck under a bias force. The range is None if
    the stage lacks this margin at its own crossover.
    """

    frequency: float
    damping_ratio: float
    locked: Range | None
    free: Range | None


def parasitic_limits(stage: Stage) -> list[ParasiticLimits]:
    """Return the crossovers that a stage may have with each of several parasitic modes.

    Each mode takes the place of the stage's own. The stage is sampled like the thesis's drive.
    """
    modes = []
    for damping in DAMPING_RATIOS:
        for frequency in FREQUENCIES:
            mode = {"parasitic.frequency": f"{frequency!r} Hz", "parasitic.damping_ratio": damping, **DRIVE}
            flats = [stage.replace({**mode, "joint.locked": held}).flat() for held in (True, False)]
            locked, free = (holding(limits(flat).comfortable, flat[CROSSOVER]) for flat in flats)
            modes.append(ParasiticLimits(frequency, damping, locked, free))
    return modes


def margin_with(stage: Stage, changes: Mapping[str, Any]) -> float:
    """Return the least modulus margin of a stage in its settled states.

    Settled states are the limit cases, and all states stuck under a bias force. `changes` are keys that are changed
    first, in SI. The stage is sampled like the thesis's drive. The margin is 0 if a state is not stable.
    """
    return crossover.settled_margin(stage.replace(DRIVE).flat() | dict(changes))


def holding(ranges: Sequence[Range], crossover: float) -> Range | None:
    """Return the range [Hz] that contains a crossover [Hz]; None if none does."""
    return next((window for window in ranges if window[0] <= crossover <= window[1]), None)
