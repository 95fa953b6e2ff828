"""Draw random machines around a stage file, and define the goal that they must meet.

Each machine is drawn with its move, within what is known of it. The goal says which parts may change; changes apply to
all machines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any
from zlib import crc32

import numpy as np
from scipy.constants import golden
from scipy.linalg import block_diag

from friso.equations.motion import size
from friso.errors import InputError, StageError
from friso.frequency.bode import COMFORTABLE_MARGIN
from friso.hunting import SEARCH_LIMITS
from friso.quantities import exactly
from friso.stage import Stage, numeric_keys
from friso.stage.arguments import MOST_SEED
from friso.stage.controllers import CONTROLLER, as_tuned
from friso.stage.correlations import Correlations, Sample, allowed_draws, draw
from friso.stage.rig import motion_of
from friso.stage.section import element_keys
from friso.stage.tables import BACKLASH, INERTIA, LEAD, MOTOR_FRICTION, MOTOR_MASS, RATIO, TRANSMISSION, motor_mass

FEWEST_MACHINES, MOST_MACHINES = 20, 100_000
"""Fewest machines, because fewer give no useful interval, and most, because more take hours."""


FRICTIONS = ("friction", MOTOR_FRICTION)
"""Tables of a friction law, whose keys have the same spreads."""


def _of_both(keys: Mapping[str, float]) -> dict[str, float]:
    """Return spreads of keys of a friction law for the friction of the guide and of the motor."""
    return {f"{table}.{key}": spread for table in FRICTIONS for key, spread in keys.items()}


SPREADS: Mapping[str, float] = MappingProxyType(
    {
        "masses.cart": 3.0,
        "masses.stage": 3.0,
        **_of_both(
            {
                "static": 30.0,
                "coulomb": 30.0,
                "viscous": 30.0,
                "stribeck_velocity": 50.0,
                "bristle_stiffness": 50.0,
                "bristle_damping": 50.0,
                "breakaway_deflection": 50.0,
                "attraction": 50.0,
            }
        ),
        MOTOR_MASS: 3.0,
        INERTIA: 3.0,
        f"{TRANSMISSION}.stiffness": 20.0,
        f"{TRANSMISSION}.damping": 50.0,
        BACKLASH: 50.0,
        "joint.stiffness": 5.0,
        "joint.damping": 50.0,
        "parasitic.frequency": 5.0,
        "parasitic.damping_ratio": 50.0,
        "rail.static_deviation": 30.0,
        "rail.coulomb_deviation": 30.0,
    }
)
"""Half-widths of the 95 % intervals [%] of keys for which the stage file has none.

friso chose them: friction as it differs between bearings of one type and preload, masses as weighed, bristles and
Stribeck velocity as uncertain as identification leaves them, a screw's stiffness as catalogues state it.
"""

ELEMENTS: Mapping[str, float] = MappingProxyType(_of_both({"element_stiffness": 50.0, "element_damping": 50.0}))
"""Half-widths of the 95 % intervals [%] of arrays for which the stage file has none. All elements of an array vary by
one common factor."""

SLIPS = tuple(f"{table}.breakaway_deflection" for table in FRICTIONS)
"""Keys of the deflection at which elasto-plastic bristles begin to slip. It is drawn as a fraction f of the deflection
of sliding, F_c/sigma_0, which it must not reach: the spread applies to f/(1 - f)."""

TINY_DEFLECTION = 1e-6
"""Factor on the slip deflection while the other keys are drawn, so that it excludes none of their values."""

TOGETHER, TOGETHER_BY = tuple((f"{table}.static", f"{table}.coulomb") for table in FRICTIONS), 0.8
"""Pairs of keys that both follow the preload, and their correlation if neither is uncertain in the file (friso's
choice)."""

HELD = (
    *(f"{CONTROLLER}.", "motion.", "drive.sample_time", "drive.velocity_sample_time", "drive.position_sample_time"),
    *("drive.delay", "drive.velocity_samples"),
)
"""Prefixes of keys that an engineer sets.

