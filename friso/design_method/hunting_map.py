"""Map, over crossover and stroke, how many corners of a specification do not come to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.design_method.population import Population, typical_move
from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.design_method.verification import move_machines
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.stage import Stage


@dataclass(frozen=True)
class HuntingMap:
    """The fraction of corners in which the stage is not in position, over crossover and stroke.

    Corners are the extremes of friction and masses. Crossovers [Hz] have shape (n,), strokes [m] (m,), and fractions
    (m, n). A corner counts if the stage is not in position a quarter of a minute after a typical move. The fraction is
    NaN if a run failed.
    """

    crossovers: np.ndarray
    strokes: np.ndarray
    share: np.ndarray


def hunting_map(stage: Stage, spec: Spec, population: Population) -> HuntingMap:
    """Compute the map of corners not in position, over crossover and stroke, around a design.

    The drive stiffness is the design's own.
    """
    flat = stage.flat()
    crossovers, strokes = (
        np.geomspace(low * flat[key], high * flat[key], count)
        for key, (low, high), count in zip(
            (CROSSOVER, "joint.stroke"),
            settings.map_reach,
            (settings.map_crossovers, settings.map_strokes),
            strict=True,
        )
    )
    shape = (settings.map_strokes, settings.map_crossovers, population.count)
    stroke, crossover, number = (
        axis.ravel() for axis in np.meshgrid(strokes, crossovers, np.arange(population.count), indexing="ij")
    )
    machines = {key: value[number] for key, value in population.keys.items()}
    runs = {**flat, **machines, **typical_move(spec), CROSSOVER: crossover, "joint.stroke": stroke}
    outcome = move_machines(runs, len(number), float(spec.position.window), patient=False)
    share = np.where(outcome.completed, outcome.restless, np.nan).reshape(shape).mean(axis=2)
    return HuntingMap(crossovers, strokes, share)
