"""Compute hysteresis loops of friction laws over a slow motion to and fro, before sliding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.driven import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.dragged import Dragged
from friso.stage.tables import friction_law
from friso.studies.settings import settings


@dataclass(frozen=True)
class HysteresisLoop:
    """A loop of force over displacement, with an `amplitude` [m] to either side of rest.

    The loop encloses the `area` [J], the energy lost in one period. `stiffness` [N/m] is the difference of the forces
    at both ends, divided by the difference of the displacements.
    """

    amplitude: float
    area: float
    stiffness: float


def hysteresis_loop(flat: Mapping[str, Any], amplitude: float, speed: float) -> HysteresisLoop:
    """Compute the last of several hysteresis loops of a stage's friction law.

    `flat` has the stage's keys. A body is moved back and forth by the `amplitude` [m] at a steady `speed` [m/s], from
    rest with unbent bristles.
    """
    law, points = flat["friction.model"], settings.points_of_a_loop
    shape = kernel(Dragged(law, friction_law(law).variant(flat)))
    # first a quarter, then whole loops from one end, as triangles with the same speed throughout
    phase = np.arange(points // 4 + settings.loop_periods * points + 1) / points
    place = amplitude * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * phase))
    inputs = Inputs(place, np.zeros(len(place)), 4 * amplitude / speed / points)
    starts = np.zeros((1, shape.initial_size))
    starts[:, shape.velocity] = inputs.velocity[0]
    (run,) = run_driven(shape, {**flat, "motion.duration": 1.0}, 1, inputs, starts, settings.loop_tolerance)
    force = np.diff(run.states[0, :, -1]) / inputs.sample_time
    last, moved = force[-points:], np.diff(place)[-points:]
    middles = (place[1:] + place[:-1])[-points:] / 2
    ends = int(middles.argmax()), int(middles.argmin())
    stiffness = (last[ends[0]] - last[ends[1]]) / (middles[ends[0]] - middles[ends[1]])
    return HysteresisLoop(amplitude, float(np.sum(last * moved)), float(stiffness))
