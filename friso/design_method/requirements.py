"""Define the requirements on leaf springs as ratios, and find which single one to relax.

Closed forms evaluate many geometries at once. If no leaf springs meet all requirements, the least sufficient change is
computed for each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution

from friso.design_method.geometry import SIZES, Geometry, Sheet, box, mechanisms
from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.leaf_springs import closed_forms
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import STANDARD_GRAVITY, Mechanism


@dataclass(frozen=True)
class LeafTask:
    """The task that leaf springs are designed for.

    Fields are the specification, a stroke [m], the crossover [Hz], the least static friction [N], and the stage's flat
    keys without leaves. The first mode that interferes with control must lie above a multiple of the crossover.
    """

    spec: Spec
    stroke: float
    crossover: float
    friction: float
    flat: Mapping[str, Any]

    @property
    def load(self) -> float:
        """Return the force along the leaves [N].

        The force is the specification's load plus the weight of the heaviest stage, or the stage file's load if that is
        larger.
        """
        masses = self.spec.masses.stage
        heaviest = masses.high if masses else float(self.flat["masses.stage"])
        return max(float(self.spec.load.force_x) + STANDARD_GRAVITY * heaviest, self.flat.get("flexure.load", 0.0))


@dataclass(frozen=True)
class RelaxableKey:
    """A key of the specification that relaxes a requirement if it is changed.

    Fields are the `key`, its `value` and `unit`. `needed` is a function from the factor by which leaf springs break the
    requirement to the value needed; None if no change of the key is enough.
    """

    key: str
    value: float
    unit: str
    needed: Callable[[float], float | None]


@dataclass(frozen=True)
class Requirement:
    """A requirement in words, with the keys that relax it.

    `excess` computes the factor by which leaf springs break it: 1 if they just meet it.
    """

    name: str
    keys: tuple[RelaxableKey, ...]
    excess: Callable[[Mechanism], Any]


def more(key: str, value: float, unit: str) -> RelaxableKey:
    """Return a key that relaxes a requirement by becoming larger.

    The key's value is multiplied by the factor by which leaf springs break the requirement.
    """
    return RelaxableKey(key, value, unit, lambda excess: value * excess)


def less(key: str, value: float, unit: str) -> RelaxableKey:
    """Return a key that relaxes a requirement by becoming smaller.

    The key's value is divided by the factor by which leaf springs break the requirement.
    """
    return RelaxableKey(key, value, unit, lambda excess: value / excess)


def safety_factor(key: str, value: float) -> RelaxableKey:
    """Return a factor of safety, at least 1, as a key that relaxes a requirement."""
    return RelaxableKey(key, value, "", lambda excess: value / excess if value >= excess else None)


BREAKAWAY, PARASITIC = "the cart must not break away inside the stroke", "first interfering frequency"


def requirements(task: LeafTask) -> list[Requirement]:
    """Return all requirements except those on space and sheets."""
    spec, safety, stroke = task.spec, task.spec.safety, task.stroke
    shorter = less("leaves.stroke", stroke, "m")
    stiffest = safety.breakaway * (1 + safety.stiffness_tolerance)

    def fatigue(mechanism: Mechanism) -> Any:
        strength = np.where(np.isnan(mechanism.fatigue), np.inf, mechanism.fatigue)
        swing = mechanism.stress_concentration * closed_forms.max_stress(mechanism, stroke) / strength
        return (
            settings.model_reserve * safety.fatigue * (swing + load_stress(mechanism, task) / mechanism.yield_strength)
        )

    return [
        Requirement(
            BREAKAWAY,
            (more("friction.static", task.friction, "N"), shorter),
            lambda mechanism: stiffest * closed_forms.drive_stiffness(mechanism) * stroke / task.friction,
        ),
        Requirement(
            "fatigue limit under stroke and load", (safety_factor("safety.fatigue", safety.fatigue), shorter), fatigue
        ),
        Requirement(
            "yield strength under stroke and load",
            (safety_factor("safety.strength", safety.strength),),
            lambda mechanism: (
                settings.model_reserve * safety.strength * static_stress(mechanism, task) / mechanism.yield_strength
            ),
        ),
        Requirement(
            "buckling under load",
            (safety_factor("safety.buckling", safety.buckling), *_lighter(task)),
            lambda mechanism: (
                settings.model_reserve
                * safety.buckling
                * buckling_share(mechanism, task, closed_forms.buckling_load(mechanism))
            ),
        ),
        Requirement(
            PARASITIC,
            (safety_factor("safety.parasitic", safety.parasitic),),
            lambda mechanism: safety.parasitic * task.crossover / first_interfering(mechanism),
        ),
        *_support(spec, stroke),
    ]


def _lighter(task: LeafTask) -> tuple[RelaxableKey, ...]:
    """Return the load along the leaves as a key that relaxes, if a smaller load alone is enough.

    The weight of the stage stays.
    """
    load = task.spec.load
    force = float(load.force_x)
    if not force or load.force_y or load.moment_y:
        return ()

    def needed(excess: float) -> float | None:
        left = task.load / excess - (task.load - force)
        return left if left >= 0 else None

    return (RelaxableKey("load.force_x", force, "N", needed),)


def _support(spec: Spec, stroke: float) -> list[Requirement]:
    """Return the requirements on stiffness along and across the leaves at full stroke.

    The list is empty if the specification has none.
    """
    forms = {
        "support_x": ("along the leaves", closed_forms.support_x),
        "support_y": ("across them", closed_forms.support_y),
    }
    return [
        Requirement(
            f"stiffness {where} at full stroke",
            (less(f"load.{key}", float(limit), "N/m"),),
            lambda mechanism, limit=limit, form=form: limit / form(mechanism, stroke),
        )
        for key, (where, form) in forms.items()
        if (limit := getattr(spec.load, key)) is not None
    ]


def buckling_share(mechanism: Mechanism, task: LeafTask, buckling: Any) -> Any:
    """Return the load on the leaves relative to the load at which they buckle.

    The ratio is a sum of two. One is the largest force along a leaf, times the number of leaves, over the `buckling`
    load [N]. The other is the force across the leaves over the force at which they buckle sideways.
    """
    across = float(task.spec.load.force_y) / closed_forms.lateral_load(mechanism)
    return leaf_load(mechanism, task) * mechanism.leaves / buckling + across


def leaf_load(mechanism: Mechanism, task: LeafTask) -> Any:
    """Return the largest force along a leaf [N]: its share of the load, plus a part by a moment.

    The moment acts about the width of the leaves.
    """
    outermost = mechanism.depth / 2 / mechanism.offset_squares
    return task.load / mechanism.leaves + float(task.spec.load.moment_y) * outermost


def static_stress(mechanism: Mechanism, task: LeafTask) -> Any:
    """Return the largest stress at the clamps [Pa] at full stroke under all loads at once.

    The concentration of stress at the clamps is included.
    """
    return mechanism.stress_concentration * closed_forms.max_stress(mechanism, task.stroke) + load_stress(
        mechanism, task
    )


def load_stress(mechanism: Mechanism, task: LeafTask) -> Any:
    """Return the stress at the clamps by the loads [Pa].

    A force across the leaf ends bends leaves in their plane like cantilevers, because nothing else holds the stage
    about z. A moment about x bends them like leaves whose ends stay parallel.
    """
    load, middle = task.spec.load, mechanism.width / 2 / mechanism.edgewise
    about_x = float(load.moment_x) * mechanism.depth / 2 / mechanism.offset_squares * mechanism.length / 2
    edgewise = (float(load.force_y) * mechanism.length + float(load.moment_z)) / mechanism.leaves + about_x
    return mechanism.stress_concentration * (edgewise * middle + leaf_load(mechanism, task) / mechanism.area)


@dataclass(frozen=True)
class Relaxation:
    """A `key` of the specification that must change from `value` to `needed` [unit].

    Changed alone, it lets the `requirement` be met, by leaf springs of a `geometry`. The geometry is None for
    requirements on other parts.
    """

    requirement: str
    key: str
    value: float
    needed: float
    unit: str
    geometry: Geometry | None = None


def relaxed_requirements(task: LeafTask) -> tuple[Relaxation, ...]:
    """Return by how much each requirement must be relaxed if all others stand, the least first.

    The result is empty if no single relaxation is enough.
    """
    needs = [*requirements(task), *_space(task)]
    all_relaxations = [relaxation for k in range(len(needs)) for relaxation in _alone(task, needs, k)]
    return tuple(sorted(all_relaxations, key=_change))


def _change(relaxation: Relaxation) -> float:
    """Return how far a requirement is relaxed, as the logarithm of the factor on its value.

    The result is infinite if the value has to become 0.
    """
    return float(abs(np.log(relaxation.needed / relaxation.value))) if relaxation.needed > 0 else np.inf


def _space(task: LeafTask) -> list[Requirement]:
    """Return the limits of the leaves' sizes and of the sheets' thickness as requirements."""
    low, high = box(task.spec)
    gauges = sorted(map(float, task.spec.leaves.thickness))
    limits = []
    for name, least, most in zip((*SIZES, "thickness"), [*low, gauges[0]], [*high, gauges[-1]], strict=True):
        words, key = "sheets" if name == "thickness" else f"{name} of the leaves", f"leaves.{name}"
        limits += [
            Requirement(f"{words}, at least", (less(key, float(least), "m"),), _over(name, least, low=True)),
            Requirement(f"{words}, at most", (more(key, float(most), "m"),), _over(name, most, low=False)),
        ]
    return limits


def _over(name: str, limit: float, low: bool) -> Callable[[Mechanism], Any]:
    """Return a function that computes by which factor leaf springs break a limit of a size.

    `name` is the size, and `low` is true for a lower limit.
    """

    def excess(mechanism: Mechanism) -> Any:
        return limit / getattr(mechanism, name) if low else getattr(mechanism, name) / limit

    return excess


@dataclass(frozen=True)
class _Trials:
    """Leaf springs in more space than allowed, given by variables of a search.

    The variables are logarithms of length, width, spacing and thickness, and the index of the kind: number of leaves
    and material. The thickness is `free`, or is rounded to the next available sheet.
    """

    task: LeafTask
    free: bool

    @property
    def kinds(self) -> list[tuple[float, str]]:
        """Return the allowed combinations of number of leaves and material."""
        section = self.task.spec.leaves
        return [(count, material) for count in section.leaves for material in section.materials]

    @property
    def gauges(self) -> np.ndarray:
        """Return the available thicknesses [m], ascending."""
        return np.sort(np.array(self.task.spec.leaves.thickness, dtype=float))

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Return the bounds of each variable, somewhat beyond the space allowed."""
        low, high = box(self.task.spec)
        ends = np.log([[*low, self.gauges[0]], [*high, self.gauges[-1]]]).T + np.log(
            settings.relaxed_beyond
        ) * np.array([-1, 1])
        return [*map(tuple, ends), (0, len(self.kinds) - 1e-9)]

    def built(self, x: np.ndarray) -> tuple[np.ndarray, list[Sheet]]:
        """Return sizes (count, 3) and sheets for variables of shape (5, count)."""
        sizes, gauges, kinds = np.exp(x[:4]).T, self.gauges, self.kinds
        nearest = gauges[np.abs(np.log(gauges) - x[3][:, None]).argmin(axis=1)]
        thickness = sizes[:, 3] if self.free else nearest
        chosen = (kinds[int(n)] for n in x[4])
        return sizes[:, :3], [Sheet(count, float(t), of) for t, (count, of) in zip(thickness, chosen, strict=True)]


