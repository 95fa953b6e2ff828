"""What the book of machines knows of its stages, and by brute force or others, holds for friso's answers."""

from collections import defaultdict

import numpy as np
import pytest
from book import BOOK, KNOWN, knowing

import friso
from friso.equations.structure import structure
from friso.hunting import Ensemble, find_attractors, find_swings, hunting, judge_many, stuck


def groups() -> dict[str, list[str]]:
    """The machines that are judged together: of one structure and one kind of motion."""
    by_kind = defaultdict(list)
    for name in knowing("attracts"):
        flat = BOOK[name].flat()
        by_kind[f"{structure(flat)}, {flat['motion.kind']}, {len(flat)} keys"].append(name)
    return {f"{names[0]} and {len(names) - 1} more": names for names in by_kind.values()}


def established(name: str) -> tuple[str, ...]:
    """Return the verdicts that agree with what is known of a machine."""
    if not KNOWN[name]["attracts"]:
        return ("settles", "transient")
    return ("hunts",) if KNOWN[name]["own_motion"] == "swings" else ("bistable",)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("group", groups())
def test_verdicts(group: str) -> None:
    names = groups()[group]
    flats = [BOOK[name].flat() for name in names]
    columns = {key: [flat[key] for flat in flats] for key in flats[0]}
    numbers = {key: np.array(values) for key, values in columns.items() if isinstance(values[0], float)}
    verdicts = judge_many({**flats[0], **numbers}, len(names), 1e-6)
    assert not [(name, said) for name, said in zip(names, verdicts, strict=True) if said not in established(name)]


def test_both_kinds_are_among_them() -> None:
    """Otherwise a constant verdict would pass."""
    assert {KNOWN[name]["attracts"] for name in knowing("attracts")} == {True, False}


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("name", knowing("amplitude"))
def test_swings(name: str) -> None:
    """By a survey of many stages, which begins from fewer states than one of a single stage."""
    attracted = find_attractors(BOOK[name].flat(), 1)
    assert attracted.decided.all()
    assert attracted.amplitude == pytest.approx(KNOWN[name]["amplitude"], rel=0.01)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("name", knowing("amplitude", "period"))
def test_swings_of_one_stage(name: str) -> None:
    (motion,), known = find_swings(BOOK[name].flat()), KNOWN[name]
    assert (motion.amplitude, motion.period) == pytest.approx((known["amplitude"], known["period"]), rel=0.01)
    assert find_attractors(BOOK[name].flat(), 2).amplitude == pytest.approx([known["amplitude"]] * 2, rel=0.02)


@pytest.mark.cases(first=6)
@pytest.mark.parametrize("rtol", [1e-7, 1e-9])
@pytest.mark.parametrize("name", knowing("jump"))
def test_jumps_swing_on(name: str, rtol: float) -> None:
    """After a jump of the reference, the stage still swings like that after 60 of these periods."""
    amplitude, period, jump = (KNOWN[name][fact] for fact in ("amplitude", "period", "jump"))
    motion = {"kind": "step", "size": f"{jump} m", "duration": f"{60 * period} s"}
    response = friso.simulate(BOOK[name].replace({"motion": motion}), rtol=rtol, sample_time=period / 400)
    late = response.position.sel(time=slice(57 * period, None))
    assert np.ptp(late.to_numpy()) / 2 == pytest.approx(amplitude, rel=0.02)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("name", [*reversed(knowing("edge"))])
@pytest.mark.parametrize("rtol", [1e-7, 1e-9])
def test_edges_by_brute_force(name: str, rtol: float) -> None:
    edge = KNOWN[name]["edge"]
    starts = np.geomspace(*edge["stuck"])
    for side, hunts in (("hunts", True), ("rests", False)):
        flat = BOOK[name].replace({"controller.crossover": edge[side]}).flat()
        several = Ensemble.held(flat, 1).take(np.zeros(len(starts), np.int64))
        results = several.run(stuck(several, starts), np.full(len(starts), float(edge["after"])), rtol, window=0.9)
        assert bool(np.any(np.ptp(results.statistics[:, 1:3], axis=1) > 1e-3)) == hunts


@pytest.mark.slow
@pytest.mark.parametrize("name", knowing("extremes"))
def test_a_cycle_that_leans_is_told_with_both_ends(name: str) -> None:
    """Of the pair of mirror images the one is told in which the stage's own motion ends."""
    lowest, highest = KNOWN[name]["extremes"]
    end = friso.simulate(BOOK[name])["error"].values[-2000:]
    assert (-end.max(), -end.min()) == pytest.approx((lowest, highest), rel=0.005)
    (cycle,) = hunting(BOOK[name], side=1.0).attracting
    assert cycle.extremes == pytest.approx((lowest, highest), rel=0.005)
    (mirrored,) = hunting(BOOK[name], side=-1.0).attracting
    assert mirrored.extremes == pytest.approx((-highest, -lowest), rel=0.005)
    assert np.max(mirrored.trace["error"].values) == pytest.approx(highest, rel=0.005)
