"""Find edges of hunting by brute force.

At many bandwidths a stage is started from many places and followed for long. Stages are drawn as in `benchmarks.truth`,
from a separate seed; results are in `edges.jsonl`, a line for each stage. Friso has no part in that file;
`independent.py` asks friso about its stages.
"""

import json
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.by_hand import ByHand, NotWritten, Run, by_hand
from benchmarks.truth.classes import classes_of
from benchmarks.truth.draws import SERIES, draw
from benchmarks.truth.swings import FAILED, RESTS, SWINGS, UNSURE, judge, legs

FILE = Path(__file__).with_name("edges.jsonl")

SEED = 5306

Quota = tuple[str, tuple[int, ...], int]

QUOTAS: tuple[Quota, ...] = (
    ("stages", (0, 1, 2, 5, 7, 8), 24),
    ("machines", (2,), 12),
    ("machines", (1, 6), 12),
    ("drives", (0,), 12),
)
"""Classes of stages: series of `benchmarks.truth.draws`, the forms taken from it, and the wanted number of stages with
an edge. The classes are rigid, free and locked stages with several laws; dead bands of the error; backlash; and
frictions at motor and load."""

FACTORS = (0.25, 0.4, 0.63, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0)
"""Bandwidths tried, relative to the stage's own: friso's range."""

BRACKET, WIDEST = 1.015, 1.06
"""Ratio of the two bandwidths that finally bracket an edge, and largest ratio that still counts as an edge if
bandwidths in between were not decided."""

DISTANCES = np.geomspace(0.03, 60.0, 12)
"""Distances of releases, and of stuck stages, in deflections of the loop at break-away."""

ABOUT = (1.0, 0.97, 1.03, 0.93, 1.07)
"""Fractions of the amplitude at a neighbouring bandwidth at which the stage is also started."""

ROUNDS, PATIENT = (40.0, 250.0, 1500.0), 4
"""Periods for which undecided runs are followed, round by round, and most runs of the last round."""

ROUGH, FINE = 1e-6, 1e-7
"""Relative tolerances: of all runs, and of runs that confirm a swing."""

BUDGET = 1_500_000
"""Most steps for a stage at one bandwidth."""

SMALL = 2e-3
"""Swing, over the deflection at break-away, below which a stage counts as at rest."""

CONFIRMED = (0.99, 1.01)
"""Factors on the state of a swing from which, at the finer tolerance, the swing must be resumed."""

LONG, KEPT = 8, 0.9
"""Number of rounds, each as long as the first one, for confirming a swing at an edge, and the fraction of its spread
that must remain."""

Record = dict[str, Any]


def kept() -> list[Record]:
    """Return the stages in the file."""
    return [json.loads(line) for line in FILE.read_text().splitlines()] if FILE.exists() else []


def grow(seconds: float) -> None:
    """Add stages to the file for some time [s], or until every class has enough edges.

    Stages without an edge stay in the file. A stage in the file is not done again.
    """
    begun, records = time.monotonic(), kept()
    there = {(record["series"], record["number"]) for record in records}
    queues = {quota: _written(*quota[:2]) for quota in QUOTAS}
    while time.monotonic() - begun < seconds:
        shares = {quota: edges_of(quota, records) / quota[2] for quota in QUOTAS}
        if min(shares.values()) >= 1:
            return
        quota = min(shares, key=shares.__getitem__)
        key = next(key for key in queues[quota] if key not in there)
        records.append(by_brute_force(*key))
        there.add(key)
        with FILE.open("a") as stream:
            stream.write(json.dumps(records[-1]) + "\n")
        print(f"  {key}: {records[-1]['edge']}, {records[-1]['cpu']} s", flush=True)


def of_quota(quota: Quota, records: Iterable[Record]) -> list[Record]:
    """Return the stages of a class."""
    series, forms, _ = quota
    return [r for r in records if r["series"] == series and r["number"] % len(SERIES[series]) in forms]


def edges_of(quota: Quota, records: Iterable[Record]) -> int:
    """Return how many stages of a class have an edge."""
    return sum(record["edge"] is not None for record in of_quota(quota, records))


def _written(series: str, forms: tuple[int, ...]) -> Iterator[tuple[str, int]]:
    """Yield series and number of stages with integral action and equations by hand."""
    for number in count():
        if number % len(SERIES[series]) not in forms:
            continue
        with suppress(NotWritten):
            plain = by_hand(draw(SEED, number, series).flat()).held().faster(1.0)
            if np.isfinite(plain.period) and not plain.remembers:
                yield series, number


