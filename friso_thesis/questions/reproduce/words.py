"""Write the words of `friso reproduce`: findings in short and in full, and the first screen.

The first screen of its page lists which claims are right, which are right for another reason, and where the thesis has
small mistakes. Conclusions under other friction laws are shown as text, table and JSON.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from friso.quantities import percent
from friso.questions.check.laws import SHOWN
from friso.shown.text import listed
from friso_thesis.studies.thesis.plausible import MAP_POINTS, Plausible
from friso_thesis.studies.thesis.space import OPEN, draw_name
from friso_thesis.studies.thesis.verdicts import ClaimVerdict

if TYPE_CHECKING:
    from friso_thesis.studies.thesis.claims import Part
    from friso_thesis.studies.thesis.laws import ConclusionByLaw, ConclusionsByLaw

TITLE = "Conclusions of the thesis under each friction law"


def laws_sentences(laws: ConclusionsByLaw) -> list[str]:
    """Say how many conclusions survive other friction laws, and which do not.

    Laws under which nothing was judged are named, each with the measured friction that it does not match.
    """
    count, of_one = len(laws.conclusions), [conclusion.claim.id for conclusion in laws.dependent]
    others = ", ".join(laws.laws[1:])
    alike = f"{count - len(of_one)} of {count} conclusions have the same judgement"
    lines = [f"{alike} under every law that preserves what is measured ({others})."]
    if of_one:
        lines.append(f"These depend on the law: {listed(of_one, 'and')}.")
    lines += [f"{law} does not keep {listed([SHOWN[k] for k in lost], 'and')}." for law, lost in laws.left_out.items()]
    return lines


def laws_rows(laws: ConclusionsByLaw) -> list[tuple[str, list[str]]]:
    """Return the judgement of every claim under each law, as table rows."""
    return [(c.claim.id, [_judgement_by_law(c, law) for law in laws.laws]) for c in laws.conclusions]


def _judgement_by_law(conclusion: ConclusionByLaw, law: str) -> str:
    turned = conclusion.turned(law)
    return f"{conclusion.judgement(law)}: {'; '.join(turned)}" if turned else str(conclusion.judgement(law))


def laws_document(laws: ConclusionsByLaw) -> dict[str, Any]:
    """Return the judgements under each law for the JSON document."""
    return {
        "laws": list(laws.laws),
        "left_out": {law: [SHOWN[kind] for kind in lost] for law, lost in laws.left_out.items()},
        "conclusions": [
            {
                "id": conclusion.claim.id,
                "claim": conclusion.claim.text,
                "judgements": {law: conclusion.judgement(law) for law in laws.laws},
                "turned": {law: list(turned) for law in laws.laws if (turned := conclusion.turned(law))},
            }
            for conclusion in laws.conclusions
        ],
    }


SHORT_FORM = 160
"""Longest short form of a finding, in letters."""

AGREEMENT = {
    "holds": "agrees",
    "depends": "depends",
    "holds in part": "in part",
    "differs": "contradicts",
    "not decided enough": "not decided enough",
    "not decided yet": "not decided yet",
    "cannot be decided": "not decidable",
    "not yet covered": "not computed",
}
"""Word of agreement for each judgement."""


def in_order(verdicts: Iterable[ClaimVerdict]) -> list[ClaimVerdict]:
    """Return the verdicts in the order in which the thesis makes the claims."""
    return sorted(verdicts, key=lambda verdict: verdict.claim.place)


def short(text: str) -> str:
    """Return the first statements of a text that fit into `SHORT_FORM` characters, at least one."""
    first = text.split(". Assumed", 1)[0]
    ends = [match.start() for match in re.finditer(r"; |\. (?=[A-Z])|$", first)]
    return first[: max((end for end in ends if end <= SHORT_FORM), default=ends[0])]


def numbers(verdict: ClaimVerdict) -> str:
    """Return the numbers of all criteria of a claim in one line; "" if it is not covered."""
    return "; ".join(part.number for part in verdict.finding.stated) if verdict.finding else ""


def met(verdict: ClaimVerdict) -> str:
    """Return how many criteria of a claim are met, and are undecided; "" if the claim was not judged."""
    if verdict.finding is None:
        return ""
    pattern = verdict.finding.pattern
    undecided = f", {pattern.count(None)} undecided" if None in pattern else ""
    return f"{pattern.count(True)} of {len(pattern)}{undecided}"


def share(verdict: ClaimVerdict) -> str:
    """Say in how many of the draws that decide a claim holds, with the interval that judges it.

    The text is empty if no draw was made.
    """
    if verdict.space is None:
        return ""
    space = verdict.space
    interval = f"{percent(space.holds.low)} to {percent(space.holds.high)}".replace(" %", "\u00a0%")
    undecided = f"; {space.undecided} undecided" if space.undecided else ""
    return f"{space.count} of {space.decided} ({interval}{undecided})"


def in_draws(verdict: ClaimVerdict, part: int) -> str:
    """Say for how many random choices of the open values one of several criteria is met.

    The text is empty for a claim with one criterion, whose fraction is stated with the claim.
    """
    space = verdict.space
    if space is None or len(space.parts) < 2:
        return ""
    return f"met in {space.met(part)} of {space.draws} draws"


def attracts(verdict: ClaimVerdict) -> str:
    """Return in a word how far a claim agrees by what attracts the stages, not by peak counts.

    The result is "" if this was not computed or does not matter.
    """
    return AGREEMENT[verdict.attracts.judgement] if verdict.attracts else ""


def criterion_word(part: Part) -> str:
    """Return "agrees" or "does not agree" for a criterion, or "undecided"."""
    return "undecided" if part.open else "agrees" if part.holds else "does not agree"


def reasons(verdict: ClaimVerdict) -> list[str]:
    """Return why a claim does not hold: the first sentence of each reason; empty without any.

    For several criteria, each reason names the criteria to which it belongs. The rest is among the details.
    """
    parts = verdict.finding.stated if verdict.finding else ()
    places: dict[str, list[str]] = {}
    for place, part in enumerate(parts, 1):
        if text := _why(part):
            places.setdefault(_first_sentence(text), []).append(str(place))
    if len(parts) == 1 and places:
        return [*places]
    if not places:
        return [_first_sentence(verdict.reason)] if verdict.reason else []
    return [f"Criteri{'a' if len(of) > 1 else 'on'} {listed(of, 'and')}: {why}" for why, of in places.items()]


def whole_reasons(verdict: ClaimVerdict) -> str:
    """Return all reasons for which criteria are not met or undecided, whole; "" if there are none."""
    parts = verdict.finding.stated if verdict.finding else ()
    return " ".join(dict.fromkeys(text for part in parts if (text := _why(part))))


def _why(part: Part) -> str:
    """Return why a criterion is not met, or is undecided; "" if it is met."""
    return part.open or ("" if part.holds else part.why)


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=\.) (?=[A-Z])", text, maxsplit=1)[0]


def details(verdict: ClaimVerdict) -> list[tuple[str, str]]:
    """Return the details of a claim for the end of its section: pairs of a name and a text.

    The texts are numbers and reasons that are shortened above, numbers by what attracts the stages, and draws that
    decide nothing. A last text says what another grid or tolerance changes.
    """
    parts = verdict.finding.stated if verdict.finding else ()
    rows = [
        (f"Criterion {place}", part.number) for place, part in enumerate(parts, 1) if short(part.number) != part.number
    ]
    rows += (
        [("Reason", whole_reasons(verdict))] if any(_first_sentence(_why(part)) != _why(part) for part in parts) else []
    )
    if verdict.attracts:
        rows += [
            (f"Criterion {place}, by what attracts", f"{criterion_word(part)}: {part.number}")
            for place, part in enumerate(verdict.attracts.stated, 1)
        ]
    failures = verdict.space.failures if verdict.space else {}
    rows += [(f"{draw_name(number).capitalize()}, undecided", text) for number, text in failures.items()]
    return rows + [("Method", text) for text in verdict.turned.values()]


def self_tests(verdicts: Iterable[ClaimVerdict]) -> list[tuple[str, Part]]:
    """Return the criteria by which friso only tests itself, each with the number of its claim."""
    return [
        (verdict.claim.id, part)
        for verdict in verdicts
        if verdict.finding
        for part in verdict.finding.parts
        if part.self_test
    ]


def open_rows() -> list[Sequence[str]]:
    """Return the values that the thesis leaves open.

    Each row has the range, how values are drawn from it, friso's own choice, and the reason.
    """
    drawn = {"even": "evenly", "log": "evenly in the logarithm", "either": "one of the two"}
    return [
        (
            value.name,
            f"{value.low:g} to {value.high:g} {value.unit}".rstrip(),
            drawn[value.scale],
            f"{value.baseline:g} {value.unit}".rstrip(),
            value.reason,
        )
        for value in OPEN
    ]


def fit_sentence(plausible: Plausible) -> str:
    """Say which random choice of the open values fits the numbers printed in the thesis best.

    friso's own choice counts too. The sentence also names the numbers compared. It is empty if no choice was compared.
    """
    fit = plausible.fit
    if fit is None:
        return ""
    units = {value.name: value.unit for value in OPEN}
    values = ", ".join(f"{name} {value:.3g} {units[name]}".rstrip() for name, value in fit.draw.values.items())
    count, claims = len(fit.numbers), ", ".join(dict.fromkeys(item.claim for item in fit.numbers))
    compared = (
        f"{count} printed number{'s' if count > 1 else ''} ({claims}), all on maps of {MAP_POINTS} x {MAP_POINTS}"
    )
    off = f"off by a factor of {math.exp(fit.misfit):.2f} (RMS of the logarithm)"
    tried = f"Of friso's own choice and {fit.draws} joint draws"
    if fit.draw.number < 0:
        return f"{tried}, friso's own choice fits best: {off}, by {compared}."
    own = (
        f"friso's own choice by {math.exp(fit.at_baseline):.2f}"
        if math.isfinite(fit.at_baseline)
        else "at friso's own choice not all of them are found"
    )
    return f"{tried}, {fit.draw.name} fits best: {off}, by {compared}; {own}. Its values: {values}."


def fit_rows(plausible: Plausible) -> list[Sequence[str]]:
    """Return rows of numbers printed in the thesis, beside those of the best open values.

    There are none if no choice of open values was compared.
    """
    if plausible.fit is None:
        return []
    return [
        (item.claim, item.criterion, f"{item.printed:g}", f"{item.read:.3g}", f"{item.read / item.printed:.2f}")
        for item in plausible.fit.numbers
    ]


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
        "S342F", 0, False,
        "A higher crossover settles sooner, but the loop is also stable where it crosses 0 dB about the first "
        "eigenfrequency.",
    ),
    Remark(
        "S323C", 1, False,
        "ode23s serves, but ode45 would too: with the thesis's steps it is stable, right and cheaper, and without a "
        "largest step only dearer.",
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
        finding = verdicts[remark.claim].finding if remark.claim in verdicts else None
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
