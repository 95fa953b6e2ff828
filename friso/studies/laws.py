"""Judge a stage under each friction law that keeps its measured friction.

A law is converted to another that keeps what was measured, and the losses are reported. Hysteresis loops over a slow
motion to and fro, before sliding, are among what is compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from friso.engine.batch import Inputs, run_driven
from friso.engine.kernel import KernelRequest, kernel, kernels
from friso.equations.bandwidth import bandwidth
from friso.equations.friction.common import MeasuredFriction
from friso.equations.imposed import Dragged
from friso.errors import InputError
from friso.frequency.system import steady_force
from friso.hunting import LONG_RUN_RTOL, Case, CheckPart, check, needed_kernels
from friso.hunting.criteria import ATTRACTED
from friso.progress import Progress, silent
from friso.quantities import exactly
from friso.stage import Stage
from friso.stage.section import list_fields, numeric_fields
from friso.stage.tables import FrictionSection, friction_law, friction_laws, passive_where


@dataclass(frozen=True)
class HysteresisLoop:
    """A loop of force over displacement.

    The loop encloses the `area` [J], the energy lost in one period. `stiffness` [N/m] is the difference of the forces
    at both ends, divided by the difference of the displacements.
    """

    area: float
    stiffness: float


POINTS_OF_A_LOOP = 1000
"""Samples of a period of a hysteresis loop. Fewer cut its corners."""

LOOP_PERIODS = 3
"""Periods of a hysteresis loop, of which the last counts. Fewer still drift."""

LOOP_TOLERANCE = 1e-6
"""Relative tolerance of the solver along a loop, below the last digit of the table."""


def hysteresis_loop(flat: Mapping[str, Any], amplitude: float, speed: float) -> HysteresisLoop:
    """Compute the last of several hysteresis loops of a stage's friction law.

    `flat` has the stage's keys. A body is moved back and forth by the `amplitude` [m] at a steady `speed` [m/s], from
    rest with unbent bristles.
    """
    law, points = flat["friction.model"], POINTS_OF_A_LOOP
    shape = kernel(Dragged(law, friction_law(law).variant(flat)))
    # first a quarter, then whole loops from one end, as triangles with the same speed throughout
    phase = np.arange(points // 4 + LOOP_PERIODS * points + 1) / points
    place = amplitude * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * phase))
    inputs = Inputs(place, np.zeros(len(place)), 4 * amplitude / speed / points)
    starts = np.zeros((1, shape.initial_size))
    starts[:, shape.velocity] = inputs.velocity[0]
    (run,) = run_driven(shape, {**flat, "motion.duration": 1.0}, 1, inputs, starts, LOOP_TOLERANCE)
    force = np.diff(run.states[0, :, -1]) / inputs.sample_time
    last, moved = force[-points:], np.diff(place)[-points:]
    middles = (place[1:] + place[:-1])[-points:] / 2
    ends = int(middles.argmax()), int(middles.argmin())
    stiffness = (last[ends[0]] - last[ends[1]]) / (middles[ends[0]] - middles[ends[1]])
    return HysteresisLoop(float(np.sum(last * moved)), float(stiffness))


ELEMENTS_IN_PARALLEL = 6
"""Number of elements of a law that has several."""

UNCHANGED_SHARE = 1e-6
"""Relative difference below which a number counts as unchanged."""

COMPARED_SPEEDS = np.geomspace(1e-2, 1e3, 201)
"""Speeds, in Stribeck velocities, at which steady friction is compared."""


MeasuredKind = Literal[
    "curve", "static", "stiffness", "virgin", "damping", "viscous", "conditions", "loop area", "loop stiffness"
]
"""Measured quantities of friction.

