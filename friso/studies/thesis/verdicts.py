"""From findings to the verdict on a claim: the judgement, the reason found, and what it depends on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from friso.studies.thesis.claims import Claim, Finding, Judgement
from friso.studies.thesis.open_parameters import Variant

_ORDER: dict[Judgement, int] = {"differs": 0, "holds in part": 1, "holds": 2}


@dataclass(frozen=True)
class Dependence:
    """A variant under which other parts hold: its judgement, and the numbers of the parts that turned."""

    variant: Variant
    judgement: Judgement
    numbers: tuple[str, ...]

    def __str__(self) -> str:
        turned = "; ".join(self.numbers)
        return f"{self.variant.parameter} {self.variant.value}: {self.judgement} ({turned})"


@dataclass(frozen=True)
class Verdict:
    """What stands beside a claim; `finding` is None for one that is not covered.

    `depends_on` are the open parameters at which other parts hold than in the baseline, out of the `tried` values that
    enter its evidence; `hangs_on` the same for tolerance and metric; `grid` says what a coarser grid does to the
    baseline, empty for nothing.
    """

    claim: Claim
    judgement: Judgement
    figure: str
    finding: Finding | None
    reason: str
    depends_on: tuple[Dependence, ...] = ()
    hangs_on: tuple[Dependence, ...] = ()
    grid: str = ""
    tried: int = 0

    @property
    def dependence(self) -> str:
        """One sentence on the open parameters, and one on tolerance and metric where they matter."""
        if self.finding is None:
            return ""
        opened = "No open parameter of the thesis enters this claim."
        if self.tried:
            turns = (
                f"the judgement changes with {_by_parameter(self.depends_on)}"
                if self.depends_on
                else "no judgement changes"
            )
            opened = f"Parameters left open by the thesis, varied one at a time ({self.tried} values): {turns}."
        return (
            f"{opened} Method: the judgement changes with {_by_parameter(self.hangs_on)}." if self.hangs_on else opened
        )


def _by_parameter(dependences: Iterable[Dependence]) -> str:
    """Each parameter once, with what is judged at which value."""
    by_name: dict[str, list[str]] = {}
    for dependence in dependences:
        by_name.setdefault(dependence.variant.parameter, []).append(
            f"{dependence.variant.value}: {dependence.judgement}"
        )
    return "; ".join(f"{name} ({', '.join(values)})" for name, values in by_name.items())


def not_covered(claim: Claim, reason: str) -> Verdict:
    """A claim with no judge, or without what its judge needs."""
    return Verdict(claim, "not yet covered", "", None, reason)


def verdict(
    claim: Claim, figure: str, baseline: Finding, coarse: Finding, varied: Sequence[tuple[Variant, Finding]]
) -> Verdict:
    """The baseline's judgement, and the variants under which other parts hold.

    `varied` has the variants that enter the evidence of the claim, on the grid of the baseline; `coarse` is the
    baseline on a coarser one, which is mentioned where it changes a part.
    """
    depends, hangs = [], []
    for variant, finding in varied:
        if finding.pattern != baseline.pattern:
            dependence = Dependence(variant, finding.judgement, _turned(baseline, finding))
            (depends if variant.kind == "unknown parameter" else hangs).append(dependence)
    tried = sum(variant.kind == "unknown parameter" for variant, _ in varied)
    grid = ""
    if coarse.pattern != baseline.pattern:
        grid = f"with every second value of each axis: {coarse.judgement} ({'; '.join(_turned(baseline, coarse))})"
    reason = _reason(baseline, [*depends, *hangs], grid)
    return Verdict(claim, baseline.judgement, figure, baseline, reason, tuple(depends), tuple(hangs), grid, tried)


def _turned(first: Finding, second: Finding) -> tuple[str, ...]:
    """The numbers of the other's parts that hold where the first's do not, or the reverse."""
    pairs = zip(first.parts, second.parts, strict=True)
    return tuple(after.number for before, after in pairs if before.holds != after.holds)


def _reason(baseline: Finding, other: Sequence[Dependence], grid: str) -> str:
    """Why a claim does not hold: the variants under which it holds better, by kind, and what the judge found itself."""
    if baseline.judgement == "holds":
        return ""
    better: dict[str, list[str]] = {}
    for dependence in other:
        if _ORDER[dependence.judgement] > _ORDER[baseline.judgement]:
            kind = f"{dependence.variant.kind} ({dependence.judgement} with"
            better.setdefault(kind, []).append(f"{dependence.variant.parameter} {dependence.variant.value}")
    named = [f"{kind} {', '.join(values)})" for kind, values in better.items()]
    reasons = dict.fromkeys(part.why for part in baseline.parts if not part.holds and part.why)
    text = "; ".join((*named, *reasons, *([grid] if grid else [])))
    return text or "none of the values tried makes it hold"
