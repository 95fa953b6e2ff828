"""Find leaf springs for a joint of given stiffness and stroke.

Of all leaf springs that fit, those are chosen whose first mode that interferes with control lies highest.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from typing import Any

import numpy as np

from friso.design_method.choice import bears, evaluate_geometries, evaluated
from friso.design_method.geometry import SIZES, Geometry, Sheet, box, mechanisms, moved_along, sheets
from friso.design_method.prepare import outline
from friso.design_method.requirements import BREAKAWAY, PARASITIC, LeafTask, evolved, requirements
from friso.design_method.settings import settings
from friso.design_method.spec import read_spec
from friso.equations.breakaway import least_breakaway
from friso.errors import InputError
from friso.leaf_springs.beams import BeamFailure
from friso.leaf_springs.closed_forms import drive_stiffness, first_interfering, loaded_drive_stiffness
from friso.quantities import exactly
from friso.stage import Stage

OF_LEAVES = (*SIZES, "leaves", "thickness", "material", "young", "poisson", "density", "yield", "fatigue")
"""Keys of [flexure] that describe the leaves; the others describe the stage that they guide."""


def leaves_for_joint(stage: Stage, present: Stage) -> Stage | None:
    """Return the stage with leaf springs in place of its joint's numbers and its parasitic mode.

    The leaf springs have the joint's stiffness, and modes that interfere with control lie as high as possible. Sizes,
    sheets, loads and factors of safety are the defaults of `friso init --spec`. Returns None if no leaves bear stroke
    and load.

    If the stage `present` has [flexure], its points keep their distance from the leaf ends. Raises InputError for a
    joint that leaf springs cannot make.
    """
    spec = read_spec(outline(stage))
    low, high = box(spec)
    first = Geometry.of(np.array([low[0], *high[1:]]), sheets(spec)[-1])  # the leaves that bear the largest load
    replaced = {"joint.stiffness": None} | ({"parasitic": None} if stage.parasitic else {})
    written = present.flexure.as_written() if present.flexure else {}
    carried = {f"flexure.{key}": entry for key, entry in written.items() if key not in OF_LEAVES}
    try:
        base = stage.replace({**replaced, **carried, **first.keys()})
        base = base.replace(_moved(present.flat(), first))
    except InputError:  # even these buckle under the load
        return None
    flat, friction = base.flat(), float(least_breakaway(base.flat()))
    task = LeafTask(spec, flat["joint.stroke"], 0.0, friction, flat)
    search = _Search(task, stage.flat()["joint.stiffness"])
    with np.errstate(all="ignore"):  # leaves without a width for this stiffness break the requirements
        geometries = search.whole_sizes(search.best())
    for geometry in geometries:
        with suppress(BeamFailure):
            if bears(task, evaluated(task, geometry)):
                return base.replace({**geometry.keys(), **_moved(base.flat(), geometry)})
    return None


def _moved(flat: Mapping[str, Any], geometry: Geometry) -> dict[str, str]:
    """Return keys of points on the stage, moved so as to keep their distance from the leaf ends.

    `geometry` are the new leaves. Values are texts with units.
    """
    return {key: exactly(place, "m") for key, place in moved_along(flat, geometry.length).items()}


class _Search:
    """Search over the leaves' length, spacing and sheet; the width follows from the stiffness."""

    def __init__(self, task: LeafTask, stiffness: float) -> None:
        """Prepare the search for leaves of a `stiffness` [N/m].

        Two requirements are left to a later check on the whole stage: that the cart stays at rest, and that no mode
        interferes with control.
        """
        self.task, self.stiffness = task, stiffness
        self.bought = sheets(task.spec)
        self.low, self.high = box(task.spec)
        # that the cart stays and that no mode disturbs is verified on the stage with its leaves
        self.needs = [need for need in requirements(task) if need.name not in (BREAKAWAY, PARASITIC)]

    def best(self) -> np.ndarray:
        """Return logarithms of the best length and spacing [m] and the index of the sheet, (3,)."""
        ends = [*np.log([self.low[[0, 2]], self.high[[0, 2]]]).T, (0.0, len(self.bought) - 1e-9)]

        def cost(x: np.ndarray) -> np.ndarray:
            return self.cost(np.exp(x[:2]).T, [self.bought[int(k)] for k in x[2]])

        minimum = evolved(cost, ends, settings.leaves_generations, settings.leaves_seed, settings.leaves_points)
        return np.asarray(minimum.x)

    def cost(self, spans: np.ndarray, bought: list[Sheet]) -> np.ndarray:
        """Return the cost of leaf springs by length and spacing [m], rows of (count, 2).

        `bought` has the sheet of each row. Leaves that break a requirement cost more, the farther they break it. For
        other leaves, the cost falls as the frequency of the first mode that interferes with control rises.
        """
        sizes = self.with_width(spans, bought)
        worst = self.broken(sizes, bought)
        frequency = np.minimum(first_interfering(mechanisms(self.task.flat, sizes, bought)), settings.highest_mode)
        return np.where(worst > 0, settings.worst_cost + worst, -np.log(frequency))

    def with_width(self, spans: np.ndarray, bought: list[Sheet]) -> np.ndarray:
        """Return lengths, widths and spacings [m], (count, 3), of leaves of the required stiffness."""
        sizes = np.insert(spans, 1, self.high[1], axis=1)
        for _ in range(settings.width_steps):
            built = mechanisms(self.task.flat, sizes, bought)
            sizes[:, 1] *= 1 + (self.stiffness - loaded_drive_stiffness(built)) / drive_stiffness(built)
        return sizes

    def broken(self, sizes: np.ndarray, bought: list[Sheet]) -> np.ndarray:
        """Return the logarithm of the largest factor by which leaves break a requirement, (count,).

        The space for their width is one requirement. The result is 0 or less for leaves that break none.
        """
        scores = evaluate_geometries(self.task, self.needs, sizes, bought)
        space = np.stack([self.low[1] / sizes[:, 1], sizes[:, 1] / self.high[1]], axis=1)
        worst = np.log(np.concatenate([scores.excess, space], axis=1)).max(axis=1)
        return np.where(np.isfinite(worst), worst, settings.worst_cost)

    def whole_sizes(self, best: np.ndarray) -> list[Geometry]:
        """Return leaf springs in whole sizes next to `best`, (3,), with the stiffness required.

        Only leaf springs that break no requirement are returned. First come those whose lowest mode that interferes
        with control has the highest frequency.
        """
        sheet = self.bought[int(best[2])]
        near = [
            np.round(np.exp(size) / settings.size_step + side) * settings.size_step
            for side in (-1, 0, 1)
            for size in best[:2]
        ]
        spans = np.array([*product(near[::2], near[1::2])])
        bought = [sheet] * len(spans)
        sizes = self.with_width(spans, bought)
        sizes[:, 1] = np.round(sizes[:, 1] / settings.size_step) * settings.size_step
        built = mechanisms(self.task.flat, sizes, bought)
        inside = np.all(
            (sizes > self.low - settings.size_step / 2) & (sizes < self.high + settings.size_step / 2), axis=1
        )
        right = np.abs(loaded_drive_stiffness(built) / self.stiffness - 1) < settings.stiffness_error
        fits = inside & right & (self.broken(sizes, bought) <= np.log(1 + settings.size_step))
        order = np.argsort(-np.asarray(first_interfering(built)))
        return [Geometry.of(sizes[k], sheet) for k in order if fits[k]]