They are steady friction over speed, break-away, stiffness before sliding, the virgin curve (force over displacement
from rest), damping at rest, and viscous damping. Then come the conditions under which they were taken. Last are the
energy lost in a hysteresis loop before sliding, and the loop's stiffness from end to end.
"""


@dataclass(frozen=True)
class MeasuredChange:
    """The change of a measured quantity by the conversion of a friction law.

    `off` is the error by the conversion: relative to static friction for curves, and relative to the number itself for
    numbers. An error of at most `allowed` counts as none.
    """

    kind: MeasuredKind
    off: float
    allowed: float = UNCHANGED_SHARE

    @property
    def kept(self) -> bool:
        """Tell whether the conversion keeps the measured quantity, within the allowed error."""
        return self.off <= self.allowed


@dataclass(frozen=True)
class LawConversion:
    """A stage converted to another friction law, and how its measured friction changed.

    `compared` has the changes of the measured quantities, and `open` the ranges [SI] of the keys that the measurements
    leave open. `active` names the condition of passivity that the law violates ("" if it is passive).
    """

    stage: Stage
    compared: tuple[MeasuredChange, ...]
    open: Mapping[str, tuple[float, float]]
    active: str

    @property
    def law(self) -> str:
        """Return the name of the law to which the stage was converted."""
        return self.stage.flat()["friction.model"]

    @property
    def lost(self) -> tuple[MeasuredChange, ...]:
        """Return the measured quantities that the conversion does not keep."""
        return tuple(item for item in self.compared if not item.kept)


def convertible() -> list[str]:
    """Return the laws to which friction can be converted, in alphabetical order."""
    return sorted(name for name, law in friction_laws().items() if law.keeping is not FrictionSection.keeping)


def measure_friction(flat: Mapping[str, Any]) -> MeasuredFriction:
    """Compute what measurements would show of a stage's friction in forward motion.

    `flat` has the stage's keys, such as "friction.static", and their SI values. Raises InputError for a friction law
    that cannot say what would be measured.
    """
    name = flat["friction.model"]
    law = friction_law(name)
    if law.shown is FrictionSection.shown:
        actual = (
            "no friction at the guide" if name == "none" else f'"{name}", which does not declare what is measured of it'
        )
        raise InputError("friction.model", actual, f"one of {', '.join(convertible())}", 'model = "lugre"')
    return law.shown(flat)


def convert(stage: Stage, law: str) -> LawConversion:
    """Replace the friction law of a stage by another, `convertible` one that measurements can hardly tell apart.

    Raises InputError for a stage whose own law does not stick.
    """
    before = measure_friction(stage.flat())
    if not before.stiffness:
        actual = f'"{stage.flat()["friction.model"]}", which does not stick: it has no stiffness before sliding to keep'
        raise InputError("friction.model", actual, "a law that sticks", 'model = "lugre"')
    made = friction_law(law)
    converted = with_friction(stage, law, made.keeping(before, ELEMENTS_IN_PARALLEL))
    return compared(stage, converted, made.left_open(before))


def with_friction(stage: Stage, law: str, keys: Mapping[str, Any]) -> Stage:
    """Return the stage with another friction law and that law's keys [SI].

    If some of its friction is unknown, all of the new law's is.
    """
    of_friction = ("friction" if key.startswith("friction.") else key for key in stage.unknown_keys)
    unknown = {"unknown": ", ".join(dict.fromkeys(of_friction))} if stage.unknown_keys else {}
    return stage.replace({"friction": _table(stage, law, keys), **unknown})


def compared(
    source: Stage, made: Stage, left_open: Mapping[str, tuple[float, float]] = MappingProxyType({})
) -> LawConversion:
    """Compare the friction of a converted stage, `made`, with that of the stage before, `source`.

    `left_open` are the ranges [SI] of the keys that measurements leave open in the new stage.
    """
    flat = made.flat()
    before, after = measure_friction(source.flat()), measure_friction(flat)
    items = (
        _curve(source, made, before),
        _number("static", before.levels.static, after.levels.static),
        _number("stiffness", before.stiffness, after.stiffness),
        _virgin_change(before, after),
        _number("damping", before.damping, after.damping),
        _number("viscous", before.levels.viscous, after.levels.viscous),
        *(_loops(source, made, before) if before.stiffness and after.stiffness else ()),
    )
    return LawConversion(made, items, left_open, passive_where(flat))


LOOP_SPEED = 1e-3
"""Speed of a loop in Stribeck velocities. Faster loops lose energy in the damping of bristles, which is reported
separately."""

LOOP_AMPLITUDES = (0.1, 0.5)
"""Amplitudes of loops, in units of static friction over initial stiffness: one with hardly any slip, one with
slip."""

LOOP_ERROR = 0.05
"""Relative difference of loop areas or stiffnesses that a log hardly shows."""


def _loops(source: Stage, made: Stage, before: MeasuredFriction) -> Iterator[MeasuredChange]:
    """Yield the changes of slow hysteresis loops between both laws: of their area and stiffness.

    The loops have fractions of the deflection at break-away as amplitudes.
    """
    deflection, speed = before.levels.static / before.stiffness, LOOP_SPEED * before.levels.stribeck_velocity
    for share in LOOP_AMPLITUDES:
        old, new = (hysteresis_loop(stage.flat(), share * deflection, speed) for stage in (source, made))
        yield _number("loop area", old.area, new.area, LOOP_ERROR)
        yield _number("loop stiffness", old.stiffness, new.stiffness, LOOP_ERROR)


def _table(stage: Stage, law: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table [friction] of a stage file for a law and its keys [SI].

    Values are written in the units of the stage's axis.
    """
    cls, kind = friction_law(law), stage.axis_kind
    table: dict[str, Any] = {"model": law}
    for name, field in numeric_fields(cls).items():
        if f"friction.{name}" in keys:
            table[name] = _text(float(keys[f"friction.{name}"]), getattr(field.on(kind), "unit", ""))
    for name, several in list_fields(cls).items():
        values = [value for key, value in keys.items() if key.startswith(f"friction.{name}.")]
        if values:
            table[name] = [_text(float(value), getattr(several.on(kind).of, "unit", "")) for value in values]
    return table


