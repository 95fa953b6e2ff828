"""Try to refute what was claimed about a stage.

Before a claim is called wrong the attack looks closer. A swing that should not exist must attract its neighbours
(`attracts`). If nothing keeps swinging although it should, starts close to the claimed attractor must not either
(`may_attract`), at two tolerances.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.by_hand import NotWritten, by_hand
from benchmarks.truth.claims import RUNS_AWAY, Claim, Edge, least_swing
from benchmarks.truth.swings import FAILED, RESTS, SWINGS, UNSURE
from benchmarks.truth.trials import CLOSER, FINE, LINGERING, ROUGH, ROUNDS, Bench, Outcome, Trial
from friso.equations.bandwidth import bandwidth, faster, with_static_friction
from friso.hunting import Kick, ParameterMargin, Swinging, find_swings

ALL = (80, 40, 60, 20)
"""Numbers of releases, pushes, stuck and drawn starts of a whole battery."""

FEW = (16, 8, 32, 8)
"""Numbers of starts of each kind at a crossover beside an edge."""

SECOND = 24
"""Starts of a battery that are also followed at the finer tolerance, and first where any that swings is enough."""

TRIED, APART = 3, 1e-3
"""Number of swinging starts that are examined closely, and the relative difference of their amplitudes: closer ones are
the same swing."""

CONSTANTS = 10.0
"""Time for which neighbours of a claimed attractor are followed, in its time constants. If it repels by half of the
claimed attraction, they leave in that time."""

POSSIBLE = (SWINGS, UNSURE, FAILED)
"""Outcomes of neighbours that are consistent with an attractor."""

NEITHER = "from 0.1 to 1 % beside what is said to attract"

ABOVE = (1.002, 1.005, 1.01, 1.1, 1.6)
"""Factors above the edge at which nothing may attract. Those within the error of the edge are left out."""

BELOW, NEAREST = (0.995, 0.98, 0.95), 0.999
"""Factors below the edge. Something must attract at one of them, or at the nearest one, where all that friso's own
survey finds is tried."""

JUST, DENSE = 1.01, 1 + 0.06 * np.linspace(-1, 1, 24)
"""Factors up to which stages just beyond an edge are also started from swings just below it, made larger and smaller by
these factors. Beyond a flip or a fold something may attract from a narrow range there."""

KICKS, BROAD = 60, np.array([1 / 1.04, 1.0, 1.04])
"""Number of displacements tried, and factors of each that must all contradict the claim: windows narrower than 7 % may
be missed (docs/hunting.md)."""

SCIPY_PERIODS, ALIKE = 20.0, 0.03
"""Periods for which SciPy follows a swing, and the largest relative difference of its amplitude."""


@dataclass(frozen=True)
class Refutation:
    """A refuted claim, and the evidence against it.

    `of` is "verdict", "own motion", "kicks", "edge" or "static friction".
    """

    of: str
    sure: bool
    why: str


def attempts(claim: Claim, seed: int) -> dict[str, Iterator[Refutation]]:
    """Return the attempts against a claim: on its "verdict", its "edge" and its margin in "static friction".

    Only what the claim states is attempted.
    """
    bench, tried = Bench(claim.stage.flat(), claim.swing), dict[str, Iterator[Refutation]]()
    if claim.verdict == "failed" or not bench.length > 0:
        return tried
    if claim.verdict == RUNS_AWAY:
        tried["verdict"] = _away(claim, bench)
    elif bench.flat["motion.kind"] != "ramp":  # the reference never stands still
        tried["verdict"] = _hunting(claim, bench, seed)
    if claim.edge is not None:
        tried["edge"] = _edge(claim, claim.edge, seed)
    if claim.friction is not None:
        tried["static friction"] = _static_friction(claim, claim.friction, seed)
    return tried


def _hunting(claim: Claim, bench: Bench, seed: int) -> Iterator[Refutation]:
    """Test whether something attracts, the stage's own motion ends in it, and displacements do."""
    yield from _verdict(claim, bench, seed)
    yield from _own_motion(claim, bench)
    if claim.kick is not None and not claim.kick.unknown:
        yield from _kicks(claim, claim.kick, bench)


def _verdict(claim: Claim, bench: Bench, seed: int) -> Iterator[Refutation]:
    """Test whether something attracts."""
    trial = bench.starts(*ALL, seed)
    if claim.attracted:
        windows = claim.kick.windows if claim.kick else ()
        if _may_hunt(bench, trial, tuple(np.sign(low) * (low * high) ** 0.5 for low, high in windows)):
            return
        if not any(may_attract(bench, motion) for motion in claim.motions):
            yield Refutation("verdict", claim.sure, f"no start swings on, at either tolerance, nor {NEITHER}")
        return
    if why := swinging(bench, trial):
        yield Refutation("verdict", claim.sure, why)


