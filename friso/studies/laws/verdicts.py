"""Judge a stage under each friction law that keeps its measured friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from friso.engine.kernel import KernelRequest, kernels
from friso.equations.bandwidth import bandwidth
from friso.errors import InputError
from friso.hunting import LONG_RUN_RTOL, Case, CheckPart, check, needed_kernels
from friso.hunting.criteria import ATTRACTED
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.tables import friction_law
from friso.studies.laws.conversion import LawConversion, MeasuredKind, compared, convert, convertible

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
