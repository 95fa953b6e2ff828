"""Controllers by their coefficients: against NumPy and SciPy, and against the PID controller that they are."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy import signal
from scipy.io import savemat

import friso
from friso.engine.batch import simulate
from friso.equations.bandwidth import faster
from friso.frequency.loops import FORCE, REFERENCE, compensator, poles
from friso.frequency.system import DriveTiming, limit_cases
from friso.hunting import HuntingDoubt, hunting
from friso.shown.motion_words import motion_sentences
from friso.stage import Stage

TABLES = friso.load(friso.example("motions/profile")).as_written()
KP, KI, KD, TAU = 6e4, 6e5, 500.0, 2.5e-3
NUMERATOR, DENOMINATOR = [KD + KP * TAU, KP + KI * TAU, KI], [TAU, 1.0, 0.0]
PID = {"kind": "pid", "kp": "60 N/mm", "ki": "600 kN/(m*s)", "kd": "500 N*s/m", "tau": "2.5 ms"}
OMEGA = np.geomspace(0.3, 3e4, 60)
SAMPLE = 5e-4


def controlled(keys: Mapping[str, Any], **tables: Any) -> Stage:
    return Stage(**{**TABLES, "controller": {"kind": "transfer_function", **keys}, **tables})


def response(flat: Mapping[str, Any], s: np.ndarray) -> np.ndarray:
    """The controller in continuous time, from the error, as friso's own equations have it."""
    system = compensator(flat, 1).take((REFERENCE,), (FORCE,))
    a, b, c, d = (np.asarray(part)[0] for part in (system.a, system.b, system.c, system.d))
    return np.array([(c @ np.linalg.solve(place * np.eye(len(a)) - a, b) + d)[0, 0] for place in s])


def is_transfer(stage: Stage, *factors: tuple[list[float], list[float]]) -> bool:
    """Tell whether the controller of a stage is the product of transfer functions."""
    by_hand = np.prod([np.polyval(n, 1j * OMEGA) / np.polyval(d, 1j * OMEGA) for n, d in factors], axis=0)
    return bool(np.abs(response(stage.flat(), 1j * OMEGA) / by_hand - 1).max() < 1e-9)


def sampled(transfer: tuple[Any, Any], step: float, **keys: Any) -> dict[str, Any]:
    """Return the keys of a controller for samples that Tustin makes of a transfer function."""
    numerator, denominator, _ = signal.cont2discrete(transfer, step, "bilinear")
    coefficients = {"numerator": [*map(float, numerator.ravel())], "denominator": [*map(float, denominator)]}
    return {**coefficients, "sample_time": f"{step!r} s", **keys}


def matlab(matrix: np.ndarray) -> str:
    return "; ".join(" ".join(repr(float(number)) for number in row) for row in np.atleast_2d(matrix))


def ways(numerator: list[float], denominator: list[float]) -> dict[str, dict[str, Any]]:
    zeros, roots_below, gain = signal.tf2zpk(numerator, denominator)
    listed = [[str(root) for root in roots.astype(complex) if root.imag >= 0] for roots in (zeros, roots_below)]
    matrices = dict(zip("abcd", map(matlab, signal.tf2ss(numerator, denominator)), strict=True))
    return {
        "coefficients": {"numerator": numerator, "denominator": denominator},
        "roots": {"zeros": listed[0], "poles": listed[1], "gain": float(gain)},
        "matrices": {"kind": "state_space", **matrices},
    }


TRANSFERS = {
    "pid": (NUMERATOR, DENOMINATOR),
    "lead": ([4e3, 4e5], [1.0, 300.0]),
    "lag beside a filter": ([2e6, 4e7, 3e8], [1.0, 500.7, 9e4 + 350, 63e3]),
    "nearly an integral": (NUMERATOR, [TAU, 1.0, 1e-5]),
    "third order": ([2e6, 4e7, 3e8], [1.0, 500.0, 9e4, 0.0]),
    "resonant": ([3e4, 1e6, 8e8, 5e9, 2e10], [1.0, 420.0, 1.3e5, 3e7, 0.0]),
}