def _text(value: float, unit: str) -> Any:
    """Return a value as text with this unit for a stage file, which reads back exactly."""
    return exactly(value, unit) if unit else value


def _number(kind: MeasuredKind, before: float, after: float, allowed: float = UNCHANGED_SHARE) -> MeasuredChange:
    size = max(abs(before), abs(after)) or 1.0
    return MeasuredChange(kind, abs(after - before) / size, allowed)


def _curve(source: Stage, made: Stage, before: MeasuredFriction) -> MeasuredChange:
    """Return the change of steady friction, at the speed where both laws differ most.

    Motion forward and back is compared.
    """
    speeds = COMPARED_SPEEDS * before.levels.stribeck_velocity
    old, new = (
        np.stack([steady_force(stage.flat(), speeds, way) for way in (True, False)]) for stage in (source, made)
    )
    return MeasuredChange("curve", float(np.abs(new - old).max() / before.levels.static))


CURVE_ERROR = 0.02
"""Largest difference of virgin curves that a measurement cannot resolve."""


def _virgin_change(before: MeasuredFriction, after: MeasuredFriction) -> MeasuredChange:
    """Return the change of the virgin curve, at the displacement where it differs most."""
    if not after.stiffness:
        return MeasuredChange("virgin", float(before.stiffness > 0), CURVE_ERROR)
    new = np.interp(before.displacement, after.displacement, after.force)
    return MeasuredChange("virgin", before.misfit(new), CURVE_ERROR)


NEEDED: frozenset[MeasuredKind] = frozenset(("curve", "static", "stiffness", "viscous"))
"""Measured quantities that a law must keep to be tried."""


@dataclass(frozen=True)
class Trial:
    """A stage under a friction law, and its cases (joint locked, free) by `friso.hunting.check`.

    `drawn` are the keys that the measurements leave open, with the values [SI] chosen for this trial.
    """

    stage: Stage
    drawn: Mapping[str, float]
    cases: Mapping[str, Case]

    def attracted(self, case: str) -> bool:
        """Tell whether the stage has a stable limit cycle in a case."""
        return self.cases[case].verdict in ATTRACTED

    def certain(self, case: str) -> bool:
        """Tell whether the verdict in a case is certain."""
        shown = self.cases[case]
        return shown.verdict not in ("failed", "none") and shown.judgement.hunting.certain

    def edge_sought(self, case: str) -> bool:
        """Tell whether the search for a case's edge of hunting was finished, with or without edge."""
        shown = self.cases[case]
        judgement = shown.judgement
        unsought = shown.verdict == "failed" or CheckPart.BANDWIDTHS in judgement.given_up
        unsought |= judgement.observed and judgement.hunting.target is None  # only its own motion keeps swinging
        return judgement.margin is not None or not unsought


