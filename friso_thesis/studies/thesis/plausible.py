"""Judge the claims for random choices of the values that the thesis does not state.

Such a choice of all values is a joint draw. The module finds in how many draws each claim holds, on which values that
depends, and which draw fits the printed numbers best. No more draws are made for a claim once they have decided.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.errors import one_line
from friso.intervals import DOUBT_PROBABILITY, Share, separation, share
from friso.progress import Tally, silent
from friso_thesis.studies.thesis.claims import (
    ClaimJudgement,
    Evidence,
    Finding,
    Part,
    Registered,
    by_peak_count,
    by_way,
)
from friso_thesis.studies.thesis.evidence import RESPONSES, evidence
from friso_thesis.studies.thesis.experiments import EXPERIMENTS
from friso_thesis.studies.thesis.kept import NOT_KEPT, Kept
from friso_thesis.studies.thesis.linear import NEEDS
from friso_thesis.studies.thesis.space import DRAW_SEED, FORCE_NOISE, OPEN, Draw, baseline, draw, enters
from friso_thesis.studies.thesis.studies import STUDIES

DRAW_LOOKS = (7, 17, 51)  # [draws]
"""Numbers of draws after which a claim is looked at; a claim whose interval has decided is drawn no further. Seven
draws that all hold lie above `HALF_SHARE`, seventeen of which none does below `RARE_SHARE`, and with fifty-one an
interval is at most a third wide. Looking three times, each interval may miss by a third of 5 %."""

DRAW_COUNT, ANALYSED_PART = DRAW_LOOKS[-1], 3
"""Default number of joint draws, and that number over the number of draws with linear analysis and experiments, which
take longer than all maps."""

MAP_POINTS = 21
"""Values per axis of the maps of a draw, whatever the baseline has. Limits are interpolated."""

DRAW_RTOL = 1e-5
"""Relative tolerance of the maps of a draw: ten times tighter than the thesis's own."""

CHANCE_PROBABILITY = 0.05
"""Probability of a chance separation above which it is not reported, for all values of a claim together."""

Findings = dict[str, Finding]
"""Findings by name, such as that of a claim."""

PARTS = {**NEEDS, **EXPERIMENTS}
"""Parts of the evidence besides maps and responses."""


@dataclass(frozen=True)
class Separation:
    """How well a value separates the draws in which a claim holds from the others.

    The `correlation` is the rank-biserial one (Kerby 2014, doi 10.2466/11.IT.3.1): 1 if the claim holds at all the
    larger values. `chance` is the probability of such a correlation by chance.
    """

    value: str
    correlation: float
    chance: float


@dataclass(frozen=True)
class MetPart:
    """In how many random choices of the open values a criterion is met, and the fraction."""

    met: int
    share: Share


STRAY_SHARE = 0.05
"""Share that the lower end of an interval must exceed to say that a claim holds in more than stray draws. It is
that of “few” cells of a map. Twice as much would need ten of 51 draws."""

LEAST_DECIDED = 7  # [draws]
"""Least number of decided draws. With fewer, even if all agree, the interval of the share reaches below a half."""

HALF_SHARE = 0.5
"""Share of the draws in which a claim must hold to agree; the whole interval must lie above it. With less, a claim
could fail in most of what the thesis leaves open."""

RARE_SHARE = 0.25
"""Largest share of the draws in which a claim that fails at friso's choice may hold, and still fail. The upper end
of the interval counts: seventeen draws without one that holds show it, and one of 51 does not turn it."""