These keys are equal on all machines, even if the file calls them uncertain.
"""

FROM_LEAVES = ("joint.stiffness", "parasitic.")
"""Prefixes of keys that follow from leaf springs, if the stage has any."""


@dataclass(frozen=True)
class Machines:
    """Random machines drawn around a stage.

    `keys` that differ between machines are SI arrays of shape (count,). They come from a `sample` of the keys
    `from_file`, which the file calls uncertain, and of keys with default `spreads` [%].
    """

    keys: Mapping[str, np.ndarray]
    sample: Sample
    from_file: tuple[str, ...]
    spreads: Mapping[str, float]


def draw_machines(stage: Stage, correlations: Correlations, count: int, seed: int) -> Machines:
    """Draw `count` machines from a stage's uncertain keys, and from default spreads of others.

    Raises InputError for an invalid seed, and for ranges of which hardly any machine is valid.
    """
    if not 0 <= seed <= MOST_SEED:
        raise InputError("--seed", str(seed), f"a whole number from 0 to {MOST_SEED}", "--seed 1")
    flat, spreads = stage.flat(), _spreads(stage)
    sample = draw(_spread(stage, spreads), _with_default_correlations(correlations, spreads), count, seed)
    keys = {key: values for key, values in sample.keys.items() if not key.startswith(HELD)}
    if keys.keys() & {INERTIA, LEAD, RATIO}:
        keys[MOTOR_MASS] = np.asarray(motor_mass({**flat, **keys}))
    keys |= {slip: _slipping(flat, keys, slip) for slip in SLIPS if slip in spreads}
    return Machines(keys, sample, tuple(key for key in stage.uncertain() if key in keys), spreads)


def _spreads(stage: Stage) -> dict[str, float]:
    """Return the default spreads [%] of a stage's keys that are not 0 and not uncertain."""
    flat, uncertain = stage.flat(), stage.uncertain()
    follow = FROM_LEAVES if stage.flexure else ()
    single = {key: spread for key, spread in SPREADS.items() if key not in uncertain and not key.startswith(follow)}
    several = {
        key: spread
        for array, spread in ELEMENTS.items()
        for key in element_keys(flat, array)
        if not uncertain.keys() & {*element_keys(flat, array)}
    }
    if INERTIA in flat:  # the motor's mass follows from it
        single.pop(MOTOR_MASS, None)
    return {key: spread for key, spread in (single | several).items() if flat.get(key)}


def _slipping(flat: Mapping[str, Any], keys: Mapping[str, np.ndarray], slip: str) -> np.ndarray:
    """Return the deflections [m] at which the bristles of drawn machines begin to slip, the key `slip`.

    `flat` has the keys of the file's stage, and `keys` the drawn ones, arrays (count,).
    """
    table = slip.partition(".")[0]

    def most(values: Mapping[str, Any]) -> Any:
        weaker = 1 - np.abs(values.get(f"{table}.asymmetry", 0.0))
        return values[f"{table}.coulomb"] * weaker / values[f"{table}.bristle_stiffness"]

    share = flat[slip] / most(flat)
    odds = share / (1 - share) * keys[slip] / (TINY_DEFLECTION * flat[slip])
    return np.asarray(most({**flat, **keys}) * odds / (1 + odds))


def _spread(stage: Stage, spreads: Mapping[str, float]) -> Stage:
    """Return the stage with the `spreads` [%] written into its keys, as uncertainties."""
    flat = stage.flat()
    for slip in spreads.keys() & {*SLIPS}:
        flat[slip] *= TINY_DEFLECTION
    fields_of_keys = numeric_keys(flat)
    return stage.replace(
        {key: f"{flat[key]!r} {fields_of_keys[key].unit} +/- {part} %" for key, part in spreads.items()}
    )


def _with_default_correlations(correlations: Correlations, spreads: Mapping[str, float]) -> Correlations:
    """Return the user's correlations, joined by default ones for keys with default `spreads`.

    Static and Coulomb friction are correlated, and the elements of an array vary together.
    """
    arrays = [tuple(key for key in spreads if key.startswith(f"{array}.")) for array in ELEMENTS]
    levels = [pair for pair in TOGETHER if all(key in spreads for key in pair)]
    groups = [*((pair, TOGETHER_BY) for pair in levels), *((array, 1.0) for array in arrays if array)]
    if not groups:
        return correlations
    blocks = [np.where(np.eye(len(keys), dtype=bool), 1.0, by) for keys, by in groups]
    matrices = [correlations.matrix] if correlations.keys else []
    names = tuple(key for keys, _ in groups for key in keys)
    return Correlations((*correlations.keys, *names), np.asarray(block_diag(*matrices, *blocks)))


ACCELERATION = "motion.acceleration"

