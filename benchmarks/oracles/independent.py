"""Compare friso's verdicts and edges with those of brute force (`edges.py`), class by class."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.by_hand import ByHand, by_hand
from benchmarks.code_digest import code_digest
from benchmarks.oracles.edges import FINE, QUOTAS, ROUNDS, Quota, Record, kept, of_quota
from benchmarks.oracles.oracle import Finding, Oracle
from benchmarks.report import Task, each
from benchmarks.truth.claims import ATTRACTED
from benchmarks.truth.draws import draw
from benchmarks.truth.kept import CHECKED
from benchmarks.truth.swings import RESTS, SWINGS
from friso.engine.kernel import kernel, kernels
from friso.equations.bandwidth import faster
from friso.equations.structure import structure
from friso.hunting import AttractionEnd, Swinging, check_given, find_swings, needed_kernels
from friso.stage import Stage

ANSWERS = Path("benchmark_results/oracles.jsonl")
"""Friso's answers, a line each, with a digest of the code that gave them. Stages in the file are not asked again."""

CLASSES = ("one friction", "dead band of the error", "backlash", "friction at the motor and at the load")
"""Names of the classes of `edges.QUOTAS`."""

VERDICT, MISSED = "verdict", "edge; plain runs begun on friso's orbit swing on up to friso's"

JUST_BELOW, LASTING, SAME_SWING = 0.9975, 5, 0.01
"""Fraction of friso's edge at which plain runs start on its own motion, rounds for which they are followed, and the
largest relative difference of their amplitude."""

SLACK = 1e-3
"""Relative distance by which an edge may lie outside brute force's bracket: the error of runs at 1e-6."""


def answer(record: Record) -> Record:
    """Return what friso says about a stage."""

    def asked(_: Task) -> Record:
        stage = draw(record["seed"], record["number"], record["series"])
        kernels(needed_kernels(stage))
        with np.errstate(all="ignore"):
            return checked(stage)

    task = record["series"], record["seed"], record["number"], code_digest(CHECKED)
    return next(said for _, said in each([task], asked, ANSWERS))


def checked(stage: Stage) -> Record:
    """Return what friso says about a stage as given, as data; an end beyond the range searched is None."""
    said = check_given(stage).judgement
    edge = said.margin and {"factor": said.margin.factor, "certain": said.margin.certain, "quiet": said.margin.quiet}
    verdict = "runs away" if said.runs_away else said.verdict
    windows = [[_end(window.low), _end(window.high)] for window in said.windows]
    return {"verdict": verdict, "certain": said.hunting.certain, "edge": edge, "windows": windows}


def _end(end: AttractionEnd | None) -> Record | None:
    return end and {"factor": end.inside, "quiet": end.outside}


def edges() -> Iterator[Finding]:
    records, beside = kept(), list[tuple[str, Record, Record]]()
    for name, quota in zip(CLASSES, QUOTAS, strict=True):
        own = compared(quota, records)
        beside += [(name, record, answer(record)) for record in own]
        yield from by_class(name, [pair[1:] for pair in beside if pair[0] == name])
    for name, record, said in beside:
        for what, words in differences(record, said):
            sure = said["certain"] if what == VERDICT else _sure_edge(said)
            case = f"{record['series']} {record['seed']}:{record['number']} ({name}), {what}"
            text = f"{words[0]} ({'certain' if sure else 'not certain'})"
            yield Finding(case, text, words[1], False if sure and what != MISSED else None)


def compared(quota: Quota, records: Sequence[Record]) -> list[Record]:
    """Return the stages of a class that have an edge, and as many without one.

    The latter are decided at their own bandwidth.
    """
    own = [record for record in of_quota(quota, records) if record["words"]["1"] in (SWINGS, RESTS)]
    with_edge = [record for record in own if record["edge"]]
    return with_edge + [record for record in own if not record["edge"]][: len(with_edge)]


def missed(record: Record, said: Record) -> bool:
    """Tell whether brute force missed a swing, because basins near an edge are narrow.

    It did if its edge lies below friso's, no run swings above friso's edge, and plain runs started on friso's own
    motion just below it keep swinging.
    """
    end = said["edge"]
    if not end or not record["edge"] or record["edge"][1] > end["factor"] or beyond(record, said):
        return False
    factor = end["factor"] * JUST_BELOW
    flat = draw(record["seed"], record["number"], record["series"]).flat()
    plain, names = by_hand(flat).held().faster(factor), [*kernel(structure(faster(flat, factor))).states]
    return any(_lasts(plain, names, motion) for motion in find_swings(faster(flat, factor)))


def _lasts(plain: ByHand, names: Sequence[str], motion: Swinging) -> bool:
    state = motion.seen if motion.cycles is None else motion.cycles.states[motion.number]
    y = plain.start() if state is None else plain.state(names, state[: len(names)])
    for _ in range(LASTING):
        run = plain.long_run(y, ROUNDS[0] * plain.period, FINE)
        if not run.done or abs(run.spread / 2 / motion.amplitude - 1) > SAME_SWING:
            return False
        y = run.state
    return True


