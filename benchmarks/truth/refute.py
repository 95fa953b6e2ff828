"""Attempts to refute what was claimed of a stage; what stands up to a second, finer look is a refutation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.truth.by_hand import NotWritten, by_hand
from benchmarks.truth.claims import RUNS_AWAY, Claim
from benchmarks.truth.swings import FAILED, RESTS, SWINGS, UNSURE
from benchmarks.truth.trials import FINE, LINGERING, NEIGHBOURS, ROUGH, ROUNDS, Bench, Trial
from friso.equations.bandwidth import bandwidth, faster
from friso.hunting import Kick

ALL = (80, 40, 60, 20)
"""Releases, pushes, stuck and drawn starts of a whole battery."""

FEW = (16, 8, 32, 8)
"""The same at a crossover beside an edge."""

CLOSE = (0, 0, 600, 0)
"""Starts 1.2 % apart, tried where none of these swings on although something is said to attract just below an edge:
there it may do so from no farther than 1.5 % about its own distance."""

SECOND = 24
"""Starts of a battery that are followed at the finer tolerance too."""

TRIED, MOST = 3, 0.5
"""Starts of those that swing on which are looked at closely, and the share of its neighbours that take a swing up."""

ABOVE = (1.002, 1.005, 1.01, 1.1, 1.6)
"""Factors above the edge at which nothing may attract; those within the range that the edge itself is known to are left
out."""

BELOW = (0.995, 0.98, 0.95)
"""Factors below it; at one of them at least something must."""

JUST, DENSE = 1.01, 1 + 0.06 * np.linspace(-1, 1, 24)
"""Factors up to which stages just beyond an edge are also begun from swings just below it, made larger and smaller by
so much: beyond a flip or a fold something may attract from a narrow range there."""

KICKS, BROAD = 60, np.array([1 / 1.04, 1.0, 1.04])
"""Displacements that are tried, and factors of each that all have to show the contrary of what is said: windows
narrower than 7 % may be missed (docs/hunting.md)."""

SCIPY_PERIODS, ALIKE = 20.0, 0.03
"""Periods for which SciPy follows a swing, and the share by which its amplitude may differ."""


@dataclass(frozen=True)
class Refutation:
    """Which claim is wrong ("verdict", "own motion", "kicks", "edge"), and how that was established."""

    of: str
    sure: bool
    why: str


def refutations(claim: Claim, seed: int) -> Iterator[Refutation]:
    """All that is wrong with a claim."""
    bench = Bench(claim.stage.flat(), claim.swing)
    if claim.verdict == "failed" or not bench.length > 0:
        return
    if claim.verdict == RUNS_AWAY:
        yield from _away(claim, bench)
    elif bench.flat["motion.kind"] != "ramp":  # whose reference never stands still
        yield from _verdict(claim, bench, seed)
        yield from _own_motion(claim, bench)
        if claim.kick is not None and not claim.kick.unknown:
            yield from _kicks(claim, claim.kick, bench)
    if claim.edge is not None:
        yield from _edge(claim, seed)


def _verdict(claim: Claim, bench: Bench, seed: int) -> Iterator[Refutation]:
    """Whether something attracts."""
    trial = bench.starts(*ALL, seed)
    if claim.attracted:
        windows = claim.kick.windows if claim.kick else ()
        if not _may_hunt(bench, trial, tuple((low * high) ** 0.5 for low, high in windows)):
            yield Refutation("verdict", claim.sure, "no start swings on, at either tolerance")
        return
    if why := swinging(bench, trial):
        yield Refutation("verdict", claim.sure, why)


def _may_hunt(bench: Bench, trial: Trial, kicks: tuple[float, ...] = ()) -> bool:
    """Whether any start swings on, or might: the kicks that are said to, then all of the trial."""
    trials = (bench.released(np.array(kicks)), trial) if kicks else (trial,)
    runs = (bench.follow(begun, rtol) for rtol in (ROUGH, FINE) for begun in trials)
    return any(np.isin(run.words.astype(str), (SWINGS, UNSURE)).any() for run in runs)


def swinging(bench: Bench, trial: Trial) -> str:
    """From which start, and how, a stage swings on; "" where it does not. What a run at one tolerance shows has to be
    shown at the other, and by its neighbours; SciPy says what it makes of it."""
    rough = bench.follow(trial, ROUGH)
    for start in rough.swinging[:: max(1, len(rough.swinging) // TRIED)][:TRIED]:
        fine = bench.follow(trial.take(np.array([start])), FINE, ROUNDS[1:])
        if fine.words[0] == SWINGS and attracts(bench, fine.ends[0], fine.periods[0]):
            return "; ".join(
                [
                    f"{trial.kinds[start]} {trial.sizes[start]:.6g} swings on by {rough.amplitude[start]:.6g} m, "
                    f"followed for {rough.followed[start]:.4g} s at {ROUGH:g}",
                    f"by {fine.amplitude[0]:.6g} m for {fine.followed[0]:.4g} s at {FINE:g}, and so do its neighbours",
                    by_scipy(bench, fine.ends[0], float(fine.amplitude[0])),
                ]
            )
    second = trial.take(np.unique(np.linspace(0, len(trial.kinds) - 1, SECOND).astype(int)))
    fine = bench.follow(second, FINE)
    for start in fine.swinging[:TRIED]:
        if attracts(bench, fine.ends[start], float(fine.periods[start])):
            size, swing = second.sizes[start], fine.amplitude[start]
            kind, followed = second.kinds[start], fine.followed[start]
            about = by_scipy(bench, fine.ends[start], float(swing))
            return f"{kind} {size:.6g} swings on by {swing:.6g} m for {followed:.4g} s at {FINE:g} alone; {about}"
    return ""


def attracts(bench: Bench, end: np.ndarray, period: float) -> bool:
    """Whether neighbours of a state that a run ended in, which swung for long with a period [s], swing on too, for very
    long."""
    beside = Trial(bench.beside(end), ("beside a swing",) * len(NEIGHBOURS), NEIGHBOURS)
    words = bench.follow(beside, FINE, (LINGERING * period / bench.period,)).words
    return bool(np.mean(words == SWINGS) >= MOST)


def by_scipy(bench: Bench, end: np.ndarray, amplitude: float) -> str:
    """What the equations by hand say of a swing [m] that a run ended in."""
    try:
        equations = by_hand(bench.flat).held()
    except NotWritten as missing:
        return f"no equations by hand ({missing})"
    if missing := [name for name in bench.kernel.states if name not in _PLACES]:
        return f"no equations by hand ({', '.join(missing)})"
    y = equations.start()
    for name, value in zip(bench.kernel.states, end, strict=False):
        y[_PLACES[name]] = value
    if "cart_position" not in bench.kernel.states:
        y[2:4] = y[0:2]
    if not {"parasitic_position", "motor_position"} & set(bench.kernel.states):
        y[4:6] = y[0:2]
    times = np.linspace(0.0, SCIPY_PERIODS * bench.period, 2000)
    x = equations.run(y, times)[:, equations.measured]
    if not np.isfinite(x[-1]):
        return "SciPy does not get there"
    swing = float(np.ptp(x) / 2)
    word = "confirms" if abs(swing / amplitude - 1) < ALIKE else "CONTRADICTS"
    return f"SciPy {word}: {swing:.6g} m over {times[-1]:.4g} s"


_PLACES = {
    "position": 0,
    "velocity": 1,
    "cart_position": 2,
    "cart_velocity": 3,
    "parasitic_position": 4,
    "parasitic_velocity": 5,
    "motor_position": 4,
    "motor_velocity": 5,
    "bristle_deflection": 6,
    "filtered_error": 7,
    "filtered_position": 7,
    "integral": 8,
}


def _away(claim: Claim, bench: Bench) -> Iterator[Refutation]:
    """Whether the stage's own motion can be followed for long although it is said to leave its reference for good."""
    words = {rtol: str(bench.follow_own(rtol).words[0]) for rtol in (ROUGH, FINE)}
    if any(word != FAILED for word in words.values()):
        why = ", ".join(f"{word} at {rtol:g}" for rtol, word in words.items())
        yield Refutation("own motion", claim.sure, f"the motion followed for long: {why}")


