"""The judges of what the thesis argues in words, on evidence made to hold and to fail."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr

from friso_thesis.studies.thesis import STUDIES, Evidence, Finding, Response, thesis_rig
from friso_thesis.studies.thesis.claims import registered
from friso_thesis.studies.thesis.evidence import RESPONSES
from friso_thesis.studies.thesis.judges import arguments
from friso_thesis.studies.thesis.judges.arguments import HEAVY, LIGHT
from friso_thesis.studies.thesis.judges.solver import judged_runs
from friso_thesis.studies.thesis.space import draw
from friso_thesis.studies.thesis.ways import by_attraction, by_peak_count

Y, N = True, False
Cells = Callable[[np.ndarray, np.ndarray], Any]


def made(name: str, peaks: Cells, words: Cells | None = None, swing: Cells | None = None) -> xr.Dataset:
    """A map of 21 values per axis with so many peaks, whose runs swing where these are counted unless otherwise."""
    spans = STUDIES[name].spans
    x, y = (np.geomspace(s.low, s.high, 21) if s.log else np.linspace(s.low, s.high, 21) for s in spans)
    grid = x[:, None] + 0 * y, 0 * x[:, None] + y
    counts, dims = np.asarray(peaks(*grid), float), tuple(span.key for span in spans)
    ends = counts > 0 if words is None else words(*grid)
    swings = np.where(counts > 0, 1e-3, 1e-9) if swing is None else swing(*grid)
    values = {"peaks": counts, "outcome": np.where(ends, "swings", "rests"), "peak_to_peak": swings}
    return by_peak_count(
        xr.Dataset({key: (dims, value) for key, value in values.items()}, coords=dict(zip(dims, (x, y), strict=True)))
    )


def judged(claim: str, maps: dict[str, xr.Dataset] | None = None, **rig: Any) -> Finding:
    return registered()[claim].judge(Evidence(maps or {}, {}, rig=thesis_rig().replace(rig.pop("changes", {}))))


def test_the_force_at_full_stroke() -> None:
    rule = {"isolator-stiffness": made("isolator-stiffness", lambda k, s: 6 * ((k * s >= 3) | (s == 0)))}
    other = {"isolator-stiffness": made("isolator-stiffness", lambda k, s: 6 * (s < 0.2e-3) + 0 * k)}
    assert judged("S341", rule).pattern == (Y, N, Y)
    assert judged("S341", other).pattern == (Y, N, N)
    assert judged("S341", rule, changes={"joint.stiffness": "0.9 N/mm"}).pattern == (Y, Y, Y)
    assert judged("S341", rule, changes={"joint.stiffness": "5 N/mm"}).pattern == (N, N, Y)


@pytest.mark.parametrize(
    ("margins", "pattern"),
    [
        ({0.5: 0.3, 1.0: 0.4, 1.7: 0.5}, (Y, Y)),
        ({0.5: 0.3, 1.0: 0.6, 1.7: 0.5}, (Y, N)),  # larger than tuned for the stage alone, and not the largest
        ({0.5: 0.2, 1.0: 0.1, 1.7: 0.0}, (N, N)),
    ],
)
def test_the_mass_to_tune_for(margins: Any, pattern: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arguments, "_margins", lambda rig: margins)
    assert judged("S342").pattern == pattern


def test_200_newtons_are_8_g_with_the_mass_identified_and_100_m_s2_take_250() -> None:
    finding = judged("S352")
    parts, table = finding.parts, finding.table
    assert [part.holds for part in parts] == [Y]
    assert "8.2 g with 2.5 kg" in parts[0].number
    assert table is not None
    assert table.rows[1][:2] == ("2.5 kg", "250 N")


def slips(acceleration: float, overshoot: float) -> Response:
    """A cart that sticks from 6 to 7 s off its reference, breaks away, and sticks again beyond it."""
    time = np.arange(0, 9, 1e-3)
    since = np.clip(time - 7, 0, 0.2)
    velocity = acceleration * np.where(
        (time > 7) & (time < 7.1), since, np.where(time < 7.2, 0.2 - since, 0) * (time > 7)
    )
    velocity += np.where(time < 6, 0.1, 0.0)
    position = np.where(time < 7.1, -1e-3, overshoot)
    reference = np.where(time < 5, 0.1 * time, 0.5)
    signals = {"cart_velocity": velocity, "position": position + reference, "reference": reference}
    trace = xr.Dataset({name: ("time", values) for name, values in signals.items()}, coords={"time": time})
    return Response(xr.Dataset(), trace)


def test_what_a_mass_does_to_the_overshoot() -> None:
    def judged_by(light: Response, heavy: Response) -> tuple[bool, ...]:
        return registered()["S41"].judge(Evidence({}, {LIGHT: light, HEAVY: heavy})).pattern

    assert judged_by(slips(2.0, 1e-3), slips(1.0, 5e-4)) == (Y, Y)
    assert judged_by(slips(1.0, 1e-3), slips(2.0, 5e-4)) == (N, Y)
    assert judged_by(slips(2.0, 1e-3), slips(1.0, 2e-3)) == (Y, N)
    assert judged_by(slips(2.0, -5e-4), slips(1.0, 2e-3)) == (N, N)  # turns before the reference: no overshoot


def test_the_two_masses_are_compared_whatever_is_drawn() -> None:
    rigs = [
        thesis_rig().replace(draw(number).changes).replace(dict(RESPONSES[name])).flat()
        for number in range(4)
        for name in (LIGHT, HEAVY)
    ]
    masses = [rig["masses.cart"] + rig["masses.stage"] for rig in rigs]
    assert masses == pytest.approx([1.7, 2.5] * 4)
    assert [rig["parasitic.mass"] / rig["masses.stage"] for rig in rigs] == pytest.approx([0.5] * 8)


def test_the_swing_over_the_crossover() -> None:
    def judged_by(swing: Cells) -> tuple[bool, ...]:
        return judged("F25O", {"system": made("system", lambda f, m: 3 * (f < 20) + 0 * m, swing=swing)}).pattern

    assert judged_by(lambda f, m: 1e-3 / f + 0 * m) == (Y,)
    assert judged_by(lambda f, m: 1e-3 * f + 0 * m) == (N,)


def test_counted_peaks_that_die_out_are_no_cycles() -> None:
    def judged_by(words: Cells) -> tuple[bool, ...]:
        return judged("S5", {"control": made("control", lambda a, b: 1 + 0 * a * b, words)}).pattern

    assert judged_by(lambda a, b: a > 0) == (Y,)
    assert judged_by(lambda a, b: a > 0.2) == (N,)


def test_by_what_attracts_the_decided_cells_count() -> None:
    """Whatever their runs do at their end, and without the cells of which it is not certain."""
    runs = made("control", lambda a, b: 1 + 0 * a * b, lambda a, b: a > 1)
    shape = runs["peaks"].shape
    attracts = np.ones(shape, bool)
    attracts[3:] = False
    decided = attracts.copy()
    assert judged("S5", {"control": by_attraction(runs, attracts, decided)}).pattern == (Y,)
    assert judged("S5", {"control": by_attraction(runs, attracts, np.ones(shape, bool))}).pattern == (N,)


def test_the_solver_is_accurate_where_it_counts_and_swings_alike() -> None:
    runs = {"still": (0, 0.0, 1000.0), "swinging": (6, 1.0e-3, 2000.0)}
    assert judged_runs(runs, runs, runs).judgement == "holds"
    other_count = judged_runs({**runs, "still": (1, 0.0, 200_000.0)}, runs, runs)
    assert other_count.pattern == (False, True)
    assert "still" in other_count.parts[0].number
    other_swing = judged_runs({**runs, "swinging": (6, 1.2e-3, 200_000.0)}, runs, runs)
    assert other_swing.pattern == (True, False)