@pytest.mark.cases(first=7)
@pytest.mark.parametrize("way", ["coefficients", "roots", "matrices"])
@pytest.mark.parametrize("transfer", TRANSFERS.values(), ids=TRANSFERS)
def test_the_controller_is_its_transfer_function(transfer: tuple[list[float], list[float]], way: str) -> None:
    assert is_transfer(controlled(ways(*transfer)[way]), transfer)


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("transfer", TRANSFERS.values(), ids=TRANSFERS)
def test_loops_are_those_of_python_control(transfer: tuple[list[float], list[float]]) -> None:
    """Open and closed loop of the mass without friction, by arithmetic on transfer functions."""
    stage = controlled(ways(*transfer)["coefficients"], friction={"model": "none"})
    plant = control.tf([1.0], [1.7, 0.0, 0.0])
    opened = plant * control.tf(*transfer)
    assert np.abs(friso.linear(stage, part="open")(1j * OMEGA) / opened(1j * OMEGA) - 1).max() < 1e-9
    closed = friso.linear(stage, part="closed")
    theirs = control.feedback(opened, 1)
    at = [closed.output_labels.index("stage"), closed.input_labels.index("reference")]
    ours = np.array([closed(1j * omega)[tuple(at)] for omega in OMEGA])
    assert np.abs(ours / theirs(1j * OMEGA) - 1).max() < 1e-6


def test_sections_are_factors_and_matrices_of_a_file_have_names(tmp_path: Path) -> None:
    """A pole and a zero at 0 cancel."""
    sections = [
        {"numerator": [500.0, 6e4], "denominator": [1.0, 0.0]},
        {"numerator": [1.0, 40.0, 4e4], "denominator": [1.0, 300.0, 4e4]},
    ]
    assert is_transfer(controlled({"sections": sections}), *((s["numerator"], s["denominator"]) for s in sections))
    savemat(tmp_path / "controller.mat", dict(zip("ABCD", signal.tf2ss(NUMERATOR, DENOMINATOR), strict=True)))
    keys = {"kind": "state_space", "file": str(tmp_path / "controller.mat"), "a": "A", "b": "B", "c": "C", "d": "D"}
    assert is_transfer(controlled(keys), (NUMERATOR, DENOMINATOR))
    both = controlled({"numerator": [2e5, 2.4e7, 0.0], "denominator": [1.0, 400.0, 0.0]})
    assert is_transfer(both, ([2e5, 2.4e7], [1.0, 400.0]))


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_a_faster_controller_has_gain_and_frequencies_scaled(factor: float) -> None:
    flat = controlled({"numerator": NUMERATOR, "denominator": DENOMINATOR}).flat()
    slow, quick = response(flat, 1j * OMEGA), response(faster(flat, factor), 1j * OMEGA * factor)
    assert np.abs(quick / (factor**2 * slow) - 1).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("limit", [{}, {"force_limit": "7 N"}], ids=["free", "limited"])
def test_the_trace_is_that_of_the_pid_controller_that_it_is(limit: dict[str, str]) -> None:
    """With a force limit the integral stays at the limit, by the same anti-windup."""
    one = simulate(Stage(**{**TABLES, "controller": {**PID, **limit}}), 1e-10, 1e-4)
    other = simulate(controlled({"numerator": NUMERATOR, "denominator": DENOMINATOR, **limit}), 1e-10, 1e-4)
    deflection = 3.0 / KP
    assert other["position"].to_numpy() == pytest.approx(one["position"].to_numpy(), abs=1e-6 * deflection)
    largest = float(np.abs(other["force"]).max())
    assert largest == pytest.approx(7) if limit else largest > 10


def test_it_hunts_as_the_pid_controller_that_it_is() -> None:
    tables = friso.load(friso.example("lugre_stick_slip")).as_written()
    motion = {"kind": "release", "displacement": "1 mm", "duration": "20 s"}
    gains = {"kind": "pid", "kp": "2 N/mm", "ki": "20 N/(mm*s)", "kd": "40 N*s/m", "tau": "1 ms"}
    numerator, denominator = [40 + 2000 * 1e-3, 2000 + 20000 * 1e-3, 20000.0], [1e-3, 1.0, 0.0]
    mine = {"kind": "transfer_function", "numerator": numerator, "denominator": denominator}
    one, other = (hunting(Stage(**{**tables, "motion": motion, "controller": keys})) for keys in (gains, mine))
    assert one.attracting
    assert len(one.attracting) == len(other.attracting)
    assert other.attracting[0].amplitude == pytest.approx(one.attracting[0].amplitude, rel=1e-5)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("divided", [1, 4])
