"""Prepare the stage that a design starts from: an isolator, leaf springs, a specification.

A rigid stage is split into cart and stage with a joint between them. The friction stays on the cart.

A first specification has ranges around the stage's own numbers, and leaves of sizes that are sold.

A joint of given stiffness and stroke gets leaf springs. Of all that fit, those are chosen whose first mode that
interferes with control lies highest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import product
from typing import Any

import numpy as np

from friso.axis import LINEAR
from friso.design_method.requirements import (
    BREAKAWAY,
    PARASITIC,
    SIZE_STEP,
    LeafTask,
    bears,
    evaluate_geometries,
    evaluated,
    evolved,
    requirements,
)
from friso.design_method.spec import SIZES, Geometry, Sheet, Spec, box, mechanisms, moved_along, read_spec, sheets
from friso.equations.bandwidth import least_breakaway
from friso.equations.controllers.pid import CROSSOVER, TUNED_MASS, controller_table
from friso.equations.motion import size
from friso.errors import InputError
from friso.frequency.bode import rigid_bandwidth
from friso.leaf_springs.beams import BeamFailure
from friso.leaf_springs.closed_forms import drive_stiffness, first_interfering, loaded_drive_stiffness
from friso.materials import materials
from friso.quantities import as_toml, exactly, percent
from friso.stage import Stage
from friso.stage.controllers import as_tuned
from friso.stage.stage import numeric_keys

FIRST_STROKE = 1e-3
"""Stroke [m] of the joint from which a search starts. `first_force_share` and `first_damping` of the settings give the
rest."""

STEEL_MODULUS = 190e9
"""Young's modulus of spring steel [Pa], the default for leaves and stops."""


STAGE_MASS_SHARE = 0.3
"""Fraction of the mass on the joint if the stage file has one mass. The thesis's rig has 0.29."""


def split(flat: Mapping[str, Any]) -> dict[str, float]:
    """Return the masses of cart and stage [kg]; a stage file with one mass has it divided."""
    masses = {key: flat[key] for key in ("masses.cart", "masses.stage") if key in flat}
    if len(masses) == 2:
        return masses
    (whole,) = masses.values()
    return {"masses.cart": (1 - STAGE_MASS_SHARE) * whole, "masses.stage": STAGE_MASS_SHARE * whole}


FIRST_FORCE_SHARE = 0.5
"""Force at the stroke over static friction from which a search starts. At 1 the cart moves before the joint."""

STOP_STIFFNESS = 0.1
"""Stiffness of the stop over Young's modulus times the stroke. The thesis's limiter has 0.105."""

FIRST_DAMPING = 0.05
"""Damping ratio from which a search starts, that of leaf springs with a little grease."""

STOP_DAMPING = 0.016
"""Damping ratio of the stop, that of the thesis's limiter with its stage."""


def isolated(stage: Stage, stroke: float = FIRST_STROKE, young: float = STEEL_MODULUS) -> Stage:
    """Return the stage with a free joint: its own joint, or one from which a search starts.

    The new joint has a stroke [m], and stops whose stiffness follows from Young's modulus `young` [Pa]. The controller
    stays tuned for the whole mass. Raises StageError if the result is not a valid stage.
    """
    free = stage.variants().get("free")
    if free is not None:
        return free
    flat = stage.flat()
    masses = split(flat)
    stiffness = FIRST_FORCE_SHARE * float(least_breakaway(flat)) / stroke
    stop = STOP_STIFFNESS * young * stroke
    numbers = {
        **masses,
        **as_tuned(flat),
        "joint.stiffness": stiffness,
        "joint.damping": 2 * FIRST_DAMPING * (stiffness * masses["masses.stage"]) ** 0.5,
        "joint.stroke": stroke,
        "joint.limiter_stiffness": stop,
        "joint.limiter_damping": 2 * STOP_DAMPING * (stop * masses["masses.stage"]) ** 0.5,
    }
    whole = stage.with_numbers({key: float(f"{value:.10g}") for key, value in numbers.items()})
    return whole.replace({"joint.locked": False}) if stage.joint else whole


JOINT = '[joint] locked = true, damping = "0.5 N*s/m", limiter_stiffness = "2e7 N/m", limiter_damping = "100 N*s/m"'

LIMITS = ("force_limit", "anti_windup", "anti_windup_time")
"""Keys of a controller that are kept when the controller is replaced by van Dijk's rules."""