SPREAD_EVENLY = (golden - 1, np.sqrt(2) - 1)
"""Steps, modulo 1, of sequences that fill the range from 0 to 1 evenly at any length: the golden and the silver
section. Their continued fractions have the smallest terms, 1 and 2 (Kuipers, Niederreiter 1974, Sec. 2.3)."""

ADDED = int.from_bytes(b"joint")
"""Second half of Philox's key for the random numbers of a joint that is not in the stage file."""

HALF_WIDTHS = 1.959963984540054
"""Standard deviations in the half-width of a 95 % interval."""

ADDED_KEYS = ("joint.stiffness", "joint.damping")


SMALLEST_MOVE = 10.0
"""Smallest move without [moves], in tolerances. A stage in position hardly leaves its place for shorter ones."""


@dataclass(frozen=True)
class MoveRange:
    """The moves that machines make: sizes from `smallest` to `largest` [m].

    Sizes are uniform in the logarithm, and so are the `accelerations` [m/s^2], given as a range; None stands for the
    acceleration in the stage file.
    """

    smallest: float
    largest: float
    accelerations: tuple[float, float] | None = None

    @classmethod
    def of_stage(cls, stage: Stage, within: float) -> MoveRange:
        """Return the moves in [moves] of a stage file.

        Without that table, moves go from ten times the tolerance `within` [m] to the file's own move.
        """
        own, stated = float(size(stage.flat())), stage.moves
        if stated is None:
            return cls(min(own, SMALLEST_MOVE * within), own)
        low, high = stated.lowest_acceleration, stated.highest_acceleration
        accelerations = None if low is None or high is None else (float(low), float(high))
        return cls(float(stated.smallest), float(stated.largest), accelerations)

    def check(self, stage: Stage) -> None:
        """Check that the motion has time for the largest move at the lowest acceleration.

        Raises InputError if it has not.
        """
        flat = stage.flat()
        slow = {ACCELERATION: self.accelerations[0]} if self.accelerations and ACCELERATION in flat else {}
        moved = {**flat, **slow}
        try:
            largest = motion_of(flat).stretched(moved, self.largest / float(size(moved)))
            stage.with_numbers({key: float(value) for key, value in {**slow, **largest}.items()})
        except StageError as error:
            unit = stage.axis_kind.unit("m")
            least, most = exactly(self.smallest, unit), exactly(max(self.smallest, float(size(flat))), unit)
            actual = f"a largest move of {exactly(self.largest, unit)}"
            raise InputError("moves", actual, error.expected, f'"{least}..{most}"') from None


