"""Derive the verdict on a claim from findings: judgement, reason, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Claim, ClaimJudgement, Finding
from friso_thesis.studies.thesis.plausible import LEAST_DECIDED, ClaimInSpace
from friso_thesis.studies.thesis.space import OPEN

NO_FINDINGS: Mapping[str, Finding] = MappingProxyType({})


@dataclass(frozen=True)
class ClaimVerdict:
    """The verdict on a claim by the thesis's count; `finding` is None if it is not covered.

    - `attracts`: the finding by what attracts the stages (None: not computed, or it does not matter). It stands beside
      the judgement and does not decide it.
    - `space`: the claim over random draws of the values that the thesis leaves open (None: none matters, or no draw was
      made).
    - `undrawn`: other assumptions that decide on the claim, and are in no draw.
    - `turned`: how another grid, or the thesis's tolerance, changes the judgement, by the name of that method.
    - `reread`: findings by other meanings of the thesis's words that turn a criterion, by the change.
    """

    claim: Claim
    figure: str
    finding: Finding | None
    reason: str
    attracts: Finding | None = None
    space: ClaimInSpace | None = None
    turned: Mapping[str, str] = field(default_factory=dict)
    undrawn: str = ""
    reread: Mapping[str, Finding] = field(default_factory=lambda: NO_FINDINGS)

    @property
    def judgement(self) -> ClaimJudgement:
        """Return the judgement, at friso's own choice of the open values and at random ones (`ClaimInSpace.judged`)."""
        if self.finding is None:
            return "not yet covered"
        return self.space.judged(self.finding) if self.space else self.finding.judgement

    @property
    def robust(self) -> bool:
        """Tell whether a claim fails for every plausible choice of what is left open.

        The claim holds in no draw of the open values, and enough draws decide (see `judgement`). No assumption outside
        the draws decides on it.
        """
        fails = self.judgement in ("holds in part", "differs")
        return bool(fails and self.space and not self.undrawn and not self.space.count)

    @property
    def dependence(self) -> str:
        """Say for which fraction of random open values a claim holds, and on what that depends.

        The text is empty if the claim was not judged.
        """
        if self.finding is None:
            return ""
        if self.space is None:
            sentence = "No joint draws of the values that the thesis leaves open were made for this claim."
        elif not self.space.decided:
            sentence = f"None of {self.space.draws} joint draws of the unstated values decides on it.{self._too_few}"
        else:
            sentence = f"It holds in {draws_text(self.space)}"
            sentence += f"; that depends on {_listed(self.space)}." if self.space.hangs_on else "."
            sentence += " No choice of the unstated values that was tried makes it hold." if self.robust else ""
            sentence += self._too_few
        return " ".join((sentence, *self.besides))

    @property
    def besides(self) -> tuple[str, ...]:
        """Say in sentences what turns a criterion, or may, besides the random open values."""
        sentences = []
        if self.turned:
            sentences.append(f"With {' and with '.join(self.turned)} a criterion is judged otherwise.")
        if self.reread:
            turns = "; ".join(f"{name}: {self._word_of(finding)}" for name, finding in self.reread.items())
            sentences.append(f"Other readings of the thesis's words turn a criterion: {turns}.")
        if self.undrawn:
            sentences.append(f"It depends also on what is assumed and not drawn: {self.undrawn}.")
        return tuple(sentences)

    @property
    def _too_few(self) -> str:
        """Say that too few draws decide, or that they leave the share too uncertain; "" if they do not."""
        if self.space is None or self.judgement != "not decided enough":
            return ""
        if self.space.decided < LEAST_DECIDED:
            return f" That is not enough: at least {LEAST_DECIDED} are needed."
        return " The interval is too wide to judge by: more draws are needed."

    @property
    def depends_on(self) -> str:
        """Return the values that decide whether the claim holds, the most decisive first.

        The result is "" if none stands out.
        """
        return ", ".join(item.value for item in self.space.hangs_on) if self.space else ""

    def _word_of(self, finding: Finding) -> str:
        """Return how a finding by another meaning of a word judges the claim.

        If that is how the claim is judged anyway, "still" is put before it.
        """
        own = self.finding.judgement if self.finding else ""
        return finding.judgement if finding.judgement != own else f"still {own}"


def draws_text(space: ClaimInSpace) -> str:
    """Write in how many of the decided joint draws a claim holds, with the interval of that share."""
    counted = f"{space.count} of {space.draws} joint draws of the unstated values"
    if space.undecided:
        counted = (
            f"{space.count} of the {space.decided} that decide, of {space.draws} joint draws of the unstated values"
        )
    return f"{counted} ({percent(space.holds.low)} to {percent(space.holds.high)})"


def _listed(space: ClaimInSpace) -> str:
    """Return the values on which a claim depends, the most decisive first, with the direction.

    The direction tells whether the claim holds with more or with less of the value.
    """
    either = {value.name: value for value in OPEN}
    words = []
    for item in space.hangs_on:
        more = "more" if either[item.value].scale != "either" else "the higher"
        less = "less" if either[item.value].scale != "either" else "the lower"
        words.append(f"{item.value} (with {more if item.correlation > 0 else less} it holds, {item.correlation:+.2f})")
    return ", ".join(words)


def not_covered(claim: Claim, reason: str) -> ClaimVerdict:
    """Return the verdict "not covered" on a claim, for lack of a judge or of evidence."""
    return ClaimVerdict(claim, "", None, reason)


def verdict(
    claim: Claim,
    figure: str,
    finding: Finding,
    attracts: Finding | None = None,
    space: ClaimInSpace | None = None,
    others: Mapping[str, Finding] = NO_FINDINGS,
    undrawn: str = "",
    readings: Mapping[str, Finding] = NO_FINDINGS,
) -> ClaimVerdict:
    """Return the verdict from findings by the thesis's count and by what attracts the stages.

    `others` are findings by another method, by its name. `readings` are findings by another reading of the thesis's
    words. A finding of either kind is mentioned if other parts of the claim hold by it.
    """
    turned = {
        name: f"with {name} {_change(finding, other)}"
        for name, other in others.items()
        if other.pattern != finding.pattern
    }
    failing = [part for part in finding.stated if not part.holds and not part.open]
    reason = " ".join(dict.fromkeys(part.why for part in failing if part.why))
    if failing and not reason:
        reason = "No reason was found."
    reread = {name: other for name, other in readings.items() if other.pattern != finding.pattern}
    return ClaimVerdict(claim, figure, finding, reason, attracts, space, turned, undrawn, reread)


def _change(first: Finding, second: Finding) -> str:
    """Say how a second finding judges the claim, with the numbers of the criteria that it turns."""
    pairs = zip(first.stated, second.stated, first.pattern, second.pattern, strict=True)
    numbers = "; ".join(after.number for _, after, was, becomes in pairs if was != becomes)
    return f"the claim is judged: {second.judgement} ({numbers})"