def prepared(stage: Stage, spec: Spec) -> Stage:
    """Return the stage with a free joint of leaf springs as large and as thin as allowed.

    The leaf springs are a start, to be replaced. Masses, for which the controller is tuned, lie in the middle of their
    ranges. Points of the stage keep their distance from the leaf ends, and the load comes from the specification.
    Raises InputError for a stage that cannot have an isolator.
    """
    check_designable(stage)
    stage = complete_joint(by_rules(stage), spec)
    section = spec.leaves
    low, high = (min(map(float, section.thickness)), section.stroke.high)
    masses: dict[str, str | None] = {
        f"masses.{name}": exactly(mass.centre, "kg")
        for name in ("cart", "stage")
        if (mass := getattr(spec.masses, name)) is not None
    }
    if masses and "tuned_mass" in stage.controller.as_written():
        masses[TUNED_MASS] = None  # the controller follows the masses
    sizes = {f"flexure.{name}": exactly(section.space(name)[1], "m") for name in ("length", "width", "spacing")}
    leaves = {
        "flexure.leaves": section.leaves[0],
        "flexure.thickness": exactly(low, "m"),
        "flexure.material": section.materials[0],
        "joint.locked": False,
        "joint.stroke": exactly(high, "m"),
        CROSSOVER: exactly(spec.limit, "Hz"),
    }
    joint = stage.joint
    removed = {"joint.stiffness": None} if joint and joint.stiffness is not None else {}
    removed |= {"parasitic": None} if stage.parasitic else {}
    numbers = ("young", "poisson", "density", "yield", "fatigue")
    section = stage.flexure.as_written() if stage.flexure else {}
    removed |= {f"flexure.{key}": None for key in (*numbers, "load") if key in section}
    base = stage.replace(removed | masses | sizes | leaves | offset_points(stage, spec))
    return base.with_numbers(moved_along(stage.flat(), base.flat()["flexure.length"])) if section else base


def offset_points(stage: Stage, spec: Spec) -> dict[str, str]:
    """Return the key for the specified offset of actuator and sensor from mid-width.

    The result is empty if the stage states a place of actuator or sensor, or the specification no offset. Without an
    offset, neither would see a mode in which the stage turns about the leaves, which no real machine achieves.
    """
    points = {f"flexure.{point}_{axis}" for point in ("actuation", "sensor") for axis in "xyz"}
    if points & stage.flat().keys() or not spec.leaves.offset:
        return {}
    return {"flexure.actuation_y": exactly(spec.leaves.offset, "m")}


def by_rules(stage: Stage) -> Stage:
    """Return the stage with a controller by van Dijk's rules.

    A controller that follows these rules is kept. Otherwise a new one takes its place, with the same bandwidth for the
    whole mass and the same force limit.
    """
    if CROSSOVER in stage.flat():
        return stage
    written = stage.as_written()
    kept = {key: written["controller"][key] for key in LIMITS if key in written["controller"]}
    return Stage(**{**written, "controller": {**controller_table(f"{rigid_bandwidth(stage):.4g} Hz"), **kept}})


def complete_joint(stage: Stage, spec: Spec) -> Stage:
    """Return the stage with masses of cart and stage and a whole joint.

    What the stage file lacks, such as damping and limiter of the joint, is assumed.
    """
    if stage.joint is not None:
        return stage
    material = spec.leaves.materials[0]
    return isolated(stage, spec.leaves.stroke.high, materials()[material].young)


def assumed(stage: Stage, spec: Spec) -> dict[str, float]:
    """Return the masses and joint keys assumed for a stage without a joint, by key [SI]."""
    if stage.joint is not None:
        return {}
    before, after = stage.flat(), complete_joint(stage, spec).flat()
    keys = ("masses.cart", "masses.stage", "joint.damping", "joint.limiter_stiffness", "joint.limiter_damping")
    return {key: after[key] for key in keys if before.get(key) != after[key]}


def with_leaves(base: Stage, geometry: Geometry, stroke: float) -> Stage:
    """Return a prepared stage with leaf springs of a geometry and a stroke [m]."""
    name = f"{base.name}, with friction isolator" if base.name else "With friction isolator"
    moved = {key: f"{place * 1e3:.6g} mm" for key, place in moved_along(base.flat(), geometry.length).items()}
    return base.replace({"name": name, "joint.stroke": f"{stroke * 1e3:.6g} mm", **geometry.keys(), **moved})