@dataclass(frozen=True)
class ClaimInSpace:
    """How a claim of the thesis fares over random choices (draws) of the open values.

    `seeds` identifies each draw by (random seed, number of the draw). `count` is the number of draws in which the claim
    holds, and `holds` their fraction of the draws that decide; `parts` has the fraction for each part of the claim.
    `hangs_on` lists the values that decide whether the claim holds, the most decisive first. A draw counts as
    `undecided` if no criterion fails but one is open, or if the claim could not be computed; `failures` has the reasons
    for the latter by number of the draw. The intervals hold, together, at all looks at a growing number of draws: each
    misses with a part of 5 %.
    """

    seeds: tuple[tuple[int, int], ...]
    holds: Share
    count: int
    parts: tuple[MetPart, ...]
    hangs_on: tuple[Separation, ...]
    undecided: int
    failures: Mapping[int, str]

    @property
    def draws(self) -> int:
        """Return how many random choices of the open values were tried."""
        return len(self.seeds)

    @property
    def decided(self) -> int:
        """Return how many random choices of the open values decide whether the claim holds."""
        return self.draws - self.undecided

    @property
    def misses(self) -> int:
        """Return for how many random choices of the open values the claim does not hold."""
        return self.decided - self.count

    def met(self, part: int) -> int:
        """Return for how many random choices of the open values a part of the claim holds."""
        return self.parts[part].met

    def judged(self, own: Finding) -> ClaimJudgement:
        """Return the judgement on a claim with the finding `own` at friso's choice of the open values.

        One rule serves all claims: the interval of the share in which a claim holds, of the draws that decide. If these
        are fewer than `least_decided`, or the interval is too wide for any other word, the claim is "not decided
        enough". It "holds" if it holds at friso's choice and the interval lies above `half_share`. If it fails at
        friso's choice and the interval ends below `rare_share`, it fails as it does there, in part or wholly. It
        "depends" if it holds somewhere (at friso's choice, or in more than stray draws) and fails somewhere.
        """
        if not turns(own):
            return own.judgement
        holds, low, high, stray = own.judgement == "holds", self.holds.low, self.holds.high, STRAY_SHARE
        if self.decided < LEAST_DECIDED:
            return "not decided enough"
        if (low > HALF_SHARE) if holds else (high <= RARE_SHARE):
            return own.judgement
        return "depends" if (holds or low > stray) and (not holds or high < 1 - stray) else "not decided enough"

    def settled(self, own: Finding) -> bool:
        """Tell whether the draws have decided: no more of them turn the judgement if the interval holds the share."""
        border = HALF_SHARE if own.judgement == "holds" else RARE_SHARE
        decides = self.holds.low > border or self.holds.high <= border
        return not turns(own) or (self.decided >= LEAST_DECIDED and decides)


def turns(own: Finding) -> bool:
    """Tell whether draws can turn the judgement of a finding at friso's choice: a criterion fails, or all hold."""
    return own.judgement == "holds" or False in own.pattern


@dataclass(frozen=True)
class PrintedNumber:
    """A number that the thesis prints for a criterion of a claim, and the one that friso finds."""

    claim: str
    criterion: str
    printed: float
    read: float


@dataclass(frozen=True)
class BestFit:
    """The random choice of open values whose numbers are nearest to the printed ones.

    friso's own choice counts as one, numbered -1. `misfit` is the root mean square of the logarithms of found over
    printed numbers, and `at_baseline` that of friso's choice. All are on maps of `MAP_POINTS` values per axis.
    `numbers` are the numbers compared, and `draws` is in how many draws all of them were judged.
    """

    draw: Draw
    misfit: float
    at_baseline: float
    numbers: tuple[PrintedNumber, ...]
    draws: int


@dataclass(frozen=True)
class Plausible:
    """Results on all claims, by name, for random choices of the open values.

    There is the best fit, None without draws. A claim without draws is not among the `claims`.
    """

    draws: tuple[Draw, ...]
    claims: Mapping[str, ClaimInSpace]
    fit: BestFit | None


def plausible(
    entries: Mapping[str, Registered],
    findings: Mapping[str, Finding],
    draws: int,
    kept: Kept = NOT_KEPT,
    tally: Tally | None = None,
) -> Plausible:
    """Judge the claims for up to `draws` random choices of the values that the thesis leaves open.

    `findings` are those at friso's own choice; a claim whose judgement draws cannot turn, or that nothing drawn enters,
    has no draws. The others are looked at after some draws, and those that have decided are drawn no further. Claims on
    linear analysis or experiments are judged in the first draws alone, one of `ANALYSED_PART`. Claims that print a
    number are also judged at friso's own choice on maps as coarse as those of a draw: it may be the best fit. `kept`
    has saved findings, and `tally` counts the progress.
    """
    tally, drawn = tally or Tally(silent, 0), tuple(draw(number) for number in range(draws))
    tried: dict[str, list[tuple[Draw, Finding | None]]] = {}
    failures: dict[str, dict[int, str]] = {name: {} for name in entries}
    by_claim: dict[str, ClaimInSpace] = {}

    def judged(one: Draw, group: Mapping[str, Registered]) -> Findings:
        about = ("findings", "draw", sorted(group), MAP_POINTS, DRAW_RTOL, DRAW_SEED, one.number)
        by_name = kept.result(about, Findings, partial(_judged, group, one))
        tally.add(_work(group), f"{one.name} of {draws}" if one in drawn else "friso's own choice")
        return by_name

    left = {name: entry for name, entry in entries.items() if turns(findings[name])}
    tally.total -= work_of(entries, draws) - work_of(left, draws)
    for first, last in pairwise((0, *looks(draws))):
        pieces = [(one, group) for one in drawn[first:last] if (group := _judged_in(left, one.number, draws))]
        each_finding = side_by_side([partial(judged, *piece) for piece in pieces])
        for (one, group), by_name in zip(pieces, each_finding, strict=True):
            for name in group:
                finding = by_name.get(name)
                tried.setdefault(name, []).append((one, finding))
                failures[name] |= {} if finding else {one.number: by_name[f"{name} {FAILED}"].parts[0].number}
        by_claim |= {name: _in_space(entries[name], tried[name], failures[name]) for name in left if name in tried}
        ahead = work_of(left, draws, last)
        left = {name: entry for name, entry in left.items() if not _settled(by_claim.get(name), findings[name])}
        tally.total -= ahead - work_of(left, draws, last)
    printing = {name: entries[name] for name in tried if numbers_of(name, findings[name])}
    tally.total += _work(printing)
    own = judged(baseline(), printing) if printing else {}
    return Plausible(drawn, by_claim, _fit({name: tried[name] for name in printing}, own))


