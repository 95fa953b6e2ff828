"""State the requirements of a design, and choose the leaf springs that meet them.

Requirements are ratios. Closed forms evaluate many geometries at once. If no leaf springs meet all requirements, the
least change that suffices is computed for each requirement alone, so that one can be relaxed.

The Pareto front has soft leaf springs whose modes interfere with control at high frequency. The softest on it that meet
all requirements are chosen. Sizes are rounded so that the leaves can be made, and the beam model confirms the choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution

from friso.design_method.settings import settings
from friso.design_method.spec import SIZES, Geometry, Sheet, Spec, box, mechanisms, round_geometries, sheets, sizes_of
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import BeamFailure, beams
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import STANDARD_GRAVITY, Evaluation, Mechanism


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


MODEL_RESERVE = 1.015
"""Reserve for the error of closed forms (docs/evidence/flexure.md), so that the beam model confirms the result."""


def requirements(task: LeafTask) -> list[Requirement]:
    """Return all requirements except those on space and sheets."""
    spec, safety, stroke = task.spec, task.spec.safety, task.stroke
    shorter = less("leaves.stroke", stroke, "m")
    stiffest = safety.breakaway * (1 + safety.stiffness_tolerance)

    def fatigue(mechanism: Mechanism) -> Any:
        strength = np.where(np.isnan(mechanism.fatigue), np.inf, mechanism.fatigue)
        swing = mechanism.stress_concentration * closed_forms.max_stress(mechanism, stroke) / strength
        return MODEL_RESERVE * safety.fatigue * (swing + load_stress(mechanism, task) / mechanism.yield_strength)

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
                MODEL_RESERVE * safety.strength * static_stress(mechanism, task) / mechanism.yield_strength
            ),
        ),
        Requirement(
            "buckling under load",
            (safety_factor("safety.buckling", safety.buckling), *_lighter(task)),
            lambda mechanism: (
                MODEL_RESERVE * safety.buckling * buckling_share(mechanism, task, closed_forms.buckling_load(mechanism))
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


RELAXED_BEYOND = 3.0
"""Factor by which space and sheets may exceed the specification in a proposal."""


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
        ends = np.log([[*low, self.gauges[0]], [*high, self.gauges[-1]]]).T + np.log(RELAXED_BEYOND) * np.array([-1, 1])
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


RELAXED_RESERVE = 0.01
"""Reserve of other requirements in a relaxation, because sizes are made in whole steps."""

UNMET_PENALTY = 10.0
"""Penalty of unmet requirements, the logarithm of a factor beyond all relaxation."""

RELAXED_SEED = 5
"""Seed of the search for relaxations. A fixed one gives equal proposals for equal specifications."""

RELAXED_POPULATION = 16
"""Population of the search for relaxations. A smaller one misses a requirement that alone stands in the way."""

RELAXED_MORE = 1.03
"""Factor on a relaxed requirement, because sizes are made in whole steps."""


def _alone(task: LeafTask, needs: list[Requirement], k: int) -> Iterator[Relaxation]:
    """Yield the least changes of keys that relax requirement `k` so that all others can be met."""
    of_sheets = np.array([requirement.keys[0].key == "leaves.thickness" for requirement in needs])
    trials = _Trials(task, free=bool(of_sheets[k]))
    spare = np.where(of_sheets, 0.0, RELAXED_RESERVE)  # sizes of sheets are met exactly

    def objective(x: np.ndarray) -> np.ndarray:
        many = mechanisms(task.flat, *trials.built(x))
        excess = np.log([np.broadcast_to(requirement.excess(many), x.shape[1]) for requirement in needs])
        others = np.delete(excess + spare[:, None], k, axis=0).max(axis=0)
        return np.where(others <= 1e-9, excess[k], UNMET_PENALTY + others)

    search = settings.relaxed_generations, RELAXED_SEED, RELAXED_POPULATION
    with np.errstate(divide="ignore"):  # a requirement of nothing divides by 0
        minimum = evolved(objective, trials.bounds, *search)
    if minimum.fun >= UNMET_PENALTY:
        return
    (sizes,), (sheet,) = trials.built(minimum.x[:, None])
    for relaxable in needs[k].keys:
        needed = relaxable.needed(RELAXED_MORE * float(np.exp(max(minimum.fun, 0.0))))
        if needed is not None and not np.isclose(needed, relaxable.value, rtol=1e-6):
            yield Relaxation(
                needs[k].name, relaxable.key, relaxable.value, needed, relaxable.unit, Geometry.of(sizes, sheet)
            )


@dataclass(frozen=True)
class Candidate:
    """Leaf springs with their drive stiffness [N/m] and a frequency [Hz], by closed forms.

    The frequency is that of the first mode that interferes with control.
    """

    geometry: Geometry
    stiffness: float
    frequency: float


FRONT_SEED = 34
"""Seed of the front. A fixed one gives equal fronts for equal specifications."""


def front(task: LeafTask) -> list[Candidate]:
    """Return the Pareto front by rising stiffness (NSGA-II, doi:10.1109/4235.996017).

    The list is empty if no leaf springs meet the requirements. The requirement on the frequency of modes is left out,
    since the search raises this frequency.
    """
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM
    from pymoo.optimize import minimize

    needs = [requirement for requirement in requirements(task) if requirement.name != PARASITIC]
    start = closest(task, needs)
    if start is None:
        return []
    low, high = _ends(task)
    first = low + (high - low) * np.random.default_rng(FRONT_SEED).random((settings.front_population, len(low)))
    first[: len(first) // 4] = start  # from there the search reaches others, however little room there is
    variation = {"sampling": first, "crossover": SBX(prob=0.9, eta=10), "mutation": PM(eta=10)}
    algorithm = NSGA2(pop_size=settings.front_population, **variation)
    with np.errstate(invalid="ignore"):  # pymoo's distances within a front of a single geometry
        result = minimize(
            _problem(task, needs),
            algorithm,
            ("n_gen", settings.front_generations),
            seed=FRONT_SEED,
            verbose=False,
        )
    if result.X is None or result.F is None:
        return []
    bought = sheets(task.spec)
    chosen, objectives = (np.atleast_2d(np.asarray(array, dtype=float)) for array in (result.X, result.F))
    candidates = [
        Candidate(Geometry.of(np.exp(x[:3]), bought[int(x[3])]), float(np.exp(f[0])), float(np.exp(-f[1])))
        for x, f in zip(chosen, objectives, strict=True)
    ]
    return sorted(candidates, key=lambda candidate: candidate.stiffness)


def _ends(task: LeafTask) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest variables of the search, each of shape (4,).

    The variables are logarithms of the sizes, and the index of the sheet.
    """
    low, high = box(task.spec)
    return np.append(np.log(low), 0.0), np.append(np.log(high), len(sheets(task.spec)) - 1e-9)