def _own_motion(claim: Claim, bench: Bench) -> Iterator[Refutation]:
    """Whether the stage's own motion ends as it is said to."""
    wanted = SWINGS if claim.verdict == "hunts" else RESTS
    words = {rtol: str(bench.follow_own(rtol).words[0]) for rtol in (ROUGH, FINE)}
    if all(word not in (wanted, UNSURE, FAILED) for word in words.values()):
        why = f"the motion followed for long {words[FINE]} at {ROUGH:g} and {FINE:g}"
        yield Refutation("own motion", claim.sure, why)


def _kicks(claim: Claim, kick: Kick, bench: Bench) -> Iterator[Refutation]:
    """Whether displacements start hunting where they are said to, and nowhere else."""
    tried = np.geomspace(*kick.searched, KICKS + 2)[1:-1, None] * BROAD
    said = np.zeros(tried.shape, bool)
    for low, high in kick.windows:
        said |= (low <= tried) & (tried <= high)
    broad = (said == said[:, :1]).all(axis=1)  # no end of a window among the three
    tried, said = tried[broad], said[broad, 0]
    for rtol in (ROUGH, FINE):
        words = bench.follow(bench.released(tried.ravel()), rtol, any_will_do=False).words.reshape(tried.shape)
        contrary = np.where(said[:, None], words == RESTS, words == SWINGS).all(axis=1)
        tried, said = tried[contrary], said[contrary]
    for size, hunts in zip(tried[:, 1], said, strict=True):
        word = "rests, and is said to hunt" if hunts else "hunts, and is said to rest"
        yield Refutation("kicks", claim.sure, f"displaced by {size:.4g} m, it {word}")


