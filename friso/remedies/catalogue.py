"""List the remedies with the keys that they change, the smallest change first.

Gains, bandwidth and joint are variables of an optimiser on logarithmic scales. Where nobody stated what the machine
allows, the speed of the advised controller is capped.

Linear loops of many machines are judged at once: which are stable, and with which margin.

The isolator suggested to a rigid stage that hunts comes from a survey of a few joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.design_method.prepare import isolated
from friso.equations.bandwidth import (
    bandwidth,
    breakaway,
    faster,
    least_breakaway,
    least_static_factor,
    sped_up,
    static_frictions,
    with_static_friction,
)
from friso.equations.motion import pieces
from friso.equations.settings import SETTINGS
from friso.errors import InputError
from friso.frequency.bode import COMFORTABLE_MARGIN, bandwidths_at, limits, loop_bandwidth, settled_margin
from friso.frequency.loops import Poles
from friso.frequency.margins import about_resonances, for_poles
from friso.frequency.system import limit_cases
from friso.hunting import find_attractors
from friso.quantities import exactly
from friso.remedies.machines import Goal
from friso.stage import Stage, numeric_keys
from friso.stage.controllers import FILTERS_KEY, controller_of, settings_of

CapReason = Literal["stated", "least", "sampling", "mode", "unknown"]
"""What caps the speed: the user's limit of the bandwidth, the least speed that works, the sampling of the drive, the
lowest mode, or that no mode is known."""


FASTER_THAN_LEAST = 1.3
"""Factor above the least speed that works up to which other remedies are searched, unless a limit of the bandwidth
is stated. Within it they cost the machine about as much as the least one."""


@dataclass(frozen=True)
class SpeedCap:
    """The largest `factor` by which a controller is made faster unasked, and the `reason` for it.

    No gain goes beyond that of the present controller made faster by the factor.
    """

    factor: float
    reason: CapReason

    def above(self, least: float) -> SpeedCap:
        """Return the cap once a controller that is `least` times as fast works, and nothing faster is needed."""
        if self.reason == "stated":
            return self
        return SpeedCap(min(self.factor, FASTER_THAN_LEAST * max(1.0, least)), "least")


LARGEST_SPEED_FACTOR = 10.0
"""Largest factor of the bandwidth. Beyond it the drive limits every machine."""

MODE_SHARE = 0.5
"""Largest bandwidth advised unasked, over the frequency of the lowest mode. Above it a mode that the file has
wrong by a little takes the margin, with or without a notch."""

FASTEST_UNASKED = 4.0
"""Largest factor on the controller's speed that is advised where nobody stated modes or a limit of the machine."""

SAMPLING_SHARE = 0.1
"""Largest bandwidth advised unasked, over the sampling rate. Above it the phase that sampling costs depends on when
the drive reads and writes, which files seldom tell."""


def speed_cap(stage: Stage, goal: Goal) -> SpeedCap:
    """Return how much faster a controller may become.

    The bandwidth of the loop may reach a fraction of the sampling rate or of the lowest mode, whichever is less; where
    no mode is known, a multiple of the present bandwidth. A cap never asks for a slower controller.
    """
    if goal.bandwidth_limit is not None:
        return SpeedCap(LARGEST_SPEED_FACTOR, "stated")
    flat, own = stage.flat(), loop_bandwidth(stage)
    caps, mode = [], flat.get("parasitic.frequency")
    if mode is not None and np.isfinite(own):
        caps.append(SpeedCap(MODE_SHARE * mode / own, "mode"))
    else:
        caps.append(SpeedCap(FASTEST_UNASKED, "unknown"))
    if (sample_time := flat.get("drive.sample_time")) and np.isfinite(own):
        caps.append(SpeedCap(SAMPLING_SHARE / sample_time / own, "sampling"))
    least = min(caps, key=lambda cap: cap.factor)
    return SpeedCap(min(max(1.0, least.factor), LARGEST_SPEED_FACTOR), least.reason)


FREQUENCIES_PER_DECADE, SLOWEST_FACTOR, FASTEST_FACTOR = 25, 0.1, 10.0
"""Frequencies at which loops are evaluated: per decade, apart from those near resonances; the lowest, over the slowest
pole; the highest, over the fastest pole, or half the sampling frequency."""

REFINEMENT_ROUNDS, REFINED_FREQUENCIES = 2, 9
"""Refinements of the frequency at which a loop comes closest to -1, and number of frequencies in each."""


