"""How far above the crossover the parasitic mode of a joint has to be, by linear analysis."""

from __future__ import annotations

from dataclasses import dataclass

from friso.frequency.crossover import limits
from friso.stage import Stage

FREQUENCIES = (100.0, 200.0, 300.0, 600.0, 1000.0)
"""Parasitic modes [Hz]."""

DAMPING_RATIOS = (0.01, 0.001)
"""Damping ratios of the mode: of the rig's stage file, and of leaf springs without anything that damps them."""

DRIVE = {"drive.sample_time": "50 us", "drive.delay": "50 us"}
"""The sampling of the thesis's drive (Sec. 3.5), and a sample of delay."""


@dataclass(frozen=True)
class Parasitic:
    """A parasitic mode at a frequency [Hz] with a damping ratio, and the crossovers [Hz], joint locked and free, up to
    which the modulus margin is 0.5 in all settled states: the end of the range that holds the rig's own, or of the next
    below; None where there is none."""

    frequency: float
    damping_ratio: float
    locked: float | None
    free: float | None


def parasitic_limits(stage: Stage) -> list[Parasitic]:
    """The stage with each of these modes instead of its own, sampled as the thesis's drive."""
    found = []
    for damping in DAMPING_RATIOS:
        for frequency in FREQUENCIES:
            mode = {"parasitic.frequency": f"{frequency!r} Hz", "parasitic.damping_ratio": damping, **DRIVE}
            locked, free = (
                limits(stage.replace({**mode, "joint.locked": held}).flat()).highest_comfortable
                for held in (True, False)
            )
            found.append(Parasitic(frequency, damping, locked, free))
    return found