def check_designable(stage: Stage) -> None:
    """Check that `friso design` can design an isolator for a stage.

    Raises InputError otherwise.
    """
    if stage.axis_kind != LINEAR:
        expected = '"linear": leaf springs guide along a line (friso tune gives any axis a joint)'
        raise InputError("axis.kind", as_toml(stage.axis_kind.name), expected, '[axis] kind = "linear"')
    if stage.joint is not None and stage.joint.damping is None:
        expected = "a [joint] with its damping and its limiter, or none; its stiffness follows from the design"
        raise InputError("joint", "no damping", expected, JOINT)
    if stage.friction is None or stage.friction.model == "none":
        raise InputError(
            "friction", "none", "friction, without which no isolator is needed", '[friction] model = "lugre" ...'
        )


STATIC, COULOMB = "friction.static", "friction.coulomb"

COMMENT = "   # "
"""Separator between a line and its comment."""

SPREAD = ("static", "coulomb", "stribeck_velocity", "bristle_stiffness", "viscous")


FRICTION_SPREAD = 0.3
"""Relative spread of friction, as in catalogues of bearings of one type."""

MASS_SPREAD = 0.05
"""Relative spread of masses, that of usual payloads."""

SHORTEST_MOVE = 0.1
"""Shortest move over the longest."""


def outline(stage: Stage) -> str:
    """Return the text of a specification with comments.

    The present crossover becomes the machine's limit. Ranges follow from uncertain keys of the stage file, or are
    assumed. Moves go up to the travel, and sheets are spring steel in usual gauges. Raises InputError for a stage that
    `friso design` cannot design for.
    """
    check_designable(stage)
    flat = stage.flat()
    limit = f"{by_rules(stage).flat()[CROSSOVER]:.4g}"
    friction = [_line(stage, f"friction.{name}", FRICTION_SPREAD) for name in SPREAD if flat.get(f"friction.{name}")]
    masses = [_line(stage, f"masses.{name}", MASS_SPREAD) for name in ("cart", "stage") if f"masses.{name}" in flat]
    both = masses if len(masses) == 2 else [f"# {line}; to be divided, unless both are given" for line in masses]
    travel, acceleration = _move(stage)
    own = flat.get("joint.stroke")
    stroke = f"{own / 2:.4g} m .. {own:.4g} m" if own else "0.3 mm .. 1 mm"
    name = f"name = {as_toml('Friction isolator of ' + (stage.name or 'the stage'))}\n\n"
    return name + _aligned(
        [
            "[machine]   # the highest crossover that it allows, by van Dijk's rules",
            f'crossover_limit = "{limit} Hz"   # the present one; or parasitic_frequencies = ["480 Hz"]',
            "",
            "[friction]   # ranges; a key left out stays as in the stage file",
            *friction,
            "",
            "[masses]",
            *both,
            "",
            "[moves]",
            f'travel = "{SHORTEST_MOVE * travel:g} m .. {travel:g} m"',
            f'acceleration = "{SHORTEST_MOVE * acceleration:g} m/s^2 .. {acceleration:g} m/s^2"',
            "",
            "[position]",
            'window = "1 um"   # in position: stays this close to the reference',
            '# settling_time = "1 s"   # what 95 % of the moves may take',
            "",
            "[load]   # at the leaf ends, beside the weight of the stage",
            'force_x = "0 N"   # along the leaves',
            'force_y = "0 N"   # along their width, as of a cable',
            "",
            "[leaves]   # what may be built",
            "leaves = 2",
            'length = "30 mm .. 70 mm"',
            'width = "15 mm .. 45 mm"',
            'spacing = "30 mm .. 60 mm"',
            'thickness = "0.1 mm .. 0.5 mm"   # standard gauges in this range, or a list of available sheets',
            'materials = ["stainless 1.4310"]',
            f'stroke = "{stroke}"   # the largest feasible one is chosen',
            'offset = "1 mm"   # of actuator and sensor from the middle of the width',
            "",
            "[safety]   # factors; those left out are the defaults",
            "hunting = 1.2   # crossover over the edge of hunting",
            "",
        ]
    )


def _aligned(lines: Sequence[str]) -> str:
    """Align the comments of lines below each other."""
    parts = [line.partition(COMMENT) for line in lines]
    widest = max(len(line) for line, _, comment in parts if comment)
    return "\n".join(f"{line:{widest}}{COMMENT}{comment}" if comment else line for line, _, comment in parts)