def evolved(
    objective: Callable[[np.ndarray], np.ndarray],
    bounds: Iterable[tuple[float, float]],
    generations: int,
    seed: int,
    population: int = 15,
) -> OptimizeResult:
    """Minimise a function of many points at once, whose columns lie between the bounds, by differential evolution.

    `population` is the number of points per variable. A variable whose bounds are equal has that value.
    """
    apart = [(low, high + 1e-12 * (high == low)) for low, high in bounds]
    several = {"vectorized": True, "updating": "deferred", "polish": False}
    return differential_evolution(objective, apart, maxiter=generations, popsize=population, rng=seed, **several)


def _alone(task: LeafTask, needs: list[Requirement], k: int) -> Iterator[Relaxation]:
    """Yield the least changes of keys that relax requirement `k` so that all others can be met."""
    of_sheets = np.array([requirement.keys[0].key == "leaves.thickness" for requirement in needs])
    trials = _Trials(task, free=bool(of_sheets[k]))
    spare = np.where(of_sheets, 0.0, settings.relaxed_reserve)  # sizes of sheets are met exactly

    def objective(x: np.ndarray) -> np.ndarray:
        many = mechanisms(task.flat, *trials.built(x))
        excess = np.log([np.broadcast_to(requirement.excess(many), x.shape[1]) for requirement in needs])
        others = np.delete(excess + spare[:, None], k, axis=0).max(axis=0)
        return np.where(others <= 1e-9, excess[k], settings.unmet_penalty + others)

    search = settings.relaxed_generations, settings.relaxed_seed, settings.relaxed_population
    with np.errstate(divide="ignore"):  # a requirement of nothing divides by 0
        minimum = evolved(objective, trials.bounds, *search)
    if minimum.fun >= settings.unmet_penalty:
        return
    (sizes,), (sheet,) = trials.built(minimum.x[:, None])
    for relaxable in needs[k].keys:
        needed = relaxable.needed(settings.relaxed_more * float(np.exp(max(minimum.fun, 0.0))))
        if needed is not None and not np.isclose(needed, relaxable.value, rtol=1e-6):
            yield Relaxation(
                needs[k].name, relaxable.key, relaxable.value, needed, relaxable.unit, Geometry.of(sizes, sheet)
            )