@pytest.mark.parametrize("transfer", TRANSFERS.values(), ids=TRANSFERS)
def test_coefficients_for_samples_run_as_they_are(transfer: tuple[list[float], list[float]], divided: int) -> None:
    keys, drive = sampled(transfer, SAMPLE), {"drive": {"sample_time": f"{SAMPLE / divided!r} s"}}
    answer = friso.simulate(controlled(keys, **drive), sample_time=SAMPLE / divided)
    error = (answer["reference"] - answer["measured_position"]).to_numpy()[::divided]
    by_hand = np.repeat(signal.lfilter(keys["numerator"], keys["denominator"], error), divided)
    command = answer["command"].to_numpy()
    assert command == pytest.approx(by_hand[: len(command)], abs=1e-8 * np.abs(by_hand).max())


@pytest.mark.parametrize("divided", [1, 4])
def test_the_integral_unwinds_by_its_own_samples(divided: int) -> None:
    """The reference is computed by hand: a PI controller at every 2 ms in a drive that samples more often.

    Its back calculation has a time constant of 20 ms.
    """
    step, unwinding, limit, inside = 2e-3, 20e-3, 3.0, 0.0
    numerator, denominator = [6e4 + 6e5 * step / 2, 6e5 * step / 2 - 6e4], [1.0, -1.0]
    keys = {"numerator": numerator, "denominator": denominator, "sample_time": "2 ms", "force_limit": "3 N"}
    keys |= {"anti_windup": "back_calculation", "anti_windup_time": "20 ms"}
    stage = controlled(keys, drive={"sample_time": f"{step / divided!r} s"})
    answer = friso.simulate(stage, sample_time=step / divided)
    error = (answer["reference"] - answer["measured_position"]).to_numpy()[::divided]
    force, before = [], 0.0
    for now in error:
        inside += 6e5 * step / 2 * (now + before)
        force.append(6e4 * now + inside)
        inside += step / unwinding * (np.clip(force[-1], -limit, limit) - force[-1])
        before = now
    assert np.abs(force).max() > 2 * limit
    by_hand = np.repeat(np.clip(force, -limit, limit), divided)
    command = answer["command"].to_numpy()
    assert command == pytest.approx(by_hand[: len(command)], abs=1e-8)


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("pole", [0.0, 1e-3, 0.1])
def test_a_slow_pole_winds_up_as_an_integral_does(pole: float) -> None:
    """A pole that leaks within 10 s or more changes little on a cycle of 0.6 s."""
    numerator, denominator = [95.0, 6250.0, 1e5], [2.5e-3, 1.0, pole]
    (cycle,) = hunting(controlled({"numerator": numerator, "denominator": denominator})).attracting
    assert cycle.amplitude == pytest.approx(157e-6, rel=0.02)
    assert cycle.period == pytest.approx(0.634, rel=0.02)


def test_a_lag_that_winds_up_without_an_integral_is_not_surely_calm() -> None:
    """The controller has two slow poles: "cannot hunt" was said of a stage that hunts in simulation."""
    fast = np.polymul([KD + KP * TAU, KP + KI * TAU, KI], [1.0, 5.0])
    slow = np.polymul([1.0, 0.02, 0.0002], [TAU, 1.0])
    half = 2.0 ** np.arange(3, -1, -1)  # C(2 s)/4, half as fast
    keys = {"numerator": [*map(float, fast * half / 4)], "denominator": [*map(float, slow * half)]}
    stage = controlled(keys, motion={"kind": "step", "size": "1 mm", "duration": "60 s"})
    assert friso.simulate(stage).measures.outcome[0] == "swings"
    verdict = hunting(stage)
    assert not verdict.certain
    assert verdict.reason == HuntingDoubt.LOOP


def test_a_filter_that_lags_winds_up() -> None:
    lag = {"kind": "lead_lag", "zero_frequency": "0.5 Hz", "pole_frequency": "0.005 Hz"}
    for filters in ([], [lag]):
        stage = Stage(**{**TABLES, "controller": {**PID, "ki": "0 N/(m*s)", "filters": filters}})
        assert hunting(stage).certain == (not filters)