def by_brute_force(series: str, number: int) -> Record:
    """Return what becomes of a stage at many bandwidths, and between which two hunting ends."""
    start, flat = time.process_time(), draw(SEED, number, series).flat()
    words = _words(by_hand(flat).held())
    edge = edge_of(words)
    return {
        "series": series,
        "seed": SEED,
        "number": number,
        "classes": classes_of(flat),
        "words": {f"{factor:.6g}": word for factor, word in sorted(words.items())},
        "edge": edge if edge and edge[1] / edge[0] <= WIDEST else None,
        "cpu": round(time.process_time() - start, 1),
    }


def _words(plain: ByHand) -> dict[float, str]:
    words, swings = dict[float, str](), dict[float, float]()

    def attempt(factor: float) -> None:
        near = min(swings, key=lambda other: abs(np.log(other / factor)), default=None)
        words[factor], amplitude = what_becomes(plain.faster(factor), swings[near] if near else 0.0)
        if words[factor] == SWINGS:
            swings[factor] = amplitude

    for factor in FACTORS:
        attempt(factor)
    if words[1.0] == SWINGS:
        words[1.0], _ = what_becomes(plain, swings[1.0], lasting=True)
    while edge := edge_of(words):
        middle = round(float(np.sqrt(edge[0] * edge[1])), 6)
        if edge[1] / edge[0] > BRACKET and not any(edge[0] < factor < edge[1] for factor in words):
            attempt(middle)
            continue
        words[edge[0]], _ = what_becomes(plain.faster(edge[0]), swings[edge[0]], lasting=True)
        if words[edge[0]] == SWINGS:
            break
    return words


def edge_of(words: Mapping[float, str]) -> list[float] | None:
    """Return the two bandwidths between which hunting ends as bandwidth rises, or None.

    It is the last such pair above the stage's own bandwidth if the stage swings there, or else the nearest pair below.
    Nothing is decided between the two.
    """
    decided = [factor for factor in sorted(words) if words[factor] != UNSURE]
    pairs = [[low, high] for low, high in pairwise(decided) if (words[low], words[high]) == (SWINGS, RESTS)]
    above = words[1.0] == SWINGS
    pairs = [pair for pair in pairs if (pair[0] >= 1 if above else pair[1] <= 1)]
    return pairs[-1] if pairs else None


def what_becomes(plain: ByHand, amplitude: float = 0.0, lasting: bool = False) -> tuple[str, float]:
    """Return whether a stage keeps swinging from any start, and how far [m].

    It is also started around an `amplitude` [m]. Near an edge swings may die out after hundreds of periods: `lasting`
    follows them longer. Work beyond `BUDGET` steps leaves it undecided.
    """
    starts, steps = [*_starts(plain, amplitude)], 0
    for periods, most in ((ROUNDS[0], len(starts)), (ROUNDS[1], len(starts)), (ROUNDS[2], PATIENT)):
        going = []
        for start in starts[:most]:
            if steps > BUDGET:
                return UNSURE, np.nan
            word, run = _followed(plain, start, periods, ROUGH, periods == ROUNDS[-1])
            steps += run.steps
            if word == FAILED:
                return FAILED, np.nan
            if word == SWINGS and _confirmed(plain, run.state, LONG if lasting else 1):
                return SWINGS, run.spread / 2
            if word != RESTS:
                going.append(run.state)
        starts = going + starts[most:]
    return (UNSURE if starts else RESTS), np.nan


def _starts(plain: ByHand, amplitude: float) -> Iterator[np.ndarray]:
    for share in ABOUT if amplitude else ():
        yield plain.stuck(share * amplitude)
    for place, distance in enumerate(DISTANCES[::-1] * plain.length):
        yield plain.stuck(distance if place % 2 else -distance)
        yield plain.jumped(-distance if place % 2 else distance)


def _followed(plain: ByHand, start: np.ndarray, periods: float, rtol: float, last: bool) -> tuple[str, Run]:
    """Return what becomes of a run, and the run."""
    end = periods * plain.period
    run = plain.long_run(start, end, rtol)
    small = SMALL * plain.length
    return judge(legs(run.times, run.places, end), run.spread, small, last) if run.done else FAILED, run


def _confirmed(plain: ByHand, state: np.ndarray, rounds: int) -> bool:
    """Tell whether neighbours of a state on a swing resume that swing.

    They must keep `KEPT` of its spread for the given number of rounds.
    """
    for factor in CONFIRMED:
        spreads, near = list[float](), factor * state
        for _ in range(rounds):
            word, run = _followed(plain, near, ROUNDS[0], FINE, True)
            if word != SWINGS:
                return False
            spreads.append(run.spread)
            near = run.state
        if min(spreads) < KEPT * spreads[0]:
            return False
    return True