def linear_flat(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys from which the linear loops of machines are computed, with SI values.

    `flat` has the machines' keys. The drive's loop for the motor current has the bandwidth of the `stage` on all
    machines. The ratio of true to assumed motor constant becomes a factor of the controller's gains. The cable is left
    out.
    """
    current_loop = {key: value for key, value in stage.flat().items() if key == "drive.current_bandwidth"}
    ratio, controller = flat.get("drive.motor_constant_ratio", 1.0), controller_of(flat)
    return {**flat, **{key: ratio * flat[key] for key in map(controller.key, controller.loop_gain)}, **current_loop}


@dataclass(frozen=True)
class LoopRobustness:
    """Stability and margin of the linear loop of each machine, arrays of shape (count,).

    `stable` is true if the loop is stable in all limit cases of the joint and the friction. `margin` is the least
    modulus margin among the cases, 0 if it is not stable.
    """

    stable: np.ndarray
    margin: np.ndarray


def linear_loops(stage: Stage, flat: Mapping[str, Any], count: int) -> LoopRobustness:
    """Return stability and margin of machines' linear loops, in the limit cases of a stage.

    `flat` has the machines' keys, such as "masses.cart", with SI numbers or arrays (count,).
    """
    stable, margin = np.ones(count, bool), np.full(count, np.inf)
    for limit_case in limit_cases(stage.flat()).values():
        for which, (settles, distance) in for_poles(flat, limit_case.repeated(count), _robustness):
            stable[which] &= settles
            margin[which] = np.minimum(margin[which], distance)
    return LoopRobustness(stable, np.where(stable, margin, 0.0))


def _robustness(loops: Poles) -> tuple[np.ndarray, np.ndarray]:
    """Return which loops are stable, and the least distance of each from -1, both (loops,)."""
    size, rows = np.abs(loops.continuous), np.arange(len(loops.closed))
    low = SLOWEST_FACTOR * float(np.median(size.min(axis=1)))
    high = min(loops.drive.highest, FASTEST_FACTOR * float(size.max()))
    even = np.geomspace(low, high, int(FREQUENCIES_PER_DECADE * np.log10(high / low)) + 2)
    resonant = np.nan_to_num(about_resonances(loops), nan=high)
    omega = np.sort(np.concatenate([np.broadcast_to(even, (len(rows), len(even))), resonant], axis=1), axis=1)
    distance = loops.distance(omega)
    for _ in range(REFINEMENT_ROUNDS):
        closest = distance.argmin(axis=1)
        before, after = (omega[rows, np.clip(closest + step, 0, omega.shape[1] - 1)] for step in (-1, 1))
        omega = np.linspace(before, after, REFINED_FREQUENCIES, axis=1)
        distance = loops.distance(omega)
    return loops.abscissa < 0, distance.min(axis=1)


KeyChanges = Callable[[Mapping[str, Any], np.ndarray], dict[str, Any]]
"""Function that takes the keys so far, in SI, and values of a variable, and returns the keys that change."""

BANDWIDTH = "bandwidth"
"""Name of the variable that makes the whole controller faster."""


DAMPING_RATIOS = (0.01, 0.3)
"""Range of damping ratios of the stage on its joint."""


SNAP_SHARE = 0.02
"""Relative difference from the present number below which the present number is kept."""


@dataclass(frozen=True)
class Variable:
    """A number between `low` and `high` (SI) on a logarithmic scale.

    Close to the `present` value, the number takes exactly that value; NaN means that there is none.
    """

    name: str
    low: float
    high: float
    change: KeyChanges
    present: float = float("nan")

    def at(self, share: np.ndarray) -> np.ndarray:
        """Return the values at coordinates from 0 to 1 over the range."""
        value = np.asarray(self.low * (self.high / self.low) ** share)
        return np.where(np.abs(share - self.share(self.present)) < SNAP_SHARE, self.present, value)

    def share(self, value: float) -> float:
        """Return the coordinate, from 0 to 1 over the range, of a value."""
        return float(np.log(value / self.low) / np.log(self.high / self.low))


def of_key(key: str, low: float, high: float) -> Variable:
    """Return a key of the stage file as a variable between `low` and `high`."""
    return Variable(key, low, high, lambda flat, value: {key: value})


LEAST_SPEED_FACTOR = 0.3
"""Smallest factor of the bandwidth. A slower loop does not settle within the move."""


def bandwidth_factor(present: float = float("nan")) -> Variable:
    """Return the bandwidth of the whole controller as a variable: a factor on the present one."""
    return Variable(BANDWIDTH, LEAST_SPEED_FACTOR, LARGEST_SPEED_FACTOR, sped_up, present)


GAIN_FACTOR = 4.0
"""Factor by which relative gains vary either way."""


def gains(stage: Stage) -> tuple[Variable, ...]:
    """Return as variables the numbers that shape the controller, then its bandwidth."""
    flat, controller = stage.flat(), controller_of(stage.flat())
    shape = [of_key(controller.key(name), low, high) for name, (low, high) in controller.shaped_by.items()]
    keys = [controller.key(name) for name in controller.speeds_up if flat.get(controller.key(name))]
    against = [of_key(key, flat[key] / GAIN_FACTOR, flat[key] * GAIN_FACTOR) for key in keys[1:]]
    return (*shape, *against, bandwidth_factor())


JOINT_STROKES = (1e-5, 3e-3)  # [m]
"""Shortest and longest stroke of a joint. Shorter ones isolate nothing; longer ones are not leaf springs."""

JOINT_FORCE_SHARE = (0.2, 0.8)
"""Least and largest force of a joint at its stroke, over static friction. With more the cart moves first; with less
the joint hardly guides."""


def joint_variables(friction: float) -> tuple[Variable, ...]:
    """Return stroke, stiffness and damping of an isolator as variables.

    The ranges of the variables follow from the least static `friction` [N].
    """

    def stiffness(flat: Mapping[str, Any], share: np.ndarray) -> dict[str, Any]:
        return {"joint.stiffness": share * friction / flat["joint.stroke"]}

    def damping(flat: Mapping[str, Any], ratio: np.ndarray) -> dict[str, Any]:
        return {"joint.damping": 2 * ratio * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])}

    return (
        of_key("joint.stroke", *JOINT_STROKES),
        Variable("force of the joint at its stroke", *JOINT_FORCE_SHARE, stiffness),
        Variable("damping ratio of the joint", *DAMPING_RATIOS, damping),
    )


NOTCH_WIDTHS, NOTCH_DEPTH = (0.1, 1.5), 0.9
"""Range of the width of a notch over its frequency, and the depth of the notch."""


TYPED_DIGITS = 4
"""Significant digits of tuned numbers, in the units of the file. Fewer cost margin by rounding."""


@dataclass(frozen=True)
class Remedy:
    """A remedy: its `name`, the stage from which it starts, and the variables it changes.

    `buys_joint` is true if it needs a joint; otherwise only the controller changes. `makes` names the remedy whose
    joint this remedy builds from leaf springs. No gain goes beyond that of the present controller made `fastest` times
    as fast.
    """

    name: str
    stage: Stage
    variables: tuple[Variable, ...]
    buys_joint: bool = False
    makes: str = ""
    fastest: float = np.inf

    def changes(self, shares: np.ndarray) -> dict[str, Any]:
        """Return the changed keys at points of the search, shape (points, variables).

        `shares` are the points, by coordinates from 0 to 1 over the range of each variable. Each key has an array of
        shape (points,).
        """
        flat, changed = self.stage.flat(), dict[str, Any]()
        for variable, share in zip(self.variables, shares.T, strict=True):
            change = variable.change({**flat, **changed}, variable.at(share))
            changed |= change
        return {**changed, **self._capped(flat, changed)}

    def _capped(self, flat: Mapping[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
        """Return the changed gains that the stage `flat` has already, none faster than allowed."""
        if np.isinf(self.fastest):
            return {}
        most = {key: value for key, value in sped_up(flat, self.fastest).items() if key in changed and value}
        return {
            key: (np.minimum if value > flat[key] else np.maximum)(changed[key], value) for key, value in most.items()
        }

    def up_to(self, cap: SpeedCap) -> Remedy:
        """Return the remedy with all gains, and the range of the bandwidth, within a cap of the speed."""
        if cap.reason == "stated":
            return self
        variables = (
            replace(one, high=max(cap.factor, one.low)) if one.name == BANDWIDTH else one for one in self.variables
        )
        return replace(self, variables=(*variables,), fastest=cap.factor)

    @property
    def verifiable(self) -> bool:
        """Tell whether limit cycles can verify the remedy: not if dither keeps the stage moving."""
        return "dither_amplitude" not in settings_of(self.stage.flat())

    @property
    def of_setting(self) -> bool:
        """Tell whether the remedy is one setting against friction, with the present gains."""
        return self.name in {setting.name for setting in SETTINGS.values()}

    @classmethod
    def settled_on(cls, name: str, stage: Stage, buys_joint: bool = False) -> Remedy:
        """Return a remedy that consists of one finished stage, without variables.

        `buys_joint` is true if the stage has a new joint.
        """
        return cls(name, stage, (), buys_joint)

    def tuned(self, shares: np.ndarray) -> Stage:
        """Return the stage at a point of the search, `shares` with coordinates 0 to 1, (variables,).

        Numbers are rounded in the units of the file; those that do not change stay as they are written.
        """
        changed = self.changes(shares[None])
        numbers = {key: float(values[0]) for key, values in changed.items()}
        return self.stage.with_rounded(numbers, TYPED_DIGITS)


def remedies(stage: Stage, goal: Goal, drive: Stage | None = None) -> list[Remedy]:
    """Return the remedies that a goal and the cap of the speed allow, from the smallest change to the largest.

    The sampling that caps the speed is that of the stage `drive`, by default `stage` itself.
    """
    listed: list[Remedy] = []
    if goal.controller:
        listed += [Remedy(BANDWIDTH, stage, (bandwidth_factor(1.0),)), *_gains("gains", stage)]
        listed += [*_notch(stage, goal), *_against_friction(stage, goal), *_structures(stage)]
    if goal.joint and least_breakaway(stage.flat()) > 0:
        listed += _isolators(stage, goal)
    cap = speed_cap(drive or stage, goal)
    return [remedy.up_to(cap) for remedy in listed]


def with_bandwidth(remedy: Remedy) -> Remedy:
    """Return a remedy that also varies the bandwidth."""
    faster = replace(bandwidth_factor(), high=min(remedy.fastest, LARGEST_SPEED_FACTOR))
    return replace(remedy, name=f"{remedy.name}, and bandwidth", variables=(*remedy.variables, faster))


def _gains(name: str, stage: Stage, first: tuple[Variable, ...] = (), buys_joint: bool = False) -> list[Remedy]:
    """Return the remedy that varies all gains, after the variables `first`, in a list.

    The list is empty if the bandwidth would be the only variable. `buys_joint` is true if the remedy needs a new joint.
    """
    several = (*first, *gains(stage))
    return [Remedy(name, stage, several, buys_joint)] if len(several) > 1 else []


def _notch(stage: Stage, goal: Goal) -> Iterator[Remedy]:
    """Yield a remedy with a notch at the parasitic mode, if there is such a mode.

    Nothing is yielded if a faster controller reaches the goal's bandwidth limit without a notch, or if the stage takes
    no further filter.
    """
    flat = stage.flat()
    if "parasitic.frequency" not in flat or _reaches(stage, goal):
        return
    frequency = flat["parasitic.frequency"]
    filters = [*stage.as_written()["controller"].get("filters", [])]
    notch = {
        "kind": "notch",
        "frequency": exactly(frequency, "Hz"),
        "width": exactly(frequency / 2, "Hz"),
        "depth": NOTCH_DEPTH,
    }
    try:
        with_notch = stage.replace({FILTERS_KEY: [*filters, notch]})
    except InputError:  # the file has as many filters as are allowed
        return
    key = f"{FILTERS_KEY}.{len(filters) + 1}.width"
    width = of_key(key, NOTCH_WIDTHS[0] * frequency, NOTCH_WIDTHS[1] * frequency)
    yield Remedy("notch at the parasitic mode, and bandwidth", with_notch, (width, bandwidth_factor()))


def _reaches(stage: Stage, goal: Goal) -> bool:
    """Tell whether a faster controller reaches the bandwidth limit with the margin required.

    The answer is False if the goal has no such limit.
    """
    if goal.bandwidth_limit is None or goal.margin > COMFORTABLE_MARGIN:
        return False
    flat = stage.flat()
    highest, own = limits(linear_flat(stage, flat)).highest_comfortable, bandwidth(flat) or 1.0
    return highest is not None and bool(bandwidths_at(stage, [highest / own])[0] >= goal.bandwidth_limit)


def _structures(stage: Stage) -> Iterator[Remedy]:
    """Yield remedies with other structures of the stage's controller, varying all gains."""
    flat = stage.flat()
    stands = not pieces(flat, 1)[..., 2:].any()  # a jump of the reference, or a release
    for name, changes in controller_of(flat).structures(flat).items():
        if stands and all(key.endswith("_feedforward") for key in changes):
            continue
        try:
            other = _restructured(stage, changes)
        except InputError:  # for instance an uncertain key that the other structure lacks
            continue
        yield from _gains(name, other)


def _restructured(stage: Stage, changes: Mapping[str, Any]) -> Stage:
    """Return a stage with changed keys of its controller.

    Changes are numbers [SI], texts, or None to remove a key.
    """
    numbers = {key: value for key, value in changes.items() if isinstance(value, float)}
    keys = numeric_keys({key: value for key, value in {**stage.flat(), **changes}.items() if value is not None})
    texts = {key: exactly(value, keys[key].unit) if keys[key].unit else value for key, value in numbers.items()}
    return stage.replace({**changes, **texts})


def _against_friction(stage: Stage, goal: Goal) -> Iterator[Remedy]:
    """Yield each unused setting against friction, as a remedy of its own."""
    flat = stage.flat()
    if breakaway(flat) <= 0:
        return
    integrates = controller_of(flat).integrates(flat)
    for setting in SETTINGS.values():
        ranges = setting.ranges(flat, goal.within) if integrates or not setting.integral else {}
        if ranges and not any(key in flat for key in ranges):
            numbers = {key: float(np.sqrt(low * high)) for key, (low, high) in ranges.items()}
            keys = tuple(of_key(key, *ends) for key, ends in ranges.items())
            yield Remedy(setting.name, stage.with_numbers(numbers), keys)


def _isolators(stage: Stage, goal: Goal) -> Iterator[Remedy]:
    """Yield the isolators as remedies: one with the present gains, one with changed gains.

    Leaf springs of the stage file are replaced by a joint with plain numbers. Nothing is yielded for a stage that
    cannot have a free joint.
    """
    try:
        free = isolated(stage)
    except InputError:
        return
    flat = free.flat()
    if free.flexure:
        kept = {key: flat[key] for key in flat if key.startswith(("joint.stiffness", "parasitic."))}
        free = free.with_numbers(kept, without=("flexure",))
    joint = joint_variables(float(least_breakaway(flat)))
    yield Remedy("isolator", free, joint, True)
    if goal.controller:
        yield from _gains("isolator and gains", free, joint, True)


DAMPING = (0.05, DAMPING_RATIOS[1])
"""Damping ratios that are tried for a suggested joint."""


@dataclass(frozen=True)
class Suggestion:
    """A joint tried in a rigid stage, and the `stage` with that joint.

    `settles` is true if the stage does not hunt, neither as it is, nor with its bandwidth divided by `Goal.distance`,
    nor with static friction multiplied or divided by it, down to Coulomb friction. `margin` is the least modulus margin
    of the limit cases, and of all states stuck under a bias force. If no joint settles, this is the last one tried.
    """

    stage: Stage
    settles: bool
    margin: float


SUGGESTED_STROKES = (1e-4, 3e-4, 1e-3, 3e-3)  # [m]
"""Strokes tried for a suggested joint, the shortest first. Longer ones are not leaf springs."""


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def suggestion(stage: Stage) -> Suggestion | None:
    """Return the isolator with the shortest of a few strokes that settles a stage.

    At full stroke, an isolator pushes with a fixed fraction of static friction, so that the cart does not move. If none
    settles the stage, the last one tried is returned. Returns None for a stage that has a joint or cannot have one.
    """
    if stage.joint:
        return None
    friction = float(least_breakaway(stage.flat()))
    if friction <= 0:
        return None
    try:
        free = isolated(stage)
    except InputError:
        return None
    remedy, tried = (
        Remedy("", free, joint_variables(friction), True),
        [(stroke, d) for stroke in SUGGESTED_STROKES for d in DAMPING],
    )
    shares = np.array([_shares(remedy, stroke, damping) for stroke, damping in tried])
    numbers = remedy.changes(shares)
    flat = {**free.flat(), **numbers, "motion.kind": "release"}  # only attractors matter, not the motion
    attracts = np.zeros(len(tried), bool)
    machines = [flat, faster(flat, 1 / Goal.distance)]
    if static_frictions(flat):
        factors = max(1 / Goal.distance, least_static_factor(flat)), Goal.distance
        machines += [with_static_friction(flat, factor) for factor in factors]
    for machine in machines:
        attracted = find_attractors(machine, len(tried), close_orbits=False)
        attracts |= attracted.attracts | ~attracted.certain
    for number in np.flatnonzero(~attracts):
        settled = remedy.tuned(shares[number])
        margin = settled_margin(settled.flat())
        if margin > 0:
            return Suggestion(settled, True, margin)
    return Suggestion(remedy.tuned(shares[-1]), False, 0.0)


SUGGESTED_FORCE = 0.6
"""Force of a suggested joint at its stroke, over static friction. With more, the cart of weak machines moves first.
"""


def _shares(remedy: Remedy, stroke: float, damping: float) -> list[float]:
    """Return coordinates, from 0 to 1, of a joint's stroke [m], force and damping ratio.

    The scale is logarithmic. The force is `RemedySettings.suggested_force`.
    """
    wanted = (stroke, SUGGESTED_FORCE, damping)
    return [
        float(np.log(value / variable.low) / np.log(variable.high / variable.low))
        for value, variable in zip(wanted, remedy.variables, strict=True)
    ]