def _edge(claim: Claim, seed: int) -> Iterator[Refutation]:
    """Whether nothing attracts on the far side of the edge, but in the windows told, and something on the near side."""
    assert claim.edge
    edge, nearest = claim.edge.factor, claim.edge.beyond / claim.edge.factor
    benches = [Bench(at(claim, edge * factor)) for factor in BELOW]
    swings = _swings(benches[0], seed)
    beyond = ABOVE if claim.attracted else [factor for factor in (*ABOVE[:4], edge**-0.5) if edge * factor < 1]
    for factor in (nearest * factor for factor in beyond):
        if any(low < edge * factor < high for low, high in claim.edge.windows):
            continue
        bench = Bench(at(claim, edge * factor))
        trial = bench.starts(*FEW, seed)
        if factor <= nearest * JUST and len(swings):
            trial = trial.and_more(swings, "just below the edge, by")
        if why := swinging(bench, trial):
            place = f"at {factor:.4g} times the edge{_crossover(bench.flat)}"
            yield Refutation("edge", claim.edge.sure, f"{place} {why}")
            return
    if not any(_may_hunt(bench, bench.starts(*starts, seed)) for starts in (ALL, CLOSE) for bench in benches):
        places = ", ".join(f"{factor:g}" for factor in BELOW)
        yield Refutation("edge", claim.edge.sure, f"at {places} times the edge no start swings on")


def _swings(bench: Bench, seed: int) -> np.ndarray:
    """States in swings that go on, a few of them, made larger and smaller, (starts, states)."""
    run = bench.follow(bench.starts(*FEW, seed), ROUGH)
    chosen = run.swinging[:: max(1, len(run.swinging) // TRIED)][:TRIED]
    if not chosen.size:
        return np.empty((0, 0))
    return np.vstack([bench.beside(end, DENSE) for end in run.ends[chosen]])[:, : bench.kernel.initial_size]


def at(claim: Claim, factor: float) -> dict[str, Any]:
    """The stage as flat keys, its controller faster by a factor."""
    return faster(claim.stage.flat(), factor)


def _crossover(flat: Mapping[str, Any]) -> str:
    own = bandwidth(flat)
    return "" if own is None else f", {own:.6g} Hz,"