@dataclass(frozen=True)
class Fleet:
    """Machines drawn around a stage, as changes of its keys, all of shape (count,).

    `ratios` multiply a key on each machine, and `shifts` are added to keys that are 0. `sizes` [m] are the moves of the
    machines. `accelerations` [m/s^2] are those of the moves, None if all have the file's. `moves` is the range from
    which sizes and accelerations were drawn. `from_file` lists the keys that the file calls uncertain, and `spreads`
    [%] the default spreads of other keys. `left_out` counts invalid draws, which were replaced.
    """

    ratios: Mapping[str, np.ndarray]
    shifts: Mapping[str, np.ndarray]
    sizes: np.ndarray
    moves: MoveRange
    from_file: tuple[str, ...]
    spreads: Mapping[str, float]
    left_out: int = 0
    accelerations: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Return the number of machines."""
        return len(self.sizes)

    def take(self, numbers: np.ndarray) -> Fleet:
        """Return a fleet of the machines with these indices."""
        ratios, shifts = (
            {key: value[numbers] for key, value in column.items()} for column in (self.ratios, self.shifts)
        )
        faster = None if self.accelerations is None else self.accelerations[numbers]
        return replace(self, ratios=ratios, shifts=shifts, sizes=self.sizes[numbers], accelerations=faster)

    def laid_over(self, stage: Stage, changes: Mapping[str, Any], points: int) -> dict[str, Any]:
        """Return flat keys, such as friction.static with SI values, of all machines at all `points`.

        `changes` are the keys of the points, of shape (points,). All machines at the first point come first. The
        controller is tuned for the stage, not for the drawn machines.
        """
        flat = stage.flat()
        tuned = as_tuned(flat)
        for key, value in {**tuned, **changes}.items():
            flat[key] = np.repeat(np.broadcast_to(value, (points,)), self.count)
        for key, ratio in self._of(flat).items():
            flat[key] = flat[key] * np.tile(ratio, points)
        for key in self.shifts.keys() & flat.keys():
            flat[key] = flat[key] + np.tile(self.shifts[key], points)
        return {**flat, **self._motion(flat, points)}

    def drawn(self, stage: Stage) -> dict[str, np.ndarray]:
        """Return the keys of a stage that differ between the machines, with SI values, (count,).

        Keys that follow from leaf springs are not among them.
        """
        follow = FROM_LEAVES if stage.flexure else ()
        flat = {key: value for key, value in stage.flat().items() if not key.startswith(follow)}
        shifted = {key: flat[key] + shift for key, shift in self.shifts.items() if key in flat}
        return {**{key: flat[key] * ratio for key, ratio in self._of(flat).items()}, **shifted}

    def _motion(self, flat: Mapping[str, Any], points: int) -> dict[str, Any]:
        """Return the keys `flat` with the motion changed so that machines make their own moves.

        Changed keys are arrays with one value for each point and machine, the machines of the first point first.
        """
        faster = {} if self.accelerations is None else {ACCELERATION: np.tile(self.accelerations, points)}
        moved = {**flat, **{key: value for key, value in faster.items() if key in flat}}
        return {**moved, **motion_of(flat).stretched(moved, np.tile(self.sizes, points) / size(moved))}

    def _of(self, flat: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return by which factor each machine differs from the stage, as arrays (count,) by key.

        Only keys that the stage has are returned. Both parts of a split mass get the factor of the whole mass.
        """
        ratios = {key: ratio for key, ratio in self.ratios.items() if key in flat}
        masses = [key for key in self.ratios if key.startswith("masses.")]
        for key in ("masses.cart", "masses.stage"):
            if key in flat and key not in ratios and masses:
                ratios[key] = self.ratios[masses[0]]
        return ratios


def draw_fleet(
    stage: Stage, correlations: Correlations, count: int, seed: int, moves: MoveRange | None = None
) -> Fleet:
    """Draw machines around a stage as `friso compare` does, each with one of the `moves`.

    The first machine is the stage file's own, with its own move or the nearest one of the range. The other moves fill
    the range evenly. Without `moves`, all machines make the file's move. A joint that is not in the file varies by the
    default spreads.

    Raises InputError for an unusable number or seed, and if hardly any machine drawn is valid.
    """
    own = float(size(stage.flat()))
    moves = moves or MoveRange(own, own)
    sample, flat = draw_machines(stage, correlations, max(count, FEWEST_MACHINES), seed), stage.flat()
    keys = {key: values[:count] for key, values in sample.keys.items() if key in flat}
    ratios = {key: values / flat[key] for key, values in keys.items() if flat[key]}
    shifts = {key: values.copy() for key, values in keys.items() if not flat[key]}
    random = np.random.Generator(np.random.Philox(key=[seed, ADDED]))
    for key in ADDED_KEYS:
        spread = SPREADS[key] / 100 / HALF_WIDTHS * random.standard_normal(count)
        ratios.setdefault(key, np.maximum(1 + spread, 1 - SPREADS[key] / 100))
    if "rail.seed" in flat:
        shifts["rail.seed"] = np.arange(count, dtype=float)  # every machine has its own rail
    even = (random.random((2, 1)) + np.outer(SPREAD_EVENLY, np.arange(count))) % 1
    sizes = moves.smallest * (moves.largest / moves.smallest) ** even[0]
    sizes[0] = min(max(own, moves.smallest), moves.largest)
    accelerations = None
    if moves.accelerations is not None and ACCELERATION in flat:
        low, high = moves.accelerations
        accelerations = low * (high / low) ** even[1]
    for values in ratios.values():
        values[0] = 1.0
    for values in shifts.values():
        values[0] = 0.0
    left_out = sample.sample.left_out
    return Fleet(ratios, shifts, sizes, moves, sample.from_file, dict(sample.spreads), left_out, accelerations)


MOST_REDRAWN = 16
"""Most machines drawn, over the number wanted, to find those that every stage allows."""