def _may_hunt(bench: Bench, trial: Trial, kicks: tuple[float, ...] = ()) -> bool:
    """Tell whether any start may keep swinging: first a few of them, then the claimed kicks and the whole trial."""
    if SWINGS in bench.follow(_few(trial), ROUGH, ROUNDS[:1], patient=False).words:
        return True
    trials = (bench.released(np.array(kicks)), trial) if kicks else (trial,)
    runs = (bench.follow(begun, rtol) for rtol in (ROUGH, FINE) for begun in trials)
    return any(np.isin(run.words.astype(str), (SWINGS, UNSURE)).any() for run in runs)


def swinging(bench: Bench, trial: Trial) -> str:
    """Return from which start, and how, a stage keeps swinging; "" if it does not.

    Its neighbours swing as well. The text includes SciPy's answer.
    """
    for rtol, begun in ((ROUGH, trial), (FINE, _few(trial))):
        run = bench.follow(begun, rtol)
        for start in _different(run):
            if attracts(bench, run.ends[start], float(run.periods[start])):
                swing, begins = float(run.amplitude[start]), f"{begun.kinds[start]} {begun.sizes[start]:.6g}"
                seen = f"swings on by {swing:.6g} m for {run.followed[start]:.4g} s at {rtol:g}"
                beside = f"and so do its neighbours at {CLOSER:g} and {FINE:g}"
                return f"{begins} {seen}, {beside}; {by_scipy(bench, run.ends[start], swing)}"
    return ""


def _few(trial: Trial) -> Trial:
    """Return `SECOND` starts of a battery, of all kinds and sizes."""
    return trial.take(np.unique(np.linspace(0, len(trial.kinds) - 1, SECOND).astype(int)))