def _problem(task: LeafTask, needs: list[Requirement]) -> Any:
    """Return the search for the front in pymoo's form: two objectives, and the requirements.

    The objectives are low stiffness, and a high frequency of the first mode that interferes with control.
    """
    from pymoo.core.problem import Problem

    low, high = _ends(task)
    bought = sheets(task.spec)

    class Leaves(Problem):
        def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            judgement = evaluate_geometries(task, needs, np.exp(x[:, :3]), [bought[int(k)] for k in x[:, 3]])
            out["F"] = np.stack([np.log(judgement.stiffness), -np.log(judgement.frequency)], axis=1)
            out["G"] = np.log(judgement.excess)

    return Leaves(n_var=len(low), n_obj=2, n_ieq_constr=len(needs), xl=low, xu=high)


START_GENERATIONS = 60
"""Generations in which a geometry that meets all requirements is found, if there is one."""


def closest(task: LeafTask, needs: list[Requirement]) -> np.ndarray | None:
    """Return the leaf springs that meet the requirements with the largest reserve, or None.

    The result has the logarithms of their sizes and the index of their sheet, shape (4,). Differential evolution
    searches for them.
    """
    bought = sheets(task.spec)

    def objective(x: np.ndarray) -> np.ndarray:
        judgement = evaluate_geometries(task, needs, np.exp(x[:3]).T, [bought[int(k)] for k in x[3]])
        return np.log(judgement.excess).max(axis=1)

    low, high = _ends(task)
    bounds = zip(low, high, strict=True)
    minimum = evolved(objective, bounds, START_GENERATIONS, FRONT_SEED)
    return minimum.x if minimum.fun <= 0 else None


@dataclass(frozen=True)
class GeometryScores:
    """The stiffness [N/m] and a frequency [Hz] of many leaf springs, both of shape (count,).

    The frequency is that of the first mode that interferes with control. `excess` is the factor by which each
    requirement is broken, shape (count, requirements).
    """

    stiffness: np.ndarray
    frequency: np.ndarray
    excess: np.ndarray


def evaluate_geometries(
    task: LeafTask, needs: list[Requirement], sizes: np.ndarray, bought: list[Sheet]
) -> GeometryScores:
    """Evaluate leaf springs by closed forms.

    `sizes` [m], shape (count, 3), are lengths, widths and spacings, and `bought` their sheets.
    """
    many = mechanisms(task.flat, sizes, bought)
    excess = [np.broadcast_to(requirement.excess(many), (len(sizes),)) for requirement in needs]
    return GeometryScores(closed_forms.drive_stiffness(many), first_interfering(many), np.stack(excess, axis=1))


@dataclass(frozen=True)
class Confirmed:
    """Leaf springs of the front, by the beam model: drive stiffness [N/m] and frequency [Hz].

    The frequency is that of the first mode that interferes with control. Both numbers are NaN if the model could not be
    evaluated; `failure` gives the reason.
    """

    candidate: Candidate
    stiffness: float
    frequency: float
    failure: str = ""


