"""Write the first screen of the page of `friso reproduce`.

It lists which claims of the thesis are right, which are right for another reason, and where the thesis has small
mistakes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso_thesis.questions.reproduce.words import short

if TYPE_CHECKING:
    from friso_thesis.studies.thesis import ClaimVerdict


@dataclass(frozen=True)
class Remark:
    """A remark on a claim, made only if one criterion of the claim turns out as expected.

    `part` is the number of the criterion, from 0. If `met` is true, the remark applies where the criterion is met,
    otherwise where it is not met.
    """

    claim: str
    part: int
    met: bool
    text: str

    @property
    def command(self) -> str:
        """Return the command that judges the claim alone, and shows more about it."""
        return f"friso reproduce --only {self.claim}"


OTHER_REASON = (
    Remark(
        "F8", 0, True,
        "The loop is stable at every speed if it is linearised before the bristles deflect. In steady sliding, "
        "friction that falls with the speed makes it unstable at low speeds.",
    ),
    Remark(
        "S41M", 0, False,
        "More mass ends hunting, but after this move not because the integral action builds up more slowly.",
    ),
    Remark(
        "S342F", 0, False,
        "A higher crossover settles sooner, but the loop is also stable within a factor of 3 of the first "
        "eigenfrequency.",
    ),
    Remark(
        "S323C", 1, False,
        "ode23s is the cheaper solver, but ode45 is not unstable: it costs more, and is right.",
    ),
)  # fmt: skip
"""Remarks on statements that are right, but for another reason than the thesis gives."""

SLIPS = (
    Remark(
        "F7", 3, True,
        "Table 1 prints the joint and the touched limiter in series; they carry the force side by side. With the "
        "formula as printed there is no second pair of modes.",
    ),
    Remark(
        "F7", 5, True,
        "The limiter sets which mass line is seen, and not whether the cart sticks.",
    ),
    Remark(
        "F18", 1, False,
        "2.5 kg instead of 1.7, and 0.75 instead of 0.5, would be one slip: a motor that gives 0.68 and 0.67 of the "
        "force assumed would show both.",
    ),
    Remark(
        "F14A", 1, False,
        "A shorter stroke does not allow a stiffer joint: the force at full stroke does not set the limit.",
    ),
)  # fmt: skip
"""Remarks on slips in the text of the thesis."""


@dataclass(frozen=True)
class RemarkRow:
    """A remark that applies, with the number that shows it."""

    remark: Remark
    number: str


def remarks(of: Iterable[Remark], verdicts: Mapping[str, ClaimVerdict]) -> list[RemarkRow]:
    """Return the remarks that apply, with the numbers that show it.

    A remark applies if this run has judged its criterion, with the result that the remark expects.
    """
    rows = []
    for remark in of:
        finding = verdicts[remark.claim].finding
        if finding and remark.part < len(finding.stated) and finding.stated[remark.part].holds == remark.met:
            rows.append(RemarkRow(remark, short(finding.stated[remark.part].number)))
    return rows


def as_far(verdict: ClaimVerdict) -> str:
    """Say in brackets how many criteria of a claim simulation decides; "" if it decides all."""
    pattern = verdict.finding.pattern if verdict.finding else ()
    decided = len(pattern) - pattern.count(None)
    return f" (simulation decides {decided} of {len(pattern)} criteria)" if decided < len(pattern) else ""


def more_right(verdicts: Iterable[ClaimVerdict]) -> int:
    """Return how many claims hold that are not in the thesis's own list of conclusions."""
    return sum(verdict.judgement == "holds" and not verdict.claim.listed for verdict in verdicts)


def right(verdicts: Iterable[ClaimVerdict]) -> list[ClaimVerdict]:
    """Return the verdicts on claims that hold and are in the thesis's own list of conclusions."""
    return [verdict for verdict in verdicts if verdict.judgement == "holds" and verdict.claim.listed]
