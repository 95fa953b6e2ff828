"""The verdict on a stage under every friction law that keeps what is measured of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.hunting.check import LONG, Case, check
from friso.hunting.criteria import ATTRACTED
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.tables import friction_law
from friso.studies.laws.conversion import ELEMENTS, LawConversion, compared, convert, convertible, measured

NEEDED = ("steady friction over speed", "break-away", "stiffness before sliding", "viscous damping")
"""What a law has to keep to be asked."""


@dataclass(frozen=True)
class Trial:
    """A stage under a law, with the keys that were `drawn` [SI] within what the measurements leave open, and its cases
    (see `friso.hunting.check`)."""

    stage: Stage
    drawn: Mapping[str, float]
    cases: Mapping[str, Case]

    def attracted(self, case: str) -> bool:
        """Whether something attracts the stage that hunts, in a case."""
        return self.cases[case].verdict in ATTRACTED


@dataclass(frozen=True)
class LawVerdict:
    """What becomes of a stage under a law: the conversion, and a trial for each choice of what it leaves open."""

    conversion: LawConversion
    trials: tuple[Trial, ...]

    @property
    def law(self) -> str:
        """The name of the law."""
        return self.conversion.law

    def verdicts(self, case: str) -> tuple[str, ...]:
        """The verdicts in a case, each once."""
        return tuple(dict.fromkeys(trial.cases[case].verdict for trial in self.trials))

    def hunts(self, case: str) -> bool | None:
        """Whether the stage hunts under the law in a case; None where that hangs on what is open, or a run failed."""
        if "failed" in self.verdicts(case):
            return None
        attracted = {trial.attracted(case) for trial in self.trials}
        return attracted.pop() if len(attracted) == 1 else None

    def edges(self, case: str) -> tuple[float, float] | None:
        """Lowest and highest edge of hunting [Hz], or in factors of the bandwidth where there is no crossover, in a
        case; None without any."""
        margins = [trial.cases[case].judgement.margin for trial in self.trials]
        edges = [edge.factor if edge.crossover is None else edge.crossover for edge in margins if edge]
        return (min(edges), max(edges)) if edges else None

    def amplitudes(self, case: str) -> tuple[float, float] | None:
        """Smallest and largest amplitude [m] of the hunting in a case; None without any."""
        cycles = [trial.cases[case].judgement.cycle for trial in self.trials if trial.attracted(case)]
        sizes = [cycle.amplitude for cycle in cycles if cycle]
        return (min(sizes), max(sizes)) if sizes else None


@dataclass(frozen=True)
class VerdictsByLaw:
    """The verdicts law by law, the stage's own first, and the laws that were `left_out`: what they do not keep."""

    stage: Stage
    verdicts: tuple[LawVerdict, ...]
    left_out: Mapping[str, tuple[str, ...]]

    @property
    def in_hertz(self) -> bool:
        """Whether edges are crossovers [Hz]; else they are factors of the bandwidth."""
        return bandwidth(self.stage.flat()) is not None

    def hunts(self, case: str) -> bool | None:
        """Whether the stage hunts in a case, whatever the law; None where that hangs on the law."""
        answers = {verdict.hunts(case) for verdict in self.verdicts}
        return answers.pop() if len(answers) == 1 else None

    def deciding(self, case: str) -> list[str]:
        """The experiments that would decide, where the verdict hangs on the law: those that tell what is open in a law
        under which the verdict hangs on that, else those that tell the laws that disagree from the others."""
        open_ones = [verdict for verdict in self.verdicts if verdict.hunts(case) is None]
        if open_ones:
            names = {(verdict.law, key) for verdict in open_ones for key in verdict.conversion.open}
        else:
            fewer = [[v for v in self.verdicts if v.hunts(case) is answer] for answer in (True, False)]
            names = {(verdict.law, "") for verdict in min(fewer, key=len)}
        texts = (friction_law(law).decided_by.get(key, "") for law, key in sorted(names))
        return list(dict.fromkeys(filter(None, texts)))


def verdicts_by_law(
    stage: Stage, rtol: float = LONG, elements: int = ELEMENTS, progress: Progress = silent
) -> VerdictsByLaw:
    """What becomes of a stage under each law that keeps what is measured of its own. Raises InputError for a law that
    does not declare what that is."""
    conversions, left_out = _conversions(stage, elements)
    planned = [(conversion, list(_drawn(conversion))) for conversion in conversions]
    total, done = sum(len(draws) for _, draws in planned), 0
    verdicts = []
    for conversion, draws in planned:
        trials = []
        for changes in draws:
            progress(done, total, conversion.law)
            made = conversion.stage.with_numbers(changes)
            trials.append(Trial(made, changes, check(made, rtol)))
            done += 1
        verdicts.append(LawVerdict(conversion, tuple(trials)))
    progress(total, total, "laws")
    return VerdictsByLaw(stage, tuple(verdicts), left_out)


def _conversions(stage: Stage, elements: int) -> tuple[list[LawConversion], dict[str, tuple[str, ...]]]:
    """The stage as it is, and under the other laws that keep what is measured of it; and what the others lose."""
    own = stage.flat()["friction.model"]
    kept, left_out = [compared(stage, stage, measured(stage.flat()))], {}
    for law in convertible():
        if law == own:
            continue
        conversion = convert(stage, law, elements)
        lost = tuple(item.what for item in conversion.lost if item.what in NEEDED)
        if lost:
            left_out[law] = lost
        else:
            kept.append(conversion)
    return kept, left_out


def _drawn(conversion: LawConversion) -> Iterator[dict[str, float]]:
    """What the measurements leave open: as the conversion has it, and at both ends of the ranges; as it is for the
    stage's own law."""
    yield {}
    if conversion.stage == conversion.source:
        return
    flat = conversion.stage.flat()
    for end in (0, 1):
        changes = {key: ends[end] for key, ends in conversion.open.items() if not np.isclose(ends[end], flat[key])}
        if changes:
            yield changes