def _different(run: Outcome) -> np.ndarray:
    """Return a few of the swinging runs, with different amplitudes."""
    _, first = np.unique(np.round(np.log(run.amplitude[run.swinging]) / APART), return_index=True)
    return run.swinging[np.sort(first)][:: max(1, len(first) // TRIED)][:TRIED]


def attracts(bench: Bench, end: np.ndarray, period: float) -> bool:
    """Tell whether neighbours of a state on a long swing keep swinging for very long.

    The swing has a period [s]. This is asked before an attractor is asserted that should not exist.
    """
    return bench.sustains(lambda factors: bench.beside(end, factors), LINGERING * period, (SWINGS,))


def may_attract(bench: Bench, motion: Swinging) -> bool:
    """Tell whether starts beside a claimed attractor keep swinging, or may.

    They are followed for as long as its multiplier takes to show, before it is asserted that nothing attracts. They
    begin around its orbit, and stuck around its distance.
    """
    lasting = np.fmin(CONSTANTS * motion.time_constant, LINGERING * motion.period)
    time = max(lasting, ROUNDS[0] * motion.period)
    state = motion.seen if motion.cycles is None else motion.cycles.states[motion.number]
    if state is not None and bench.sustains(lambda factors: bench.beside(state, factors), time, POSSIBLE):
        return True
    return bench.sustains(lambda factors: bench.stuck_at(motion.distance * factors), time, POSSIBLE)


def by_scipy(bench: Bench, end: np.ndarray, amplitude: float) -> str:
    """Return what the equations by hand say about a swing [m] in which a run ended."""
    names, times = bench.kernel.states, np.linspace(0.0, SCIPY_PERIODS * bench.period, 2000)
    try:
        equations = by_hand(bench.flat).held()
        x = equations.run(equations.state(names, end[: len(names)]), times)[:, equations.measured]
    except NotWritten as missing:
        return f"no equations by hand ({missing})"
    if not np.isfinite(x[-1]):
        return "SciPy does not get there"
    swing = float(np.ptp(x) / 2)
    word = "confirms" if abs(swing / amplitude - 1) < ALIKE else "CONTRADICTS"
    return f"SciPy {word}: {swing:.6g} m over {times[-1]:.4g} s"


def _away(claim: Claim, bench: Bench) -> Iterator[Refutation]:
    """Test whether the stage's own motion can be followed although it is said to diverge."""
    words = {rtol: str(bench.follow_own(rtol).words[0]) for rtol in (ROUGH, FINE)}
    if any(word != FAILED for word in words.values()):
        why = ", ".join(f"{word} at {rtol:g}" for rtol, word in words.items())
        yield Refutation("own motion", claim.sure, f"the motion followed for long: {why}")


def _own_motion(claim: Claim, bench: Bench) -> Iterator[Refutation]:
    """Test whether the stage's own motion ends as claimed."""
    hunts = claim.verdict == "hunts"
    runs = [bench.follow_own(rtol) for rtol in (ROUGH, FINE)]
    if any(run.words[0] != (RESTS if hunts else SWINGS) for run in runs):
        return
    if hunts or attracts(bench, runs[-1].ends[0], float(runs[-1].periods[0])):
        why = f"the motion followed for long {runs[-1].words[0]} at {ROUGH:g} and {FINE:g}"
        yield Refutation("own motion", claim.sure, why)


def _kicks(claim: Claim, kick: Kick, bench: Bench) -> Iterator[Refutation]:
    """Test whether displacements start hunting where claimed, and nowhere else."""
    sizes = np.geomspace(*kick.searched, KICKS + 2)[1:-1, None] * BROAD
    sides = [1.0] if kick.symmetric else [1.0, -1.0]
    tried = np.concatenate([side * sizes for side in sides])
    said = np.zeros(tried.shape, bool)
    for side in sides:
        for low, high in kick.towards(side):
            said |= (low <= side * tried) & (side * tried <= high)
    broad = (said == said[:, :1]).all(axis=1)  # none of the three is an end of a window
    tried, said = tried[broad], said[broad, 0]
    for rtol in (ROUGH, FINE):
        run = bench.follow(bench.released(tried.ravel()), rtol, any_will_do=False)
        words = run.words.reshape(tried.shape)
        contrary = np.where(said[:, None], words == RESTS, words == SWINGS).all(axis=1)
        own = len(BROAD) * np.flatnonzero(contrary) + 1  # the run from the displacement itself
        tried, said = tried[contrary], said[contrary]
    for size, hunts, number in zip(tried[:, 1], said, own, strict=True):
        if hunts or attracts(bench, run.ends[number], float(run.periods[number])):
            word = "rests, and is said to hunt" if hunts else "hunts, and is said to rest"
            yield Refutation("kicks", claim.sure, f"displaced by {size:.4g} m, it {word}")


def _edge(claim: Claim, edge: Edge, seed: int) -> Iterator[Refutation]:
    """Test that nothing attracts beyond the edge, except in windows, and something before it."""
    end, nearest = edge.factor, edge.beyond / edge.factor
    benches = [Bench(at(claim, end * factor)) for factor in BELOW]
    swings = _swings(benches[0], seed)
    beyond = ABOVE if claim.attracted else [factor for factor in (*ABOVE[:4], end**-0.5) if end * factor < 1]
    for factor in (nearest * factor for factor in beyond):
        if any(low < end * factor < high for low, high in edge.windows):
            continue
        bench = Bench(at(claim, end * factor))
        trial = bench.starts(*FEW, seed)
        if factor <= nearest * JUST and len(swings):
            trial = trial.and_more(swings, "just below the edge, by")
        if why := swinging(bench, trial):
            place = f"at {factor:.4g} times the edge{_crossover(bench.flat)}"
            yield Refutation("edge", edge.sure, f"{place} {why}")
            return
    if any(_may_hunt(bench, bench.starts(*ALL, seed)) for bench in benches):
        return
    if not any(_may_attract_at(at(claim, end * factor)) for factor in (NEAREST, *BELOW)):
        places = ", ".join(f"{factor:g}" for factor in (*BELOW, NEAREST))
        yield Refutation("edge", edge.sure, f"at {places} times the edge no start swings on, nor {NEITHER}")


def _static_friction(claim: Claim, margin: ParameterMargin, seed: int) -> Iterator[Refutation]:
    """Yield factors of static friction at which the stage hunts though it is said not to, or the reverse.

    Both ends of a stated change are tried, and the ends of the range where none is stated.
    """
    said = {
        factor: (attracts, claim.sure and end.certain)
        for end in (margin.below, margin.above)
        if end
        for factor, attracts in ((end.inside, True), (end.outside, False))
    }
    ends = {margin.range[side > 0]: (margin.attracts, claim.sure) for side in (-1, 1) if margin.end(side) is None}
    quiet = {margin.range[side > 0] for side in margin.open_sides} | {1.0}
    for factor, (hunts, sure) in {factor: of for factor, of in (said | ends).items() if factor not in quiet}.items():
        flat = with_static_friction(claim.stage.flat(), factor)
        bench = Bench(flat)
        if not hunts and (why := swinging(bench, bench.starts(*FEW, seed))):
            yield Refutation("static friction", sure, f"at {factor:.4g} times its static friction it {why}")
        if hunts and not _may_hunt(bench, bench.starts(*ALL, seed)) and not _may_attract_at(flat):
            yield Refutation("static friction", sure, f"at {factor:.4g} times its static friction no start swings on")


def _may_attract_at(flat: dict[str, Any]) -> bool:
    """Tell whether what friso itself finds for a stage, given as flat keys, attracts."""
    motions = find_swings(flat)
    bench = Bench(flat, least_swing(motions))
    return any(may_attract(bench, motion) for motion in motions)


def _swings(bench: Bench, seed: int) -> np.ndarray:
    """Return states on lasting swings, a few of them, made larger and smaller, (starts, states)."""
    run = bench.follow(bench.starts(*FEW, seed), ROUGH)
    chosen = _different(run)
    if not chosen.size:
        return np.empty((0, 0))
    return np.vstack([bench.beside(end, DENSE) for end in run.ends[chosen]])[:, : bench.kernel.initial_size]


def at(claim: Claim, factor: float) -> dict[str, Any]:
    """Return the stage as flat keys with its controller faster by a factor."""
    return faster(claim.stage.flat(), factor)


def _crossover(flat: Mapping[str, Any]) -> str:
    own = bandwidth(flat)
    return "" if own is None else f", {own:.6g} Hz,"