def by_class(name: str, pairs: Sequence[tuple[Record, Record]]) -> Iterator[Finding]:
    """Yield counts of what friso is certain about, and how much of it brute force confirms."""
    sure = [(record, said) for record, said in pairs if said["certain"]]
    open_edges = sum(not _sure_edge(said) for record, said in pairs if record["edge"])
    parts = {
        "certain verdicts": [same_verdict(*pair) for pair in sure],
        "certain edges": [
            same_edge(*pair) or missed(*pair) for pair in sure if pair[0]["edge"] and _sure_edge(pair[1])
        ],
        "nothing beyond a certain edge": [not beyond(*pair) for pair in sure if _sure_edge(pair[1])],
    }
    for what, agree in parts.items():
        words = f"{len(agree)}", f"{sum(agree)} the same"
        yield Finding(f"{name}: {what}", *words, all(agree) if agree else None)
    words = f"{len(pairs) - len(sure)} verdicts, {open_edges} edges", f"of {len(pairs)} and {_with_edge(pairs)}"
    yield Finding(f"{name}: left open", *words, None)


def differences(record: Record, said: Record) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the differences, whether friso is certain or not: what was asked, and both answers."""
    if not same_verdict(record, said):
        yield VERDICT, (said["verdict"], record["words"]["1"])
    if record["edge"] and not same_edge(record, said):
        low, high = record["edge"]
        edge = said["edge"]
        own = f"{edge['factor']:.5g} to {edge['quiet']:.5g}" if edge else "none"
        name = MISSED if missed(record, said) else "edge"
        yield name, (own, f"{low:.5g} to {high:.5g}")
    if places := beyond(record, said):
        yield "beyond the edge", ("nothing attracts", f"swings at {', '.join(f'{place:.5g}' for place in places)}")


def same_verdict(record: Record, said: Record) -> bool:
    """Tell whether friso states an attractor if and only if a run keeps swinging."""
    return (said["verdict"] in ATTRACTED) == (record["words"]["1"] == SWINGS)


def same_edge(record: Record, said: Record) -> bool:
    """Tell whether an end that friso states overlaps brute force's bracket of the edge."""
    low, high = record["edge"]
    ends = [said["edge"], *(end for _, end in said["windows"])]
    return any(end["factor"] <= high * (1 + SLACK) and end["quiet"] >= low * (1 - SLACK) for end in ends if end)


def beyond(record: Record, said: Record) -> list[float]:
    """Return bandwidths beyond friso's edge at which runs swing without an attractor of friso."""
    if not said["edge"]:
        return []
    factors = [float(factor) for factor, word in record["words"].items() if word == SWINGS]
    return [f for f in factors if f > said["edge"]["quiet"] * (1 + SLACK) and not _in_window(f, said["windows"])]


def _in_window(factor: float, windows: Any) -> bool:
    for low, high in windows:
        above = low is None or factor >= min(low["factor"], low["quiet"]) * (1 - SLACK)
        if above and (high is None or factor <= max(high["factor"], high["quiet"]) * (1 + SLACK)):
            return True
    return False


def _sure_edge(said: Record) -> bool:
    return bool(said["certain"] and said["edge"] and said["edge"]["certain"])


def _with_edge(pairs: Sequence[tuple[Record, Record]]) -> int:
    return sum(record["edge"] is not None for record, _ in pairs)


ORACLES = (
    Oracle(
        "edges",
        "Stages drawn at random, dead bands, backlash and two frictions among them, hunt and stop hunting at the "
        "bandwidths at which plain simulation from many starts has them do so.",
        "Own brute force (`edges.py`): equations by hand, an integrator that shares nothing with friso "
        "(doi:10.1145/355993.355994), 24 starts at each of 9 bandwidths and between; kept in edges.jsonl",
        "Where friso is certain the verdict is the same; the edge overlaps the bracket of brute force (1.5 %, or up to "
        "6 % where what lies between was not decided), or plain runs begun on friso's own orbit swing on up to it; and "
        "no run swings on beyond it outside the windows that friso tells. Where friso is not certain, a difference is "
        "listed and counts for neither. After a first comparison swings at an edge were confirmed for longer, as "
        "brute force had taken some that die out for hunting, and the runs begun on friso's orbit were added; "
        "tolerances stayed. Looked at by hand, 26 November 2026: on drives 5306:16 brute force is wrong. Its "
        "swing at 0.38842 dies after 450 periods at 1e-8, and its neighbours leave it in friso's engine too; the "
        "320 periods over which swings at an edge are confirmed are too few for a cycle that repels so weakly.",
        edges,
    ),
)