@dataclass(frozen=True)
class ChosenLeaves:
    """The leaf springs chosen, evaluated by the beam model, with their requirements.

    `excess`, shape (requirements,), is the factor by which they use up each requirement by closed forms: 1 if they just
    meet it, never more. `passed_over` says why softer leaf springs were not taken.
    """

    geometry: Geometry
    beams: Evaluation
    requirements: tuple[Requirement, ...]
    excess: np.ndarray
    passed_over: tuple[str, ...]

    @property
    def frequency(self) -> float:
        """Return the frequency [Hz] of the first mode that interferes with control.

        The lower one of both models' frequencies is taken, since either model may miss a mode where two modes hide each
        other.
        """
        mode = self.beams.interfering
        return min(mode.frequency if mode else np.inf, float(first_interfering(self.beams.mechanism)))


def chosen(task: LeafTask, candidates: Sequence[Candidate]) -> ChosenLeaves | None:
    """Return the softest geometry that meets all requirements by closed forms and by beams.

    Returns None if there is none.
    """
    needs, passed = requirements(task), []
    for geometry, excess in _in_order(task, needs, candidates):
        try:
            evaluation = evaluated(task, geometry)
        except BeamFailure as failure:
            passed.append(str(failure))
            continue
        choice = ChosenLeaves(geometry, evaluation, tuple(needs), excess, tuple(passed))
        clear = choice.frequency >= task.spec.safety.parasitic * task.crossover
        if clear and stays(task, evaluation) and bears(task, evaluation):
            return choice
        passed.append(f"beams: {evaluation.drive[0]:.4g} N/m, {choice.frequency:.4g} Hz")
    return None


def stays(task: LeafTask, by_beams: Evaluation) -> bool:
    """Tell whether the beam model confirms that friction holds the cart over the whole stroke.

    The force of the leaves at the end of the stroke, with its safety factor and tolerance, is at most the friction.
    """
    safety = task.spec.safety
    return bool(safety.breakaway * (1 + safety.stiffness_tolerance) * by_beams.forces[-1] <= task.friction)


def bears(task: LeafTask, by_beams: Evaluation) -> bool:
    """Tell whether, by the beam model, the leaves withstand fatigue and buckling under load."""
    safety = task.spec.safety
    swing = 0.0 if np.isnan(by_beams.fatigue_margin) else 1 / by_beams.fatigue_margin
    lasts = safety.fatigue * (swing + load_stress(by_beams.mechanism, task) / by_beams.mechanism.yield_strength) <= 1
    return bool(lasts and safety.buckling * buckling_share(by_beams.mechanism, task, by_beams.buckling) <= 1)


SIZE_STEP = 1e-4  # [m]
"""Step of sizes that a workshop makes."""


def _in_order(
    task: LeafTask, needs: list[Requirement], candidates: Sequence[Candidate]
) -> Iterator[tuple[Geometry, np.ndarray]]:
    """Yield leaf springs in whole sizes that meet the requirements by closed forms.

    The softest come first. Each geometry comes with the factor by which it uses up every requirement, shape
    (requirements,), at most 1.
    """
    enough = task.spec.safety.parasitic * task.crossover
    near = [candidate.geometry for candidate in candidates if candidate.frequency >= 0.98 * enough]
    sizes = list({geometry: None for start in near for geometry in round_geometries(task.spec, start, SIZE_STEP)})
    if not sizes:
        return
    judgement = evaluate_geometries(task, needs, sizes_of(sizes), [geometry.sheet for geometry in sizes])
    for k in np.argsort(judgement.stiffness):
        if np.all(judgement.excess[k] <= 1):
            yield sizes[k], judgement.excess[k]


def evaluated(task: LeafTask, geometry: Geometry) -> Evaluation:
    """Evaluate a geometry by the beam model.

    Raises BeamFailure if the model finds no solution.
    """
    return beams(mechanisms(task.flat, sizes_of([geometry]), [geometry.sheet]).member(0), task.stroke)


def confirmed(task: LeafTask, candidates: Sequence[Candidate]) -> Iterable[Confirmed]:
    """Evaluate some leaf springs of the front, evenly picked, by the beam model.

    Where the model finds no solution, the result holds the reason.
    """
    for k in np.unique(np.linspace(0, len(candidates) - 1, settings.confirmed_candidates).astype(int)):
        candidate = candidates[k]
        try:
            evaluation = evaluated(task, candidate.geometry)
        except BeamFailure as failure:
            yield Confirmed(candidate, np.nan, np.nan, str(failure))
            continue
        mode = evaluation.interfering
        yield Confirmed(candidate, float(evaluation.drive[0]), mode.frequency if mode else np.nan)