def _line(stage: Stage, key: str, share: float) -> str:
    """Return the line of a key with its range: the stage's own, or `share` to both sides.

    Coulomb friction does not exceed the static friction.
    """
    flat, own = stage.flat(), stage.uncertain().get(key)
    name, unit = key.split(".")[1], numeric_keys(flat)[key].unit
    low, high = (own.low, own.high) if own else ((1 - share) * flat[key], (1 + share) * flat[key])
    cut = ""
    if key == COULOMB and STATIC in flat:
        static = stage.uncertain().get(STATIC)
        most = static.high if static else (1 + share) * flat[STATIC]
        cut, high = ", up to the static friction" if high > most else "", min(high, most)
    why = ("as in the stage file" if own else f"assumed: {percent(share)} about the stage file's") + cut
    return f'{name} = "{low:.4g} {unit} .. {high:.4g} {unit}"   # {why}'


def _move(stage: Stage) -> tuple[float, float]:
    """Return travel [m] and acceleration [m/s^2] of the stage's motion, or 10 mm at 10 m/s^2."""
    flat = stage.flat()
    if flat["motion.kind"] != "there_and_back" or not flat["motion.acceleration"]:
        return 1e-2, 10.0
    rate = float(flat["motion.acceleration"])
    return float(size(flat)), rate


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


LEAVES_GENERATIONS = 60
"""Generations of the search for leaves. Fewer have not converged."""

LEAVES_SEED = 36
"""Seed of the search for leaves. A fixed one gives equal leaves for equal joints."""

LEAVES_POINTS = 20
"""Points for each of the three variables of a search for leaves. Fewer stay at the first thickness."""

HIGHEST_MODE = 1e6  # [Hz]
"""Frequency of leaves without a mode that both actuator and sensor see."""

WORST_COST = 1e3
"""Cost above that of any leaves that meet the requirements."""

WIDTH_STEPS = 5
"""Steps that adapt the width to the stiffness, to within a percent under any load."""

STIFFNESS_ERROR = 0.01
"""Relative error of the stiffness allowed for whole sizes."""


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

        minimum = evolved(cost, ends, LEAVES_GENERATIONS, LEAVES_SEED, LEAVES_POINTS)
        return np.asarray(minimum.x)

    def cost(self, spans: np.ndarray, bought: list[Sheet]) -> np.ndarray:
        """Return the cost of leaf springs by length and spacing [m], rows of (count, 2).

        `bought` has the sheet of each row. Leaves that break a requirement cost more, the farther they break it. For
        other leaves, the cost falls as the frequency of the first mode that interferes with control rises.
        """
        sizes = self.with_width(spans, bought)
        worst = self.broken(sizes, bought)
        frequency = np.minimum(first_interfering(mechanisms(self.task.flat, sizes, bought)), HIGHEST_MODE)
        return np.where(worst > 0, WORST_COST + worst, -np.log(frequency))

    def with_width(self, spans: np.ndarray, bought: list[Sheet]) -> np.ndarray:
        """Return lengths, widths and spacings [m], (count, 3), of leaves of the required stiffness."""
        sizes = np.insert(spans, 1, self.high[1], axis=1)
        for _ in range(WIDTH_STEPS):
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
        return np.where(np.isfinite(worst), worst, WORST_COST)

    def whole_sizes(self, best: np.ndarray) -> list[Geometry]:
        """Return leaf springs in whole sizes next to `best`, (3,), with the stiffness required.

        Only leaf springs that break no requirement are returned. First come those whose lowest mode that interferes
        with control has the highest frequency.
        """
        sheet = self.bought[int(best[2])]
        near = [np.round(np.exp(size) / SIZE_STEP + side) * SIZE_STEP for side in (-1, 0, 1) for size in best[:2]]
        spans = np.array([*product(near[::2], near[1::2])])
        bought = [sheet] * len(spans)
        sizes = self.with_width(spans, bought)
        sizes[:, 1] = np.round(sizes[:, 1] / SIZE_STEP) * SIZE_STEP
        built = mechanisms(self.task.flat, sizes, bought)
        inside = np.all((sizes > self.low - SIZE_STEP / 2) & (sizes < self.high + SIZE_STEP / 2), axis=1)
        right = np.abs(loaded_drive_stiffness(built) / self.stiffness - 1) < STIFFNESS_ERROR
        fits = inside & right & (self.broken(sizes, bought) <= np.log(1 + SIZE_STEP))
        order = np.argsort(-np.asarray(first_interfering(built)))
        return [Geometry.of(sizes[k], sheet) for k in order if fits[k]]
