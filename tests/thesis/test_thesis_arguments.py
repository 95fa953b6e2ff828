"""The judges of what the thesis argues in words, on evidence made to hold and to fail."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_maps import Cells, made

from friso_thesis.studies.thesis.claims import Evidence, Finding, Response, by_attraction, registered
from friso_thesis.studies.thesis.evidence import RESPONSES
from friso_thesis.studies.thesis.judges import arguments, control_law
from friso_thesis.studies.thesis.judges.arguments import (
    HEAVIEST,
    HEAVY,
    HIGH_ALPHA,
    LIGHT,
    LOW_ALPHA,
    ArguedCycle,
    cycle_of,
)
from friso_thesis.studies.thesis.judges.control_law import (
    K_P,
    TAU_I,
    TAU_Z,
    TunedLoop,
    judged_crossovers,
    judged_forms,
    rewritten,
)
from friso_thesis.studies.thesis.judges.influence import judged_ranks
from friso_thesis.studies.thesis.judges.leaf_springs import (
    evaluated,
    judged_dimensions,
    judged_place,
    judged_shortening,
)
from friso_thesis.studies.thesis.judges.shares import NARROW, WIDE, Sticking
from friso_thesis.studies.thesis.judges.solver import judged_runs, judged_solvers
from friso_thesis.studies.thesis.space import draw
from friso_thesis.studies.thesis.studies import STUDIES, thesis_rig

Y, N = True, False


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
    assert judged_by(slips(2.0, -5e-4), slips(1.0, 2e-3)) == (None, N)  # turns before the reference: no overshoot
    assert judged_by(slips(2.0, -5e-4), slips(1.0, -2e-4)) == (None, None)


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
    """By what attracts the decided cells count, whatever their runs do at their end."""

    def runs(words: Cells) -> xr.Dataset:
        return made("control", lambda a, b: 1 + 0 * a * b, words)

    assert judged("S5", {"control": runs(lambda a, b: a > 0)}).pattern == (Y,)
    assert judged("S5", {"control": runs(lambda a, b: a > 0.2)}).pattern == (N,)
    resting = runs(lambda a, b: a > 1)
    everywhere = np.ones(resting["peaks"].shape, bool)
    attracts = everywhere & (np.arange(len(everywhere)) < 3)[:, None]
    for decided, pattern in ((attracts, (Y,)), (everywhere, (N,))):
        read = by_attraction(resting, attracts, decided, np.full(attracts.shape, np.inf))
        assert judged("S5", {"control": read}).pattern == pattern


def test_the_solver_is_accurate_where_it_counts_and_swings_alike() -> None:
    runs = {"still": (0, 0.0, 1000.0), "swinging": (6, 1.0e-3, 2000.0)}
    assert judged_runs(runs, runs, runs).judgement == "holds"
    other_count = judged_runs({**runs, "still": (1, 0.0, 200_000.0)}, runs, runs)
    assert other_count.pattern == (False, True)
    other_swing = judged_runs({**runs, "swinging": (6, 1.2e-3, 200_000.0)}, runs, runs)
    assert other_swing.pattern == (True, False)


# --- claims that were found by reading on -----------------------------------------------------------------------------


def test_two_forms_of_the_controller() -> None:
    tuned = {"k_p": 1000.0, "tau_z": 0.06, "tau_i": 0.12, "tau_p": 0.006}
    assert judged_forms(rewritten(), tuned).pattern == (Y, Y)
    plain = K_P * (1 + TAU_Z / TAU_I), K_P / TAU_I, K_P * TAU_Z  # the coefficients of Eq. 7 are not those of Eq. 6
    assert judged_forms(plain, tuned).pattern == (N, Y)
    assert judged_forms(rewritten(), {**tuned, "tau_p": 0.1}).pattern == (Y, N)


@pytest.mark.parametrize(
    ("near", "far", "force", "settling", "pattern"),
    [(0.0, 0.3, 0.9, -0.9, (Y, Y, Y)), (0.2, 0.3, 0.1, 0.2, (N, N, N)), (0.0, 0.0, 0.9, np.nan, (N, Y, N))],
)
def test_the_crossover_and_the_first_mode(near: float, far: float, force: float, settling: float, pattern: Any) -> None:
    tried = TunedLoop(0.05, 0.05, far), TunedLoop(0.3, 1.2, 0.5), TunedLoop(0.4, 1.4, near), TunedLoop(0.7, 2.2, 0.6)
    assert judged_crossovers(tried, 10.0, force, settling).pattern == pattern


def test_the_motor_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    assert judged("S421").pattern == (Y,)
    monkeypatch.setattr(control_law, "loops", lambda flat, *_: np.array([1.0 + flat["controller.tuned_mass"]]))
    assert judged("S421").pattern == (N,)


def test_the_leaf_springs_in_words() -> None:
    leaves = evaluated()
    assert judged_shortening(leaves).pattern == (Y, Y)
    assert leaves.shortening == pytest.approx(0.6 * 1e-3**2 / 70e-3, rel=0.01)  # parallel leaves (Brouwer et al.)
    assert judged_dimensions((1.1, 1.1, 1.2), (0.75, 0.9, 0.8)).pattern == (Y, Y)
    assert judged_dimensions((1.1, 1.1, 1.1), (0.75, 0.9, 0.9)).pattern == (N, N)
    assert judged_dimensions((1.1, 1.0, 1.2), (0.75, 0.9, 0.8)).pattern == (N, Y)
    assert judged_place(leaves.stiffness[0], 70e-3).pattern == (Y,)
    assert judged_place(leaves.stiffness[0], 140e-3).pattern == (N,)


def test_the_ranks_of_influence() -> None:
    locked, free = (
        {"crossover": -0.8, "mass": 0.3},
        {"crossover": -0.7, "stroke": -0.5, "joint stiffness": 0.4, "x": 0.1},
    )
    assert judged_ranks(locked, free).pattern == (Y, Y)
    assert judged_ranks({**locked, "mass": 0.9}, {**free, "x": -0.6}).pattern == (N, N)


def test_a_loop_tuned_to_the_eigenfrequency_crosses_far_above_it() -> None:
    """Sec. 3.4.2: 8 Hz, tuned for the whole mass, crosses 0 dB about 20 Hz with the joint free (Fig. 23)."""
    tried = control_law.loops_over_crossover(thesis_rig().to_toml(), 11.0)
    at = min(tried, key=lambda loop: abs(loop.tuned - 8.0 / 11.0))
    assert 1.9 < at.crossing < 2.5
    assert tried[0].crossing == pytest.approx(tried[0].tuned, rel=0.02)  # and a slow one where it is tuned
    finding = judged_crossovers(tried, 11.0, 0.9, -0.9)
    assert finding.pattern == (N, Y, Y)


def test_other_solvers() -> None:
    own = {"peaks": 6, "swing_m": 1e-3, "steps": 100, "evaluations": 1000}
    solvers = [f"{name}{held}" for name in ("ode23s", "ode15s", "ode45") for held in ("", "_held")]
    values = {f"{joint}_{name}_{key}": number for joint in ("locked", "free") for name in solvers
              for key, number in own.items()}  # fmt: skip
    for changes, pattern in (
        ({f"{joint}_ode15s_held_evaluations": 2000 for joint in ("locked", "free")}, (Y, N)),
        ({f"{joint}_ode45_held_evaluations": 1300 for joint in ("locked", "free")}, (N, Y)),
        ({"locked_ode45_held_peaks": 0}, (N, Y)),
        ({"locked_ode45_held_swing_m": 2e-3}, (N, Y)),
        ({"locked_ode45_held_evaluations": 1300, "locked_ode45_peaks": 0}, (N, N)),
    ):
        assert judged_solvers(values | changes).pattern == pattern


def cycle(
    overshoot: float = 1e-3, build_up: float = 5.0, time: float = 1.0, integral: float = 0.7, both: bool = True
) -> ArguedCycle:
    directions = np.array([1, -1] if both else [1, 1])
    return ArguedCycle(overshoot, build_up, Sticking(np.full(2, time), np.full(2, integral), directions))


@pytest.mark.parametrize(
    ("claim", "cycles", "pattern"),
    [
        ("S41G", {WIDE: cycle(2e-3, 6.0), NARROW: cycle()}, (Y, Y)),
        ("S41G", {WIDE: cycle(), NARROW: cycle(2e-3, 6.0)}, (N, N)),
        ("S41G", {WIDE: cycle(2e-3, 6.0), NARROW: cycle(both=False)}, (None, None)),
        ("S41A", {LOW_ALPHA: cycle(), HIGH_ALPHA: cycle(time=0.5, integral=0.6)}, (Y, Y)),
        ("S41A", {LOW_ALPHA: cycle(time=0.5, integral=0.6), HIGH_ALPHA: cycle()}, (N, N)),
        ("S41M", {LIGHT: cycle(), HEAVIEST: cycle(build_up=4.0)}, (Y, Y)),
        ("S41M", {LIGHT: cycle(build_up=4.0), HEAVIEST: cycle()}, (N, Y)),
    ],
)
def test_the_steps_of_the_arguments(claim: str, cycles: Any, pattern: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arguments, "cycle_of", lambda response: cycles[response.trace])
    still = xr.Dataset({"count": 0.0})
    responses = {name: Response(still, name) for name in cycles}  # type: ignore[arg-type]
    assert registered()[claim].judge(Evidence({}, responses)).pattern == pattern


def test_the_build_up_is_read_after_the_initial_overshoot() -> None:
    """Before 6 s the integral action changes by 10 N/s, from then on by 1 N/s; the return ends at 5.1 s."""
    time = np.arange(0.0, 20.0, 0.01)
    force_i = np.where(time < 6.0, 10 * time, 60 + (time - 6.0))
    signals = {"force_i": force_i, "force": 1 + force_i, "friction_force": force_i, "cart_velocity": 0 * time}
    signals |= {"position": 0 * time, "reference": np.clip(5.1 - time, 0.0, 0.1)}
    trace = xr.Dataset({name: ("time", values) for name, values in signals.items()}, {"time": time})
    assert cycle_of(Response(xr.Dataset(), trace)).build_up == pytest.approx(1.0)


def test_periods_and_peaks_of_maps() -> None:
    def with_periods(name: str, period: Cells) -> xr.Dataset:
        runs = made(name, lambda x, y: 6 + 0 * x)
        x, y = (runs[span.key] for span in STUDIES[name].spans)
        return runs.assign(period=period(x, y) + 0 * runs["peaks"])

    falling, rising = (with_periods("system", lambda f, m, power=power: f**power) for power in (-1, 1))
    assert judged("F25R", {"system": falling}).pattern == (Y,)
    assert judged("F25R", {"system": rising}).pattern == (N,)
    isolated = [name for name in STUDIES if name.startswith("isolator")]
    assert judged("S5P", {name: with_periods(name, lambda x, y: 2.5 + 0 * x) for name in isolated}).pattern == (Y,)
    assert judged("S5P", {name: with_periods(name, lambda x, y: 1.6 + 0 * x) for name in isolated}).pattern == (N,)