def _settled(space: ClaimInSpace | None, own: Finding) -> bool:
    return space is not None and space.settled(own)


def looks(draws: int) -> tuple[int, ...]:
    """Return after how many of at most `draws` draws the claims are looked at."""
    return (*(count for count in DRAW_LOOKS if count < draws), draws) if draws else ()


def _judged_in(entries: Mapping[str, Registered], number: int, draws: int) -> dict[str, Registered]:
    """Return the claims that are judged in one of `draws` draws, by its number."""
    analysed = number < draws // ANALYSED_PART
    return {
        name: entry for name, entry in entries.items() if entry.needs and (analysed or not entry.needs & PARTS.keys())
    }


def work_of(entries: Mapping[str, Registered], draws: int, first: int = 0) -> int:
    """Return the most work that draws from the number `first` on take, in units of the progress tally."""
    return sum(_work(_judged_in(entries, number, draws)) for number in range(first, draws))


EXPERIMENT_WORK = (
    ("locked_line", 700),
    ("joint_steps", 140),
    ("slow_motion", 90),
    ("constant_speed", 4100),
    ("rig_loops", 1000),
    ("moves", 4600),
    ("grid", 9500),
    ("cycles", 3700),
    ("standstill", 3000),
    ("traces", 1000),
)  # [runs]
"""Work of each experiment on a drawn rig, in runs of a map: as measured on three drawn rigs, in milliseconds of
processor time. Equal work for all told half an hour for claims of half a minute."""

LINEAR_WORK = 2500  # [runs]
"""Work of the linear analysis of a rig, in runs of a map: 2.5 s of processor time."""

RESPONSE_WORK = 40  # [runs]
"""Work of a run in time, in runs of a map, for the progress: 40 ms of processor time against 1 ms."""


def _work(entries: Mapping[str, Registered]) -> int:
    """Return the work of judging these claims in one draw, in units of the progress tally."""
    needs = {need for entry in entries.values() for need in entry.needs}
    maps = len(needs & STUDIES.keys()) * MAP_POINTS**2
    experiments = sum(work for name, work in EXPERIMENT_WORK if name in needs)
    linear = LINEAR_WORK * bool(needs & NEEDS.keys())
    return maps + experiments + linear + RESPONSE_WORK * len(needs & RESPONSES.keys())


def counted(entry: Registered, base: Evidence) -> Finding:
    """Return a judge's finding by the thesis's criterion: a stage hunts if peaks are counted."""
    return entry.judge(by_way(base, by_peak_count))


def _judged(entries: Mapping[str, Registered], one: Draw) -> Findings:
    """Judge the claims in one draw of the open values, and return the findings by claim.

    A claim that cannot be computed there gets the reason.
    """
    needs = {need for entry in entries.values() for need in entry.needs}
    try:
        base = evidence(needs, MAP_POINTS, DRAW_RTOL, changes=one.changes)
        base = replace(base, force_noise=one.values[FORCE_NOISE])
    except _SHOWS_NOTHING as error:
        return {f"{name} {FAILED}": _failure(error) for name in entries}
    findings: Findings = {}
    for name, entry in entries.items():
        try:
            findings[name] = counted(entry, base)
        except _SHOWS_NOTHING as error:
            findings[f"{name} {FAILED}"] = _failure(error)
    return findings


def _failure(error: Exception) -> Finding:
    """Return the finding for a claim that an error leaves undecided, for some open values."""
    return Finding.of(Part("can be computed", False, one_line(f"{type(error).__name__}: {error}")))


FAILED = "failed"
"""Suffix of the name of a claim that could not be computed."""

