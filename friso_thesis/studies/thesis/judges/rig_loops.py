"""Judge by the rig with its real drive, in claims on responses (Fig. 17, 18, 22, 23)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from friso.quantities import percent
from friso_thesis.studies.rig.experiments.frf import (
    MOTOR_CONSTANT_RATIOS,
    MeasuredLoop,
    crossing_near_target,
    highest_stable,
)
from friso_thesis.studies.rig.outcome import SLIDING
from friso_thesis.studies.thesis.as_built import AS_BUILT, RigLoops
from friso_thesis.studies.thesis.claims import Evidence, Part, number_text
from friso_thesis.studies.thesis.reading import about, words

HIGHEST_SETTING, OTHER_CROSSING, FREE_CROSSING = 48.0, 600.0, 20.0
"""Highest setting, crossing that threatens stability (Fig. 22), and crossing of the free joint (Fig. 23) [Hz]."""

BEYOND_CROSSOVER = 3.0
"""Ratio of a peak's frequency to the crossover from which the peak belongs to a mode."""

ASSUMED = (
    f"Assumed: sample time, encoder and peak force of Sec. 3.5; a delay of {AS_BUILT['drive.delay']}, a current loop "
    f"of {AS_BUILT['drive.current_bandwidth']}, a rail that varies by {percent(AS_BUILT['rail.static_deviation'])}, a "
    f"multisine of {SLIDING.strength:g} times the static friction"
)


RAIL = "how friction varies along the rail, which rails these are, the drive's delay"
"""Assumptions about the rig with its real drive that are not drawn."""


def on_the_rig(evidence: Evidence, parts: Callable[[RigLoops], tuple[Part, ...]]) -> tuple[Part, ...]:
    """Return the criteria that `parts` judges by the rig with its real drive; () without it."""
    return parts(evidence.identified.rig_loops) if evidence.identified is not None else ()


def measured_locked(loops: RigLoops) -> tuple[Part, ...]:
    """Judge where the open loops of the locked rig cross 0 dB, as measured with its real drive."""
    return _crossings(loops), _further(loops)


def _crossings(loops: RigLoops) -> Part:
    read = {loop.tuned: crossing_near_target(loop) for loop in loops.locked}
    return Part(
        f"measured on the rig as built, every open loop crosses 0 dB about where it is tuned (within {words.about:g})",
        all(about(crossed, tuned) for tuned, crossed in read.items()),
        ", ".join(f"{number_text(crossed, unit='Hz')} tuned to {tuned:.3g} Hz" for tuned, crossed in read.items())
        + f". {ASSUMED}",
        why="Friction, which the loop of the model does not have, bends the response at low frequency.",
    )


def _further(loops: RigLoops) -> Part:
    """Judge whether the locked loop tuned to the highest crossover crosses 0 dB a second time."""
    last = loops.locked[-1]
    above = [crossing.value for crossing in last.crossings if crossing.value > words.about * last.tuned]
    near, gain = _peak(last, BEYOND_CROSSOVER * last.tuned)
    return Part(
        f"measured on the rig as built, that tuned to {last.tuned:g} Hz crosses 0 dB again about {OTHER_CROSSING:g} Hz",
        any(about(f, OTHER_CROSSING) for f in above),
        f"above the first crossing: {', '.join(f'{f:.3g} Hz' for f in above) or 'none'}; its peak there is "
        f"{number_text(gain, '.2g')} at {number_text(near, unit='Hz')}",
        beyond="Simulation cannot decide this: the only parasitic mode of the model is that of Fig. 18"
        + (f", at {near:.3g} Hz with the joint locked." if np.isfinite(near) else "."),
    )


def _peak(loop: MeasuredLoop, low: float) -> tuple[float, float]:
    """Return frequency [Hz] and magnitude of the open loop's peak above a frequency [Hz].

    Both are NaN for a loop that was not measured.
    """
    if not loop.measured:
        return np.nan, np.nan
    size = np.abs(loop.response.response) * (loop.response.frequency > low)
    return float(loop.response.frequency[size.argmax()]), float(size.max())


def measured_free(loops: RigLoops) -> tuple[Part, Part]:
    """Judge where the free joint's open loop crosses 0 dB, and up to which tuning it is stable."""
    crossed = max((crossing.value for crossing in loops.free.crossings), default=np.nan)
    highest = highest_stable(loops.settings, loops.stable)
    return (
        Part(
            f"measured on the rig as built, tuned to {loops.free.tuned:g} Hz, it crosses 0 dB about {FREE_CROSSING:g} "
            "Hz",
            about(crossed, FREE_CROSSING),
            f"last crossing: {number_text(crossed, unit='Hz')}. {ASSUMED}",
            why="With the masses weighed it crosses higher than with those identified, which the model does not have.",
        ),
        Part(
            f"the highest setting at which the rig as built comes to rest is about {HIGHEST_SETTING:g} Hz",
            about(highest, HIGHEST_SETTING),
            f"{number_text(highest, unit='Hz')}, of settings 10 % apart, released away from its reference, the "
            "limiters not touched",
            beyond="Simulation cannot decide this: the thesis found “resonances in the compliant joint”, of which "
            "the model has one, and gives no delay.",
        ),
    )


def weaker_motor(loops: RigLoops, joint: int, seen: float, weighed: float) -> tuple[Part]:
    """Judge whether a weaker motor brings the apparent mass nearer `seen` than `weighed` [kg].

    `joint` is 0 for locked, 1 for free.
    """
    plain, weak, strong = loops.apparent[joint]
    part = Part(
        f"with a motor that gives {MOTOR_CONSTANT_RATIOS[1]:g} of the force that the drive assumes, it is nearer "
        f"{seen:g} than the "
        f"{weighed:g} kg weighed (by their ratios)",
        bool(weak > (seen * weighed) ** 0.5),
        f"{weak:.3g} kg, {plain:.3g} with the assumed force, {strong:.3g} with {MOTOR_CONSTANT_RATIOS[2]:g} times it: "
        "a motor "
        f"stronger than assumed makes masses appear lighter. {ASSUMED}",
        self_test=True,
    )
    return (part,)
