"""From findings to the verdict on a claim: the judgement, the reason found, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from friso.quantities import percent
from friso.shares import Share
from friso_thesis.studies.thesis.claims import Claim, ClaimJudgement, Finding
from friso_thesis.studies.thesis.plausible import ClaimInSpace
from friso_thesis.studies.thesis.space import OPEN
from friso_thesis.studies.thesis.ways import CYCLE, weakest

ROBUST = 0.25
"""Share of the space in which a claim may hold after all, up to which its contradiction is called robust: 13 draws
without it."""

NO_WAYS: Mapping[str, Finding] = MappingProxyType({})


@dataclass(frozen=True)
class ClaimVerdict:
    """The verdict on a claim; `finding` is None if the claim is not covered.

    - `ways`: findings by the way in which hunting is judged; the finding is the weakest of them.
    - `space`: the claim over joint draws of the values that the thesis leaves open (None: none enters, or no draw was
      made).
    - `undrawn`: other assumptions that decide on it, and are in no draw.
    - `turned`: change of the judgement by another grid, or by the thesis's tolerance, by the name of that method.
    - `reread`: findings by other readings of the thesis's words that turn a criterion, by the change.
    """

    claim: Claim
    judgement: ClaimJudgement
    figure: str
    finding: Finding | None
    reason: str
    ways: Mapping[str, Finding] = field(default_factory=lambda: NO_WAYS)
    space: ClaimInSpace | None = None
    turned: Mapping[str, str] = field(default_factory=dict)
    undrawn: str = ""
    reread: Mapping[str, Finding] = field(default_factory=lambda: NO_WAYS)

    @property
    def by_runs(self) -> Finding | None:
        """Return the finding in the ways that the draws and the other methods know too,
        without what attracts."""
        return _by_runs(self.ways) or self.finding

    @property
    def by_cycle_only(self) -> bool:
        """Tell whether it does not hold, but for what attracts would."""
        runs = self.by_runs
        return self.judgement != "holds" and runs is not None and runs.judgement == "holds"

    @property
    def contradiction(self) -> str:
        """Return the kind of contradiction of a claim that does not hold; empty if it holds.

        It is "arbitrary" if the claim holds in some draw. It is "robust" if it holds in none and its share is at most
        `ROBUST` by its interval. Otherwise it is "open": there are too few draws, or it fails by an attracting cycle
        alone, which draws do not look for, or it depends on values that are not drawn.
        """
        if self.finding is None or self.judgement == "holds":
            return ""
        if self.space is None or self.by_cycle_only:
            return "open"
        if self.space.count:
            return "arbitrary"
        if self.undrawn:
            return "open"
        return "robust" if self.space.holds.high <= ROBUST else "open"

    @property
    def chosen(self) -> bool:
        """Tell whether it holds at friso's choice of the unstated values,
        and in some draw of them does not."""
        return self.judgement == "holds" and self.space is not None and self.space.misses > 0

    @property
    def dependence(self) -> str:
        """In which share of the space it holds, and on what that hangs."""
        if self.finding is None:
            return ""
        if self.space is None:
            sentence = "No joint draws of the values that the thesis leaves open were made for this claim."
        else:
            subject = "By the runs it" if len(self.ways) > 1 else "It"
            sentence = f"{subject} holds in {draws_text(self.space.holds, self.space.count, self.space.draws)}"
            sentence += (
                f", {percent(self.space.undecided / self.space.draws)} undecided" if self.space.undecided else ""
            )
            sentence += f"{_HANGS[bool(self.space.hangs_on)]}{_listed(self.space)}."
            sentence += _KINDS.get(self.contradiction, "")
            sentence += _CHOSEN if self.chosen else ""
        if self.by_cycle_only:
            sentence += " It does not hold by an attracting cycle only, which was not tried in draws."
        if self.turned:
            sentence += f" With {' and with '.join(self.turned)} a criterion is judged otherwise by the runs."
        if self.reread:
            turns = "; ".join(f"{name}: {self._word_of(finding)}" for name, finding in self.reread.items())
            sentence += f" Other readings of the thesis's words turn a criterion: {turns}."
        if self.undrawn:
            sentence += f" It hangs also on what is assumed and not drawn: {self.undrawn}."
        return sentence

    def _word_of(self, finding: Finding) -> str:
        """Return the judgement by another reading."""
        return finding.judgement if finding.judgement != self.judgement else f"still {finding.judgement}"


_CHOSEN = " The agreement rests on friso's choice: other values, equally plausible, remove it."
_HANGS = {True: "; that hangs on ", False: ""}
_KINDS = {
    "robust": " The contradiction is robust: no choice of the unstated values tried removes it.",
    "arbitrary": " The contradiction is arbitrary: other values, equally plausible, remove it.",
}


def draws_text(share: Share, count: int, draws: int) -> str:
    """Return the share of the joint draws in words."""
    return f"{count} of {draws} joint draws of the unstated values ({percent(share.low)} to {percent(share.high)})"


def _listed(space: ClaimInSpace) -> str:
    """Return the values on which a claim hangs, the most decisive first."""
    either = {value.name: value for value in OPEN}
    words = []
    for item in space.hangs_on:
        more = "more" if either[item.value].scale != "either" else "the higher"
        less = "less" if either[item.value].scale != "either" else "the lower"
        words.append(f"{item.value} (with {more if item.correlation > 0 else less} it holds, {item.correlation:+.2f})")
    return ", ".join(words)


def not_covered(claim: Claim, reason: str) -> ClaimVerdict:
    """Return a claim with no judge, or without what its judge needs."""
    return ClaimVerdict(claim, "not yet covered", "", None, reason)


def verdict(
    claim: Claim,
    figure: str,
    ways: Mapping[str, Finding],
    together: Finding,
    space: ClaimInSpace | None = None,
    others: Mapping[str, Finding] = NO_WAYS,
    undrawn: str = "",
    readings: Mapping[str, Finding] = NO_WAYS,
) -> ClaimVerdict:
    """Return the verdict from the findings of all `ways` and the one that they allow `together`.

    `others` are findings by another method, by its name, in the ways that need the runs alone. `readings` are findings
    by another reading of the words, in all ways. Both are mentioned if other parts of the claim hold there.
    """
    runs = _by_runs(ways) or together
    turned = {
        name: f"with {name} {_change(runs, finding)}"
        for name, finding in others.items()
        if finding.pattern != runs.pattern
    }
    reasons = (
        () if together.judgement == "holds" else dict.fromkeys(p.why for p in together.judged if not p.holds and p.why)
    )
    reason = " ".join(reasons)
    if not reason and together.judgement != "holds":
        reason = "No reason was found."
    reread = {name: finding for name, finding in readings.items() if finding.pattern != together.pattern}
    return ClaimVerdict(claim, together.judgement, figure, together, reason, dict(ways), space, turned, undrawn, reread)


def _by_runs(ways: Mapping[str, Finding]) -> Finding | None:
    """Return the weakest finding of the ways that need the runs alone; None without any."""
    runs = {way: finding for way, finding in ways.items() if way != CYCLE}
    return weakest(runs) if runs else None


def _change(first: Finding, second: Finding) -> str:
    """Return how a finding is judged otherwise, with the numbers of the parts that turned."""
    pairs = zip(first.judged, second.judged, strict=True)
    numbers = "; ".join(after.number for before, after in pairs if before.holds != after.holds)
    return f"the claim is judged by the runs: {second.judgement} ({numbers})"