@dataclass(frozen=True)
class LawVerdict:
    """The verdict on a stage under one friction law.

    Fields are the conversion to the law, and one trial for each choice of values for the keys that the conversion
    leaves open.
    """

    conversion: LawConversion
    trials: tuple[Trial, ...]

    @property
    def law(self) -> str:
        """Return the name of the law."""
        return self.conversion.law

    def verdicts(self, case: str) -> tuple[str, ...]:
        """Return the distinct verdicts of all trials in a case."""
        return tuple(dict.fromkeys(trial.cases[case].verdict for trial in self.trials))

    def answers(self, case: str) -> set[bool]:
        """Return the certain answers to whether the stage hunts under the law in a case.

        There are two, true and false, if the answer depends on keys that the measurements leave open.
        """
        return {trial.attracted(case) for trial in self.trials if trial.certain(case)}

    def certain(self, case: str) -> bool:
        """Tell whether the verdicts of all trials in a case are certain."""
        return all(trial.certain(case) for trial in self.trials)

    def hunts(self, case: str) -> bool | None:
        """Tell whether the stage hunts under the law in a case.

        None if that is not certain, or depends on keys that the measurements leave open.
        """
        answers = self.answers(case)
        return answers.pop() if len(answers) == 1 and self.certain(case) else None

    def edges(self, case: str) -> tuple[float, float] | None:
        """Return the lowest and highest edge of hunting in a case; None without any.

        Edges are crossovers [Hz], or factors of the bandwidth if there is no crossover. A certain edge is widened by
        its error to both sides, an uncertain one up to where no attractor was found.
        """
        margins = [margin for trial in self.trials if (margin := trial.cases[case].judgement.margin)]
        units = [1.0 if edge.crossover is None else edge.crossover / edge.factor for edge in margins]
        ends = [
            (edge.factor * (1 - edge.reserve), edge.factor * (1 + edge.reserve))
            if edge.certain
            else (edge.factor, edge.quiet)
            for edge in margins
        ]
        lowest = [low * unit for (low, _), unit in zip(ends, units, strict=True)]
        highest = [high * unit for (_, high), unit in zip(ends, units, strict=True)]
        return (min(lowest), max(highest)) if margins else None

    def again(self, case: str) -> float | None:
        """Return the lowest bandwidth beyond the edge at which the stage hunts again, in the unit of `edges`."""
        judgements = [trial.cases[case].judgement for trial in self.trials]
        begins = [
            window.low.outside * (1.0 if edge.crossover is None else edge.crossover / edge.factor)
            for judgement in judgements
            if (edge := judgement.margin)
            for window in judgement.windows
            if window.low and window.lies(1, edge.factor)
        ]
        return min(begins, default=None)

    def edges_certain(self, case: str) -> bool:
        """Tell whether all edges of hunting that were found in a case are certain."""
        margins = [trial.cases[case].judgement.margin for trial in self.trials]
        return all(edge.certain for edge in margins if edge)

    def edges_sought(self, case: str) -> bool:
        """Tell whether every trial finished its search for the edge of hunting in a case."""
        return all(trial.edge_sought(case) for trial in self.trials)

    def amplitudes(self, case: str) -> tuple[float, float] | None:
        """Return the smallest and largest amplitude [m] of hunting in a case; None without hunting."""
        cycles = [trial.cases[case].judgement.cycle for trial in self.trials if trial.attracted(case)]
        sizes = [cycle.amplitude for cycle in cycles if cycle]
        return (min(sizes), max(sizes)) if sizes else None