@pytest.mark.slow
def test_a_lag_of_a_tenth_hunts_where_hardly_any_coulomb_friction_brakes() -> None:
    """Two poles at 0.5 1/s, and a static gain 1.11 times that which slip needs: +-0.98 mm every 2.2 s."""
    slow, fast = np.poly([-0.5, -0.5]), np.poly([-0.5 / np.sqrt(0.9)] * 2)
    friction = {**TABLES["friction"], "static": "1 N", "coulomb": "0.02 N", "stribeck_velocity": "1 mm/s"}
    friction |= {"bristle_stiffness": "1e7 N/m", "bristle_damping": "6000 N*s/m", "viscous": "0 N*s/m"}
    numerator, denominator = 1000 * np.polymul(fast, [1.9e-4, 1.0]), np.polymul(slow, [9.5e-6, 1.0])
    keys = {"numerator": [*map(float, numerator)], "denominator": [*map(float, denominator)]}
    motion = {"kind": "release", "displacement": "1.5 mm", "duration": "300 s"}
    friction |= {"stribeck_exponent": 2}
    stage = controlled(keys, masses={"cart": "1 kg"}, friction=friction, motion=motion)
    assert not hunting(stage).certain
    assert "swings" in friso.simulate(stage).sentences()[0]


def test_a_loop_of_samples_is_that_of_the_plant_at_them() -> None:
    """Without friction: the zero-order hold of a free mass, times the controller's transfer function in z.

    A verdict says that it is on the continuous equivalent.
    """
    keys = sampled((NUMERATOR, DENOMINATOR), SAMPLE)
    stage = controlled(keys, friction={"model": "none"})
    assert is_transfer(stage, (NUMERATOR, DENOMINATOR))
    assert "continuous equivalent (Tustin)" in stage.controller.note(stage.flat())
    assert "samples of 0.0005 s" in stage.controller.note(stage.flat())
    members = next(iter(limit_cases(stage.flat()).values()))
    loop = poles(stage.flat(), members, DriveTiming.of(stage.flat()))
    omega = np.geomspace(1, 3000, 40)
    z = np.exp(1j * omega * SAMPLE)
    plant = SAMPLE**2 / 2 / 1.7 * (z + 1) / (z - 1) ** 2
    by_hand = plant * np.polyval(keys["numerator"], z) / np.polyval(keys["denominator"], z)
    assert np.abs(loop.loop(omega)[0] / by_hand - 1).max() < 1e-6


@pytest.mark.cases(first=1)
@pytest.mark.parametrize("step", [8e-3, 0.5e-3])
def test_what_only_samples_make_unstable_is_told_first(step: float, own_bandwidth: None) -> None:
    """The poles are computed by hand without friction.

    They are those of the free mass behind a zero-order hold, and of the controller in z.
    """
    keys = sampled(([6e4 * 1e-3 + 500, 6e4 + 6e5 * 1e-3, 6e5], [1e-3, 1.0, 0.0]), step)
    hold = step**2 / 2 / 1.7 * np.convolve(keys["numerator"], [1.0, 1.0])
    closed = np.polyadd(np.convolve(keys["denominator"], [1.0, -2.0, 1.0]), hold)
    diverges = bool(np.abs(np.roots(closed)).max() > 1)
    assert diverges == (step > 1e-3)
    answer = friso.check(controlled(keys))
    assert answer.as_built
    assert bool(answer.as_built.unstable) == diverges == ("samples and delays" in answer.sentences()[1])


def test_a_multisine_with_phases_says_how_far_it_jumps_at_first() -> None:
    motion = {"kind": "multisine", "amplitude": ["0.3 mm", "0.2 mm"], "frequency": ["1 Hz", "3 Hz"]}
    keys = {"numerator": NUMERATOR, "denominator": DENOMINATOR}
    phased = controlled(keys, motion={**motion, "phase": ["0 deg", "90 deg"], "duration": "6 s"})
    assert any("jump of 200 µm" in sentence for sentence in motion_sentences(phased))
    assert motion_sentences(controlled(keys, motion={**motion, "duration": "6 s"})) == []


def test_a_stage_that_hunts_after_a_move_back_swings() -> None:
    """The last move does not count, although half of the deviation in the run's last half comes from it."""
    stage = controlled({"numerator": [95.0, 6250.0, 1e5], "denominator": [2.5e-3, 1.0, 0.0]})
    answer = friso.simulate(stage.replace({"motion.dwell": "5 s"}))
    assert "swings ±157 µm every 63" in answer.sentences()[0]


@pytest.mark.parametrize("stated", [None, "clamp", "none"])
def test_what_an_integral_does_at_a_limit_is_never_assumed_in_silence(stated: str | None) -> None:
    table = {"kind": "transfer_function", "numerator": [3000, 60000], "denominator": [1, 0], "force_limit": "200 N"}
    stage = friso.load(Path(__file__).parents[1] / "examples" / "thesis_drive.toml").replace(
        {"controller": table | ({"anti_windup": stated} if stated else {})}
    )
    assert ("anti_windup" in stage.controller.note(stage.flat())) == (stated is None)