def draw_common(
    stages: Sequence[Stage], correlations: Sequence[Correlations], count: int, seed: int
) -> tuple[Fleet, tuple[str, ...]]:
    """Draw `count` machines that are laid over each of several stages; none is a stage file's own.

    A key varies as the first stage that has it says, by the same factor in all: what files state differently stays
    different. Machines that one of the stages does not allow are replaced. Returns the machines, and the uncertain keys
    that an engineer sets, which do not vary.

    Raises InputError for an unusable seed, and if hardly any machine is allowed in all stages.
    """
    held = dict.fromkeys(key for stage in stages for key in stage.uncertain() if key.startswith(HELD))
    several, allowed = 1, np.zeros(0, bool)
    while several <= MOST_REDRAWN:
        fleets = [draw_fleet(stages[0], correlations[0], several * count + 1, seed)]
        for stage, own in zip(stages[1:], correlations[1:], strict=True):
            fleets.append(draw_fleet(stage, own, several * count + 1, _own_seed(stage, seed)))
        fleet = _joined(fleets, stages).take(np.arange(1, several * count + 1))
        allowed = np.all([allowed_draws(stage, fleet.drawn(stage), fleet.count)[0] for stage in stages], axis=0)
        if np.count_nonzero(allowed) >= count:
            return fleet.take(np.flatnonzero(allowed)[:count]), tuple(held)
        several *= 2
    text = f"draws of which {np.count_nonzero(allowed)} of {allowed.size} are allowed in all files"
    raise InputError("", text, "files that differ by less, or keys that are less uncertain")


def _own_seed(stage: Stage, seed: int) -> int:
    """Return the seed of the keys that only a further stage has.

    It follows from the names of its keys, so that the machines are the same whichever other stages are compared.
    """
    return (seed + crc32(" ".join(sorted(stage.flat())).encode())) % MOST_SEED


def _joined(fleets: Sequence[Fleet], stages: Sequence[Stage]) -> Fleet:
    """Return the first fleet, with keys that only further stages have as drawn for the first of these.

    The parts of a mass that a further stage splits follow the whole.
    """
    ratios, shifts = dict[str, np.ndarray](), dict[str, np.ndarray]()
    spreads, from_file = dict[str, float](), dict[str, None]()
    for fleet, stage in zip(fleets, stages, strict=True):
        new = {*stage.flat()} - {*ratios, *shifts}
        if any(key.startswith("masses.") for key in (*ratios, *shifts)):
            new = {key for key in new if not key.startswith("masses.")}
        ratios |= {key: values for key, values in fleet.ratios.items() if key in new}
        shifts |= {key: values for key, values in fleet.shifts.items() if key in new}
        spreads |= {key: spread for key, spread in fleet.spreads.items() if key in new}
        from_file |= dict.fromkeys(key for key in fleet.from_file if key in new)
    return replace(fleets[0], ratios=ratios, shifts=shifts, spreads=spreads, from_file=(*from_file,))


MEETING_SHARE = 0.95
"""Fraction of the machines, each with its own move, that must meet the goal."""


@dataclass(frozen=True)
class Goal:
    """The goal that a tuned machine must meet, and the parts that may change.

    A machine is in position `within` [m] of its reference. A fraction `share` (95 %) of machines and moves must be
    there `settle` [s] after the reference stands still; None means before the run ends. The actuator may use at most
    `force_limit` [N]; None means any force. The bandwidth must not exceed `bandwidth_limit` [Hz]; None means that only
    the stage file limits it.

    `moves` is the range of moves; None means those of the stage. The limit cases, and all states stuck under a bias
    force, must keep the modulus `margin`. The machine must not hunt at its bandwidth, nor at bandwidths up to the
    factor `distance` away. `controller` and `joint` are true if these parts may change.
    """

    within: float = 1e-6
    settle: float | None = None
    force_limit: float | None = None
    bandwidth_limit: float | None = None
    margin: float = COMFORTABLE_MARGIN
    distance: float = SEARCH_LIMITS.edge_distance
    share: float = MEETING_SHARE
    controller: bool = True
    joint: bool = True
    moves: MoveRange | None = None

    def moves_of(self, stage: Stage) -> MoveRange:
        """Return the moves that machines must make: the goal's, or else the stage's."""
        return self.moves or MoveRange.of_stage(stage, self.within)

    def surely(self, machines: int) -> float:
        """Return the fraction of a sample of machines that must meet the goal.

        This fraction is one standard error above the one required of all machines. Otherwise, half of the settings at
        the limit would pass.
        """
        return min(1.0, self.share + float(np.sqrt(self.share * (1 - self.share) / machines)))