@dataclass(frozen=True)
class VerdictsByLaw:
    """The verdicts on a stage under each friction law, its own first.

    `left_out` lists the laws that do not keep the stage's measured friction, with the quantities that they lose.
    """

    stage: Stage
    verdicts: tuple[LawVerdict, ...]
    left_out: Mapping[str, tuple[MeasuredKind, ...]]

    @property
    def in_hertz(self) -> bool:
        """Tell whether edges are crossovers [Hz]; else they are factors of the bandwidth."""
        return bandwidth(self.stage.flat()) is not None

    def hunts(self, case: str) -> bool | None:
        """Tell whether the stage hunts in a case under all laws.

        None if that depends on the law, or is not certain.
        """
        answers = {verdict.hunts(case) for verdict in self.verdicts}
        return answers.pop() if len(answers) == 1 else None

    def answers(self, case: str) -> set[bool]:
        """Return all certain answers, of any law, to whether the stage hunts in a case."""
        return set().union(*(verdict.answers(case) for verdict in self.verdicts))

    def depends_on_law(self, case: str) -> bool:
        """Tell whether the stage certainly hunts in some trials of a case, and surely not in others.

        Trials differ in the law, or in keys that the measurements leave open.
        """
        return len(self.answers(case)) > 1

    def uncertain(self, case: str) -> list[str]:
        """Return the laws under which not every verdict in a case is certain."""
        return [verdict.law for verdict in self.verdicts if not verdict.certain(case)]

    def deciding(self, case: str) -> list[str]:
        """Return the experiments that would decide whether the stage hunts in a case.

        There are none if all laws agree, or if no answer is certain. If the answer depends on keys that measurements
        leave open in a law, the experiments determine these keys. Otherwise, the experiments separate the laws that
        disagree, or are not certain, from the others.
        """
        if self.hunts(case) is not None or not self.answers(case):
            return []
        depends = self.depends_on_law(case)
        open_ones = [
            verdict
            for verdict in self.verdicts
            if verdict.hunts(case) is None and len(verdict.answers(case)) == (2 if depends else 1)
        ]
        if open_ones:
            names = {(verdict.law, key) for verdict in open_ones for key in verdict.conversion.open}
        elif depends:
            sides = [[v.law for v in self.verdicts if answer in v.answers(case)] for answer in (True, False)]
            distinguished = [side for side in sides if all("" in friction_law(law).decided_by for law in side)]
            names = {(law, "") for law in min(distinguished or sides, key=len)}
        else:
            names = {(law, "") for law in self.uncertain(case)}
        texts = (friction_law(law).decided_by.get(key, "") for law, key in sorted(names))
        return list(dict.fromkeys(filter(None, texts)))


def verdicts_by_law(stage: Stage, rtol: float = LONG_RUN_RTOL, progress: Progress = silent) -> VerdictsByLaw:
    """Check a stage for hunting under each friction law that keeps its measured friction.

    Raises InputError for a stage whose law cannot say what would be measured.
    """
    conversions, left_out = kept_laws(stage)
    planned = [(conversion, [*trials_left_open(conversion).values()]) for conversion in conversions]
    total, done = sum(len(draws) for _, draws in planned), 0
    kernels(set[KernelRequest]().union(*(needed_kernels(conversion.stage) for conversion in conversions)))
    verdicts = []
    for conversion, draws in planned:
        trials = []
        for changes in draws:
            progress(done, total, conversion.law)
            made = conversion.stage.with_numbers(changes)
            trials.append(Trial(made, changes, check(made, rtol, margins=False)))
            done += 1
        verdicts.append(LawVerdict(conversion, tuple(trials)))
    progress(total, total, "laws")
    return VerdictsByLaw(stage, tuple(verdicts), left_out)


def kept_laws(stage: Stage) -> tuple[list[LawConversion], dict[str, tuple[MeasuredKind, ...]]]:
    """Return the stage under all laws that keep its measured friction, its own first.

    Also returns, for every other law, the measured quantities that it loses.
    """
    own = stage.flat()["friction.model"]
    kept = [compared(stage, stage)]
    left_out: dict[str, tuple[MeasuredKind, ...]] = {}
    for law in convertible():
        if law == own:
            continue
        try:
            conversion = convert(stage, law)
        except InputError:
            if stage.conditions is None:
                raise
            left_out[law] = ("conditions",)  # the law cannot follow them
            continue
        lost: tuple[MeasuredKind, ...] = tuple(item.kind for item in conversion.lost if item.kind in NEEDED)
        if lost:
            left_out[law] = lost
        else:
            kept.append(conversion)
    return kept, left_out


def trials_left_open(conversion: LawConversion) -> dict[str, dict[str, float]]:
    """Return the values [SI] to try for the keys that measurements leave open, by trial.

    The trial "" is as converted. In the trials "least" and "most", all open keys are at the lower or the upper ends of
    their ranges. The stage's own law, which leaves none open, has one trial.
    """
    trials: dict[str, dict[str, float]] = {"": {}}
    flat = conversion.stage.flat()
    for end, name in enumerate(("least", "most")):
        changes = {key: ends[end] for key, ends in conversion.open.items() if not np.isclose(ends[end], flat[key])}
        if changes:
            trials[name] = changes
    return trials