_SHOWS_NOTHING = ValueError, ArithmeticError, RuntimeError
"""Errors that mean that an experiment on a drawn rig shows nothing, such as a loop that stops. Errors of the program
are of other types."""


def _in_space(
    entry: Registered, tried: Sequence[tuple[Draw, Finding | None]], failures: Mapping[int, str]
) -> ClaimInSpace:
    findings = [(one, finding) for one, finding in tried if finding]
    decided = [(one, finding) for one, finding in findings if finding.judgement == "holds" or False in finding.pattern]
    holds = np.array([finding.judgement == "holds" for _, finding in decided], bool)
    return ClaimInSpace(
        tuple((DRAW_SEED, one.number) for one, _ in tried),
        _share(holds, len(holds)),
        int(holds.sum()),
        tuple(_met(column, len(tried)) for column in zip(*(finding.pattern for _, finding in findings), strict=True)),
        tuple(_separations(entry, [one for one, _ in decided], holds)),
        len(tried) - len(decided),
        failures,
    )


def _met(column: Sequence[bool | None], count: int) -> MetPart:
    """Return in how many of `count` random choices of the open values a criterion is met.

    `column` says for each choice whether it is met. Choices that `column` lacks, or has as None, are undecided.
    """
    flags = np.array([holds for holds in column if holds is not None], bool)
    return MetPart(int(flags.sum()), _share(flags, count))


def _share(flags: np.ndarray, count: int) -> Share:
    """Return the fraction of true flags among `count` random choices, with its interval.

    Choices without a flag count as undecided. All looks together miss the fraction with a probability of 5 %.
    """
    missing = count - len(flags)
    decided = np.append(np.ones(len(flags), bool), np.zeros(missing, bool))
    return share(np.append(flags, np.zeros(missing, bool)), decided, DOUBT_PROBABILITY / len(DRAW_LOOKS))


def _separations(entry: Registered, drawn: Sequence[Draw], holds: np.ndarray) -> Iterator[Separation]:
    """Yield the open values that separate draws in which a claim holds, by more than chance.

    The test is Mann and Whitney's, with Bonferroni's correction.
    """
    if holds.all() or not holds.any():
        return
    values = [value for value in OPEN if enters(value, entry.needs, RESPONSES, PARTS)]
    every = []
    for value in values:
        numbers = np.array([one.values[value.name] for one in drawn])
        every.append(Separation(value.name, *separation(numbers, holds)))
    chosen = [item for item in every if item.chance < CHANCE_PROBABILITY / len(values)]
    yield from sorted(chosen, key=lambda item: -abs(item.correlation))


def _fit(
    by_claim_tried: Mapping[str, Sequence[tuple[Draw, Finding | None]]], own: Mapping[str, Finding]
) -> BestFit | None:
    """Return the draw, or friso's `own` choice, that fits the printed numbers best.

    Hunting is judged by the peak count. A draw of which a number is unknown is left out. Returns None if no draw is
    left.
    """
    first = baseline()
    by_draw: dict[int, list[PrintedNumber]] = {
        first.number: [item for name, finding in own.items() for item in numbers_of(name, finding)]
    }
    drawn: dict[int, Draw] = {first.number: first}
    for name, tried in by_claim_tried.items():
        for one, finding in tried:
            drawn[one.number] = one
            if finding:
                by_draw.setdefault(one.number, []).extend(numbers_of(name, finding))
    most = max(len(numbers) for numbers in by_draw.values())
    misfits = {number: _misfit(numbers) for number, numbers in by_draw.items() if len(numbers) == most}
    usable = {number: value for number, value in misfits.items() if np.isfinite(value)}
    if not usable:
        return None
    best = min(usable, key=lambda number: usable[number])
    others = len(misfits.keys() - {first.number})
    return BestFit(drawn[best], usable[best], misfits.get(first.number, np.inf), tuple(by_draw[best]), others)


def numbers_of(claim: str, finding: Finding) -> list[PrintedNumber]:
    """Return the numbers that the thesis prints for a claim, beside those of a finding."""
    return [
        PrintedNumber(claim, part.criterion, part.printed, part.read)
        for part in finding.parts
        if np.isfinite(part.printed)
    ]


def _misfit(numbers: Sequence[PrintedNumber]) -> float:
    """Return the root mean square of ln(found/printed); infinite if a number is not found."""
    ratios = np.array([item.read / item.printed for item in numbers], float)
    if not ratios.size or not (np.isfinite(ratios) & (ratios > 0)).all():
        return np.inf
    return float(np.sqrt(np.mean(np.log(ratios) ** 2)))
